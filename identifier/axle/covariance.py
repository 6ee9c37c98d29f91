"""The covariance as factors P = U D U': positive semidefinite in any precision, and bounded.

U is unit upper triangular, D >= 0 diagonal (G. J. Bierman, Factorization Methods for Discrete
Sequential Estimation, 1977): whatever rounding does to the factors, their product stays symmetric
and positive semidefinite. The trace of the block of the weights and the variance of each other
parameter stay below `widest` times the prior's: what would pass that is not added.
"""

from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.axle.car import larger, reciprocal

LEAST_VARIANCE = 1e-14  # of stored weights: of a parameter given those after it, in its unit
TINY = 1e-30  # keeps quotients of factors finite where one has vanished
_ROUNDING = 1e-5  # share of the limit that rounding in float may take in a step

Symmetric = dict[tuple[int, int], Any]


class Factors(NamedTuple):
    """U above its unit diagonal, by place; D (q entries)."""

    U: dict[tuple[int, int], Any]
    D: list[Any]


class Spread(NamedTuple):
    """What the factors say of P: its block of the weights, by place with i <= j, the trace of that
    block, and the other variances.
    """

    weights: Symmetric
    trace: Any
    others: list[Any]


def triangle(q: int) -> list[tuple[int, int]]:
    """Return the places of the upper triangle, by rows."""
    return list(combinations_with_replacement(range(q), 2))


def packed(P: Array) -> Array:
    """Return factors (k, q (q + 1)/2) of positive definite P: D on the diagonal, U above it.
    P : symmetric matrices (k, q, q).
    """
    return np.array([_factored(one)[tuple(np.array(triangle(len(one))).T)] for one in P])


def _factored(P: Array) -> Array:
    """Return U with D on its diagonal (q, q), from the last column to the first."""
    rest, F = P.copy(), np.zeros_like(P)
    for j in reversed(range(len(P))):
        D = max(float(rest[j, j]), LEAST_VARIANCE)
        F[:j, j], F[j, j] = rest[:j, j] / D, D
        rest[:j, :j] -= D * np.outer(F[:j, j], F[:j, j])
    return F


def unpacked(packed: Array, q: int) -> Array:
    """Return P (k, q, q) of factors (k, q (q + 1)/2).
    packed : D on the diagonal, U above it, by rows, (k, q (q + 1)/2).
    """
    F = np.zeros((len(packed), q, q))
    F[:, *np.array(triangle(q)).T] = packed
    D = np.einsum("aii->ai", F).copy()
    np.einsum("aii->ai", F)[:] = 1.0
    P = np.einsum("aij,aj,akj->aik", F, D, F)
    return 0.5 * (P + P.transpose(0, 2, 1))


def per_variance(prior: Array, n: int, widest: float) -> Array:
    """Return 1/limit of the trace of the weights and of each other variance, (2, q - n + 1).
    prior : covariance before the first sample, (2, q, q).   widest : limit over the prior's [-].
    """
    return 1.0 / (widest * (1.0 - _ROUNDING) * _sizes(prior, n))


def _sizes(P: Array, n: int) -> Array:
    """Return the trace of the weights and each other variance, (2, q - n + 1)."""
    variances = np.einsum("aii->ai", P)
    return np.column_stack([variances[:, :n].sum(axis=1), variances[:, n:]])


def narrowed(P: Array, limits: Array) -> Array:
    """Return P, scaled down where it is wider than allowed.
    P : covariances (2, q, q).   limits : from `per_variance`.
    """
    n = P.shape[1] - limits.shape[1] + 1
    return P / np.maximum((_sizes(P, n) * limits).max(axis=1), 1.0)[:, None, None]


def factors_of(packed: list[Any], q: int) -> Factors:
    """Return the factors that a row holds.
    packed : q (q + 1)/2 entries.
    """
    by_place = dict(zip(triangle(q), packed, strict=True))
    D = [by_place.pop((i, i)) for i in range(q)]
    return Factors(by_place, D)


def row_of(factors: Factors) -> list[Any]:
    """Return the row that holds factors."""
    U, D = factors
    return [D[i] if i == j else U[i, j] for i, j in triangle(len(D))]


