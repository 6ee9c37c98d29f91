"""Concurrent learning: the present pair and a memory of exciting ones, learnt from together.

Ω = ω (S Sᵀ + s sᵀ) and Y = ω (Z Sᵀ + y sᵀ), ω = 1/κ: a filtered pair stands for the time its filter
looks back. Stored pairs fade, s_j and y_j alike, so that y_j = W s_j stays true while a newer pair
takes the place of an old one more easily.
"""

from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from identifier.regression.definite import symmetric
from identifier.regression.descent import Descent
from identifier.regression.filtered import Pair
from identifier.regression.law import Array, Law, Numbers, State, Weights
from identifier.regression.memory import Memory, remember


def start(n_h: int, memory: int, ridge: float) -> dict[str, Array]:
    """Return an empty memory: S = 0 (n_h, M) and Z = 0 (2, M).

    Parameters
    ----------
    n_h : number of hidden units.
    memory : number of places M.
    ridge : not read.
    """
    del ridge
    return {"S": np.zeros((n_h, memory)), "Z": np.zeros((2, memory))}


def update(
    state: State, weights: Weights, pair: Pair, numbers: Numbers, ahead: Any, *, descent: Descent
) -> tuple[dict[str, Any], Any]:
    """Return memory and W after a pair.

    Parameters
    ----------
    state : S and Z.
    weights : W now and at the start.
    pair : s and y.
    numbers : of the law; the forgetting is the rate at which the weight of a stored pair fades.
    ahead : T_s [s], or 0 where learning rests.
    descent : the way down the cost.
    """
    weight, fade = 1 / numbers.filter_rate, ca.exp(-numbers.forgetting * ahead / 2)
    S, Z = fade * state["S"], fade * state["Z"]
    Omega = weight * (symmetric(S @ S.T) + symmetric(pair.s @ pair.s.T))
    Y = weight * (Z @ S.T + pair.y @ pair.s.T)
    share = 1 - ca.exp(-numbers.learning_rate * ahead)
    memory = remember(Memory(S, Z), pair, weight=weight, ridge=numbers.ridge, allowed=ahead > 0)
    return memory._asdict(), descent(weights, Omega, Y, numbers.ridge, share)


def concurrent(descent: Descent) -> Law:
    """Return the law.

    Parameters
    ----------
    descent : the way down the cost, `gradient` or `newton`.
    """
    return Law(start=start, update=partial(update, descent=descent))
