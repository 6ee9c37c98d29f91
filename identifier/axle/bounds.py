"""Bounds of what is learnt, kept by projection.

The saturated force W = Σ w_j of an axle is kept in a range by the least move in the metric of the
covariance, w += P 1 (W_lim - W)/(1'P 1): moving one unit alone, or clipping each, would break what
was learnt. A box on each weight is the last resort.
"""

from dataclasses import astuple, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from identifier.axle.checks import require_positive
from identifier.axle.piecewise import larger, within
from identifier.axle.rls import Symmetric, at

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Limits of parameters.

    Parameters
    ----------
    least_grip, most_grip : of the saturated force [static axle loads].
    weight : of each weight [static axle loads].
    compliance : [m per static axle load].
    steering : of the steering's zero [rad].
    v_y : of the bias of v_y [m/s].

    Raises
    ------
    ValueError
        Where a number is not positive.
    """

    least_grip: float = 0.1
    most_grip: float = 1.5
    weight: float = 3.0
    compliance: float
    steering: float = 0.01
    v_y: float

    def __post_init__(self) -> None:
        require_positive(self)

    def numbers(self) -> Array:
        """Return the fields in their order, (6,)."""
        return np.array(astuple(self))


class BoundNumbers(NamedTuple):
    """The fields of `Bounds`."""

    least_grip: Any
    most_grip: Any
    weight: Any
    compliance: Any
    steering: Any
    v_y: Any


def bounded(
    numbers: BoundNumbers,
    theta: list[Any],
    P: Symmetric,
    *,
    offset: Any,
    slope: list[Any] | None = None,
) -> list[Any]:
    """Return [w, s, k, offset] of an axle within its bounds.

    Parameters
    ----------
    numbers : the bounds.
    theta : parameters, n + 3 entries.
    P : their covariance.
    offset : bound of the last one.
    slope : derivatives of the units at a slip, n entries; the curve shall not fall there.
    """
    n = len(theta) - 3
    w, (s, k, o) = theta[:n], theta[n:]
    grip = sum(w)
    missing = within(grip, numbers.least_grip, numbers.most_grip) - grip
    w = _moved(w, P, [1] * n, missing)
    if slope is not None:
        falling = sum(a * b for a, b in zip(w, slope, strict=True))
        w = _moved(w, P, slope, larger(-falling, 0))
    return [
        *(within(weight, -numbers.weight, numbers.weight) for weight in w),
        within(s, 0, numbers.compliance),
        within(k, 0, 1),
        within(o, -offset, offset),
    ]


def _moved(w: list[Any], P: Symmetric, row: list[Any], missing: Any) -> list[Any]:
    """Move w by the least, in the metric of P, that makes row'w larger by what is missing."""
    n = len(w)
    P_row = [sum(at(P, i, j) * row[j] for j in range(n)) for i in range(n)]
    size = sum(a * b for a, b in zip(row, P_row, strict=True))
    move = missing / larger(size, 1e-12)
    return [a + b * move for a, b in zip(w, P_row, strict=True)]
