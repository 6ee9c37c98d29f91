"""A short filter that is hard to beat: tires of two numbers an axle behind a fixed lag.

State [v_y, r, α' (2,), ln C (2,), ln μ (2,), δ₀, b_a]: C in static axle loads per radian, μ in
static axle loads, of a Magic Formula with one shape for all; δ₀ the zero of the front steering,
b_a the bias of the accelerometer. The motion is that of `identifier.baselines.kalman`; measured are
v_y, r and, where a log has it, a_y = (F_f + F_r)/m + b_a. No gate, no alarm, and the stiffness of
the vehicle file is not looked at.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.baselines.chosen import CHOSEN
from identifier.baselines.curves import CURVES, CurveModel, measured_slip, unlagged
from identifier.baselines.kalman import CARRY, PORTS, corrected, midpoint
from identifier.baselines.ports import (
    LAG_DESCRIBED,
    LAG_PORTS,
    WITH_A_Y,
    axle_loads,
    given_ports,
    lag_symbols,
    lagged_slip,
    motion_rate,
)
from identifier.method import Method
from identifier.setup import Setup
from identifier.tire_model import TireModel
from models.rules import require_positive
from models.vehicle import GRAVITY, Vehicle

CURVE = CURVES["magic_formula"]
BOUNDS = np.log([[2.0, 60.0], [0.2, 1.6]])  # of ln C and ln μ
TIRE = slice(4, 8)  # of the state


class Numbers(NamedTuple):
    """What the filter is given, in the order of its constant.

    Standard deviations of v_y [m/s], r [rad/s] and a_y [m/s²]; disturbances of v_y [m/s/√s] and
    r [rad/s/√s]; walk of ln C and ln μ [1/√s]; relaxation length of both axles [m]; learning
    speed [m/s].
    """

    v_y_noise: Any
    r_noise: Any
    a_y_noise: Any
    v_y_disturbance: Any
    r_disturbance: Any
    walk: Any
    relaxation_length: Any
    learning_speed: Any


def _curve_parameters(theta: Any, loads: Any) -> Any:
    """Return B [1/rad], C [-] and D [N] of both axles, (2, 3).
    theta : ln C and ln μ of both axles (4,).   loads : static, (2,) [N].
    """
    stiffness, friction = ca.exp(theta[:2]), ca.exp(theta[2:])
    shape = ca.DM.ones(2) * CHOSEN.typical_shape
    return ca.horzcat(stiffness / (shape * friction), shape, friction * loads)


def build_step(name: str) -> ca.Function:
    """Return the filter's step; carried are the ports of a `kalman` filter whose tire lags."""
    ports, last = given_ports(), lag_symbols()
    s, p = ports.sample, ports.sample.parameters
    estimate, P = ca.SX.sym("estimate", CHOSEN.states), ca.SX.sym("P", CHOSEN.states, CHOSEN.states)
    before, running = ca.SX.sym("before", 3), ca.SX.sym("running")
    numbers = ca.SX.sym("numbers", len(Numbers._fields))
    given, dt, loads = Numbers(*ca.vertsplit(numbers)), s.sampling[0], axle_loads(p, GRAVITY)
    sigma = ca.vertcat(given.relaxation_length, given.relaxation_length)
    learning = s.v_x >= given.learning_speed
    going = ca.logic_and(learning, running > 0.5)

    def force(z: Any, slip: Any, u: Any) -> Any:
        return CURVE.force(_curve_parameters(z[TIRE], loads), loads, slip, u)

    def slip_of(z: Any, v_x: Any, x: Any, u: Any) -> Any:
        return measured_slip(CURVE, p, ca.vertcat(z[8], 0), v_x, x, u)

    v_mean = ca.fmax((before[2] + s.v_x) / 2, given.learning_speed)
    u_mean = (before[:2] + s.u) / 2
    alpha = slip_of(estimate, v_mean, estimate[:2], u_mean)
    motion = motion_rate(p, v_mean, estimate[:2], force(estimate, estimate[2:4], u_mean))
    rate = ca.vertcat(motion, v_mean / sigma * (alpha - estimate[2:4]))
    ahead = ca.vertcat(midpoint(estimate, rate, dt), estimate[4:])
    F = ca.jacobian(ahead, estimate)
    walks = ca.vertcat(
        *(given.v_y_disturbance, given.r_disturbance, 0, 0), *[given.walk] * 4, ca.SX(2, 1)
    )
    at = ca.SX.sym("at", CHOSEN.states)
    shows = ca.vertcat(at[:2], ca.sum1(force(at, at[2:4], s.u)) / p.m + at[9])
    shows, H = ca.substitute([shows, ca.jacobian(shows, at)], [at], [ahead])
    H[2, :] *= ports.has_a_y
    missed = ca.vertcat(s.x - shows[:2], ports.has_a_y * (ports.a_y - shows[2]))
    R = ca.diag(ca.vertcat(*given[:3]) ** 2)
    found = corrected(F @ P @ F.T + ca.diag(walks**2 * dt), H, R, missed, CHOSEN.no_gate)

    after = ahead + found.move
    low, high = (np.repeat(BOUNDS[:, k], 2) for k in (0, 1))
    after[TIRE] = ca.fmin(ca.fmax(after[TIRE], low), high)
    alpha_now = slip_of(estimate, s.speed, s.x, s.u)
    afresh = ca.vertcat(s.x, alpha_now, estimate[4:])
    unsure = ca.vertcat(given.v_y_noise, given.r_noise, *[given.v_y_noise / s.speed] * 2)
    P_next = ca.if_else(going, found.P, ca.diagcat(ca.diag(unsure**2), P[4:, 4:]))
    lagged = lagged_slip(last, alpha_now, s.speed * dt, sigma)
    axle_force = force(estimate, lagged, s.u)
    return ca.Function(
        name,
        [estimate, P, before, running, *last, *ports.ports, numbers],
        [
            ca.if_else(going, after, afresh),
            ca.densify(P_next),
            ca.vertcat(s.u, s.v_x),
            ca.if_else(learning, 1, 0),
            *(lagged, alpha_now, ca.if_else(s.moving, 1, 0)),
            ca.if_else(s.moving, axle_force, 0),
        ],
        [*CARRY, *LAG_PORTS, *WITH_A_Y, "vehicle", "sampling", "numbers"],
        [*(f"{port}_next" for port in (*CARRY, *LAG_PORTS)), "axle_force"],
        {"cse": True},
    )


