"""A plane curve, sampled: X, Y [m] and heading ψ [rad] over arc length s [m], dψ/ds = κ [1/m].

ISO axes seen from above: ψ = 0 along X, κ > 0 turns left.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.doors import require_few

Array = NDArray[np.float64]


class PathError(ValueError):
    """A path or its source breaks a rule; one line: file or name, place, rule, value, remedy."""


class Line(NamedTuple):
    """Samples of a curve at equal steps of arc length, all (n,); s starts at 0."""

    s: Array
    X: Array
    Y: Array
    psi: Array
    kappa: Array


def uniform_grid(length: float, spacing: float) -> Array:
    """Return s from 0 to `length` [m] in equal steps of at most `spacing`.

    Parameters
    ----------
    length : of the curve [m].
    spacing : longest step [m].

    Raises
    ------
    PathError
        Where spacing is not positive or leaves fewer than four steps, or too many.
    """
    if not 0.0 < spacing <= length / 4.0:
        raise PathError(
            f"spacing must be positive and at most a quarter of the length {length:.4g} m, "
            f"it is {spacing}"
        )
    steps = length / spacing
    require_few(PathError, f"a path of {length:.4g} m", steps, "path", f"steps of {spacing:g} m")
    return np.linspace(0.0, length, int(np.ceil(length / spacing - 1e-9)) + 1)


def line_from_heading(
    psi: Array, kappa: Array, spacing: float, start: tuple[float, float] = (0.0, 0.0)
) -> Line:
    """Integrate a heading that was sampled four times as fine as the line will be.

    X and Y by Boole's rule, whose error is of order spacing^6.

    Parameters
    ----------
    psi : heading [rad], (4 n + 1,), at steps of spacing/4.
    kappa : dψ/ds at the same places [1/m], (4 n + 1,).
    spacing : step of the line [m].
    start : X, Y of the first sample [m].

    Raises
    ------
    PathError
        Where the number of samples is not 4 n + 1.
    """
    if psi.shape != kappa.shape or psi.size % 4 != 1 or psi.size < 5:
        raise PathError(f"psi and kappa must have 4 n + 1 samples, they have {psi.size}")
    boole = np.array([7.0, 32.0, 12.0, 32.0, 7.0]) * spacing / 90.0
    place: list[Array] = []
    for origin, slope in zip(start, (np.cos(psi), np.sin(psi)), strict=True):
        steps = np.lib.stride_tricks.sliding_window_view(slope, 5)[::4] @ boole
        place.append(np.asarray(origin + np.append(0.0, np.cumsum(steps)), dtype=np.float64))
    s = np.linspace(0.0, spacing * (place[0].size - 1), place[0].size)
    return Line(s, place[0], place[1], psi[::4], kappa[::4])
