"""Means over windows that slide, and least squares whose weights are not negative.

SciPy has both, in a sparse matrix and in `scipy.optimize.nnls`: to import these takes longer than
all that the doctor computes of a log of a minute.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array

ROUNDING = 1e-14  # of a gradient over the sizes it is made of


class Windows(NamedTuple):
    """Windows of one shape: `windows @ x` sums x (n,) or (n, k) under each, (m,) or (m, k).

    under : samples under each (m, l).   weights : of these (l,).
    """

    under: NDArray[np.intp]
    weights: Array

    def __matmul__(self, x: Array) -> Array:
        return np.asarray((x.T.take(self.under, axis=-1) @ self.weights).T, dtype=np.float64)


def not_negative(gram: Array, moment: Array, guess: NDArray[np.bool_] | None = None) -> Array:
    """Return the weights w >= 0 at which ½ wᵀ G w - mᵀ w is least (k,).

    The active set of Lawson and Hanson (Solving Least Squares Problems, 1974, chapter 23), on the
    normal equations: the optimum is where no gradient g = m - G w of a weight at zero is positive.

    Parameters
    ----------
    gram : G, positive definite (k, k).
    moment : m (k,).
    guess : which weights are rather not zero (k,): where that is so, nothing is searched.
    """
    if guess is not None:
        w = _free_optimum(gram, moment, guess)
        if (w[guess] > 0.0).all() and not _rising(gram, moment, w, guess)[0].any():
            return w
    w, free = np.zeros(moment.size), np.zeros(moment.size, dtype=bool)
    for _ in range(10 * moment.size):
        rises, gradient = _rising(gram, moment, w, free)
        if not rises.any():
            break
        free[np.argmax(np.where(rises, gradient, -np.inf))] = True
        while True:
            best = _free_optimum(gram, moment, free)
            below = free & (best <= 0.0)
            if not below.any():
                w = best
                break
            share = np.min(w[below] / (w[below] - best[below]))
            w = w + share * (best - w)
            free &= w > ROUNDING * np.abs(w).max(initial=0.0)
            w[~free] = 0.0
    return w


def _free_optimum(gram: Array, moment: Array, free: NDArray[np.bool_]) -> Array:
    """Return the weights where the others are zero, of any sign (k,)."""
    w = np.zeros(moment.size)
    w[free] = np.linalg.solve(gram[free][:, free], moment[free])
    return w


def _rising(
    gram: Array, moment: Array, w: Array, free: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], Array]:
    """Return which weights at zero would better be larger, and all gradients (k,)."""
    gradient = moment - gram @ w
    sure = ROUNDING * (np.abs(moment) + np.abs(gram) @ np.abs(w))
    return ~free & (gradient > sure), gradient
