"""The frozen axle model in continuous time: force curves of a slip that lags by a first order.

F = F_z λ Σ w_j tanh(α'/α_j) cos δ   and   σ dα'/dt = v_x (α - α'),   σ = (s + k g/ω²) λ C + σ_0.
λ = 1 + κ v_x² is the load of the axle over the static one: 1 where the car has no downforce.
The sway of the body gives way in series with the carcass: its share k adds k g/ω² to the
compliance s. That is without the inertia of the roll: ω is above what steering asks for.
"""

from typing import Any

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.axle.car import Car
from identifier.axle.curve import Curve, curve, doublings
from identifier.axle.slip import SHORTEST, beyond_play
from models.vehicle import GRAVITY, Vehicle, load_ratio


def curve_at_speed(
    slip: Any, v_x: Any, W: Array, ladder: tuple[float, ...], vehicle: Vehicle
) -> Curve:
    """Return the force curve of a car at a slip and a speed, in static axle loads.
    slip : (2,) [rad].   v_x : longitudinal speed [m/s].   W : weights [static axle loads], (2, n).
    ladder : slip scales [rad], (n,).
    vehicle : whose downforce counts; without any the speed is not looked at.
    """
    scales = ca.DM(1.0 / np.array(ladder)[None])
    static = curve(slip, ca.DM(W), scales, doublings(ladder))
    if not vehicle.has_downforce:
        return static
    return static.under(load_ratio(ca.DM(vehicle.downforce), v_x))


def series_compliance(compliance: Array, share: Array, roll_frequency: float) -> Array:
    """Return the deflection of carcass and body per static axle load [m], (2,).
    compliance : of the carcass [m per load], (2,).   share : of the sway [-], (2,).
    roll_frequency : ω [rad/s].
    """
    return compliance + GRAVITY / roll_frequency**2 * share


def lagged_force(
    car: Car,
    at: Curve,
    compliance: Array,
    offset: Array,
    *,
    slip: Any,
    x: Any,
    delta: Any,
    v_x: Any,
    least_lag: Any,
    play: float = 0.0,
) -> tuple[Any, Any]:
    """Return the axle forces (2,) [N] and dα'/dt (2,) [rad/s].
    at : force curve at the lagged slip.   compliance : of `series_compliance`.
    offset : zero of the front steering [rad] and bias of v_y [m/s], (2,).
    slip : lagged slip α' (2,) [rad].   x : [v_y, r] (2,).
    delta : angle of the front wheels [rad].   v_x : longitudinal speed [m/s], positive.
    least_lag : time under which no lag falls [s].   play : of the steering, to each side [rad].
    """
    sideways = x[0] - offset[1] + ca.DM(car.arm) * x[1]
    alpha = ca.vertcat(delta + offset[0], 0) - ca.atan(sideways / v_x)
    if play:
        alpha = ca.vertcat(beyond_play(alpha[0], play), alpha[1])
    sigma = ca.DM(compliance) * at.carcass_slope + SHORTEST * float(car.arm[0] - car.arm[1])
    cos_delta = ca.vertcat(1 - delta**2 / 2 + delta**4 / 24, 1)
    force = at.force * ca.DM(car.load) * cos_delta
    return force, (alpha - slip) / ca.fmax(sigma / v_x, least_lag)
