"""Levenberg-Marquardt within bounds, by normal equations: short and wide problems, many residuals.

min |r(p)|²,   lower <= p <= upper;   (JᵀJ + μ D) d = -Jᵀ r over the parameters that are free to
move, D = diag(JᵀJ), and the step is clipped to the bounds. A step is taken only downhill; μ follows
Nielsen's rule. Source: Madsen, Nielsen and Tingleff, Methods for Non-Linear Least Squares Problems,
2nd ed., 2004, section 3.2.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEP = 1e-6  # of the one-sided differences, for parameters of order one
FIRST_DAMPING = 1e-2
LARGEST_DAMPING = 1e12
GAIN = 1e-7  # a step that lowers the cost by a smaller share is the last
TINY = 1e-12  # keeps the normal equations solvable where a parameter does nothing


class Fit(NamedTuple):
    """Parameters (k,), and the sum of squares that they leave."""

    parameters: Array
    cost: float


def least_squares(
    residual: Callable[[Array], Array], start: Array, lower: Array, upper: Array, *, steps: int
) -> Fit:
    """Return a local minimum of the sum of squares.

    Parameters
    ----------
    residual : r(p), any length.
    start : first parameters (k,), each of order one; moved into the bounds.
    lower : bounds (k,).
    upper : bounds (k,).
    steps : largest number of steps downhill.
    """
    p = np.clip(start, lower, upper)
    r = residual(p)
    cost, damping = float(r @ r), FIRST_DAMPING
    for _ in range(steps):
        J = _jacobian(residual, p, r, upper)
        slope, normal = J.T @ r, J.T @ J
        growth = 2.0
        while damping < LARGEST_DAMPING:
            trial = np.clip(p + _step(normal, slope, damping, p, lower, upper), lower, upper)
            r_trial = residual(trial)
            now = float(r_trial @ r_trial)
            if now < cost:
                break
            damping, growth = damping * growth, 2.0 * growth
        else:
            return Fit(p, cost)
        d = trial - p
        expected = -float(d @ (2.0 * slope + normal @ d))
        quality = (cost - now) / expected if expected > 0.0 else 0.0
        damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * quality - 1.0) ** 3), 1e-12)
        small = cost - now < GAIN * cost
        p, r, cost = trial, r_trial, now
        if small:
            break
    return Fit(p, cost)


def _step(
    normal: Array, slope: Array, damping: float, p: Array, lower: Array, upper: Array
) -> Array:
    """Solve the damped normal equations for what does not press against its bound."""
    free = ~(((p <= lower) & (slope > 0.0)) | ((p >= upper) & (slope < 0.0)))
    d = np.zeros_like(p)
    A = normal[np.ix_(free, free)]
    scale = np.diag(A) + TINY * max(float(np.trace(A)), TINY)
    d[free] = np.linalg.solve(A + damping * np.diag(scale), -slope[free])
    return d


def _jacobian(residual: Callable[[Array], Array], p: Array, r: Array, upper: Array) -> Array:
    columns = []
    for i in range(p.size):
        ahead = p.copy()
        step = STEP * max(1.0, abs(float(p[i])))
        ahead[i] += step if p[i] + step <= upper[i] else -step
        columns.append((residual(ahead) - r) / (ahead[i] - p[i]))
    return np.column_stack(columns)
