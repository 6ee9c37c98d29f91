"""The adaptive laws (11)-(13): which error drives them, and how they leak.

The leakage never rests: whatever |ξ̃| is, noise or what no network can learn, takes W and V towards
zero.

ξ̃ = ξ - ξ̂ [U s], z = ∫ exp(-λ (t - τ)) ξ̃ dτ [U s²], σ = tanh(V̂ x̄), U the force unit.
The paper never defines ξ̃. Only with ξ - ξ̂, so that dξ̃/dt = A_d ξ̃ + f - f̂, do (11)-(12) descend.

In functions:
A_d : Hurwitz matrix (2, 2) [1/s].   drive : the error that drives the laws (2,).
xi : measured axle impulse (2,).   xi_hat : estimated axle impulse (2,).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from models.rules import require_not_negative, require_positive, require_within

_LEAST = 1e-15  # of a gain that is not 0, in its unit, whatever U is
_LARGEST = 1e12  # of a gain, in its unit, whatever U is

_Direction = Callable[[Any, Any], Any]


def _static_direction(A_d: Any, drive: Any) -> Any:
    """Return (driveᵀ A_d⁻¹)ᵀ, along which (11)-(12) descend, (2,)."""
    return ca.solve(A_d.T, drive)  # with A_dᵀ: it differs where A_d is not symmetric


def _lyapunov_direction(A_d: Any, drive: Any) -> Any:
    """Return -P drive with A_dᵀ P + P A_d = -2 I, (2,): -A_d⁻¹ where A_d is symmetric.

    P = [det(A_d) I + Sᵀ S]/(-tr(A_d) det(A_d)), S = A_d - tr(A_d) I, solves the equation of a
    2x2 matrix in closed form.
    """
    trace = A_d[0, 0] + A_d[1, 1]
    determinant = A_d[0, 0] * A_d[1, 1] - A_d[0, 1] * A_d[1, 0]
    S = A_d - trace * ca.DM.eye(2)
    return (determinant * drive + S.T @ (S @ drive)) / (trace * determinant)


class DrivingError(NamedTuple):
    """Coefficients of z and ξ̃ in the error that drives (11) and (12), numbers or symbols.

    `z` has no unit and `xi_tilde` is a time [s]; for a law without z, `xi_tilde` has no unit.
    """

    z: Any
    xi_tilde: Any

    def drive(self, z: Any, xi_tilde: Any) -> Any:
        return self.z * z + self.xi_tilde * xi_tilde


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """A law: the error z z + (xi + lead τ) ξ̃ drives (11)-(12) along a direction."""

    name: str
    z: float = 0.0
    xi: float = 0.0
    lead: float = 0.0
    direction: _Direction = _static_direction

    def error(self, lead: Any = 0.0) -> DrivingError:
        """Return the coefficients of the driving error.
        lead : lead time τ of the gains [s], a number or a symbol.
        """
        return DrivingError(self.z, self.xi + self.lead * lead)


# The integral law is that of (11)-(12); the instantaneous one the conventional scheme. z + τ ξ̃:
# with τ long enough the loop is positive real, and along `_lyapunov_direction` no gain is then too
# high, whatever the Hurwitz A_d; for A_d = -a I long enough is 1/a.
LAWS: Mapping[str, Law] = {
    law.name: law
    for law in (
        Law(name="integral", z=1.0),
        Law(name="instantaneous", xi=1.0),
        Law(name="pi_lead", z=1.0, lead=1.0, direction=_lyapunov_direction),
    )
}


class _WeightRates(NamedTuple):
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
    direction: _Direction = _static_direction,
) -> _WeightRates:
    """Return (11)-(12), each a descent along the static gradient with a leakage.
    drive : the error that drives the laws, z, ξ̃ or z + τ ξ̃ (2,).
    xi_tilde : error ξ - ξ̂ (2,), whose norm scales the leakage.   W : weights (2, n_h).
    V : weights (n_h, n_in).   x_bar : network input (n_in,).
    sigma : hidden layer tanh(V x̄) (n_h,).   eta_W : learning rate η1.   eta_V : learning rate η2.
    rho_W : leakage ρ1.   rho_V : leakage ρ2.
    """
    g = direction(A_d, drive)  # (zᵀ A_d⁻¹)ᵀ as printed
    leak = ca.norm_2(xi_tilde)
    slope = 1 - sigma**2  # diagonal of I - Λ, (13)
    W_dot = -eta_W * g @ sigma.T - rho_W * leak * W  # (11)
    V_dot = -eta_V * (slope * (W.T @ g)) @ x_bar.T - rho_V * leak * V  # (12)
    return _WeightRates(W_dot, V_dot)


# The series-parallel observer (8), the error filter (10), and where the network reads the state.
#
# ξ, ξ̂ [U s]: axle impulse, measured and estimated.   u = [δ_f, δ_r] [rad].   f̂ [U]: network
# output.


def observer_rate(A_d: Any, A_xi: Any, B_xi: Any, xi: Any, xi_hat: Any, u: Any, f_hat: Any) -> Any:
    """Return dξ̂/dt of (8), (2,) [U].
    A_xi : A_ξ of (7) at the present speed (2, 2) [1/s].   B_xi : B_ξ of (7) (2, 2) [U/rad].
    u : steering (2,) [rad].   f_hat : network output (2,) [U].
    """
    return A_d @ xi_hat + (A_xi @ xi + B_xi @ u - A_d @ xi) + f_hat  # (8)


def filter_rate(forgetting: Any, z: Any, xi_tilde: Any) -> Any:
    """Return dz/dt of (10), (2,) [U s].
    forgetting : λ [1/s].   z : filtered error (2,) [U s²].   xi_tilde : error (2,) [U s].
    """
    return -forgetting * z + xi_tilde  # (10)


# Reading the estimate, as (8) prints it, closes a loop: A_d must then be fast against the slope of
# the tire.
INPUT_SOURCES: Mapping[str, Callable[[Any, Any], Any]] = {  # of ξ and ξ̂
    "measured": lambda xi, _: xi,
    "estimated": lambda _, xi_hat: xi_hat,
}

# Gains of the identifier, with their units.
#
# With the force unit U (kN for a car) the axle impulse ξ is in U s, the filtered error z in U s².


class NotHurwitzError(TireidError, ValueError):
    """A_d has an eigenvalue whose real part is not negative."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """Gains of the observer (8), the filter (10) and the laws (11)-(12).
    A_d : Hurwitz matrix of the prescribed error dynamics (2x2), by rows [1/s].
    forgetting : λ of (9)-(10) [1/s].
    eta_W : learning rate of W: η1 [1/s⁴], or [1/s³] for the instantaneous law.
    eta_V : learning rate of V: η2 [1/(U² s⁴)], or [1/(U² s³)] for the instantaneous law.
    rho_W : leakage of W, ρ1 [1/(U s²)].   rho_V : leakage of V, ρ2 [1/(U s²)].
    lead : τ of the PI-lead law z + τ ξ̃ [s]; the other laws do not read it.
    """

    A_d: tuple[tuple[float, float], tuple[float, float]]
    forgetting: float
    eta_W: float
    eta_V: float
    rho_W: float
    rho_V: float
    lead: float = 0.0

    def __post_init__(self) -> None:
        A_d = np.array(self.A_d, dtype=np.float64)
        if A_d.shape != (2, 2) or not np.isfinite(A_d).all():
            raise ValueError(f"A_d must be a 2x2 matrix of finite numbers, it is {self.A_d}")
        require_within(ValueError, 0.0, _LARGEST, **{"|A_d|": np.abs(A_d).max()})
        poles = np.linalg.eigvals(A_d)
        if not poles.real.max() < 0.0:
            raise NotHurwitzError(f"A_d must be Hurwitz, its eigenvalues are {poles}")
        require_positive(ValueError, forgetting=self.forgetting)
        names = ("forgetting", "eta_W", "eta_V", "rho_W", "rho_V", "lead")
        gains = {name: getattr(self, name) for name in names}
        require_not_negative(ValueError, **gains)
        given = {name: value for name, value in gains.items() if value}
        require_within(ValueError, _LEAST, _LARGEST, **given)

    @property
    def matrix(self) -> Array:
        """A_d as an array (2, 2) [1/s]."""
        return np.array(self.A_d, dtype=np.float64)

    def scaled_by_forgetting(self) -> "Gains":
        """Return these gains with η/λ in place of η.

        Below the frequency λ the filtered error is z ≈ ξ̃/λ, so that the integral law at η acts as
        the instantaneous law at η/λ: the control of every comparison of the two.
        """
        return replace(self, eta_W=self.eta_W / self.forgetting, eta_V=self.eta_V / self.forgetting)


def diagonal(a: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return A_d = -a I by rows.   a : rate of the error dynamics [1/s]."""
    return ((-a, 0.0), (0.0, -a))
