"""The slip of a tread element, common to the brush tires.

σ = [κ, tan α]/(1 + κ): sliding over rolling speed (Pacejka, Tyre and Vehicle Dynamics, ch. 3).
"""

from typing import NamedTuple

import casadi as ca

from models.tires.forces import Expression

ROLLING_FLOOR = 1e-3  # 1 + κ of a locked wheel: slides in the same direction, divides by no zero
COSINE_FLOOR = 1e-3  # |cos α| of a wheel that moves sideways
NO_FORCE = 1e-6  # N; rounds the root of a sum of squares at zero, so that its derivative exists


class Slips(NamedTuple):
    """The demand of a tread that never slides, and the speed it refers to.

    Attributes
    ----------
    p_x, p_y : C_κ κ and C_α tan α [N].
    size : length of (p_x, p_y) [N], never zero.
    rolling : 1 + κ, rolling over forward speed [-], never zero.
    """

    p_x: Expression
    p_y: Expression
    size: Expression
    rolling: Expression


def slips(alpha: Expression, kappa: Expression, C_alpha: float, C_kappa: float) -> Slips:
    """Slips weighed by their stiffnesses, safe for a locked wheel and for any angle.

    Parameters
    ----------
    alpha : slip angle, paper's sign [rad].
    kappa : longitudinal slip [-]; below -1 the wheel counts as locked.
    C_alpha : cornering stiffness [N/rad].
    C_kappa : longitudinal slip stiffness [N].
    """
    tan_alpha = ca.sin(alpha) / ca.fmax(ca.fabs(ca.cos(alpha)), COSINE_FLOOR)
    p_x = C_kappa * kappa
    p_y = C_alpha * tan_alpha
    size = ca.sqrt(p_x**2 + p_y**2 + NO_FORCE**2)
    return Slips(p_x, p_y, size, ca.fmax(1.0 + kappa, ROLLING_FLOOR))
