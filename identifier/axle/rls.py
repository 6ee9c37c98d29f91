"""Recursive least squares with directional forgetting (R. Kulhavy, Automatica 23, 1987).

Only the direction that the regressor excites is forgotten: no wind-up while the rest is not
excited. P (q, q) is symmetric and kept as its upper triangle, by rows.
"""

from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Symmetric = dict[tuple[int, int], Any]


class Learnt(NamedTuple):
    """Parameters (q entries) and covariance after an update."""

    theta: list[Any]
    P: Symmetric


def triangle(q: int) -> list[tuple[int, int]]:
    """Return the places of the upper triangle, by rows.

    Parameters
    ----------
    q : size of the matrix.
    """
    return list(combinations_with_replacement(range(q), 2))


def packed(P: Array) -> Array:
    """Return upper triangles (2, q (q + 1)/2) of symmetric matrices (2, q, q).

    Parameters
    ----------
    P : symmetric matrices.
    """
    rows, columns = np.array(triangle(P.shape[1])).T
    upper: Array = P[:, rows, columns]
    return upper


def unpacked(upper: Array, q: int) -> Array:
    """Return symmetric matrices (2, q, q) of upper triangles (2, q (q + 1)/2).

    Parameters
    ----------
    upper : upper triangles, by rows.
    q : size of the matrices.
    """
    P = np.zeros((2, q, q))
    rows, columns = np.array(triangle(q)).T
    P[:, rows, columns] = upper
    P[:, columns, rows] = upper
    return P


def at(P: Symmetric, i: int, j: int) -> Any:
    """Return P_ij from the upper triangle.

    Parameters
    ----------
    P : upper triangle by place.
    i : row.
    j : column.
    """
    return P[min(i, j), max(i, j)]


def update(
    theta: list[Any],
    P: Symmetric,
    h: list[Any],
    *,
    error: Any,
    R: Any,
    forgetting: Any,
    grows: Any,
    learns: Any,
) -> Learnt:
    """Return parameters and covariance after one sample.

    θ⁺ = θ + P h e/(R + h'Ph);  P⁺ = P - c P h h'P, c = (1 - (1 - λ) R/(λ h'Ph))/(R + h'Ph), which
    keeps P positive definite for every c, also c < 0, where P grows: 1/h'P⁻¹h stays positive.

    Parameters
    ----------
    theta : parameters, q entries.
    P : covariance.
    h : regressor, q entries.
    error : e = y - h'θ, clipped.
    R : variance of the error.
    forgetting : (1 - λ)/λ.
    grows : whether P may grow.
    learns : whether to update at all.
    """
    q = len(theta)
    Ph = [sum(at(P, i, j) * h[j] for j in range(q)) for i in range(q)]
    excited = sum(a * b for a, b in zip(Ph, h, strict=True)) + 1e-12 * R
    scale = learns / ((R + excited) * excited)
    gain = error * excited * scale
    c = excited - forgetting * R
    c = ca.if_else(ca.logic_and(c < 0, ca.logic_not(grows)), 0, c) * scale
    theta = [a + b * gain for a, b in zip(theta, Ph, strict=True)]
    P = {(i, j): value - c * Ph[i] * Ph[j] for (i, j), value in P.items()}
    return Learnt(theta, P)
