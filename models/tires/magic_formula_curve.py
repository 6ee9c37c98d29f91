"""The two curves of the Magic Formula, and the guard all its divisions share.

Pacejka, Tyre and Vehicle Dynamics, 2nd ed., (4.49)-(4.52), (4.72).
"""

from typing import NamedTuple

import casadi as ca

from models.tires.forces import Expression, positive

EPSILON = 1e-9  # N; keeps B = K/(C D) finite in the air and on ice, changes no force by 1e-8 N


class Shape(NamedTuple):
    """Curve of a force over its slip at one load and camber, without E, which needs the slip.

    Attributes
    ----------
    B, C, D : stiffness [1/rad for α, - for κ], shape [-] and peak [N].
    S_H, S_V : shift of the slip [rad or -] and of the force [N].
    """

    B: Expression
    C: Expression
    D: Expression
    S_H: Expression
    S_V: Expression


def magic_curve(
    x: Expression, B: Expression, C: Expression, D: Expression, E: Expression
) -> Expression:
    """D sin(C atan(B x - E (B x - atan B x))), (4.49) without shifts.

    Parameters
    ----------
    x : slip, shifted.
    B, C : stiffness and shape factor.
    D : peak value [N].
    E : curvature factor.
    """
    Bx = B * x
    return D * ca.sin(C * ca.atan(Bx - E * (Bx - ca.atan(Bx))))


def magic_slope(
    x: Expression, B: Expression, C: Expression, D: Expression, E: Expression
) -> Expression:
    """Derivative of `magic_curve` with respect to x; B C D at x = 0.

    Parameters
    ----------
    x : slip, shifted.
    B, C : stiffness and shape factor.
    D : peak value [N].
    E : curvature factor.
    """
    Bx = B * x
    inner = Bx - E * (Bx - ca.atan(Bx))
    inner_slope = B * (1.0 - E * Bx**2 / (1.0 + Bx**2))
    return D * ca.cos(C * ca.atan(inner)) * C * inner_slope / (1.0 + inner**2)


def weight(s: Expression, S_H: Expression, B: Expression, C: float, E: Expression) -> Expression:
    """Share of the pure-slip force left by the other slip: 1 at s = 0, never negative.

    G = cos(C atan(B s_S - E (B s_S - atan B s_S))) over the same at S_H, with s_S = s + S_H.

    Parameters
    ----------
    s : the other slip, not shifted.
    S_H : its shift.
    B, C, E : stiffness, shape and curvature factor of the weight.
    """
    Bs = B * (s + S_H)
    B0 = B * S_H
    G = ca.cos(C * ca.atan(Bs - E * (Bs - ca.atan(Bs))))
    G_0 = ca.cos(C * ca.atan(B0 - E * (B0 - ca.atan(B0))))
    return positive(G / G_0)  # the standard asks for G > 0; with C > 1 the cosine alone is not
