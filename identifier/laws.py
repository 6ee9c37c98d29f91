"""The adaptive laws (11)-(13): which error drives them, how they leak, how weights are bounded.

ξ̃ = ξ - ξ̂ [U s], z = ∫ exp(-λ (t - τ)) ξ̃ dτ [U s²], σ = tanh(V̂ x̄), U the force unit.
The paper never defines ξ̃. Only with ξ - ξ̂, so that dξ̃/dt = A_d ξ̃ + f - f̂, do (11)-(12) descend.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import casadi as ca

DrivingError = Callable[[Any, Any, Any], Any]


def integral(z: Any, xi_tilde: Any, lead: Any) -> Any:
    """Drive the laws by the exponentially filtered error z, as (11)-(12) do; (2,).

    Parameters
    ----------
    z : filtered error (2,).
    xi_tilde : error (2,).
    lead : not read.
    """
    del xi_tilde, lead
    return z


def instantaneous(z: Any, xi_tilde: Any, lead: Any) -> Any:
    """Drive the laws by the error itself, the conventional scheme; (2,).

    Parameters
    ----------
    z : filtered error (2,).
    xi_tilde : error (2,).
    lead : not read.
    """
    del z, lead
    return xi_tilde


def pi_lead(z: Any, xi_tilde: Any, lead: Any) -> Any:
    """Drive the laws by z + τ ξ̃: with τ >= 1/a the loop is positive real, no gain is too high.

    Parameters
    ----------
    z : filtered error (2,).
    xi_tilde : error (2,).
    lead : lead time τ [s].
    """
    return z + lead * xi_tilde


DRIVING_ERRORS: Mapping[str, DrivingError] = {
    "integral": integral,
    "instantaneous": instantaneous,
    "pi_lead": pi_lead,
}


class WeightRates(NamedTuple):
    """Time derivatives of the weights: W_dot (2, n_h) and V_dot (n_h, n_in)."""

    W_dot: Any
    V_dot: Any


def weight_rates(
    *,
    drive: Any,
    xi_tilde: Any,
    W: Any,
    V: Any,
    x_bar: Any,
    sigma: Any,
    A_d: Any,
    eta_W: Any,
    eta_V: Any,
    rho_W: Any,
    rho_V: Any,
) -> WeightRates:
    """Return (11)-(12), each a descent along the static gradient with a leakage.

    Parameters
    ----------
    drive : the error that drives the laws, z, ξ̃ or z + τ ξ̃ (2,).
    xi_tilde : error ξ - ξ̂ (2,), whose norm scales the leakage.
    W : weights (2, n_h).
    V : weights (n_h, n_in).
    x_bar : network input (n_in,).
    sigma : hidden layer tanh(V x̄) (n_h,).
    A_d : Hurwitz matrix (2, 2) [1/s].
    eta_W : learning rate η1.
    eta_V : learning rate η2.
    rho_W : leakage ρ1.
    rho_V : leakage ρ2.
    """
    g = ca.solve(A_d.T, drive)  # (zᵀ A_d⁻¹)ᵀ: with A_dᵀ, it differs where A_d is not symmetric
    leak = ca.norm_2(xi_tilde)
    slope = 1 - sigma**2  # diagonal of I - Λ, (13)
    W_dot = -eta_W * g @ sigma.T - rho_W * leak * W  # (11)
    V_dot = -eta_V * (slope * (W.T @ g)) @ x_bar.T - rho_V * leak * V  # (12)
    return WeightRates(W_dot, V_dot)


def unbounded(weights: Any, radius: Any) -> Any:
    """Return the weights as they are: the leakage alone bounds them.

    Parameters
    ----------
    weights : matrix.
    radius : ignored.
    """
    del radius
    return weights


def ball(weights: Any, radius: Any) -> Any:
    """Return the weights, projected on the ball |weights|_F <= radius.

    Parameters
    ----------
    weights : matrix.
    radius : Frobenius norm that is kept, positive.
    """
    return weights * ca.fmin(1, radius / ca.fmax(ca.norm_fro(weights), 1e-300))
