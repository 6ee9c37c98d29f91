"""The covariance of z as factors P = U D U', through a step and through a measurement.

z = [m; θ]: m moves by m⁺ = A m + B θ + w, θ stays. Because θ stands last, its factors stay as they
are: U_mθ⁺ = A U_mθ + B U_θθ, and only the block of m is factored anew, by weighted Gram-Schmidt on
the rows of [A U_mm, I] with the weights [D_m, Q] (C. L. Thornton; G. J. Bierman, Factorization
Methods for Discrete Sequential Estimation, 1977, chapter 7.4). P stays positive semidefinite in any
precision.
"""

from typing import Any

import casadi as ca

from identifier.axle.car import larger
from identifier.axle.covariance import TINY, Factors, excited, updated

CONDITIONS = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_NOT)


def as_factor(number: Any) -> Any:
    """Return a number as one that others are multiplied with: CasADi would turn each product with a
    choice into a choice.
    number : scalar expression, finite where it is not chosen.
    """
    if number.is_leaf():
        return number
    if number.op() in CONDITIONS:
        return 1 - ca.logic_not(number)
    if number.op() != ca.OP_IF_ELSE_ZERO:
        return number
    condition, chosen = number.dep(0), number.dep(1)
    return (1 - ca.logic_not(condition)) * as_factor(chosen)


def propagated(factors: Factors, F: Any, Q: list[Any]) -> Factors:
    """Return the factors after m⁺ = F z + w.

    F is given by its way: rows for the a numbers on the way to m⁺, then for m⁺, each over z and
    the numbers on the way before it. So what many rows share is multiplied with U once.
    factors : of z, q entries.   F : Jacobian of what moves (a + m, q + a), sparse.
    Q : variances of w, m entries; None where there is none.
    """
    U, D = factors
    q, m = len(D), len(Q)
    steps = [
        [(as_factor(F[i, j]), j) for j in range(F.shape[1]) if F.has_nz(i, j)]
        for i in range(F.shape[0])
    ]

    def column(k: int) -> list[Any]:
        """Column k of F U."""
        values = [*(U[j, k] for j in range(k)), ca.SX(1), *[ca.SX(0)] * (q - k - 1)]
        for terms in steps:
            values.append(sum((slope * values[j] for slope, j in terms), start=ca.SX(0)))
        return values[-m:]

    noisy = [i for i in range(m) if Q[i] is not None]
    moved = [column(k) for k in range(q)]
    rows = [
        [*(moved[k][i] for k in range(m)), *(ca.SX(float(i == j)) for j in noisy)] for i in range(m)
    ]
    weights = [*D[:m], *(Q[i] for i in noisy)]
    after = {
        (i, k): moved[k][i] if i < m else U[i, k] for i in range(q) for k in range(max(i + 1, m), q)
    }
    diagonal = [*D]
    for j in reversed(range(m)):
        weighted = [a * d for a, d in zip(rows[j], weights, strict=True)]
        diagonal[j] = sum(a * b for a, b in zip(rows[j], weighted, strict=True))
        per = 1 / (diagonal[j] + TINY)
        for i in range(j):
            after[i, j] = per * sum(a * b for a, b in zip(rows[i], weighted, strict=True))
            rows[i] = [a - after[i, j] * b for a, b in zip(rows[i], rows[j], strict=True)]
    return Factors(after, diagonal)


def measured(
    factors: Factors,
    h: Any,
    *,
    innovation: Any,
    R: Any,
    clip: Any,
    counts: Any,
) -> tuple[list[Any], Factors]:
    """Return what one number that is measured corrects of z, and the factors after it.
    h : gradient of what is measured, (1, q), sparse.   innovation : ν, measured less expected.
    R : variance of the measurement, positive.
    clip : standard deviations from which an innovation counts no more than at them.
    counts : 1 where there is a measurement, else 0.
    """
    row = [h[0, j] if h.has_nz(0, j) else ca.SX(0) for j in range(len(factors.D))]
    direction = excited(factors, row, 0)
    per_S = 1 / (direction.a + R)
    surprise = innovation**2 * per_S
    share = clip / ca.sqrt(larger(surprise, clip**2))  # sqrt(clip²) is clip, to the last bit
    gain = counts * share * innovation * per_S
    moved = [along * gain for along in direction.v]
    return moved, updated(factors, direction, counts * (1 / R))
