"""Where a car is along a path: the foot of the perpendicular, found by walking and never jumping.

e_y > 0: the car is left of the path. At the foot the along-track residual g = (P - C(s)) · t(s) is
zero; dg/ds = -(1 - κ e_y), so that s += g/(1 - κ e_y) is Newton's step.
"""

import math
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

# s [m] -> X, Y [m], ψ [rad], κ [1/m]
PointOf: TypeAlias = Callable[[float], tuple[float, float, float, float]]

LONGEST_STEP = 1.0  # m; shorter than any turn that a car can drive, so that no step skips a bend
SMALLEST_SLOPE = 0.3  # of 1 - κ e_y: near the center of a turn every s is as close as the next
TOLERANCE = 1e-9  # m
STEPS = 200


class Projection(NamedTuple):
    """The point of a path that a car is at.

    s: arc length [m], counting laps on a closed path; e_y: deviation to the left [m];
    psi: heading of the path there [rad], unwrapped; kappa: its curvature [1/m].
    """

    s: float
    e_y: float
    psi: float
    kappa: float

    def heading_error(self, psi: float) -> float:
        """Return e_psi = ψ - ψ_path [rad], between -pi and pi.

        Parameters
        ----------
        psi : heading of the car [rad], however many turns it has counted.
        """
        return math.remainder(psi - self.psi, 2.0 * math.pi)


def walk_to_foot(point_of: PointOf, X: float, Y: float, near: float, reach: float) -> Projection:
    """Walk from `near` towards the car until the path passes square beside it.

    The walk follows the path, so that another leg that passes close by cannot catch it.

    Parameters
    ----------
    point_of : s [m] -> X, Y [m], ψ [rad], κ [1/m] of the path.
    X : of the car [m].
    Y : of the car [m].
    near : s where the walk starts [m].
    reach : how far from `near` the walk may go [m]; where it must stop short, e_y is the deviation
        there.
    """
    s = near
    for _ in range(STEPS):
        X_s, Y_s, psi, kappa = point_of(s)
        cos_psi, sin_psi = math.cos(psi), math.sin(psi)
        along = (X - X_s) * cos_psi + (Y - Y_s) * sin_psi
        e_y = (Y - Y_s) * cos_psi - (X - X_s) * sin_psi
        step = along / max(1.0 - kappa * e_y, SMALLEST_SLOPE)
        step = min(max(step, -LONGEST_STEP), LONGEST_STEP)
        goal = min(max(s + step, near - reach), near + reach)
        if abs(goal - s) < TOLERANCE:
            break
        s = goal
    return Projection(float(s), float(e_y), float(psi), float(kappa))
