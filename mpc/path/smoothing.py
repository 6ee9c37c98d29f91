"""Way-points that were measured, moved a little so that a line through them bends gently.

Minimizes Σ |p - q|² + λ Σ g |D³ p|², D³ the third divided difference over the chord length: what it
leaves alone is a path of constant bending. λ is as large as the allowed distance permits.
"""

from typing import Any

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from mpc.path.line import Array

LEAST, MOST = -12.0, 18.0  # exponents of λ over the sixth power of the mean gap
HALVINGS = 40


def smooth(points: Array, *, closed: bool, distance: float) -> Array:
    """Move points so that their third differences get small.

    Parameters
    ----------
    points : X, Y [m], (k, 2); where closed, the last repeats the first and will again.
    closed : whether they form a ring.
    distance : root mean square of how far they may move [m].
    """
    if len(points) < 4 + closed:
        return points
    roughness = _roughness(points, closed)
    q = points[:-1] if closed else points
    one = sparse.identity(len(q), format="csc")
    unit = float(np.mean(np.hypot(*np.diff(points, axis=0).T))) ** 6

    def moved(exponent: float) -> Array:
        return np.asarray(splu(one + 10.0**exponent * unit * roughness).solve(q))

    low, high = LEAST, MOST
    for _ in range(HALVINGS):  # the distance grows with λ
        middle = 0.5 * (low + high)
        apart = np.sqrt(np.mean(np.sum((moved(middle) - q) ** 2, axis=1)))
        low, high = (middle, high) if apart < distance else (low, middle)
    p = moved(low)
    return np.vstack((p, p[:1])) if closed else p


def _roughness(points: Array, closed: bool) -> Any:
    """Return D' G D of the third divided differences D, weighted by the gaps G."""
    gaps = np.hypot(*np.diff(points, axis=0).T)
    if not closed:
        gaps = np.append(gaps, np.inf)  # differences across the open ends become zero
    n = gaps.size
    D: Any = sparse.identity(n, format="csr")
    around = sparse.csr_matrix((np.ones(n), (np.arange(n), (np.arange(n) + 1) % n)), (n, n))
    span = np.zeros(n)
    for order in range(3):
        span = span + np.roll(gaps, -order)
        D = sparse.diags(1.0 / span) @ (around @ D - D)
    return (D.T @ sparse.diags(np.where(np.isfinite(span), span, 0.0) / 3.0) @ D).tocsc()
