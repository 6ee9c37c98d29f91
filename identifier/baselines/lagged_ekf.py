"""A short filter that is hard to beat: tires of two numbers an axle behind a fixed lag.

State z = [v_y, r, α' (2,), ln C (2,), ln μ (2,), δ₀, b_a]: C in static axle loads per radian, μ in
static axle loads, of a Magic Formula with one shape for all; δ₀ the zero of the front steering,
b_a the bias of the accelerometer. ẋ = K F - [v_x r, 0]; measured are v_y, r and, where a log has
it, a_y = (F_f + F_r)/m + b_a. The sampled map is the linearly implicit midpoint rule; covariances
are corrected in Joseph's form. No gate, no alarm, and the stiffness of the vehicle file is not
looked at.
Source: Simon, Optimal State Estimation, 2006, sections 5.1 and 13.2.
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
from identifier.baselines.curves import (
    LAG_PORTS,
    OVER,
    CurveModel,
    LaggedSlip,
    lag_symbols,
    lagged_slip,
    magic_formula,
    measured_slip,
    sample_ports,
    unlagged,
)
from identifier.method import Method
from identifier.setup import AXLE_FORCE, COVARIANCE, Port, Setup
from identifier.tire_model import TireModel
from models.bicycle import BicycleParameters, bicycle
from models.rules import Positive
from models.vehicle import GRAVITY, Vehicle

SHAPE = 1.4  # C of a passenger tire, Pacejka, Tyre and Vehicle Dynamics, figure 4.9
# At first: ln C and ln μ, of 14 static axle loads/rad and of 0.85 static axle loads.
BEGINNING = [math.log(14.0)] * 2 + [math.log(0.85)] * 2
# Standard deviations at first: ln C and ln μ [-], δ₀ [rad] and b_a [m/s²].
SPREADS = (0.6, 0.6, 0.25, 0.25, 0.01, 0.3)
BOUNDS = np.log([[2.0, 60.0], [0.2, 1.6]])  # of ln C and ln μ
TIRE = slice(4, 8)  # of the state
_STATES = 10

WITH_A_Y = (*OVER, "a_y")
CARRY = ("estimate", "P", "before", "running")
PORTS = (
    AXLE_FORCE,
    Port("estimate", "m/s; rad/s; -", "v_y, r and the unknowns of the force"),
    Port("P", "of estimate", "covariance of estimate", rule=COVARIANCE),
    Port("before", "rad; rad; m/s", "delta_f, delta_r and v_x of the last sample"),
    Port("running", "-", "1 after a sample in motion"),
)


class _Numbers(NamedTuple):
    """What the filter is given, in the order of its constant.

    Standard deviations of v_y [m/s], r [rad/s] and a_y [m/s²]; disturbances of v_y [m/s/√s] and
    r [rad/s/√s]; walk of ln C and ln μ [1/√s]; relaxation length of both axles [m]; learning
    speed [m/s]. All were chosen on 24 random cars of our plant.
    """

    v_y_noise: Any
    r_noise: Any
    a_y_noise: Any
    v_y_disturbance: Any
    r_disturbance: Any
    walk: Any
    relaxation_length: Any
    learning_speed: Any


def axle_loads(p: BicycleParameters) -> Any:
    """Return the static axle loads F_z (2,) [N]."""
    return p.m * GRAVITY / (p.l_f + p.l_r) * ca.vertcat(p.l_r, p.l_f)


def motion_rate(p: BicycleParameters, v_x: Any, x: Any, F: Any) -> Any:
    """Return dx/dt of (1)-(2), (2,).
    v_x : longitudinal speed [m/s].   x : [v_y, r] (2,).   F : axle forces (2,) [N].
    """
    return bicycle(p, 1.0).K @ F - ca.vertcat(v_x * x[1], 0)


def midpoint(estimate: Any, rate: Any, dt: Any) -> Any:
    """Return what moves of an estimate a step later: z⁺ = z + T_s (I - T_s J/2)⁻¹ f, J = ∂f/∂z.

    The linearly implicit midpoint rule, which no stiff tire at low speed makes unstable.
    estimate : symbols; what moves comes first.   rate : f, of what moves (n,).
    dt : sampling interval [s].
    """
    n = rate.numel()
    implicit = ca.inv_minor(ca.SX.eye(n) - dt / 2 * ca.jacobian(rate, estimate)[:, :n])
    return estimate[:n] + dt * implicit @ rate


class _Corrected(NamedTuple):
    """What a measurement makes of an estimate: its move (n,), and the covariance after (n, n)."""

    move: Any
    P: Any


def corrected(P: Any, H: Any, R: Any, innovation: Any) -> _Corrected:
    """Return what a measurement makes of an estimate, in Joseph's form.
    P : covariance before (n, n).
    H : what the measured numbers are of the estimate (m, n); a row of zeros measures nothing.
    R : covariance of the numbers (m, m).   innovation : (m,).
    """
    K = P @ H.T @ ca.inv_minor(H @ P @ H.T + R)
    keep = ca.SX.eye(P.size1()) - K @ H
    after = keep @ P @ keep.T + K @ R @ K.T
    return _Corrected(K @ innovation, (after + after.T) / 2)


def _curve_parameters(theta: Any, loads: Any) -> Any:
    """Return B [1/rad], C [-] and D [N] of both axles, (2, 3).
    theta : ln C and ln μ of both axles (4,).   loads : static, (2,) [N].
    """
    stiffness, friction = ca.exp(theta[:2]), ca.exp(theta[2:])
    shape = ca.DM.ones(2) * SHAPE
    return ca.horzcat(stiffness / (shape * friction), shape, friction * loads)


def _build_step() -> ca.Function:
    """Return the filter's step; carried are `CARRY` and the lag of what is measured."""
    s, last, carry = sample_ports(), lag_symbols(), (*CARRY, *LaggedSlip._fields)
    p, dt, loads = s.parameters, s.sampling[0], axle_loads(s.parameters)
    z, P = ca.SX.sym("estimate", _STATES), ca.SX.sym("P", _STATES, _STATES)
    before, running = ca.SX.sym("before", 3), ca.SX.sym("running")
    numbers = ca.SX.sym("numbers", len(_Numbers._fields))
    given = _Numbers(*ca.vertsplit(numbers))
    sigma = ca.vertcat(given.relaxation_length, given.relaxation_length)
    learning = s.v_x >= given.learning_speed
    going = ca.logic_and(learning, running > 0.5)

    def force(z: Any, slip: Any, u: Any) -> Any:
        return magic_formula(_curve_parameters(z[TIRE], loads), slip, u)

    def slip_of(v_x: Any, x: Any, u: Any) -> Any:
        return measured_slip(p, ca.vertcat(z[8], 0), v_x, x, u)

    v_mean = ca.fmax((before[2] + s.v_x) / 2, given.learning_speed)
    u_mean = (before[:2] + s.u) / 2
    motion = motion_rate(p, v_mean, z[:2], force(z, z[2:4], u_mean))
    rate = ca.vertcat(motion, v_mean / sigma * (slip_of(v_mean, z[:2], u_mean) - z[2:4]))
    ahead = ca.vertcat(midpoint(z, rate, dt), z[4:])
    F = ca.jacobian(ahead, z)
    disturbed = (given.v_y_disturbance, given.r_disturbance, 0, 0)
    walks = ca.vertcat(*disturbed, *[given.walk] * 4, ca.SX(2, 1))
    at = ca.SX.sym("at", _STATES)
    shows = ca.vertcat(at[:2], ca.sum1(force(at, at[2:4], s.u)) / p.m + at[9])
    shows, H = ca.substitute([shows, ca.jacobian(shows, at)], [at], [ahead])
    H[2, :] *= s.has_a_y
    a_y = ca.if_else(s.has_a_y, s.a_y, 0)
    innovation = ca.vertcat(s.x - shows[:2], s.has_a_y * (a_y - shows[2]))
    R = ca.diag(ca.vertcat(*given[:3]) ** 2)
    found = corrected(F @ P @ F.T + ca.diag(walks**2 * dt), H, R, innovation)

    after = ahead + found.move
    low, high = (np.repeat(BOUNDS[:, k], 2) for k in (0, 1))
    after[TIRE] = ca.fmin(ca.fmax(after[TIRE], low), high)
    alpha_now = slip_of(s.speed, s.x, s.u)
    afresh = ca.vertcat(s.x, alpha_now, z[4:])
    unsure = ca.vertcat(*given[:2], *[given.v_y_noise / s.speed] * 2)
    P_next = ca.if_else(going, found.P, ca.diagcat(ca.diag(unsure**2), P[4:, 4:]))
    lagged = lagged_slip(last, alpha_now, s.speed * dt, sigma)
    return ca.Function(
        "lagged_ekf",
        [z, P, before, running, *last, s.x, s.u, s.v_x, s.a_y, s.vehicle, s.sampling, numbers],
        [
            ca.if_else(going, after, afresh),
            ca.densify(P_next),
            ca.vertcat(s.u, s.v_x),
            ca.if_else(learning, 1, 0),
            *(lagged, alpha_now, ca.if_else(s.moving, 1, 0)),
            ca.if_else(s.moving, force(z, lagged, s.u), 0),
        ],
        [*carry, *WITH_A_Y, "vehicle", "sampling", "numbers"],
        [*(f"{port}_next" for port in carry), "axle_force"],
        {"cse": True},
    )