def entry(factors: Factors, i: int, k: int) -> Any:
    """Return P = U D U' at row i and column k.
    i, k : place, from 0, i <= k.
    """
    U, D = factors
    first = D[k] if i == k else U[i, k] * D[k]
    return first + sum(U[i, j] * D[j] * U[k, j] for j in range(k + 1, len(D)))


def spread(factors: Factors, n: int) -> Spread:
    """Return P = U D U' in the block of the weights, and its variances.
    n : number of weights, which stand first.
    """
    weights = {(i, k): entry(factors, i, k) for i, k in triangle(n)}
    trace = sum(weights[i, i] for i in range(n))
    others = [entry(factors, i, i) for i in range(n, len(factors.D))]
    return Spread(weights, trace, others)


def width(trace: Any, others: list[Any], limits: list[Any]) -> Any:
    """Return the largest of the bounded variances over its limit.
    others : variances of the other parameters.
    limits : 1/limit of the trace and of each other variance.
    """
    widest, *rest = (a * b for a, b in zip([trace, *others], limits, strict=True))
    for one in rest:
        widest = larger(one, widest)
    return widest


def scaled(factors: Factors, wide: Any) -> Factors:
    """Return the factors of P/wide where wide > 1, else of P.
    wide : from `width`.
    """
    scale = reciprocal(larger(wide, 1))
    return Factors(factors.U, [D * scale for D in factors.D])


def inflated(factors: Factors, direction: list[Any], amount: Any) -> Factors:
    """Return the factors of P + amount d d' in the block of the weights (Agee and Turner).
    direction : d, n entries.   amount : variance to add, not negative.
    """
    U, D, v, c = dict(factors.U), list(factors.D), list(direction), amount
    for j in reversed(range(len(v))):
        old, cv = D[j], c * v[j]
        D[j] = old + cv * v[j]
        per_D = reciprocal(D[j] + TINY)
        for i in range(j):
            v[i] = v[i] - v[j] * U[i, j]
            U[i, j] = U[i, j] + cv * per_D * v[i]
        c = c * old * per_D
    return Factors(U, D)


class _Excited(NamedTuple):
    """A regressor seen through the covariance: f = U'h, g = D f, v = P h, a = h'P h > 0."""

    f: list[Any]
    g: list[Any]
    v: list[Any]
    a: Any


def excited(factors: Factors, h: list[Any], least: Any) -> _Excited:
    """Return what a regressor excites.
    h : regressor, q entries.
    """
    U, D = factors
    q = len(D)
    f = [h[j] + sum(U[i, j] * h[i] for i in range(j)) for j in range(q)]
    g = [a * b for a, b in zip(D, f, strict=True)]
    v: list[Any] = []
    for j in range(q):  # in the order of `updated`, where its terms are found again
        v = [*(v[i] + U[i, j] * g[j] for i in range(j)), g[j]]
    return _Excited(f, g, v, sum(a * b for a, b in zip(f, g, strict=True)) + least)


def updated(factors: Factors, direction: _Excited, c: Any) -> Factors:
    """Return the factors of P - c P h h'P/(1 + c a) (Bierman).

    D_j is multiplied by β_(j-1)/β_j, β_j = 1 + c Σ_(i<=j) f_i g_i, which is positive whatever
    rounding does; c < 0 makes P grow, c = 0 leaves every bit of it.
    c : more than -1/a by more than rounding.
    """
    U, D = dict(factors.U), list(factors.D)
    before, per_before, excitation = 1.0, 1.0, 0.0
    v: list[Any] = []
    for j, (f, g) in enumerate(zip(direction.f, direction.g, strict=True)):
        excitation = excitation + f * g
        move = -(c * f) * per_before
        for i in range(j):
            old = U[i, j]
            U[i, j] = old + v[i] * move
            v[i] = v[i] + old * g
        v.append(g)
        beta = 1 + c * excitation
        ratio = before / beta  # 1, not almost, where nothing is excited
        D[j] = D[j] * ratio
        before, per_before = beta, per_before * ratio
    return Factors(U, D)
