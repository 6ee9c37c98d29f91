"""Lateral force of the Magic Formula 5.2 (PAC2002), pure and combined slip.

α, γ, κ, F_z, F_y in the axes of the tire file (ISO: α of the opposite sign to the paper's, so that
K_y < 0); F_z >= 0. Numbers: Pacejka, Tyre and Vehicle Dynamics, 2nd ed., ch. 4.3.2. The 5.2 form
takes α and γ where the book's later form takes tan α and sin γ, and knows no turn slip (ζ = 1).
"""

import casadi as ca

from models.tires.forces import Expression, positive
from models.tires.magic_formula_coefficients import Coefficients
from models.tires.magic_formula_curve import EPSILON, Shape, magic_curve, magic_slope, weight


def lateral_shape(c: Coefficients, gamma: Expression, F_z: Expression, mu: Expression) -> Shape:
    """All of the curve that does not depend on slip.

    Parameters
    ----------
    c : coefficients of the tire file.
    gamma : camber [rad].
    F_z : wheel load, not negative [N].
    mu : friction of the road over that of the measurement [-].
    """
    df_z = c.load_increment(F_z)  # (4.E2)
    F_z0 = c.FNOMIN * c.LFZO  # (4.E1)
    LMUY = c.LMUY * mu
    gamma_y = gamma * c.LGAY
    C_y = c.PCY1 * c.LCY  # (4.E21)
    mu_y = (c.PDY1 + c.PDY2 * df_z) * (1.0 - c.PDY3 * gamma_y**2) * LMUY  # (4.E23)
    D_y = positive(mu_y) * F_z  # (4.E22)
    K_y0 = c.PKY1 * F_z0 * ca.sin(2.0 * ca.atan(F_z / (c.PKY2 * F_z0))) * c.LKY
    K_y = K_y0 * (1.0 - c.PKY3 * ca.fabs(gamma_y))  # (4.E25)
    B_y = K_y / (C_y * D_y + EPSILON)  # (4.E26)
    S_Hy = (c.PHY1 + c.PHY2 * df_z) * c.LHY + c.PHY3 * gamma_y * c.LKYG  # (4.E27)
    S_Vyg = (c.PVY3 + c.PVY4 * df_z) * gamma_y * c.LKYG  # (4.E28), over F_z
    S_Vy = F_z * ((c.PVY1 + c.PVY2 * df_z) * c.LVY + S_Vyg) * LMUY  # (4.E29)
    return Shape(B_y, C_y, D_y, S_Hy, S_Vy)


def lateral_curvature(
    c: Coefficients, alpha_y: Expression, gamma: Expression, F_z: Expression
) -> Expression:
    """E_y, at most 1.

    Parameters
    ----------
    c : coefficients of the tire file.
    alpha_y : slip angle, ISO sign, shifted [rad].
    gamma : camber [rad].
    F_z : wheel load, not negative [N].
    """
    df_z = c.load_increment(F_z)
    asymmetry = (c.PEY3 + c.PEY4 * gamma * c.LGAY) * ca.sign(alpha_y)
    return ca.fmin((c.PEY1 + c.PEY2 * df_z) * (1.0 - asymmetry) * c.LEY, 1.0)  # (4.E24)


def pure_lateral(
    c: Coefficients, alpha: Expression, gamma: Expression, F_z: Expression, mu: Expression
) -> Expression:
    """F_y0 [N] of a wheel that rolls freely, (4.E19).

    Parameters
    ----------
    c : coefficients of the tire file.
    alpha : slip angle, ISO sign [rad].
    gamma : camber [rad].
    F_z : wheel load, not negative [N].
    mu : friction of the road over that of the measurement [-].
    """
    B_y, C_y, D_y, S_Hy, S_Vy = lateral_shape(c, gamma, F_z, mu)
    alpha_y = alpha + S_Hy  # (4.E20)
    E_y = lateral_curvature(c, alpha_y, gamma, F_z)
    return magic_curve(alpha_y, B_y, C_y, D_y, E_y) + S_Vy  # (4.E19)


def combined_lateral(
    c: Coefficients,
    alpha: Expression,
    kappa: Expression,
    gamma: Expression,
    F_z: Expression,
    mu: Expression,
) -> Expression:
    """F_y [N] at any slip, (4.E58).

    Parameters
    ----------
    c : coefficients of the tire file.
    alpha : slip angle, ISO sign [rad].
    kappa : longitudinal slip [-].
    gamma : camber [rad].
    F_z : wheel load, not negative [N].
    mu : friction of the road over that of the measurement [-].
    """
    df_z = c.load_increment(F_z)
    B_yk = c.RBY1 * ca.cos(ca.atan(c.RBY2 * (alpha - c.RBY3))) * c.LYKA  # (4.E62)
    C_yk = c.RCY1  # (4.E63)
    E_yk = ca.fmin(c.REY1 + c.REY2 * df_z, 1.0)  # (4.E64)
    S_Hyk = c.RHY1 + c.RHY2 * df_z  # (4.E65)
    G_yk = weight(kappa, S_Hyk, B_yk, C_yk, E_yk)  # (4.E59)-(4.E61)
    mu_F_z = lateral_shape(c, gamma, F_z, mu).D  # μ_y F_z, camber included
    D_Vyk = mu_F_z * (c.RVY1 + c.RVY2 * df_z + c.RVY3 * gamma)
    D_Vyk = D_Vyk * ca.cos(ca.atan(c.RVY4 * alpha))  # (4.E67)
    S_Vyk = D_Vyk * ca.sin(c.RVY5 * ca.atan(c.RVY6 * kappa)) * c.LVYKA  # (4.E66)
    return G_yk * pure_lateral(c, alpha, gamma, F_z, mu) + S_Vyk  # (4.E58)


def lateral_slope(c: Coefficients, F_z: Expression) -> Expression:
    """∂F_y/∂α at α = κ = γ = 0, μ = 1, ISO sign: negative [N/rad]; equals K_y where S_Hy = 0.

    Parameters
    ----------
    c : coefficients of the tire file.
    F_z : wheel load, not negative [N].
    """
    B_y, C_y, D_y, S_Hy, _ = lateral_shape(c, 0.0, F_z, 1.0)
    E_y = lateral_curvature(c, S_Hy, 0.0, F_z)
    return magic_slope(S_Hy, B_y, C_y, D_y, E_y)
