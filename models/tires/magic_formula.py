"""The Magic Formula 5.2 (PAC2002) as a tire of this package, read from a `.tir` file.

In functions:
gamma : camber [rad].   F_z : wheel load, not negative [N].
mu : friction of the road over that of the measurement [-].   alpha : slip angle, ISO sign [rad].
kappa : longitudinal slip [-].
"""

from dataclasses import dataclass, replace
from os import PathLike
from typing import Literal, NamedTuple, Self

import casadi as ca

from models.tires.forces import Expression, TireForces, folded, positive
from models.tires.magic_formula_coefficients import Coefficients
from models.tires.tir import ValidRange, read_magic_formula

# The two curves of the Magic Formula, and the guard all its divisions share.
#
# Pacejka, Tyre and Vehicle Dynamics, 2nd ed., (4.49)-(4.52), (4.72).

_EPSILON = 1e-9  # N; keeps B = K/(C D) finite in the air and on ice, changes no force by 1e-8 N


class _Shape(NamedTuple):
    """Curve of a force over its slip at one load and camber, without E, which needs the slip.
    B, C, D : stiffness [1/rad for α, - for κ], shape [-] and peak [N].
    S_H, S_V : shift of the slip [rad or -] and of the force [N].
    """

    B: Expression
    C: Expression
    D: Expression
    S_H: Expression
    S_V: Expression


def _bent(Bx: Expression, E: Expression) -> Expression:
    return Bx - E * (Bx - ca.atan(Bx))


def _magic_curve(
    x: Expression, B: Expression, C: Expression, D: Expression, E: Expression
) -> Expression:
    """D sin(C atan(B x - E (B x - atan B x))), (4.49) without shifts.
    B, C : stiffness and shape factor.   D : peak value [N].
    """
    return D * ca.sin(C * ca.atan(_bent(B * x, E)))


def _magic_slope(
    x: Expression, B: Expression, C: Expression, D: Expression, E: Expression
) -> Expression:
    """Derivative of `_magic_curve` with respect to x, of its arguments; B C D at x = 0."""
    Bx = B * x
    inner = _bent(Bx, E)
    inner_slope = B * (1.0 - E * Bx**2 / (1.0 + Bx**2))
    return D * ca.cos(C * ca.atan(inner)) * C * inner_slope / (1.0 + inner**2)


def _weight(s: Expression, S_H: Expression, B: Expression, C: float, E: Expression) -> Expression:
    """Share of the pure-slip force left by the other slip: 1 at s = 0, never negative.

    G = cos(C atan(B s_S - E (B s_S - atan B s_S))) over the same at S_H, with s_S = s + S_H.
    s : the other slip, not shifted.
    B, C, E : stiffness, shape and curvature factor of the weight.
    """
    G, G_0 = (ca.cos(C * ca.atan(_bent(B * x, E))) for x in (s + S_H, S_H))
    return positive(G / G_0)  # the standard asks for G > 0; with C > 1 the cosine alone is not


# Lateral force of the Magic Formula 5.2 (PAC2002), pure and combined slip.
#
# α, γ, κ, F_z, F_y in the axes of the tire file (ISO: α of the opposite sign to the paper's, so
# that K_y < 0); F_z >= 0. Numbers: Pacejka, Tyre and Vehicle Dynamics, 2nd ed., ch. 4.3.2. The 5.2
# form takes α and γ where the book's later form takes tan α and sin γ, and knows no turn slip (ζ =
# 1).


def _lateral_shape(c: Coefficients, gamma: Expression, F_z: Expression, mu: Expression) -> _Shape:
    """All of the curve that does not depend on slip."""
    df_z = c.load_increment(F_z)  # (4.E2)
    F_z0 = c.FNOMIN * c.LFZO  # (4.E1)
    LMUY = c.LMUY * mu
    gamma_y = gamma * c.LGAY
    C_y = c.PCY1 * c.LCY  # (4.E21)
    mu_y = (c.PDY1 + c.PDY2 * df_z) * (1.0 - c.PDY3 * gamma_y**2) * LMUY  # (4.E23)
    D_y = positive(mu_y) * F_z  # (4.E22)
    K_y0 = c.PKY1 * F_z0 * ca.sin(2.0 * ca.atan(F_z / (c.PKY2 * F_z0))) * c.LKY
    K_y = K_y0 * (1.0 - c.PKY3 * ca.fabs(gamma_y))  # (4.E25)
    B_y = K_y / (C_y * D_y + _EPSILON)  # (4.E26)
    S_Hy = (c.PHY1 + c.PHY2 * df_z) * c.LHY + c.PHY3 * gamma_y * c.LKYG  # (4.E27)
    S_Vyg = (c.PVY3 + c.PVY4 * df_z) * gamma_y * c.LKYG  # (4.E28), over F_z
    S_Vy = F_z * ((c.PVY1 + c.PVY2 * df_z) * c.LVY + S_Vyg) * LMUY  # (4.E29)
    return _Shape(B_y, C_y, D_y, S_Hy, S_Vy)


