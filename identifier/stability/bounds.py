"""What bounds every law that is linear in (z, ξ̃): small gain θ, and the force that leakage holds.

That needs a bounded residual f and bounded inputs only: no ideal weights, no approximation error,
no excitation. γ = ∫ |exp(A_d t)| dt; forces in U (kN), ξ̃ in U s; |.| Frobenius for weights.

Law c_z z + c_ξ ξ̃ in (11), (12). m' = -λ m + |ξ̃| dominates |z|; with g' = η_W |A_d⁻¹| √n_h,
φ = |W_hat| + c_z (g'/λ) m obeys φ' <= |ξ̃| (g' (c_z/λ + c_ξ) + ρ_W c_z (g'/λ) m - ρ_W φ), so that
φ cannot pass g' (c_z/λ + c_ξ)/ρ_W + c_z g' X/λ² while |ξ̃| <= X; and
|ξ̃| <= γ (sup|f| + √n_h |W_hat|). The circle closes where θ = c_z γ √n_h g'/λ² < 1: always for the
instantaneous law, for η_W n_h < a² λ² for the integral law with A_d = -a I.

That is continuous time from rest. `sampled_bound.py` carries it to the identifier as it runs, with
γ of the sampled A_d and f as the samples see it, (ξ_{k+1} - ξ_k)/dt - A_ξ ξ_k - B_ξ u_k: a jump of
the steering inside a sample makes that large.
"""

import numpy as np

from codegen.arrays import Array
from identifier.paper.laws import DrivingError
from identifier.stability.sampled_bound import error_gains


def small_gain(
    A_d: Array,
    *,
    law: DrivingError,
    forgetting: float,
    eta_W: float,
    n_h: int,
    dt: float,
    direction: Array,
) -> float:
    """θ = c_z γ η_W |A_d⁻¹| n_h/λ² [-]; below 1 the law is bounded.
    A_d : (2, 2) Hurwitz error dynamics [1/s].   forgetting : λ [1/s].
    eta_W : learning rate of (11).   n_h : hidden units; |s|² <= n_h.
    dt : step of explicit Euler [s].
    direction : (2, 2) D [s].
    """
    peak, size = error_gains(A_d, dt).force, float(np.linalg.norm(direction, 2))
    return law.z * peak * eta_W * size * n_h / forgetting**2


def steady_capacity(
    direction: Array,
    *,
    law: DrivingError,
    forgetting: float,
    eta_W: float,
    rho_W: float,
    n_h: int,
) -> float:
    """n_h η_W |A_d⁻¹| (c_z/λ + c_ξ)/ρ_W [U]: the largest force that leakage lets W hold.

    In steady state learning balances leakage, η_W |s|² |A_d⁻¹| (c_z/λ + c_ξ) |ξ̃| = ρ_W |ξ̃| |f_hat|:
    a residual above it leaves an error however long one learns. It shrinks with |s|²/n_h.
    direction : (2, 2) D [s].   forgetting : λ [1/s].
    eta_W : learning rate of (11).   rho_W : leakage gain of (11) [1/(U s²)].
    """
    c_z, c_xi = law
    size = float(np.linalg.norm(direction, 2))
    return n_h * eta_W * size * (c_z / forgetting + c_xi) / rho_W
