"""What estimators of v_y without a sensor of it share: they read r, a_y, v_x and steering alone.

x = [v_y, r] [m/s, rad/s].   u = [δ_f, δ_r] [rad].   F: axle forces [N], frame of the body.
ẋ = K F - [v_x r, 0];   measured are r and, at the center of gravity, a_y = (F_f + F_r)/m.
A steady turn needs F_r = l_f m v_x r/L, so that on a linear tire its v_y is
l_r r + v_x (δ_r - F_r/C_r): what every one of them begins with.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import casadi as ca

from identifier.baselines.kalman import midpoint
from identifier.baselines.ports import motion_rate
from identifier.setup import Port
from models.bicycle import BicycleParameters

V_Y = Port("v_y", "m/s", "lateral velocity at the center of gravity, positive to the left")
V_Y_SD = Port("v_y_sd", "m/s", "standard deviation of v_y")
MOST_SLIDING = 0.7  # |v_y|/v_x beyond which an estimate is none


class FilteredTire(NamedTuple):
    """What makes the forces by θ: functions of symbols.

    slip(bicycle parameters, friction, θ, v_x, x, u) -> α (2,) [rad].
    force(bicycle parameters, friction, θ, α, u) -> axle forces (2,) [N].   unknowns : size of θ.
    """

    slip: Callable[[BicycleParameters, Any, Any, Any, Any, Any], Any]
    force: Callable[[BicycleParameters, Any, Any, Any, Any], Any]
    unknowns: int


def turning_force(p: BicycleParameters, v_x: Any, x: Any) -> Any:
    """Return n, the axle forces of a steady turn (2,) [N].
    v_x : longitudinal speed [m/s].   x : [v_y, r] (2,).
    """
    return p.m * v_x * x[1] / (p.l_f + p.l_r) * ca.vertcat(p.l_r, p.l_f)


def steady_v_y(p: BicycleParameters, v_x: Any, r: Any, u: Any) -> Any:
    """Return v_y of a steady turn on the linear rear tire [m/s].
    v_x : longitudinal speed [m/s].   r : yaw rate [rad/s].   u : [δ_f, δ_r] (2,).
    """
    F_r = turning_force(p, v_x, ca.vertcat(0, r))[1]
    return p.l_r * r + v_x * (u[1] - F_r / p.C_r)


def axle_force(
    tire: FilteredTire, p: BicycleParameters, known: Any, estimate: Any, v_x: Any, u: Any
) -> Any:
    """Return the axle forces of an estimate, (2,) [N].
    tire : forces by θ, without lag.   estimate : [v_y, r, θ].
    v_x : longitudinal speed [m/s], not zero.   u : [δ_f, δ_r] (2,).
    """
    x, theta = estimate[:2], estimate[2:]
    return tire.force(p, known, theta, tire.slip(p, known, theta, v_x, x, u), u)


def predicted(
    tire: FilteredTire, p: BicycleParameters, known: Any, estimate: Any, v_x: Any, u: Any, dt: Any
) -> Any:
    """Return the estimate a step later, θ as it is.
    estimate : [v_y, r, θ], symbols.   dt : sampling interval [s].
    """
    F = axle_force(tire, p, known, estimate, v_x, u)
    rate = motion_rate(p, v_x, estimate[:2], F)
    return ca.vertcat(midpoint(estimate, rate, dt), estimate[2:])


def expected(
    tire: FilteredTire, p: BicycleParameters, known: Any, estimate: Any, v_x: Any, u: Any
) -> Any:
    """Return what the sensors should show of an estimate: r [rad/s] and a_y [m/s²], (2,)."""
    F = axle_force(tire, p, known, estimate, v_x, u)
    return ca.vertcat(estimate[1], (F[0] + F[1]) / p.m)
