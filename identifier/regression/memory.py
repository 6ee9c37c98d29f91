"""A memory of M pairs that excite the most: a new pair takes the place that gains the most.

S (n_h, M) and Z (2, M) [U]: stored regressors and targets, zero where nothing is stored yet.
Excitation is the determinant of G = ω S Sᵀ + δ I, ω [s] being what one pair counts for. s in the
place of s_j multiplies it by (1 + a)(1 - b_j) + c_j², with a = ω sᵀ G⁻¹ s, b_j = ω s_jᵀ G⁻¹ s_j and
c_j = ω s_jᵀ G⁻¹ s. For an empty place that is 1 + a, which no stored pair can exceed: the memory
fills first.
"""

from typing import Any, NamedTuple

import casadi as ca

from identifier.regression.definite import symmetric, whiten
from identifier.regression.filtered import Pair

WORTH = 1.01  # a pair is stored where it multiplies the determinant by more than this


class Memory(NamedTuple):
    """Stored regressors S (n_h, M) and targets Z (2, M) [U]."""

    S: Any
    Z: Any


def determinant_gains(S: Any, s: Any, weight: Any, ridge: Any) -> Any:
    """Return by what the determinant would be multiplied, for s in each of the M places; (M,).

    Parameters
    ----------
    S : stored regressors (n_h, M).
    s : the new one (n_h,).
    weight : ω [s].
    ridge : δ [s].
    """
    G = weight * symmetric(S @ S.T) + ridge * ca.SX.eye(S.shape[0])
    whitened = whiten(G, ca.sqrt(weight) * ca.horzcat(S, s))
    stored, new = whitened[:, :-1], whitened[:, -1]
    b, c = ca.sum1(stored**2).T, stored.T @ new
    return (1 + ca.sumsqr(new)) * (1 - b) + c**2


def remember(memory: Memory, pair: Pair, *, weight: Any, ridge: Any, allowed: Any) -> Memory:
    """Return the memory with the pair in its best place, or unchanged where it is not worth it.

    Parameters
    ----------
    memory : S and Z.
    pair : s and y.
    weight : what one pair counts for, ω [s].
    ridge : δ [s].
    allowed : zero where nothing may be stored.
    """
    gains = determinant_gains(memory.S, pair.s, weight, ridge)
    best, place = gains[0], 0
    for j in range(1, gains.numel()):
        better = gains[j] > best
        best, place = ca.if_else(better, gains[j], best), ca.if_else(better, j, place)
    stored = ca.logic_and(allowed, best > WORTH)
    columns = range(memory.S.shape[1])
    here = ca.horzcat(*(ca.logic_and(stored, place == j) for j in columns))
    return Memory(
        S=memory.S + (pair.s - memory.S) * ca.repmat(here, memory.S.shape[0], 1),
        Z=memory.Z + (pair.y - memory.Z) * ca.repmat(here, memory.Z.shape[0], 1),
    )