@cache
def _scan() -> Scan:
    return Scan(build_step("lagged_ekf"), carry=(*CARRY, *LAG_PORTS), over=WITH_A_Y)


@dataclass(frozen=True, slots=True, kw_only=True)
class LaggedEkf(Method):
    """Stiffness and friction of each axle behind a fixed lag, with a_y where there is one.
    v_y_noise, r_noise : standard deviations of what is measured [m/s], [rad/s].
    v_y_disturbance, r_disturbance : what the tires miss, as random change [m/s/√s], [rad/s/√s].
    relaxation_length : of both axles [m].
    a_y_noise : standard deviation of the accelerometer [m/s²].   walk : of ln C and ln μ [1/√s].
    stiffness_spread, friction_spread : standard deviations of ln C and ln μ at first [-].
    steering_spread : standard deviation of the zero of the front steering at first [rad].
    a_y_spread : standard deviation of the bias of a_y at first [m/s²].
    dt : sampling interval [s].   learning_speed : below this speed [m/s] learning rests.
    min_speed : below this speed [m/s] forces read zero.
    """

    ports = (*PORTS, *LAG_DESCRIBED)
    remark = "two numbers an axle, one relaxation length for all cars of a size"

    v_y_noise: float
    r_noise: float
    v_y_disturbance: float
    r_disturbance: float
    relaxation_length: float
    a_y_noise: float = 0.4
    walk: float = 1e-4
    stiffness_spread: float = 0.6
    friction_spread: float = 0.25
    steering_spread: float = 0.01
    a_y_spread: float = 0.3
    dt: float = 0.01
    learning_speed: float = 3.0
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        spreads = ("stiffness_spread", "friction_spread", "steering_spread", "a_y_spread")
        names = (*Numbers._fields, *spreads, "dt", "min_speed")
        require_positive(ValueError, **{name: getattr(self, name) for name in names})

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> Self:
        """Return the filter for a car: its size alone sets the numbers.

        Noise, disturbances and spreads were chosen on 24 random cars of our plant.
        """
        time, speed = vehicle.froude_time, vehicle.froude_speed
        return cls(
            v_y_noise=0.02 * speed,
            r_noise=0.002 / time,
            v_y_disturbance=0.05 * speed / math.sqrt(time),
            r_disturbance=0.03 / time**1.5,
            relaxation_length=0.12 * vehicle.wheelbase,
            dt=dt,
            learning_speed=0.6 * speed,
            min_speed=vehicle.lowest_speed,
        )

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs; it begins afresh, with no stored model."""
        if start is not None:
            raise ValueError("the lagged filter begins afresh: it goes on from no stored model")
        theta = np.repeat(np.log([CHOSEN.stiffness, CHOSEN.friction]), 2)
        spread = [self.stiffness_spread] * 2 + [self.friction_spread] * 2
        slip = self.v_y_noise / self.learning_speed
        sd = [self.v_y_noise, self.r_noise, slip, slip, *spread]
        return Setup(
            scan=_scan(),
            carry={
                "estimate": np.concatenate([np.zeros(4), theta, np.zeros(2)]),
                "P": np.diag([*sd, self.steering_spread, self.a_y_spread]) ** 2,
                "before": np.zeros(3),
                "running": np.zeros(1),
                **unlagged(),
            },
            constants={
                "numbers": np.array([getattr(self, name) for name in Numbers._fields]),
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> CurveModel:
        """Return the Magic Formula with the carried parameters, the lag and the steering's zero.
        state : estimate (10,).
        """
        z = state["estimate"].ravel()
        values = _curve_parameters(ca.DM(z[TIRE]), ca.DM(vehicle.axle_loads))
        return CurveModel(
            vehicle=vehicle,
            curve="magic_formula",
            parameters=np.array(ca.DM(values)),
            min_speed=self.min_speed,
            relaxation_length=np.full(2, self.relaxation_length),
            offset=np.array([z[8], 0.0]),
        )
