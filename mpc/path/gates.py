"""The line a good driver takes through gates of cones: as straight as they let it be.

y(x): lateral place [m] over the place along the lane [m], a spline whose fourth derivative is
continuous. Minimizes the peak k of |κ| while |dκ/ds| <= k/easing: steering takes its time. A small
cost on dκ/ds chooses among the lines with the same peak.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, isfinite
from typing import Any

import casadi as ca
import numpy as np
from scipy.interpolate import BSpline

from mpc.path.line import Array, Line, PathError
from mpc.path.waypoints import sample

DEGREE = 5
PER_INTERVAL = 4  # places between two knots where limits hold
GENTLY = 5.0  # m³: weight of ∫ (dκ/ds)² ds against the peak of |κ| [1/m]
CONE_SPACING = 3.0  # m
OPTIONS: dict[str, Any] = {
    "print_time": False,
    "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 500},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """A lane between two rows of cones, or beside one row where a side is infinite.

    Parameters
    ----------
    start : where it begins along x [m].
    end : where it ends [m].
    right : y of the right cones [m].
    left : y of the left cones [m].

    Raises
    ------
    PathError
        Where start or end is not finite, start after end, or right not below left.
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
        x = np.linspace(self.start, self.end, ceil((self.end - self.start) / CONE_SPACING) + 1)
        rows = [np.column_stack((x, np.full_like(x, y))) for y in (self.right, self.left)]
        return np.vstack([row for row in rows if np.isfinite(row).all()])


def cones_of(gates: Sequence[Gate]) -> Array:
    """Return X, Y of all cones [m], (k, 2).

    Parameters
    ----------
    gates : of the course.
    """
    return np.vstack([gate.cones() for gate in gates])


def line_through_gates(
    gates: Sequence[Gate],
    *,
    start: tuple[float, float],
    end: tuple[float, float],
    clearance: float,
    easing: float,
    spacing: float = 0.25,
    knots: float = 1.0,
) -> Line:
    """Find the line of smallest peak curvature; it starts and ends along x without curvature.

    Parameters
    ----------
    gates : what the line must pass.
    start : x, y of the first point [m].
    end : x, y of the last point [m].
    clearance : smallest distance from the rows of cones, as half the width of the car [m].
    easing : length over which the curvature may rise from zero to its peak [m].
    spacing : longest step of the samples [m].
    knots : about the distance of the knots of the spline [m].

    Raises
    ------
    PathError
        Where a gate is too narrow for the clearance, a number is out of range, or no line is found.
    """
    numbers = {"easing": easing, "spacing": spacing, "knots": knots, "length": end[0] - start[0]}
    for name, value in {**numbers, "clearance": clearance}.items():
        if not (value > 0.0 and isfinite(value)):
            raise PathError(f"gates: {name} must be positive and finite, it is {value}")
    for gate in gates:
        if gate.left - gate.right < 2.0 * clearance:
            raise PathError(f"gates: {gate} is too narrow for a clearance of {clearance} m")
    intervals = max(DEGREE + 1, ceil((end[0] - start[0]) / knots))
    inner = np.linspace(start[0], end[0], intervals + 1)
    t = np.concatenate((np.full(DEGREE, start[0]), inner, np.full(DEGREE, end[0])))
    c = _coefficients(t, inner, gates, start, end, clearance, easing)
    greville = np.array([t[i + 1 : i + DEGREE + 1].mean() for i in range(c.size)])  # of y = x
    spline = BSpline(t, np.column_stack((greville, c)), DEGREE)
    return sample(spline, inner, spacing, "gates")


def _coefficients(
    t: Array,
    inner: Array,
    gates: Sequence[Gate],
    start: tuple[float, float],
    end: tuple[float, float],
    clearance: float,
    easing: float,
) -> Array:
    """Solve for the coefficients of the spline."""
    n = t.size - DEGREE - 1
    edges = np.concatenate([[gate.start, gate.end] for gate in gates])
    x = np.linspace(inner[0], inner[-1], PER_INTERVAL * (inner.size - 1) + 1)
    x = np.unique(np.concatenate((x, edges[(edges > x[0]) & (edges < x[-1])])))
    c, k = ca.MX.sym("c", n), ca.MX.sym("k")
    basis = [_basis(t, x, order) for order in range(4)]
    y, dy, ddy, dddy = (ca.mtimes(matrix, c) for matrix in basis)
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
    cost = k + GENTLY * ca.sum1(np.gradient(x) * ca.sqrt(stretch) * kappa_ds**2)
    problem = {"x": ca.vertcat(c, k), "f": cost, "g": rows}
    solver: Any = ca.nlpsol("line", "ipopt", problem, OPTIONS)
    guess = np.append(np.linspace(start[1], end[1], n), 0.05)
    solution = solver(x0=guess, lbg=lower, ubg=upper)
    if not solver.stats()["success"]:
        raise PathError(f"gates: no line found ({solver.stats()['return_status']})")
    return np.asarray(solution["x"]).ravel()[:n]


def _basis(t: Array, x: Array, order: int) -> Any:
    """Return the sparse matrix from the coefficients to a derivative at x."""
    n = t.size - DEGREE - 1
    matrix = BSpline(t, np.eye(n), DEGREE)(x, nu=order)
    return ca.sparsify(ca.DM(np.where(np.abs(matrix) < 1e-12, 0.0, matrix)))
