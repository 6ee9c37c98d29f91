"""The adaptive laws (11)-(13): which error drives them, how they leak, how weights are bounded.

The leakage of (11)-(12) never rests: whatever |ξ̃| is, noise or what no network can learn, takes
W and V towards zero, and in hours of driving the network is gone. Two things keep it. A dead zone:
only what lies beyond a ball leaks, W - Π(W), Π(W) the point of the ball that is nearest, which is
the switching σ of Ioannou and Sun, Robust Adaptive Control (1996), 8.4.1, with the factor
1 - W_free/|W| beyond the radius in place of their ramp from one to two radii: it too is continuous,
and since W - Π(W) never grows faster than W, all that is proven of the leakage holds of what lies
beyond the ball. Or a projection (8.4.2 there) in place of the leakage, which keeps weights in a
ball; it is done after the step.

ξ̃ = ξ - ξ̂ [U s], z = ∫ exp(-λ (t - τ)) ξ̃ dτ [U s²], σ = tanh(V̂ x̄), U the force unit.
The paper never defines ξ̃. Only with ξ - ξ̂, so that dξ̃/dt = A_d ξ̃ + f - f̂, do (11)-(12) descend.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import casadi as ca

DrivingError = Callable[[Any, Any, Any], Any]
Direction = Callable[[Any, Any], Any]


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
    """Drive the laws by z + τ ξ̃: with τ long enough the loop is positive real.

    Together with `lyapunov_direction` no gain is then too high, whatever the Hurwitz A_d; for
    A_d = -a I long enough is 1/a, else `identifier.stability.pi_lead.lead_time`.

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


def static_direction(A_d: Any, drive: Any) -> Any:
    """Return (driveᵀ A_d⁻¹)ᵀ, along which (11)-(12) descend, (2,).

    Parameters
    ----------
    A_d : Hurwitz matrix (2, 2) [1/s].
    drive : the error that drives the laws (2,).
    """
    return ca.solve(A_d.T, drive)  # with A_dᵀ: it differs where A_d is not symmetric


def lyapunov_direction(A_d: Any, drive: Any) -> Any:
    """Return -P drive with A_dᵀ P + P A_d = -2 I, (2,): -A_d⁻¹ where A_d is symmetric.

    P = [det(A_d) I + Sᵀ S]/(-tr(A_d) det(A_d)), S = A_d - tr(A_d) I, solves the equation of a
    2x2 matrix in closed form.

    Parameters
    ----------
    A_d : Hurwitz matrix (2, 2) [1/s].
    drive : the error that drives the laws (2,).
    """
    trace = A_d[0, 0] + A_d[1, 1]
    determinant = A_d[0, 0] * A_d[1, 1] - A_d[0, 1] * A_d[1, 0]
    S = A_d - trace * ca.DM.eye(2)
    return (determinant * drive + S.T @ (S @ drive)) / (trace * determinant)


DIRECTIONS: Mapping[DrivingError, Direction] = {
    integral: static_direction,
    instantaneous: static_direction,
    pi_lead: lyapunov_direction,  # only with P is the lead passive where A_d is not symmetric
}


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


def whole(weights: Any, radius: Any) -> Any:
    """Return the weights as they are: all of them leak, as in (11)-(12).

    Parameters
    ----------
    weights : matrix.
    radius : ignored.
    """
    del radius
    return weights


def beyond_ball(weights: Any, radius: Any) -> Any:
    """Return what of the weights lies beyond the ball: zero within it, and continuous.

    Parameters
    ----------
    weights : matrix.
    radius : Frobenius norm within which nothing leaks, not negative.
    """
    return weights - ball(weights, radius)


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
    direction: Direction = static_direction,
    leaking: Callable[[Any, Any], Any] = whole,
    W_free: Any = 0.0,
    V_free: Any = 0.0,
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
    direction : of the descent, from A_d and the driving error; one of `DIRECTIONS`.
    leaking : what of the weights leaks, from them and the radius: `whole` or `beyond_ball`.
    W_free : radius of the dead zone of W, which `whole` does not read [U].
    V_free : radius of the dead zone of V, which `whole` does not read [-].
    """
    g = direction(A_d, drive)  # (zᵀ A_d⁻¹)ᵀ as printed
    leak = ca.norm_2(xi_tilde)
    slope = 1 - sigma**2  # diagonal of I - Λ, (13)
    W_dot = -eta_W * g @ sigma.T - rho_W * leak * leaking(W, W_free)  # (11)
    V_dot = -eta_V * (slope * (W.T @ g)) @ x_bar.T - rho_V * leak * leaking(V, V_free)  # (12)
    return WeightRates(W_dot, V_dot)
