"""An ellipsoid around all weights that the drive so far leaves possible, strip by strip.

E = {w : (w - c)' P⁻¹ (w - c) <= 1}. A mean of a drive cuts it by |y - h'w| <= e; the next is the
smallest ellipsoid around what is left, by two parallel cuts (R. G. Bland, D. Goldfarb and M. J.
Todd, Operations Research 29, 1981, section 4; as a filter: E. Fogel and Y. F. Huang, Automatica 18,
1982). It holds the polytope, costs n² per sample and keeps n (n + 3)/2 numbers: for use while
driving, where the polytope itself grows. An empty cut is proof that the bound is violated.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from codegen.arrays import Array
from identifier.axle.guarantee import ForceBound, Strips

LARGEST_WEIGHT = 3.0  # static axle loads: the ball about the box of weights is begun with
ALIKE = 1e-9  # of two cuts, from which on they are taken to be as deep


class Ellipsoid(NamedTuple):
    """Center c (n,) and shape P (n, n)."""

    center: Array
    shape: Array

    @classmethod
    def around(cls, n: int, largest: float = LARGEST_WEIGHT) -> Self:
        """Return the ball around a box of weights.

        Parameters
        ----------
        n : number of weights.
        largest : of each weight [static axle loads].
        """
        return cls(np.zeros(n), n * largest**2 * np.eye(n))

    def reach(self, h: Array) -> tuple[Array, Array]:
        """Return least and largest h'w, (k,) each.

        Parameters
        ----------
        h : (k, n).
        """
        middle = h @ self.center
        half = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", h, self.shape, h), 0.0))
        return middle - half, middle + half

    def cut(self, h: Array, y: float, allowed: float) -> "Ellipsoid | None":
        """Return the smallest ellipsoid around what |y - h'w| <= allowed leaves; None: nothing.

        Parameters
        ----------
        h : (n,).
        """
        c, P = self
        n, Ph = c.size, P @ h
        size = math.sqrt(max(float(h @ Ph), 0.0))
        away = y - float(h @ c)
        if not size > 1e-12 * (1.0 + abs(y)):  # it is a point along h
            return self if abs(away) <= allowed else None
        upper = max((-away - allowed) / size, -1.0)  # depth of the cuts: h'w <= y + e and >= y - e
        lower = max((away - allowed) / size, -1.0)
        if upper > 1.0 or lower > 1.0:
            return None
        if upper * lower >= 1.0 / n:
            return self  # it is the smallest one already
        if abs(upper - lower) < ALIKE:
            at = upper * upper
            sigma, tau, delta = (1.0 - n * at) / (1.0 - at), 0.0, n * (1.0 - at) / (n - 1.0)
        else:
            u, v = upper * upper, lower * lower
            rho = math.sqrt(4.0 * (1.0 - u) * (1.0 - v) + (n * (v - u)) ** 2)
            sigma = (n + 2.0 * (1.0 - upper * lower - 0.5 * rho) / (upper - lower) ** 2) / (n + 1.0)
            tau = 0.5 * sigma * (upper - lower)
            delta = n * n / (n * n - 1.0) * (1.0 - 0.5 * (u + v - rho / n))
        shape = delta * (P - sigma * np.outer(Ph, Ph) / size**2)
        return Ellipsoid(c - tau * Ph / size, 0.5 * (shape + shape.T))


def outer_ellipsoid(
    strips: Strips, axle: int, bound: ForceBound, ladder: tuple[float, ...]
) -> Ellipsoid | None:
    """Return the ellipsoid after all means of a drive; None where one contradicts the others.

    Parameters
    ----------
    axle : 0 front, 1 rear.
    ladder : slip scales of the units [rad].
    """
    known: Ellipsoid | None = Ellipsoid.around(len(ladder))
    allowed = bound.allowed(strips.beyond, strips.rate)[:, axle]
    for h, y, wide in zip(strips.h[:, axle], strips.y[:, axle], allowed, strict=True):
        if known is None:
            return None
        known = known.cut(h, float(y), float(wide))
    return known
