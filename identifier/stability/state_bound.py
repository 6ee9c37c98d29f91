"""Bounds that hold, for every law that is linear in (z, ξ̃), and under a projection.

They need a bounded residual f and bounded inputs only: no ideal weights, no approximation error,
no excitation. γ = ∫ |exp(A_d t)| dt; forces in U (kN), ξ̃ in U s; |.| Frobenius for weights.

Law c_z z + c_ξ ξ̃ in (11), (12). m' = -λ m + |ξ̃| dominates |z|; with g' = η_W |A_d⁻¹| √n_h,
φ = |W_hat| + c_z (g'/λ) m obeys φ' <= |ξ̃| (g' (c_z/λ + c_ξ) + ρ_W c_z (g'/λ) m - ρ_W φ), so that
φ cannot pass g' (c_z/λ + c_ξ)/ρ_W + c_z g' X/λ² while |ξ̃| <= X; and
|ξ̃| <= γ (sup|f| + √n_h |W_hat|). The circle closes where θ = c_z γ √n_h g'/λ² < 1: always for the
instantaneous law, for η_W n_h < a² λ² for the integral law with A_d = -a I.

Explicit Euler obeys the same inequalities where λ dt <= 1 and ρ dt X <= 1, with γ of the sampled
A_d and f as the samples see it, (ξ_{k+1} - ξ_k)/dt - A_ξ ξ_k - B_ξ u_k: a jump of the steering
inside a sample makes that large.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from identifier.stability.gain_limit import require_positive
from identifier.stability.loop import Law
from identifier.stability.lyapunov import (
    Matrix,
    lyapunov,
    peak_gain,
    require_hurwitz,
    sampled_peak_gain,
)


class NoBoundError(ValueError):
    """The small-gain condition θ < 1 fails: no bound is known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Norms of the initial state.

    Parameters
    ----------
    xi_tilde : |ξ̃(0)| [U s].
    z : |z(0)| [U s²].
    W : |W_hat(0)| [U].
    V : |V_hat(0)| [-].
    """

    xi_tilde: float = 0.0
    z: float = 0.0
    W: float = 0.0
    V: float = 0.0


AT_REST = Start()


@dataclass(frozen=True, slots=True, kw_only=True)
class StateBounds:
    """What the state of the identifier never exceeds.

    Parameters
    ----------
    xi_tilde : X, bound on |ξ̃| [U s].
    W : bound on |W_hat| [U].
    """

    xi_tilde: float
    W: float


def small_gain(
    A_d: npt.ArrayLike,
    *,
    law: Law,
    forgetting: float,
    eta_W: float,
    n_h: int,
    dt: float | None = None,
    direction: Matrix | None = None,
) -> float:
    """θ = c_z γ η_W |A_d⁻¹| n_h/λ² [-]; below 1 the law is bounded.

    Parameters
    ----------
    A_d : (2, 2) Hurwitz error dynamics [1/s].
    law : coefficients of z and ξ̃ in the driving error.
    forgetting : λ [1/s].
    eta_W : learning rate of (11).
    n_h : hidden units; |s|² <= n_h.
    dt : step of explicit Euler [s]; None for continuous time.
    direction : (2, 2) D [s], None for -A_d⁻ᵀ.
    """
    require_positive(forgetting=forgetting)
    c_z, _ = law
    return c_z * _peak(A_d, dt) * eta_W * _size(A_d, direction) * n_h / forgetting**2


def steady_capacity(
    A_d: npt.ArrayLike,
    *,
    law: Law,
    forgetting: float,
    eta_W: float,
    rho_W: float,
    n_h: int,
    direction: Matrix | None = None,
) -> float:
    """n_h η_W |A_d⁻¹| (c_z/λ + c_ξ)/ρ_W [U]: the largest force that leakage lets W hold.

    In steady state learning balances leakage, η_W |s|² |A_d⁻¹| (c_z/λ + c_ξ) |ξ̃| = ρ_W |ξ̃| |f_hat|:
    a residual above it leaves an error however long one learns. It shrinks with |s|²/n_h.

    Parameters
    ----------
    A_d : (2, 2) Hurwitz error dynamics [1/s].
    law : coefficients of z and ξ̃ in the driving error.
    forgetting : λ [1/s].
    eta_W : learning rate of (11).
    rho_W : leakage gain of (11) [1/(U s²)].
    n_h : hidden units.
    direction : (2, 2) D [s], None for -A_d⁻ᵀ.
    """
    require_positive(forgetting=forgetting, rho_W=rho_W)
    c_z, c_xi = law
    return n_h * eta_W * _size(A_d, direction) * (c_z / forgetting + c_xi) / rho_W


def state_bounds(
    A_d: npt.ArrayLike,
    *,
    law: Law,
    forgetting: float,
    eta_W: float,
    rho_W: float,
    n_h: int,
    residual_bound: float,
    start: Start = AT_REST,
    dt: float | None = None,
    direction: Matrix | None = None,
) -> StateBounds:
    """Return X and the bound on |W_hat|.

    From rest X = γ (sup|f| + √n_h g' (c_z/λ + c_ξ)/ρ_W)/(1 - θ) and
    |W_hat| <= g' (c_z/λ + c_ξ)/ρ_W + c_z g' X/λ². From elsewhere X is the largest of the fixed
    points that the start can select, with |exp(A_d t) ξ̃(0)| bounded by `transient_peak`.

    Parameters
    ----------
    A_d : (2, 2) Hurwitz error dynamics [1/s].
    law : coefficients of z and ξ̃ in the driving error.
    forgetting : λ [1/s].
    eta_W : learning rate of (11).
    rho_W : leakage gain of (11) [1/(U s²)].
    n_h : hidden units.
    residual_bound : sup|f| [U].
    start : norms of the initial state.
    dt : step of explicit Euler [s]; None for continuous time.
    direction : (2, 2) D [s], None for -A_d⁻ᵀ.

    Raises
    ------
    NoBoundError
        If θ >= 1.
    """
    require_positive(rho_W=rho_W)
    theta = small_gain(
        A_d,
        law=law,
        forgetting=forgetting,
        eta_W=eta_W,
        n_h=n_h,
        dt=dt,
        direction=direction,
    )
    if not theta < 1.0:
        raise NoBoundError(f"θ must be below 1 for a bound of this law, it is {theta:.4g}")
    c_z, c_xi = law
    gamma, s_max = _peak(A_d, dt), math.sqrt(n_h)
    g = eta_W * _size(A_d, direction) * s_max  # g'
    balance, memory = g * (c_z / forgetting + c_xi) / rho_W, c_z * g / forgetting
    W_start = start.W + memory * start.z
    unlearned = transient_peak(A_d) * start.xi_tilde + gamma * residual_bound
    xi_tilde = max(
        unlearned + gamma * s_max * W_start,
        unlearned + gamma * s_max * (balance + memory * start.z),
        (unlearned + gamma * s_max * balance) / (1.0 - theta),
    )
    m = max(start.z, xi_tilde / forgetting)
    return StateBounds(xi_tilde=xi_tilde, W=max(W_start, balance + memory * m))


def V_bound(
    A_d: npt.ArrayLike,
    bounds: StateBounds,
    *,
    law: Law,
    forgetting: float,
    eta_V: float,
    rho_V: float,
    x_bar_max: float,
    start: Start = AT_REST,
    direction: Matrix | None = None,
) -> float:
    """Bound on |V_hat| [-]: the same argument, with g2 = η_V |A_d⁻¹| |W_hat|_max x_bar_max.

    Parameters
    ----------
    A_d : (2, 2) Hurwitz error dynamics [1/s].
    bounds : of `state_bounds`.
    law : coefficients of z and ξ̃ in the driving error.
    forgetting : λ [1/s].
    eta_V : learning rate of (12).
    rho_V : leakage gain of (12) [1/(U s²)].
    x_bar_max : bound on |x_bar|.
    start : norms of the initial state.
    direction : (2, 2) D [s], None for -A_d⁻ᵀ.
    """
    require_positive(forgetting=forgetting, rho_V=rho_V)
    c_z, c_xi = law
    g2 = eta_V * _size(A_d, direction) * bounds.W * x_bar_max
    memory = c_z * g2 / forgetting
    m = max(start.z, bounds.xi_tilde / forgetting)
    balance = g2 * (c_z / forgetting + c_xi) / rho_V
    return max(start.V + memory * start.z, balance + memory * m)


def projection_bound(
    A_d: npt.ArrayLike,
    *,
    W_max: float,
    n_h: int,
    residual_bound: float,
    start: Start = AT_REST,
    dt: float | None = None,
) -> float:
    """γ (sup|f| + √n_h W_max) [U s]: holds for any law and any gain while |W_hat| <= W_max.

    Sampled, the projected weights must be the ones that f_hat uses.

    Parameters
    ----------
    A_d : (2, 2) Hurwitz error dynamics [1/s].
    W_max : radius of the projection (Frobenius) [U].
    n_h : hidden units.
    residual_bound : sup|f| [U].
    start : norms of the initial state.
    dt : step of explicit Euler [s]; None for continuous time.
    """
    forced = _peak(A_d, dt) * (residual_bound + math.sqrt(n_h) * W_max)
    return transient_peak(A_d) * start.xi_tilde + forced


def transient_peak(A_d: npt.ArrayLike) -> float:
    """A bound on max over t of |exp(A_d t)| [-]: 1, or sqrt(cond P), A_dᵀ P + P A_d = -I.

    Parameters
    ----------
    A_d : (2, 2) Hurwitz error dynamics [1/s].
    """
    matrix = require_hurwitz(A_d)
    if np.linalg.eigvalsh(matrix + matrix.T)[-1] <= 0.0:
        return 1.0  # |exp(A_d t)| never grows
    return math.sqrt(float(np.linalg.cond(lyapunov(matrix, np.eye(2)).P)))


def _peak(A_d: npt.ArrayLike, dt: float | None) -> float:
    """γ of continuous time or of the Euler step [s]."""
    return peak_gain(A_d) if dt is None else sampled_peak_gain(A_d, dt)


def _size(A_d: npt.ArrayLike, direction: Matrix | None) -> float:
    """|D| [s]."""
    dynamics = require_hurwitz(A_d)
    return float(np.linalg.norm(np.linalg.inv(dynamics) if direction is None else direction, 2))
