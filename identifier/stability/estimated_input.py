"""The loop that opens where the network reads the estimate x_hat instead of the measurement.

With x_hat = x - K ξ̃, the network errs by J_f K ξ̃, J_f = ∂f/∂x, and the error dynamics become
A_d + J_f K. For f = F(α) - C α and α = δ - (1/v_x) [1 l_f; 1 -l_r] x:
J_f K = diag(C - F') N / v_x, N = [1 l_f; 1 -l_r] K, symmetric positive semidefinite but for the
row scaling: even a perfect network needs a > λ_max(J_f K). Worst where the tire is saturated,
F' = 0. (8)c prints x_hat; x is measured, so that reading x costs nothing and has no such limit.
"""

import numpy as np
import numpy.typing as npt

from identifier.stability.gain_limit import require_positive
from identifier.stability.lyapunov import Matrix


def axle_coupling(*, m: float, I_z: float, l_f: float, l_r: float) -> Matrix:
    """N = [1 l_f; 1 -l_r] K [1/kg], (2, 2), with K of (6).

    Parameters
    ----------
    m : mass [kg].
    I_z : yaw inertia [kg m²].
    l_f : center of gravity to front axle [m].
    l_r : center of gravity to rear axle [m].
    """
    require_positive(m=m, I_z=I_z, l_f=l_f, l_r=l_r)
    K = np.array([[1.0 / m, 1.0 / m], [l_f / I_z, -l_r / I_z]])  # (6) prints a transpose
    slip = np.array([[1.0, l_f], [1.0, -l_r]])
    coupling: Matrix = slip @ K
    return coupling


def estimated_input_feedback(
    *,
    m: float,
    I_z: float,
    l_f: float,
    l_r: float,
    stiffness_lost: npt.ArrayLike,
    v_x: float,
) -> Matrix:
    """J_f K = diag(C - F') N / v_x [1/s], (2, 2): what reading x_hat adds to A_d.

    Parameters
    ----------
    m : mass [kg].
    I_z : yaw inertia [kg m²].
    l_f : center of gravity to front axle [m].
    l_r : center of gravity to rear axle [m].
    stiffness_lost : (2,) C - F' of front and rear axle [N/rad]; C itself at full saturation.
    v_x : speed [m/s].
    """
    require_positive(v_x=v_x)
    lost = np.asarray(stiffness_lost, dtype=np.float64)
    if lost.shape != (2,) or not np.all(np.isfinite(lost)):
        raise ValueError(f"stiffness_lost must be two numbers, it is {lost.tolist()}")
    return np.diag(lost) @ axle_coupling(m=m, I_z=I_z, l_f=l_f, l_r=l_r) / v_x


def minimal_decay(feedback: npt.ArrayLike) -> float:
    """Smallest a [1/s] with -a I + J_f K Hurwitz.

    Parameters
    ----------
    feedback : (2, 2) J_f K [1/s].
    """
    return float(np.max(np.linalg.eigvals(np.asarray(feedback)).real))


def jacobian_feedback(
    *, W: npt.ArrayLike, V_x: npt.ArrayLike, s: npt.ArrayLike, K: npt.ArrayLike
) -> Matrix:
    """J_f K = W (I - Λ) V_x K of the present network [1/s], (2, 2).

    Parameters
    ----------
    W : (2, n_h) output weights, force unit U.
    V_x : (n_h, 2) d(V x_bar)/dx, with the scales of the input in it [s/m, s/rad].
    s : (n_h,) hidden units.
    K : (2, 2) of (6) for forces in U.
    """
    W, V_x, s, K = np.asarray(W), np.asarray(V_x), np.asarray(s), np.asarray(K)
    feedback: Matrix = (W * (1.0 - s**2)) @ V_x @ K
    return feedback
