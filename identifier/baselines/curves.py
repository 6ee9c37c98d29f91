"""Curves of axle force over slip angle whose few parameters a baseline learns.

α = δ - atan((v_y ± l r)/v_x) in the paper's sign, the negative of ISO 8855, so that F = +C α.
Each curve gives both axle forces in the frame of the body, F cos δ; only the linear one is the
paper's (3) as it stands, with neither atan nor cos.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import casadi as ca

from models.bicycle import BicycleParameters, linear_axle_force, slip_angles

TINY = 1e-9  # rad: keeps Dugoff's λ finite at zero slip, where it does not matter


class Curve(NamedTuple):
    """A curve: its parameters, named with their units, and its forces.

    force(bicycle parameters, curve parameters (2, n), loads (2,), v_x, x, u) -> (2,) [N].
    """

    parameters: tuple[str, ...]
    force: Callable[..., Any]


def wheel_slip(p: BicycleParameters, v_x: Any, x: Any, u: Any) -> Any:
    """Return slip angles α = δ - atan((v_y ± l r)/v_x) (2,) [rad].

    Parameters
    ----------
    p : of the bicycle.
    v_x : longitudinal speed [m/s], not zero.
    x : [v_y, r] (2,).
    u : [δ_f, δ_r] (2,).
    """
    return u + ca.atan(slip_angles(p.l_f, p.l_r, v_x, x, u) - u)


def linear(p: BicycleParameters, q: Any, loads: Any, v_x: Any, x: Any, u: Any) -> Any:
    """Return F = C α of (3), (2,) [N].

    Parameters
    ----------
    p : of the bicycle; its stiffness is not looked at.
    q : C [N/rad] (2, 1).
    loads : not looked at.
    v_x : longitudinal speed [m/s], not zero.
    x : [v_y, r] (2,).
    u : [δ_f, δ_r] (2,).
    """
    del loads
    return linear_axle_force(p._replace(C_f=q[0, 0], C_r=q[1, 0]), v_x, x, u)


def magic_formula(p: BicycleParameters, q: Any, loads: Any, v_x: Any, x: Any, u: Any) -> Any:
    """Return F = D sin(C atan(B α)) cos δ, the Magic Formula without E, (2,) [N].

    Source: Pacejka, Tyre and Vehicle Dynamics, 2nd ed., (4.49) with E = 0.

    Parameters
    ----------
    p : of the bicycle.
    q : B [1/rad], C [-], D [N] (2, 3).
    loads : not looked at.
    v_x : longitudinal speed [m/s], not zero.
    x : [v_y, r] (2,).
    u : [δ_f, δ_r] (2,).
    """
    del loads
    B, C, D = q[:, 0], q[:, 1], q[:, 2]
    alpha = wheel_slip(p, v_x, x, u)
    return D * ca.sin(C * ca.atan(B * alpha)) * ca.cos(u)


def dugoff(p: BicycleParameters, q: Any, loads: Any, v_x: Any, x: Any, u: Any) -> Any:
    """Return Dugoff's force without longitudinal slip, times cos δ, (2,) [N].

    F = C tan α f(λ), λ = μ F_z/(2 C |tan α|), f = λ (2 - λ) for λ < 1, else 1.
    Source: Dugoff, Fancher and Segel, SAE 700377 (1970).

    Parameters
    ----------
    p : of the bicycle.
    q : C [N/rad], μ [-] (2, 2).
    loads : F_z (2,) [N].
    v_x : longitudinal speed [m/s], not zero.
    x : [v_y, r] (2,).
    u : [δ_f, δ_r] (2,).
    """
    C, mu = q[:, 0], q[:, 1]
    slope = ca.tan(ca.fmin(ca.fmax(wheel_slip(p, v_x, x, u), -1.5), 1.5))  # short of a right angle
    lam = ca.fmin(mu * loads / (2 * C * ca.fmax(ca.fabs(slope), TINY)), 1)
    return C * slope * lam * (2 - lam) * ca.cos(u)


CURVES: Mapping[str, Curve] = {
    "linear": Curve(("C_N_rad",), linear),
    "magic_formula": Curve(("B_1_rad", "C", "D_N"), magic_formula),
    "dugoff": Curve(("C_N_rad", "mu"), dugoff),
}
