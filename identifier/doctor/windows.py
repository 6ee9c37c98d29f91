"""Means over windows that slide, and least squares whose weights are not negative.

SciPy has both, in a sparse matrix and in `scipy.optimize.nnls`: to import these takes longer than
all that the doctor computes of a log of a minute.
"""

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from codegen.arrays import Array

ROUNDING = 1e-14  # of a gradient over the sizes it is made of


class Windows(NamedTuple):
    """Windows of one shape: `windows @ x` sums x (n,) or (n, k) under each, (m,) or (m, k).

    starts : first sample of each (m,).   weights : of the samples from there on (l,).
    """

    starts: NDArray[np.intp]
    weights: Array

    def __matmul__(self, x: Array) -> Array:
        if not self.starts.size:
            return np.zeros((0, *x.shape[1:]))
        under = sliding_window_view(x, self.weights.size, axis=0)[self.starts]
        return np.asarray(under @ self.weights, dtype=np.float64)


def not_negative(gram: Array, moment: Array) -> Array:
    """Return the weights w >= 0 at which ½ wᵀ G w - mᵀ w is least (k,).

    The active set of Lawson and Hanson (Solving Least Squares Problems, 1974, chapter 23), on the
    normal equations: the optimum is where no gradient g = m - G w of a weight at zero is positive.

    Parameters
    ----------
    gram : G, positive definite (k, k).
    moment : m (k,).
    """
    w, free = np.zeros(moment.size), np.zeros(moment.size, dtype=bool)
    for _ in range(10 * moment.size):
        gradient = moment - gram @ w
        sure = ROUNDING * (np.abs(moment) + np.abs(gram) @ np.abs(w))
        rises = ~free & (gradient > sure)
        if not rises.any():
            break
        free[np.argmax(np.where(rises, gradient, -np.inf))] = True
        while True:
            best = np.zeros(moment.size)
            best[free] = np.linalg.solve(gram[np.ix_(free, free)], moment[free])
            below = free & (best <= 0.0)
            if not below.any():
                w = best
                break
            share = np.min(w[below] / (w[below] - best[below]))
            w = w + share * (best - w)
            free &= w > ROUNDING * np.abs(w).max(initial=0.0)
            w[~free] = 0.0
    return w