def _lateral_curvature(
    c: Coefficients, alpha_y: Expression, gamma: Expression, F_z: Expression
) -> Expression:
    """E_y, at most 1.   alpha_y : slip angle, ISO sign, shifted [rad]."""
    df_z = c.load_increment(F_z)
    asymmetry = (c.PEY3 + c.PEY4 * gamma * c.LGAY) * ca.sign(alpha_y)
    return ca.fmin((c.PEY1 + c.PEY2 * df_z) * (1.0 - asymmetry) * c.LEY, 1.0)  # (4.E24)


def _pure_lateral(
    c: Coefficients, alpha: Expression, gamma: Expression, F_z: Expression, mu: Expression
) -> Expression:
    """F_y0 [N] of a wheel that rolls freely, (4.E19)."""
    B_y, C_y, D_y, S_Hy, S_Vy = _lateral_shape(c, gamma, F_z, mu)
    alpha_y = alpha + S_Hy  # (4.E20)
    E_y = _lateral_curvature(c, alpha_y, gamma, F_z)
    return _magic_curve(alpha_y, B_y, C_y, D_y, E_y) + S_Vy  # (4.E19)


def _combined_lateral(
    c: Coefficients,
    alpha: Expression,
    kappa: Expression,
    gamma: Expression,
    F_z: Expression,
    mu: Expression,
) -> Expression:
    """F_y [N] at any slip, (4.E58)."""
    df_z = c.load_increment(F_z)
    B_yk = c.RBY1 * ca.cos(ca.atan(c.RBY2 * (alpha - c.RBY3))) * c.LYKA  # (4.E62)
    C_yk = c.RCY1  # (4.E63)
    E_yk = ca.fmin(c.REY1 + c.REY2 * df_z, 1.0)  # (4.E64)
    S_Hyk = c.RHY1 + c.RHY2 * df_z  # (4.E65)
    G_yk = _weight(kappa, S_Hyk, B_yk, C_yk, E_yk)  # (4.E59)-(4.E61)
    mu_F_z = _lateral_shape(c, gamma, F_z, mu).D  # μ_y F_z, camber included
    D_Vyk = mu_F_z * (c.RVY1 + c.RVY2 * df_z + c.RVY3 * gamma)
    D_Vyk = D_Vyk * ca.cos(ca.atan(c.RVY4 * alpha))  # (4.E67)
    S_Vyk = D_Vyk * ca.sin(c.RVY5 * ca.atan(c.RVY6 * kappa)) * c.LVYKA  # (4.E66)
    return G_yk * _pure_lateral(c, alpha, gamma, F_z, mu) + S_Vyk  # (4.E58)


# Longitudinal force of the Magic Formula 5.2 (PAC2002), pure and combined slip.
#
# α, γ, κ, F_z in the axes of the tire file (ISO: α of the opposite sign to the paper's); F_z >= 0.
# Numbers: Pacejka, Tyre and Vehicle Dynamics, 2nd ed., ch. 4.3.2. The 5.2 form takes α and γ where
# the book's later form takes tan α and sin γ, and knows no turn slip (ζ = 1).


def _longitudinal_shape(
    c: Coefficients, gamma: Expression, F_z: Expression, mu: Expression
) -> _Shape:
    """All of the curve that does not depend on slip."""
    df_z = c.load_increment(F_z)  # (4.E2)
    LMUX = c.LMUX * mu
    gamma_x = gamma * c.LGAX
    C_x = c.PCX1 * c.LCX  # (4.E11)
    mu_x = (c.PDX1 + c.PDX2 * df_z) * (1.0 - c.PDX3 * gamma_x**2) * LMUX  # (4.E13)
    D_x = positive(mu_x) * F_z  # (4.E12)
    K_x = F_z * (c.PKX1 + c.PKX2 * df_z) * ca.exp(c.PKX3 * df_z) * c.LKX  # (4.E15)
    B_x = K_x / (C_x * D_x + _EPSILON)  # (4.E16)
    S_Hx = (c.PHX1 + c.PHX2 * df_z) * c.LHX  # (4.E17)
    S_Vx = F_z * (c.PVX1 + c.PVX2 * df_z) * c.LVX * LMUX  # (4.E18)
    return _Shape(B_x, C_x, D_x, S_Hx, S_Vx)


def _longitudinal_curvature(c: Coefficients, kappa_x: Expression, F_z: Expression) -> Expression:
    """E_x, at most 1.   kappa_x : slip, shifted [-]."""
    df_z = c.load_increment(F_z)
    E_0 = c.PEX1 + c.PEX2 * df_z + c.PEX3 * df_z**2
    return ca.fmin(E_0 * (1.0 - c.PEX4 * ca.sign(kappa_x)) * c.LEX, 1.0)  # (4.E14)


