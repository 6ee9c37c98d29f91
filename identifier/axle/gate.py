"""Which samples are used, and when learning may run.

A sample that no car could have made is replaced by the last good one; after `hold` seconds of
that the run restarts with the next good one. Learning waits `settle` seconds after a restart,
after three bad samples in a row, and while v_y and r repeat to the last bit (a stuck sensor).
"""

import math
from dataclasses import astuple, dataclass
from functools import reduce
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.axle.car import car_numbers, downforce_numbers, larger
from identifier.setup import Port
from models.rules import Positive
from models.vehicle import GRAVITY, Vehicle

BAD_IN_A_ROW = 3
GATE_PORT = Port(
    "gate",
    "SI",
    "last good v_x, v_y, r, delta_f, delta_r; on; time of steady learning; bad and stuck samples "
    "in a row",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plausibility(Positive):
    """Bounds of what a car can do; generous, since they are there for faults.
    min_speed : below this speed [m/s] forces read zero.
    learning_speed : below this speed [m/s] learning rests.
    max_speed : no car is faster [m/s].   max_sideslip : largest |v_y|/v_x [-].
    slow : speed that stands for v_x in that ratio, where v_x is lower [m/s].
    max_yaw_rate : [rad/s].   max_steering : [rad].   max_rate : largest acceleration [m/s²].
    jump : what noise may add to v_x and v_y from one sample to the next [m/s].
    max_yaw_acceleration : [rad/s²].   yaw_jump : what noise may add to r [rad/s].
    max_steering_rate : [rad/s].   steering_jump : what noise may add to the steering [rad].
    hold : longest time to go on with the last good sample, or with values that do not change [s].
    settle : time to wait before learning [s].
    """

    min_speed: float
    learning_speed: float
    max_speed: float
    max_sideslip: float = 0.6
    slow: float
    max_yaw_rate: float
    max_steering: float = 1.2
    max_rate: float
    jump: float
    max_yaw_acceleration: float
    yaw_jump: float
    max_steering_rate: float = 10.0
    steering_jump: float = 0.1
    hold: float = 0.25
    settle: float = 0.5

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle) -> "Plausibility":
        """Return the bounds for a car: speeds scale with U = sqrt(g L), lengths with L (Froude)."""
        U, L = vehicle.froude_speed, vehicle.wheelbase
        return cls(
            min_speed=vehicle.lowest_speed,
            learning_speed=0.6 * U,
            max_speed=60.0 * U,
            slow=U,
            max_yaw_rate=4.0 * U / L,
            max_rate=3.0 * GRAVITY,
            jump=0.1 * U,
            max_yaw_acceleration=6.0 * GRAVITY / L,
            yaw_jump=0.2 * U / L,
        )

    def rest(self, dt: float) -> int:
        """Return how many bad samples in a row end a run, so that the next good one begins anew.
        dt : sampling interval [s].
        """
        return math.floor(self.hold / dt) + 2

    def numbers(self) -> tuple[float, ...]:
        """Return the numbers of a step, whose port names them as the fields are."""
        return astuple(self)

    def constants(self, vehicle: Vehicle, ladder: tuple[float, ...], dt: float) -> dict[str, Array]:
        """Return what every step of curves is given: its car, time, units and these numbers.
        ladder : slip scales of the units [rad].   dt : sampling interval [s].
        """
        return {
            "dt": np.array(dt),
            "car": car_numbers(vehicle),
            "scales": 1.0 / np.array(ladder)[None],
            "plausibility": np.array(self.numbers()),
            **downforce_numbers(vehicle),
        }


class GateState(NamedTuple):
    """Last good sample (SI), whether the run is on (0 or 1), time of steady learning [s], and
    samples in a row that were bad or stuck.
    """

    v_x: Any
    v_y: Any
    r: Any
    delta_f: Any
    delta_r: Any
    on: Any
    steady: Any
    bad: Any
    stuck: Any


class Gate(NamedTuple):
    """What the gate lets through.

    v_x, v_y, r and delta (2,): the sample to go on with.   on : whether forces are given.
    first : 1 at a (re)start, else 0.   learns : whether learning runs.   state : to carry.
    """

    v_x: Any
    v_y: Any
    r: Any
    delta: Any
    on: Any
    first: Any
    learns: Any
    state: Any


def _all(*conditions: Any) -> Any:
    return reduce(ca.logic_and, conditions)


def gate(limits: Any, dt: Any, last: GateState, x: Any, u: Any, v_x: Any) -> Gate:
    """Judge a sample.
    limits : numbers of a `Plausibility`.   dt : sampling interval [s].   x : [v_y, r] (2,).
    u : [δ_f, δ_r] (2,).   v_x : longitudinal speed [m/s].
    """
    v_y, r, delta_f, delta_r = x[0], x[1], u[0], u[1]
    plausible = _all(
        ca.fabs(v_x) < limits.max_speed,
        ca.fabs(v_y) < limits.max_sideslip * larger(ca.fabs(v_x), limits.slow),  # NaN is not
        ca.fabs(r) < limits.max_yaw_rate,
        ca.fabs(delta_f) < limits.max_steering,
        ca.fabs(delta_r) < limits.max_steering,
    )
    since = dt * (1 + last.bad)
    largest_change = limits.max_rate * since + limits.jump
    turn = limits.max_steering_rate * since + limits.steering_jump
    near = _all(
        ca.fabs(v_x - last.v_x) < largest_change,
        ca.fabs(v_y - last.v_y) < largest_change,
        ca.fabs(r - last.r) < limits.max_yaw_acceleration * since + limits.yaw_jump,
        ca.fabs(delta_f - last.delta_f) < turn,
        ca.fabs(delta_r - last.delta_r) < turn,
    )
    good = ca.logic_and(plausible, ca.logic_or(near, ca.logic_not(last.on)))
    bad = ca.if_else(good, 0, last.bad + 1)
    same = ca.logic_and(v_y == last.v_y, r == last.r)
    stuck = ca.if_else(same, last.stuck + 1, 0)

    sample = (v_x, v_y, r, delta_f, delta_r)
    used = [ca.if_else(good, new, old) for new, old in zip(sample, last[:5], strict=True)]
    holds = ca.logic_and(last.on, bad * dt <= limits.hold)
    on = ca.logic_and(used[0] >= limits.min_speed, ca.logic_or(good, holds))
    # A slow sensor in a fast log holds its value for some samples; one that is stuck, for longer.
    alive = stuck * dt <= limits.hold
    steady = _all(used[0] > limits.learning_speed, bad < BAD_IN_A_ROW, alive, on)
    clock = ca.if_else(steady, last.on * last.steady + dt, 0)
    return Gate(
        v_x=larger(used[0], limits.min_speed),
        v_y=used[1],
        r=used[2],
        delta=ca.vertcat(used[3], used[4]),
        on=on,
        first=1 - last.on,
        learns=_all(good, stuck < BAD_IN_A_ROW, clock >= limits.settle - dt / 2),
        state=ca.vertcat(*used, on, clock, ca.if_else(on, bad, 0), stuck),
    )
