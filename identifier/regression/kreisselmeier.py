"""Kreisselmeier's statistics: with them the exact gradient of the paper's cost (9) is at hand.

J = ∫ exp(-λ (t - τ)) |y(τ) - W s(τ)|²/2 dτ for the weights of *now*, not those of τ, has the
gradient dJ/dW = W Ω - Y with dΩ/dt = -λ Ω + s sᵀ and dY/dt = -λ Y + y sᵀ. The integral law (11)
takes the regressor out of the integral and so lags; this one does not.
Sampled: Ω⁺ = exp(-λ T) Ω + T s sᵀ, exactly the gradient of Σ exp(-λ T (k - j)) |y_j - W s_j|² T/2.
"""

from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from identifier.regression.definite import symmetric
from identifier.regression.descent import Descent
from identifier.regression.filtered import Pair
from identifier.regression.law import Array, Law, Numbers, State, Weights


def start(n_h: int, memory: int, ridge: float) -> dict[str, Array]:
    """Return no information: Omega = 0 (n_h, n_h) [s] and Y = 0 (2, n_h) [U s].

    Parameters
    ----------
    n_h : number of hidden units.
    memory : not read.
    ridge : not read.
    """
    del memory, ridge
    return {"Omega": np.zeros((n_h, n_h)), "Y": np.zeros((2, n_h))}


def update(
    state: State, weights: Weights, pair: Pair, numbers: Numbers, ahead: Any, *, descent: Descent
) -> tuple[dict[str, Any], Any]:
    """Return statistics and W after a pair.

    Parameters
    ----------
    state : Omega and Y.
    weights : W now and at the start.
    pair : s and y.
    numbers : of the law.
    ahead : T_s [s], or 0 where learning rests.
    descent : the way down the cost.
    """
    keep, share = ca.exp(-numbers.forgetting * ahead), 1 - ca.exp(-numbers.learning_rate * ahead)
    Omega = symmetric(keep * state["Omega"] + ahead * pair.s @ pair.s.T)
    Y = keep * state["Y"] + ahead * pair.y @ pair.s.T
    return {"Omega": Omega, "Y": Y}, descent(weights, Omega, Y, numbers.ridge, share)


def kreisselmeier(descent: Descent) -> Law:
    """Return the law.

    Parameters
    ----------
    descent : the way down the cost, `gradient` or `newton`.
    """
    return Law(start=start, update=partial(update, descent=descent))
