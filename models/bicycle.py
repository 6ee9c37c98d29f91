"""Lateral bicycle dynamics, ẋ = A x + B u + K f, and its decoupled form ξ̇ = A_ξ ξ + B_ξ u + f.

x = [v_y, r]: lateral velocity [m/s], yaw rate [rad/s].   u = [δ_f, δ_r]: steering [rad].
f = [f_f, f_r]: axle force the linear tire misses [N].    ξ = K⁻¹ x: axle impulse [N s].
Equation numbers: Hong and Choi. Slip angles have the paper's sign, α = δ - (v_y ± l r)/v_x and
F = +C α, the negative of ISO 8855. As in (1)-(2), F_y is the axle force in the frame of the body;
cos(δ) and F_x sin(δ) are not in these equations.

The parameters and v_x may be numbers or CasADi expressions.
"""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from codegen.arrays import Array


class BicycleParameters(NamedTuple):
    """Parameters of the linear bicycle, numbers or CasADi symbols.

    m [kg], I_z [kg m²], l_f and l_r [m], C_f and C_r: cornering stiffness of an axle [N/rad].
    """

    m: Any
    I_z: Any
    l_f: Any
    l_r: Any
    C_f: Any
    C_r: Any


class _Bicycle(NamedTuple):
    """The matrices of (4), (6) and (7), each 2x2; those in ξ: A_ξ [1/s] and B_ξ [N/rad]."""

    A: Any
    B: Any
    K: Any
    K_inv: Any
    A_xi: Any
    B_xi: Any


def _matrix(a: Any, b: Any, c: Any, d: Any) -> Any:
    return ca.vertcat(ca.horzcat(a, b), ca.horzcat(c, d))


def bicycle(parameters: BicycleParameters, v_x: Any) -> _Bicycle:
    """Return the matrices of the bicycle at a speed.
    parameters : numbers or CasADi expressions, see `BicycleParameters`.
    v_x : longitudinal speed [m/s], not zero.
    """
    m, I_z, l_f, l_r, C_f, C_r = parameters
    sum_C, sum_Cl, sum_Cll = C_f + C_r, C_f * l_f - C_r * l_r, C_f * l_f**2 + C_r * l_r**2
    A = _matrix(
        -sum_C / (m * v_x), -v_x - sum_Cl / (m * v_x), -sum_Cl / (I_z * v_x), -sum_Cll / (I_z * v_x)
    )  # (4)
    B = _matrix(C_f / m, C_r / m, C_f * l_f / I_z, -C_r * l_r / I_z)  # (4)
    # (6) prints K with a transpose; only without it do (1)-(2) and B = K diag(C_f, C_r) hold.
    K = _matrix(1 / m, 1 / m, l_f / I_z, -l_r / I_z)  # (6)
    wheelbase = l_f + l_r
    K_inv = _matrix(m * l_r, I_z, m * l_f, -I_z) / wheelbase
    A_xi = K_inv @ A @ K  # (7), depends on v_x
    B_xi = ca.diag(ca.vertcat(C_f, C_r))  # (7): K⁻¹ B = diag(C_f, C_r) exactly
    return _Bicycle(A, B, K, K_inv, A_xi, B_xi)


def slip_angles(l_f: Any, l_r: Any, v_x: Any, x: Any, u: Any) -> Any:
    """Return [α_f, α_r] = δ - (v_y ± l r)/v_x [rad], (2,), in the paper's sign, as used in (3)."""
    return ca.vertcat(u[0] - (x[0] + l_f * x[1]) / v_x, u[1] - (x[0] - l_r * x[1]) / v_x)


def measured_slip(
    l_f: float,
    l_r: float,
    *,
    v_x: ArrayLike,
    v_y: ArrayLike,
    r: ArrayLike,
    delta_f: ArrayLike,
    delta_r: ArrayLike = 0.0,
) -> Array:
    """Return [α_f, α_r] = δ - atan2(v_y ± l r, v_x) [rad] of samples, (n, 2), the paper's sign.

    Without small angles; meaningless at standstill.
    v_x : longitudinal speed [m/s], (n,).   v_y : lateral velocity [m/s], (n,).
    r : yaw rate [rad/s], (n,).   delta_f : steering in front [rad], (n,).
    delta_r : at the rear [rad], (n,).
    """
    v_y, r = np.asarray(v_y), np.asarray(r)
    front = np.asarray(delta_f) - np.arctan2(v_y + l_f * r, v_x)
    rear = np.asarray(delta_r) - np.arctan2(v_y - l_r * r, v_x)
    return np.column_stack([front, rear])


def linear_axle_force(parameters: BicycleParameters, v_x: Any, x: Any, u: Any) -> Any:
    """Return the axle forces of the linear tire (3), (2,) [N].
    v_x : longitudinal speed [m/s], not zero.   x : [v_y, r] (2,).   u : [δ_f, δ_r] (2,).
    """
    alpha = slip_angles(parameters.l_f, parameters.l_r, v_x, x, u)
    return ca.vertcat(parameters.C_f * alpha[0], parameters.C_r * alpha[1])
