"""The line a good driver takes through gates of cones: as straight as they let it be.

y(x): lateral place [m] over the place along the lane [m], a spline whose fourth derivative is
continuous. Minimizes the peak k of |κ| while |dκ/ds| <= k/easing: steering takes its time. A small
cost on dκ/ds chooses among the lines with the same peak.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil, isfinite
from typing import Any

import casadi as ca
import numpy as np
from scipy.interpolate import BSpline

from codegen.arrays import Array
from mpc.path.line import Line, PathError
from mpc.path.path import Path
from mpc.path.waypoints import sample

_KNOTS = 1.0  # m, about their distance
_PER_INTERVAL = 4  # places between two knots where limits hold
_GENTLY = 5.0  # m³: weight of ∫ (dκ/ds)² ds against the peak of |κ| [1/m]
_CONE_SPACING = 3.0  # m
_CAR_WIDTH = 1.8  # m
_LANE_MARGIN = 0.05  # m, between the side of a car and the cones of a lane
_SLALOM_MARGIN = 0.3  # m, and those of a slalom
_RUN = 40.0  # m, before the first cones and after the last
SPACING = 0.25  # m, longest step of the samples
_NARROWEST = 1.0  # m, of a car
_WIDEST = 2.6  # m, of a car
_EASING = 6.0  # m

_DEGREE = 5
_OPTIONS: dict[str, Any] = {
    "print_time": False,
    "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 500},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """A lane between two rows of cones, or beside one row where a side is infinite.
    start : where it begins along x [m].   end : where it ends [m].
    right : y of the right cones [m].   left : y of the left cones [m].
    """

    start: float
    end: float
    right: float
    left: float

    def __post_init__(self) -> None:
        if not (isfinite(self.start) and isfinite(self.end) and self.start <= self.end):
            raise PathError(f"a gate must start before its end: {self}")
        if not self.right < self.left:
            raise PathError(f"the right of a gate must be below its left: {self}")

    def cones(self) -> Array:
        """Return X, Y of its cones [m], (k, 2), at most 3 m from one another."""
        x = np.linspace(self.start, self.end, ceil((self.end - self.start) / _CONE_SPACING) + 1)
        rows = [np.column_stack((x, np.full_like(x, y))) for y in (self.right, self.left)]
        return np.vstack([row for row in rows if np.isfinite(row).all()])


@lru_cache(maxsize=16)  # a course is asked for once for each drive
def line_through_gates(
    gates: tuple[Gate, ...],
    *,
    start: tuple[float, float],
    end: tuple[float, float],
    clearance: float,
    easing: float,
) -> Line:
    """Find the line of smallest peak curvature; it starts and ends along x without curvature.
    start : x, y of the first point [m].   end : x, y of the last point [m].
    clearance : smallest distance from the rows of cones, as half the width of the car [m].
    easing : length over which the curvature may rise from zero to its peak [m].
    """
    for gate in gates:
        if gate.left - gate.right < 2.0 * clearance:
            raise PathError(f"gates: {gate} is too narrow for a clearance of {clearance} m")
    intervals = max(_DEGREE + 1, ceil((end[0] - start[0]) / _KNOTS))
    inner = np.linspace(start[0], end[0], intervals + 1)
    t = np.concatenate((np.full(_DEGREE, start[0]), inner, np.full(_DEGREE, end[0])))
    n = t.size - _DEGREE - 1
    edges = np.concatenate([[gate.start, gate.end] for gate in gates])
    x = np.linspace(inner[0], inner[-1], _PER_INTERVAL * (inner.size - 1) + 1)
    x = np.unique(np.concatenate((x, edges[(edges > x[0]) & (edges < x[-1])])))
    c, k = ca.MX.sym("c", n), ca.MX.sym("k")
    basis = (BSpline(t, np.eye(n), _DEGREE)(x, nu=order) for order in range(4))
    y, dy, ddy, dddy = (
        ca.mtimes(ca.sparsify(ca.DM(np.where(np.abs(matrix) < 1e-12, 0.0, matrix))), c)
        for matrix in basis
    )
    stretch = 1.0 + dy**2  # (ds/dx)²
    kappa = ddy / stretch**1.5
    kappa_ds = (dddy * stretch - 3.0 * dy * ddy**2) / stretch**3
    low, high = np.full(x.size, -np.inf), np.full(x.size, np.inf)
    for gate in gates:
        inside = (x >= gate.start) & (x <= gate.end)
        low[inside] = np.maximum(low[inside], gate.right + clearance)
        high[inside] = np.minimum(high[inside], gate.left - clearance)
    low[[0, -1]], high[[0, -1]] = (start[1], end[1]), (start[1], end[1])
    if (low > high).any():
        raise PathError(f"gates: nothing is free at x = {x[np.argmax(low > high)]:.4g} m")
    ends = ca.vertcat(*(f[i] for f in (dy, ddy) for i in (0, x.size - 1)))
    rows = ca.vertcat(y, ends, kappa - k, -kappa - k, easing * kappa_ds - k, -easing * kappa_ds - k)
    upper = np.concatenate((high, np.zeros(4 + 4 * x.size)))
    lower = np.concatenate((low, np.zeros(4), np.full(4 * x.size, -np.inf)))
    cost = k + _GENTLY * ca.sum1(np.gradient(x) * ca.sqrt(stretch) * kappa_ds**2)
    problem = {"x": ca.vertcat(c, k), "f": cost, "g": rows}
    solver = ca.nlpsol("line", "ipopt", problem, _OPTIONS)
    guess = np.append(np.linspace(start[1], end[1], n), 0.05)
    solution = solver(x0=guess, lbg=lower, ubg=upper)
    if not solver.stats()["success"]:
        raise PathError(f"gates: no line found ({solver.stats()['return_status']})")
    greville = [t[i + 1 : i + _DEGREE + 1].mean() for i in range(n)]  # of y = x
    found = np.asarray(solution["x"]).ravel()[:n]
    spline = BSpline(t, np.column_stack((greville, found)), _DEGREE)
    return sample(spline, inner, SPACING, "gates")


# The lane changes of ISO 3888: a double lane change (part 1) and obstacle avoidance (part 2).
#
# Lengths and widths of the lanes are those of ISO 3888-1:2018 and ISO 3888-2:2011 as public
# programs and papers give them, not checked against the text of the standards; b is the width of
# the car. x = 0 at the first cones, y = 0 in the middle of the first lane, the middle lane is to
# the left, and the right cones of the last lane are in line with those of the first.
#     part 1: lanes 15, 25, 30 m (two of 15) with 30 and 25 m between them, 1.1 b + 0.25,
#         1.2 b + 0.25, 1.3 b + 0.25 wide; the middle lane is offset by 3.5 m.
#     part 2: lanes 12, 11, 12 m with 13.5 and 12.5 m between them, 1.1 b + 0.25, b + 1 and
#         1.3 b + 0.25, at least 3 m, wide; the middle lane begins 1 m beside the first.
# The offset of part 1 is taken between right cones. The standard leaves the line to the driver;
# ours is the one of smallest peak curvature, see the gates above.


def iso_3888_1(*, car_width: float = _CAR_WIDTH) -> Path:
    """Return the double lane change of ISO 3888-1, 125 m between the first and the last cones.

    Parameters
    ----------
    car_width : width of the car without mirrors [m]; the lanes grow with it. The car keeps 5 cm
        from the cones, and begins and ends 40 m from them.
    """
    first, middle, last = (share * _checked(car_width) + 0.25 for share in (1.1, 1.2, 1.3))
    right = -0.5 * first
    gates = (
        Gate(start=0.0, end=15.0, right=right, left=right + first),
        Gate(start=45.0, end=70.0, right=right + 3.5, left=right + 3.5 + middle),
        Gate(start=95.0, end=125.0, right=right, left=right + last),
    )
    return _path("ISO 3888-1", gates, 0.5 * car_width + _LANE_MARGIN, 10.0, lanes=True)


def iso_3888_2(*, car_width: float = _CAR_WIDTH) -> Path:
    """Return the obstacle avoidance of ISO 3888-2, 61 m between the first and the last cones.

    Arguments are those of `iso_3888_1`.

    Examples
    --------
    >>> path = iso_3888_2(car_width=1.8)
    >>> f"{path.length:.1f} m, tightest radius {1.0 / path.peak_curvature:.1f} m"
    '141.7 m, tightest radius 40.7 m'
    """
    first, middle = 1.1 * _checked(car_width) + 0.25, car_width + 1.0
    last = max(1.3 * car_width + 0.25, 3.0)
    right = -0.5 * first
    side = right + first + 1.0
    gates = (
        Gate(start=0.0, end=12.0, right=right, left=right + first),
        Gate(start=25.5, end=36.5, right=side, left=side + middle),
        Gate(start=49.0, end=61.0, right=right, left=right + last),
    )
    return _path("ISO 3888-2", gates, 0.5 * car_width + _LANE_MARGIN, 6.0, lanes=True)


def _checked(car_width: float) -> float:
    if not _NARROWEST <= car_width <= _WIDEST:
        raise PathError(f"car_width must be {_NARROWEST} to {_WIDEST} m, it is {car_width}")
    return car_width


def _path(
    name: str,
    gates: tuple[Gate, ...],
    clearance: float,
    easing: float,
    *,
    lanes: bool = False,
) -> Path:
    """Drive through the gates; where they are lanes, the car keeps them before and after."""
    begin, finish = gates[0].start - _RUN, gates[-1].end + _RUN
    line = line_through_gates(
        (replace(gates[0], start=begin), *gates[1:-1], replace(gates[-1], end=finish))
        if lanes
        else gates,
        start=(begin, 0.0),
        end=(finish, 0.0),
        clearance=clearance,
        easing=easing,
    )
    return Path.from_line(line, name=name, cones=np.vstack([gate.cones() for gate in gates]))


def slalom(*, gap: float = 18.0, cones: int = 8) -> Path:
    """Return the line of smallest peak curvature around the cones, the first of them at the origin.

    The car passes the first cone on its left side, y > 0, and ends on the line that it came from.

    Parameters
    ----------
    gap : distance of the cones [m].
    """
    if not (cones >= 1 and gap >= 5.0 and math.isfinite(gap)):
        raise PathError(f"a slalom needs a cone and 5 m between them, got {cones} and {gap} m")
    sides = (0.0, math.inf), (-math.inf, 0.0)  # right and left of the gates in turn
    places = [(i * gap, *sides[i % 2]) for i in range(cones)]
    gates = tuple(Gate(start=x, end=x, right=right, left=left) for x, right, left in places)
    half = 0.5 * _CAR_WIDTH + _SLALOM_MARGIN
    return _path("slalom", gates, half, _EASING)