def _combined_longitudinal(
    c: Coefficients,
    alpha: Expression,
    kappa: Expression,
    gamma: Expression,
    F_z: Expression,
    mu: Expression,
) -> Expression:
    """F_x [N] at any slip, (4.E50); arguments are those of `_combined_lateral`."""
    df_z = c.load_increment(F_z)
    B_xa = c.RBX1 * ca.cos(ca.atan(c.RBX2 * kappa)) * c.LXAL  # (4.E54)
    C_xa = c.RCX1  # (4.E55)
    E_xa = ca.fmin(c.REX1 + c.REX2 * df_z, 1.0)  # (4.E56)
    S_Hxa = c.RHX1  # (4.E57)
    G_xa = _weight(alpha, S_Hxa, B_xa, C_xa, E_xa)  # (4.E51)-(4.E53)
    B_x, C_x, D_x, S_Hx, S_Vx = _longitudinal_shape(c, gamma, F_z, mu)
    kappa_x = kappa + S_Hx  # (4.E10)
    E_x = _longitudinal_curvature(c, kappa_x, F_z)
    F_x0 = _magic_curve(kappa_x, B_x, C_x, D_x, E_x) + S_Vx  # (4.E9), of a wheel that runs straight
    return G_xa * F_x0  # (4.E50)


@dataclass(frozen=True, slots=True, kw_only=True)
class MagicFormula:
    """Steady-state Magic Formula 5.2 in combined slip with camber.
    side : side of the car this tire belongs to, "left" or "right".
    name : where the tire comes from, for messages and tables.
    """

    coefficients: Coefficients
    side: Literal["left", "right"]
    valid_range: ValidRange
    name: str

    def __post_init__(self) -> None:
        _require_side(self.side)

    @classmethod
    def from_tir(cls, path: str | PathLike[str]) -> Self:
        """Read a tire property file (PAC2002 or MF-Tyre 5.0 to 5.2).   path : the `.tir` file."""
        return cls(**read_magic_formula(path)._asdict())

    def forces(
        self,
        alpha: Expression,
        kappa: Expression,
        gamma: Expression,
        F_z: Expression,
        mu: Expression = 1.0,
    ) -> TireForces:
        """Longitudinal and lateral force in the wheel frame [N].

        Outside `valid_range` the formula extrapolates: finite, but nobody measured it.
        alpha : slip angle, paper's sign [rad]; beyond ±π/2 the wheel rolls backwards.
        gamma : camber [rad], > 0 leans the top to the right.
        mu : friction of the road over that of the measurement [-]; multiplies LMUX and LMUY.
        """
        c, load = self.coefficients, positive(F_z)
        alpha_iso = -folded(alpha)  # the file and its equations have the ISO sign
        return TireForces(
            _combined_longitudinal(c, alpha_iso, kappa, gamma, load, mu),
            _combined_lateral(c, alpha_iso, kappa, gamma, load, mu),
        )

    def slip_stiffness(self, F_z: Expression) -> Expression:
        """∂F_x/∂κ at zero slip and camber [N]; 0 in the air."""
        c, load = self.coefficients, positive(F_z)
        B_x, C_x, D_x, S_Hx, _ = _longitudinal_shape(c, 0.0, load, 1.0)
        E_x = _longitudinal_curvature(c, S_Hx, load)
        return _magic_slope(S_Hx, B_x, C_x, D_x, E_x)

    def cornering_stiffness(self, F_z: Expression) -> Expression:
        """∂F_y/∂α at zero slip and camber, paper's sign: positive [N/rad]; 0 in the air."""
        c, load = self.coefficients, positive(F_z)
        B_y, C_y, D_y, S_Hy, _ = _lateral_shape(c, 0.0, load, 1.0)
        return -_magic_slope(S_Hy, B_y, C_y, D_y, _lateral_curvature(c, S_Hy, 0.0, load))

    def relaxation_length(self, F_z: Expression) -> Expression:
        """Relaxation length of F_y without camber [m]; 0 where the file has none.

        σ_α = PTY1 sin(2 atan(F_z/(PTY2 F_z0))) R_0 LFZO LSGAL (MSC, Using the PAC2002 Tire Model).
        """
        c = self.coefficients
        over_load = ca.sin(2.0 * ca.atan2(positive(F_z), c.PTY2 * c.FNOMIN * c.LFZO))
        return c.PTY1 * over_load * c.UNLOADED_RADIUS * c.LFZO * c.LSGAL

    def mirrored(self) -> Self:
        """The same tire for the other side of the car.

        Its forces are F_x(-α, κ, -γ) and -F_y(-α, κ, -γ) of this one, so that a car with one of
        each drives straight.
        """
        other: Literal["left", "right"] = "right" if self.side == "left" else "left"
        return replace(self, coefficients=self.coefficients.mirrored(), side=other)

    def mounted(self, side: Literal["left", "right"]) -> Self:
        """The tire for that side: itself where it belongs there, else mirrored.
        side : "left" or "right".
        """
        _require_side(side)
        return self if side == self.side else self.mirrored()


def _require_side(side: str) -> None:
    if side not in ("left", "right"):
        raise ValueError(f'side must be "left" or "right", it is {side!r}')