@cache
def _scan() -> Scan:
    return Scan(_build_step(), carry=(*CARRY, *LaggedSlip._fields), over=WITH_A_Y)


@dataclass(frozen=True, slots=True, kw_only=True)
class LaggedEkf(Positive, Method):
    """Stiffness and friction of each axle behind a fixed lag, with a_y where there is one.

    The size of the car alone sets its numbers.
    time : sqrt(L/g) of the car [s].   speed : sqrt(g L) [m/s].   wheelbase : L [m].
    dt : sampling interval [s].   min_speed : below this speed [m/s] forces read zero.
    """

    ports = (*PORTS, *LAG_PORTS)
    remark = "two numbers an axle, one relaxation length for all cars of a size"

    time: float
    speed: float
    wheelbase: float
    dt: float = 0.01
    min_speed: float = 1.0

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> Self:
        return cls(
            time=vehicle.froude_time,
            speed=vehicle.froude_speed,
            wheelbase=vehicle.wheelbase,
            dt=dt,
            min_speed=vehicle.lowest_speed,
        )

    @property
    def _numbers(self) -> _Numbers:
        return _Numbers(
            v_y_noise=0.02 * self.speed,
            r_noise=0.002 / self.time,
            a_y_noise=0.4,
            v_y_disturbance=0.05 * self.speed / math.sqrt(self.time),
            r_disturbance=0.03 / self.time**1.5,
            walk=1e-4,
            relaxation_length=0.12 * self.wheelbase,
            learning_speed=0.6 * self.speed,
        )

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs; it begins afresh, with no stored model."""
        if start is not None:
            raise ValueError("the lagged filter begins afresh: it goes on from no stored model")
        numbers = self._numbers
        slip = numbers.v_y_noise / numbers.learning_speed
        sd = [numbers.v_y_noise, numbers.r_noise, slip, slip, *SPREADS]
        return Setup(
            scan=_scan(),
            carry={
                "estimate": np.array([0.0] * 4 + BEGINNING + [0.0] * 2),
                "P": np.diag(sd) ** 2,
                "before": np.zeros(3),
                "running": np.zeros(1),
                **unlagged(),
            },
            constants={
                "numbers": np.array(numbers),
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
            parameters=np.array(ca.DM(values)),
            min_speed=self.min_speed,
            relaxation_length=np.full(2, self._numbers.relaxation_length),
            offset=np.array([z[8], 0.0]),
        )
