"""A plane curve, sampled: X, Y [m] and heading ψ [rad] over arc length s [m], dψ/ds = κ [1/m].

ISO axes seen from above: ψ = 0 along X, κ > 0 turns left.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from models.schema import require_few

_LARGEST_TURN = 0.3  # rad in one step; coarser samples would not carry the cubics between them
_DISAGREEMENT = 0.02  # of a step, or rad; beside what cubics leave out at that turn


class PathError(TireidError, ValueError):
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
    length : of the curve [m].   spacing : longest step [m].
    """
    if not 0.0 < spacing <= length / 4.0:
        raise PathError(
            f"spacing must be positive and at most a quarter of the length {length:.4g} m, "
            f"it is {spacing}"
        )
    steps = length / spacing
    require_few(PathError, f"a path of {length:.4g} m", steps, "path", f"steps of {spacing:g} m")
    return np.linspace(0.0, length, int(np.ceil(steps - 1e-9)) + 1)


def line_from_heading(psi: Array, kappa: Array, spacing: float) -> Line:
    """Integrate from the origin a heading that was sampled four times as fine as the line will be.

    X and Y by Boole's rule, whose error is of order spacing^6.
    psi : heading [rad], (4 n + 1,), at steps of spacing/4.
    kappa : dψ/ds at the same places [1/m], (4 n + 1,).   spacing : step of the line [m].
    """
    if psi.shape != kappa.shape or psi.size % 4 != 1 or psi.size < 5:
        raise PathError(f"psi and kappa must have 4 n + 1 samples, they have {psi.size}")
    boole = np.array([7.0, 32.0, 12.0, 32.0, 7.0]) * spacing / 90.0
    place: list[Array] = []
    for slope in (np.cos(psi), np.sin(psi)):
        steps = np.lib.stride_tricks.sliding_window_view(slope, 5)[::4] @ boole
        place.append(np.append(0.0, np.cumsum(steps)))
    s = np.linspace(0.0, spacing * (place[0].size - 1), place[0].size)
    return Line(s, place[0], place[1], psi[::4], kappa[::4])


def check_line(line: Line, name: str, closed: bool) -> None:
    """Refuse samples that do not fit one another."""
    s, X, Y, psi, kappa = line
    if s.size < 5:
        raise PathError(f"{name}: a path needs at least 5 samples, it has {s.size}")
    h = float(s[-1]) / (s.size - 1)
    if not (h > 0.0 and np.abs(s - h * np.arange(s.size)).max() <= 1e-6 * h):
        raise PathError(f"{name}: s must rise from 0 in equal steps")
    turn = float(h * np.abs(kappa).max())
    if turn > _LARGEST_TURN:
        raise PathError(
            f"{name}: a step may turn by at most {_LARGEST_TURN} rad, one turns by "
            f"{turn:.3g}; "
            f"sample it finer than {h:.3g} m"
        )
    middle = 0.5 * (psi[:-1] + psi[1:])
    dX, dY = np.diff(X) / h, np.diff(Y) / h
    along, across = dX * np.cos(middle) + dY * np.sin(middle), dY * np.cos(middle)
    across = across - dX * np.sin(middle)
    turned = np.diff(psi) - 0.5 * h * (kappa[:-1] + kappa[1:])
    wrong = np.maximum(np.abs(along - 1.0), np.maximum(np.abs(across), np.abs(turned)))
    worst = int(wrong.argmax())
    if wrong[worst] > _DISAGREEMENT + 0.25 * turn**2:
        raise PathError(
            f"{name}: X, Y, psi and kappa must be one curve over s, at s = {s[worst]:.4g} m they "
            f"disagree by {wrong[worst]:.2g} of a step"
        )
    gap = math.hypot(X[-1] - X[0], Y[-1] - Y[0])
    bend = math.remainder(psi[-1] - psi[0], 2.0 * math.pi)
    kink = float(kappa[-1] - kappa[0])
    if closed and (gap > 1e-3 * h or abs(bend) > 1e-3 * h or abs(kink) * h > 1e-3):
        raise PathError(
            f"{name}: a closed path must end as it starts, its ends differ by {gap:.3g} m, "
            f"{bend:.3g} rad and {kink:.3g} 1/m"
        )


Pair: TypeAlias = tuple[Any, Any]  # at both ends of a step, numbers or arrays


class Ends(NamedTuple):
    """Both ends of a step: X, Y [m], ψ [rad], κ [1/m]; numbers, or arrays for many steps."""

    X: Pair
    Y: Pair
    psi: Pair
    kappa: Pair

    def between(
        self, u: Any, h: float, cos: Callable[[Any], Any], sin: Callable[[Any], Any]
    ) -> tuple[Any, Any, Any, Any]:
        """Return X, Y [m], ψ [rad], κ [1/m] inside the step.
        u : place in the step, 0 to 1 [-].   h : length of the step [m].
        """
        (psi_0, psi_1), (kappa_0, kappa_1) = self.psi, self.kappa
        cos_0, cos_1, sin_0, sin_1 = cos(psi_0), cos(psi_1), sin(psi_0), sin(psi_1)
        return (
            _quintic(u, h, self.X, (cos_0, cos_1), (-kappa_0 * sin_0, -kappa_1 * sin_1)),
            _quintic(u, h, self.Y, (sin_0, sin_1), (kappa_0 * cos_0, kappa_1 * cos_1)),
            cubic(u, h, self.psi, self.kappa),
            kappa_0 + u * (kappa_1 - kappa_0),
        )


def cubic(u: Any, h: float, p: Pair, d: Pair) -> Any:
    """Return the cubic that has values and slopes given at both ends of a step.
    u : place in the step, 0 to 1 [-].   p : values at u = 0 and 1.
    """
    chord = p[1] - p[0]
    bend_0, bend_1 = h * d[0] - chord, chord - h * d[1]
    return p[0] + u * chord + u * (1.0 - u) * ((1.0 - u) * bend_0 + u * bend_1)


def _quintic(u: Any, h: float, p: Pair, d: Pair, dd: Pair) -> Any:
    """Return the quintic that has values, slopes and second derivatives given at both ends.
    u : place in the step, 0 to 1 [-].   p : values at u = 0 and 1.
    """
    chord = p[1] - p[0]
    bend_0, bend_1 = h * d[0] - chord, chord - h * d[1]
    more_0 = 0.5 * h * h * dd[0] + 2.0 * bend_0 - bend_1  # beyond those of the cubic
    more_1 = 0.5 * h * h * dd[1] - bend_0 + 2.0 * bend_1
    lack = u * (1.0 - u) * ((1.0 - u) * more_0 + u * more_1)
    return cubic(u, h, p, d) + u * (1.0 - u) * lack
