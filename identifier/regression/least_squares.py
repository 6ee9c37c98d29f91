"""Recursive least squares on y = W s, with the way of forgetting as an argument.

P (n_h, n_h) [1/s] is the inverse of the information Ω + δ I of `descent`, carried instead of solved
for; without forgetting W is the ridge regression of all pairs so far, ridge δ about W_0.
"""

from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from identifier.regression.definite import symmetric
from identifier.regression.filtered import Pair
from identifier.regression.forgetting import Forgetting
from identifier.regression.law import Array, Law, Numbers, State, Weights


def start(n_h: int, memory: int, ridge: float) -> dict[str, Array]:
    """Return P = I/δ.

    Parameters
    ----------
    n_h : number of hidden units.
    memory : not read.
    ridge : δ [s].
    """
    del memory
    return {"P": np.eye(n_h) / ridge}


def update(
    state: State, weights: Weights, pair: Pair, numbers: Numbers, ahead: Any, *, forget: Forgetting
) -> tuple[dict[str, Any], Any]:
    """Return P and W after a pair; the trace of P is never let grow above that of the start.

    Parameters
    ----------
    state : P.
    weights : W now; what W was at the start is in it already.
    pair : s and y.
    numbers : of the law; the learning rate is not read.
    ahead : T_s [s], or 0 where learning rests.
    forget : the way of forgetting.
    """
    P, W, (s, y) = state["P"], weights.now, pair
    gain = ahead * P @ s / (1 + ahead * s.T @ P @ s)
    keep, bound = ca.exp(-numbers.forgetting * ahead), P.shape[0] / numbers.ridge
    W_next = W + (y - W @ s) @ gain.T
    P_next = forget(symmetric(P - gain @ (P @ s).T), s, keep, bound)
    return {"P": symmetric(P_next)}, W_next


def least_squares(forget: Forgetting) -> Law:
    """Return the law.

    Parameters
    ----------
    forget : the way of forgetting.
    """
    return Law(start=start, update=partial(update, forget=forget))
