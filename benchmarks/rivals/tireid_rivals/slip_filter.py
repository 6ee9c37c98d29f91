"""Kalman filters of v_y and yaw rate that hear r and a_y: on known linear tires, and learning.

State [v_y, r, θ], all as in `tireid_rivals.without_v_y`. The linear filter has no θ: the
tires are those of the vehicle file. The joint one learns a tire of Dugoff for each axle alongside,
θ = [ln C/C_0 front and rear, ln μ/μ_0 front and rear], as random walks, and knows nothing of bank,
bias, roll, lag or offsets: the naive filter that a textbook suggests (Simon, Optimal State
Estimation, 2006, sections 5.1 and 13.2; states and parameters together in section 13.4).
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
from identifier.baselines.curves import CURVES, CurveModel
from identifier.baselines.kalman import corrected
from identifier.baselines.ports import WITH_A_Y, axle_loads, given_ports
from identifier.method import Method, require_fresh, resumed
from identifier.setup import AXLE_FORCE, COVARIANCE, Port, Setup
from identifier.tire_model import TireModel
from models.bicycle import BicycleParameters
from models.rules import require_positive
from models.vehicle import GRAVITY, Vehicle
from tireid_rivals.without_v_y import (
    MOST_SLIDING,
    V_Y,
    V_Y_SD,
    FilteredTire,
    axle_force,
    expected,
    predicted,
    steady_v_y,
)

CARRY = ("estimate", "P", "before", "running")
PORTS = (
    AXLE_FORCE,
    V_Y,
    V_Y_SD,
    Port("estimate", "m/s; rad/s; -", "v_y, r and the unknowns of the tires"),
    Port("P", "of estimate", "covariance of estimate", rule=COVARIANCE),
    Port("before", "rad; rad; m/s", "delta_f, delta_r and v_x of the last sample"),
    Port("running", "-", "1 after a sample in motion that was understood"),
)
LIMITS = (2.0, 2.0, 1.5, 1.5)  # of |θ|: stiffness within a factor of 7.4, friction of 4.5


class Numbers(NamedTuple):
    """What a filter is given, in the order of its constant.

    Standard deviations of r [rad/s] and a_y [m/s²]; disturbances of v_y [m/s/√s] and r [rad/s/√s];
    walk of θ [1/√s]; standard deviation of the rear slip at a start [rad]; outlier; friction;
    learning speed [m/s].
    """

    r_noise: Any
    a_y_noise: Any
    v_y_disturbance: Any
    r_disturbance: Any
    walk: Any
    start_slip: Any
    outlier: Any
    friction: Any
    learning_speed: Any


def _linear(p: BicycleParameters, known: Any, theta: Any, slip: Any, u: Any) -> Any:
    del known, theta
    return CURVES["linear"].force(ca.vertcat(p.C_f, p.C_r), None, slip, u)


def _dugoff(p: BicycleParameters, known: Any, theta: Any, slip: Any, u: Any) -> Any:
    loads = axle_loads(p, GRAVITY)
    q = ca.horzcat(ca.vertcat(p.C_f, p.C_r) * ca.exp(theta[:2]), known * ca.exp(theta[2:]))
    return CURVES["dugoff"].force(q, loads, slip, u)


def _tire(curve: str, force: Any, unknowns: int) -> FilteredTire:
    def slip(p: BicycleParameters, known: Any, theta: Any, v_x: Any, x: Any, u: Any) -> Any:
        del known, theta
        return CURVES[curve].slip(p, v_x, x, u)

    return FilteredTire(slip=slip, force=force, unknowns=unknowns)


TIRES: Mapping[str, FilteredTire] = {
    "linear": _tire("linear", _linear, 0),
    "dugoff": _tire("dugoff", _dugoff, len(LIMITS)),
}


def build_step(name: str, tire: FilteredTire) -> ca.Function:
    """Return the filter's step; all numbers stay inputs of it.

    Carried: estimate (n,) = [v_y, r, θ], its covariance P, before (3,), running. Below the learning
    speed, and after an estimate that slides by more than `MOST_SLIDING`, x begins anew in a steady
    turn; θ and its covariance are kept.
    """
    ports, n = given_ports(), 2 + tire.unknowns
    s, estimate, P = ports.sample, ca.SX.sym("estimate", n), ca.SX.sym("P", n, n)
    before, running = ca.SX.sym("before", 3), ca.SX.sym("running")
    numbers = ca.SX.sym("numbers", len(Numbers._fields))
    given, p, dt = Numbers(*ca.vertsplit(numbers)), s.parameters, s.sampling[0]
    fast = s.v_x >= given.learning_speed
    going = ca.logic_and(fast, running > 0.5)

    v_mean = ca.fmax((before[2] + s.v_x) / 2, given.learning_speed)
    ahead = predicted(tire, p, given.friction, estimate, v_mean, (before[:2] + s.u) / 2, dt)
    F = ca.jacobian(ahead, estimate)
    walks = ca.repmat(given.walk, tire.unknowns, 1)
    Q = ca.diag(ca.vertcat(given.v_y_disturbance, given.r_disturbance, walks) ** 2 * dt)
    at = ca.SX.sym("at", n)
    shows = expected(tire, p, given.friction, at, s.speed, s.u)
    shows, H = ca.substitute([shows, ca.jacobian(shows, at)], [at], [ahead])
    H[1, :] *= ports.has_a_y
    missed = ca.vertcat(ports.r - shows[0], ports.has_a_y * (ports.a_y - shows[1]))
    R = ca.diag(ca.vertcat(given.r_noise, given.a_y_noise) ** 2)
    found = corrected(F @ P @ F.T + Q, H, R, missed, given.outlier)

    limit = ca.DM(LIMITS[: tire.unknowns])
    theta = ca.fmin(ca.fmax((ahead + found.move)[2:], -limit), limit)
    afresh = ca.vertcat(steady_v_y(p, s.speed, ports.r, s.u), ports.r, estimate[2:])
    first = ca.diag(ca.vertcat(given.start_slip * s.speed, given.r_noise) ** 2)
    after = ca.vertcat((ahead + found.move)[:2], theta)
    following = ca.if_else(going, after, afresh)
    P_next = ca.if_else(going, found.P, ca.diagcat(first, P[2:, 2:]))
    sane = ca.fabs(following[0]) < MOST_SLIDING * s.speed
    told_force = axle_force(
        tire, p, given.friction, ca.vertcat(following[:2], estimate[2:]), s.speed, s.u
    )
    return ca.Function(
        name,
        [estimate, P, before, running, *ports.ports, numbers],
        [
            following,
            ca.densify(P_next),
            ca.vertcat(s.u, s.v_x),
            ca.logic_and(fast, sane),
            ca.if_else(s.moving, told_force, 0),
            ca.if_else(s.moving, following[0], 0),
            ca.sqrt(P_next[0, 0]),
        ],
        [*CARRY, *WITH_A_Y, "vehicle", "sampling", "numbers"],
        [*(f"{port}_next" for port in CARRY), "axle_force", "v_y", "v_y_sd"],
        {"cse": True},
    )


@cache
def _scan(tire: str) -> Scan:
    return Scan(build_step(f"slip_filter_{tire}", TIRES[tire]), carry=CARRY, over=WITH_A_Y)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipFilter(Method):
    """Lateral velocity by a Kalman filter of r and a_y; a recording's v_y is not read.
    tire : "linear", that of the vehicle file, or "dugoff", which is learnt.
    r_noise : standard deviation of the measured yaw rate [rad/s].
    a_y_noise : standard deviation of the measured a_y [m/s²].
    v_y_disturbance : what the tires miss, as random change of v_y [m/s/√s].
    r_disturbance : what the tires miss, as random change of the yaw rate [rad/s/√s].
    start_slip : standard deviation of the rear slip at a start [rad].
    walk : of every unknown of the tires [1/√s]; the linear tire has none.
    friction : what friction is held for at first [-]; as all that follow, not of the linear tire.
    stiffness_spread : standard deviation of the logarithm of stiffness at first [-].
    friction_spread : standard deviation of the logarithm of friction at first [-].
    dt : sampling interval [s].   learning_speed : below this speed [m/s] the filter rests.
    min_speed : below this speed [m/s] forces and v_y read zero.
    """

    ports = PORTS
    estimates = "lateral velocity"
    needs = ("a_y",)  # it estimates v_y

    tire: str
    r_noise: float
    a_y_noise: float
    v_y_disturbance: float
    r_disturbance: float
    start_slip: float = 0.007
    walk: float = 0.01
    friction: float = 0.86
    stiffness_spread: float = 0.4
    friction_spread: float = 0.7
    outlier: float = 5.0
    dt: float = 0.01
    learning_speed: float = 3.0
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        if self.tire not in TIRES:
            raise ValueError(f"tire must be one of {list(TIRES)}, not {self.tire!r}")
        names = (*Numbers._fields, "stiffness_spread", "friction_spread", "dt", "min_speed")
        require_positive(ValueError, **{name: getattr(self, name) for name in names})

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, tire: str, dt: float = 0.01) -> Self:
        """Return the filter for a car; its numbers were chosen on 48 random drives of our plant.

        So that the joint filter errs least, and 95 % of its errors lie within two standard
        deviations there; the linear one has the same, and does not know that stiffnesses are wrong.
        dt : sampling interval [s].
        """
        time, speed = vehicle.froude_time, vehicle.froude_speed
        return cls(
            tire=tire,
            r_noise=0.0023 / time,
            a_y_noise=1.5,
            v_y_disturbance=0.09 * speed / math.sqrt(time),
            r_disturbance=0.26 / time**1.5,
            walk=0.002 / math.sqrt(time),
            dt=dt,
            learning_speed=0.6 * speed,
            min_speed=vehicle.lowest_speed,
        )

    @property
    def learns(self) -> bool:
        return TIRES[self.tire].unknowns > 0

    @property
    def remark(self) -> str:
        """Say which tires it stands on."""
        on = "identified tires of Dugoff" if self.learns else "the vehicle's linear tires"
        return f"on {on}"

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs; a frozen curve of its kind may begin it, else the prior does."""
        theta = np.zeros(TIRES[self.tire].unknowns)
        if not self.learns:
            require_fresh(start)
        elif start is not None:
            refusal = "the stored model is not a curve 'dugoff'"
            stored = resumed(start, CurveModel, refusal, curve="dugoff").parameters
            prior = np.column_stack([vehicle.bicycle[4:], np.full(2, self.friction)])
            theta = np.clip(np.log(stored / prior).ravel(order="F"), -np.array(LIMITS), LIMITS)
        spread = np.repeat([self.stiffness_spread, self.friction_spread], 2)[: theta.size]
        return Setup(
            scan=_scan(self.tire),
            carry={
                "estimate": np.append(np.zeros(2), theta),
                "P": np.diag(np.append(np.zeros(2), spread) ** 2),
                "before": np.zeros(3),
                "running": np.zeros(1),
            },
            constants={
                "numbers": np.array([getattr(self, name) for name in Numbers._fields]),
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> CurveModel:
        if not self.learns:
            Method.frozen(self, vehicle, state)
        theta = state["estimate"].ravel()[2:].reshape(2, 2)
        stiffness, friction = np.exp(theta) * [vehicle.bicycle[4:], [self.friction] * 2]
        return CurveModel(
            vehicle=vehicle,
            curve="dugoff",
            parameters=np.column_stack([stiffness, friction]),
            min_speed=self.min_speed,
        )
