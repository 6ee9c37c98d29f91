"""Two ways down the quadratic cost J(W) = tr[W Ω Wᵀ/2 - W Yᵀ] + δ |W - W_0|²/2.

Ω (n_h, n_h) [s]: information.   Y (2, n_h) [U s].   δ [s]: ridge.   W_0: weights at the start.
For Ω = Σ s sᵀ T and Y = Σ y sᵀ T this is the cost Σ |y - W s|² T/2, up to a constant. The ridge is
the leakage: with no information left, W returns to W_0. `share` = 1 - exp(-η T) is in [0, 1) for
every η, and neither step can overshoot.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca

from identifier.regression.definite import solve_definite
from identifier.regression.law import Weights

Descent = Callable[[Weights, Any, Any, Any, Any], Any]


def gradient(weights: Weights, Omega: Any, Y: Any, ridge: Any, share: Any) -> Any:
    """Return W after a step against dJ/dW, normalized by trace(Ω + δ I); (2, n_h).

    Parameters
    ----------
    weights : W and W_0, (2, n_h).
    Omega : information (n_h, n_h).
    Y : (2, n_h).
    ridge : δ, positive.
    share : of the way along the steepest direction there can be.
    """
    W, W_0 = weights
    slope = W @ Omega - Y + ridge * (W - W_0)
    return W - share * slope / (ca.trace(Omega) + Omega.shape[0] * ridge)


def newton(weights: Weights, Omega: Any, Y: Any, ridge: Any, share: Any) -> Any:
    """Return W after going a share of the way to the minimum, weighted least squares; (2, n_h).

    Parameters
    ----------
    weights : W and W_0, (2, n_h).
    Omega : information (n_h, n_h).
    Y : (2, n_h).
    ridge : δ, positive: Ω + δ I is then positive definite.
    share : of the way to the minimum.
    """
    W, W_0 = weights
    minimum = solve_definite(Omega + ridge * ca.SX.eye(Omega.shape[0]), (Y + ridge * W_0).T).T
    return W - share * (W - minimum)
