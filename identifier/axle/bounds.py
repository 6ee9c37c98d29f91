"""Bounds of what is learnt, kept after every sample, exactly: also in float, whatever was learnt.

The saturated force W = Σ w_j and the slope S = Σ a_j w_j of an axle are kept in their ranges by the
least move in the metric of the covariance, which finds both at once: moving one unit alone, or
clipping each, would break what was learnt. Rounding, and the box on each weight, are the business
of what comes last: a move on the straight line towards the center of the set, where all units are
equal, by just so much that every bound holds. The numbers of that test lie inside the declared
bounds by more than rounding in float can do, so that what is declared holds of the stored numbers.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identifier.axle.checks import require_positive
from identifier.axle.covariance import Symmetric
from identifier.axle.piecewise import larger, reciprocal, within

Array = NDArray[np.float64]

FLOAT = float(np.finfo(np.float32).eps)
TINY = 1e-12  # of a size that is divided by


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
        Where a number is not positive, or least_grip is not below most_grip.
    """

    least_grip: float = 0.1
    most_grip: float = 1.5
    weight: float = 3.0
    compliance: float
    steering: float = 0.01
    v_y: float

    def __post_init__(self) -> None:
        require_positive(self)
        if not self.least_grip < self.most_grip:
            raise ValueError(
                f"least_grip must be below most_grip, they are {self.least_grip}, {self.most_grip}"
            )

    def numbers(self, n: int) -> Array:
        """Return the numbers of `BoundNumbers`, (10,).

        n products of weights that lie in the box sum up to within n + 8 roundings.

        Parameters
        ----------
        n : number of units.

        Raises
        ------
        ValueError
            Where n weights within their box, all equal, cannot carry the middle of the grip.
        """
        rounding = (n + 8) * FLOAT * self.weight
        least, most = self.least_grip + n * rounding, self.most_grip - n * rounding
        center = 0.5 * (least + most) / n
        radius = self.weight - center - rounding
        if not (least < most and radius > 0.0 and center > rounding):
            raise ValueError(
                f"{n} weights up to {self.weight} cannot carry a grip of {self.least_grip} to "
                f"{self.most_grip}"
            )
        return np.array(
            [
                least,
                most,
                rounding,
                center,
                2.0 / (most - least),
                1.0 / (center - rounding),
                1.0 / radius,
                _inward(self.compliance),
                _inward(self.steering),
                _inward(self.v_y),
            ]
        )


def _inward(limit: float) -> float:
    """Return the largest float that is not above a limit."""
    nearest = np.float32(limit)
    return float(nearest if float(nearest) <= limit else np.nextafter(nearest, np.float32(0)))


class BoundNumbers(NamedTuple):
    """Ends of grip and slope, the center, 1/half width of grip, slope and weight; other limits.

    Grip, slope and weight are inside the declared bounds by what rounding may do.
    """

    least_grip: Any
    most_grip: Any
    least_slope: Any
    center: Any
    per_grip: Any
    per_slope: Any
    per_weight: Any
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
    """Return [w, s, k, offset] of an axle within its bounds; what is within them is not moved.

    Parameters
    ----------
    numbers : the bounds.
    theta : parameters, n + 3 entries.
    P : covariance of the weights, the metric: upper triangle by place.
    offset : bound of the last one.
    slope : derivatives of the units at a slip over their sum, n entries; the curve shall not fall
        there.
    """
    n = len(theta) - 3
    w, (s, k, o) = theta[:n], theta[n:]
    w = _gripping(numbers, w, P) if slope is None else _rising(numbers, w, P, slope)
    return [
        *_towards_center(numbers, w, slope),
        within(s, 0, numbers.compliance),
        within(k, 0, 1),
        within(o, -offset, offset),
    ]


def _dot(a: list[Any], b: list[Any]) -> Any:
    return sum(x * y for x, y in zip(a, b, strict=True))


def _times(P: Symmetric, row: list[Any]) -> list[Any]:
    n = len(row)
    return [sum(P[min(i, j), max(i, j)] * row[j] for j in range(n)) for i in range(n)]


def _gripping(numbers: BoundNumbers, w: list[Any], P: Symmetric) -> list[Any]:
    """Move w by the least, in the metric of P, so that its grip is in range."""
    along = _times(P, [1] * len(w))
    grip = sum(w)
    move = (within(grip, numbers.least_grip, numbers.most_grip) - grip) / (sum(along) + TINY)
    return [a + b * move for a, b in zip(w, along, strict=True)]


def _rising(numbers: BoundNumbers, w: list[Any], P: Symmetric, slope: list[Any]) -> list[Any]:
    """Move w by the least, in the metric of P, so that its grip is in range and its slope rises.

    Where the curve falls once the grip alone is mended, the slope ends at its bound: the move to
    it, then one along it (P-orthogonal, which leaves the slope) to the grip.
    """
    by_grip, by_slope = _times(P, [1] * len(w)), _times(P, slope)
    A, B, C = sum(by_grip), sum(by_slope), _dot(slope, by_slope)
    least, most = numbers.least_grip, numbers.most_grip
    grip, missing = sum(w), numbers.least_slope - _dot(slope, w)
    falls = missing * A > B * (within(grip, least, most) - grip)
    per_C = ca.if_else(falls, reciprocal(C + TINY), 0)
    to_slope, share = missing * per_C, B * per_C
    grip = grip + B * to_slope
    to_grip = (within(grip, least, most) - grip) / (A - B * share + TINY)
    to_slope = to_slope - to_grip * share
    return [a + b * to_grip + c * to_slope for a, b, c in zip(w, by_grip, by_slope, strict=True)]


def _towards_center(numbers: BoundNumbers, w: list[Any], slope: list[Any] | None) -> list[Any]:
    """Move w towards the center of the set until every bound holds."""
    away = [one - numbers.center for one in w]
    over = larger(ca.fabs(sum(away)) * numbers.per_grip, 1)
    if slope is not None:
        over = larger(-_dot(slope, away) * numbers.per_slope, over)
    for one in away:
        over = larger(ca.fabs(one) * numbers.per_weight, over)
    part = reciprocal(over)
    rest = (1 - part) * numbers.center
    return [part * one + rest for one in w]
