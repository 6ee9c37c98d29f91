"""Longitudinal force of the Magic Formula 5.2 (PAC2002), pure and combined slip.

α, γ, κ, F_z in the axes of the tire file (ISO: α of the opposite sign to the paper's); F_z >= 0.
Numbers: Pacejka, Tyre and Vehicle Dynamics, 2nd ed., ch. 4.3.2. The 5.2 form takes α and γ where
the book's later form takes tan α and sin γ, and knows no turn slip (ζ = 1).
"""

import casadi as ca

from models.tires.forces import Expression, positive
from models.tires.magic_formula_coefficients import Coefficients
from models.tires.magic_formula_curve import EPSILON, Shape, magic_curve, magic_slope, weight


def longitudinal_shape(
    c: Coefficients, gamma: Expression, F_z: Expression, mu: Expression
) -> Shape:
    """All of the curve that does not depend on slip.

    Parameters
    ----------
    c : coefficients of the tire file.
    gamma : camber [rad].
    F_z : wheel load, not negative [N].
    mu : friction of the road over that of the measurement [-].
    """
    df_z = c.load_increment(F_z)  # (4.E2)
    LMUX = c.LMUX * mu
    gamma_x = gamma * c.LGAX
    C_x = c.PCX1 * c.LCX  # (4.E11)
    mu_x = (c.PDX1 + c.PDX2 * df_z) * (1.0 - c.PDX3 * gamma_x**2) * LMUX  # (4.E13)
    D_x = positive(mu_x) * F_z  # (4.E12)
    K_x = F_z * (c.PKX1 + c.PKX2 * df_z) * ca.exp(c.PKX3 * df_z) * c.LKX  # (4.E15)
    B_x = K_x / (C_x * D_x + EPSILON)  # (4.E16)
    S_Hx = (c.PHX1 + c.PHX2 * df_z) * c.LHX  # (4.E17)
    S_Vx = F_z * (c.PVX1 + c.PVX2 * df_z) * c.LVX * LMUX  # (4.E18)
    return Shape(B_x, C_x, D_x, S_Hx, S_Vx)


def longitudinal_curvature(c: Coefficients, kappa_x: Expression, F_z: Expression) -> Expression:
    """E_x, at most 1.

    Parameters
    ----------
    c : coefficients of the tire file.
    kappa_x : slip, shifted [-].
    F_z : wheel load, not negative [N].
    """
    df_z = c.load_increment(F_z)
    E_0 = c.PEX1 + c.PEX2 * df_z + c.PEX3 * df_z**2
    return ca.fmin(E_0 * (1.0 - c.PEX4 * ca.sign(kappa_x)) * c.LEX, 1.0)  # (4.E14)


def pure_longitudinal(
    c: Coefficients, kappa: Expression, gamma: Expression, F_z: Expression, mu: Expression
) -> Expression:
    """F_x0 [N] of a wheel that runs straight, (4.E9).

    Parameters
    ----------
    c : coefficients of the tire file.
    kappa : longitudinal slip [-].
    gamma : camber [rad].
    F_z : wheel load, not negative [N].
    mu : friction of the road over that of the measurement [-].
    """
    B_x, C_x, D_x, S_Hx, S_Vx = longitudinal_shape(c, gamma, F_z, mu)
    kappa_x = kappa + S_Hx  # (4.E10)
    E_x = longitudinal_curvature(c, kappa_x, F_z)
    return magic_curve(kappa_x, B_x, C_x, D_x, E_x) + S_Vx  # (4.E9)


def combined_longitudinal(
    c: Coefficients,
    alpha: Expression,
    kappa: Expression,
    gamma: Expression,
    F_z: Expression,
    mu: Expression,
) -> Expression:
    """F_x [N] at any slip, (4.E50).

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
    B_xa = c.RBX1 * ca.cos(ca.atan(c.RBX2 * kappa)) * c.LXAL  # (4.E54)
    C_xa = c.RCX1  # (4.E55)
    E_xa = ca.fmin(c.REX1 + c.REX2 * df_z, 1.0)  # (4.E56)
    S_Hxa = c.RHX1  # (4.E57)
    G_xa = weight(alpha, S_Hxa, B_xa, C_xa, E_xa)  # (4.E51)-(4.E53)
    return G_xa * pure_longitudinal(c, kappa, gamma, F_z, mu)  # (4.E50)


def longitudinal_slope(c: Coefficients, F_z: Expression) -> Expression:
    """∂F_x/∂κ at κ = α = γ = 0, μ = 1 [N]; equals K_x where S_Hx = 0.

    Parameters
    ----------
    c : coefficients of the tire file.
    F_z : wheel load, not negative [N].
    """
    B_x, C_x, D_x, S_Hx, _ = longitudinal_shape(c, 0.0, F_z, 1.0)
    E_x = longitudinal_curvature(c, S_Hx, F_z)
    return magic_slope(S_Hx, B_x, C_x, D_x, E_x)
