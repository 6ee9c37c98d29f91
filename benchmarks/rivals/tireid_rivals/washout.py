"""v_y by integration of a_y - v_x r where it moves fast, by the linear model where it is slow.

dv/dt = a_y - v_x r + ω (v_s - v): v is the integral washed out by s/(s + ω), and v_s passed through
ω/(s + ω), where v_s is v_y of a steady turn on the linear rear tire (`steady_v_y`). Solved exactly
for rates that hold over a step. A complementary filter; what bank and bias do to it is 1/ω of them.
"""

from dataclasses import dataclass
from functools import cache
from typing import Self

import casadi as ca
import numpy as np

from codegen import Scan
from identifier.baselines.curves import CURVES
from identifier.baselines.ports import WITH_A_Y, given_ports
from identifier.method import Method, require_fresh
from identifier.setup import AXLE_FORCE, Port, Setup
from identifier.tire_model import TireModel
from models.rules import require_positive_fields
from models.vehicle import Vehicle
from tireid_rivals.without_v_y import V_Y, steady_v_y

CARRY = ("washed", "rate", "running")
PORTS = (
    AXLE_FORCE,
    V_Y,
    Port("washed", "m/s", "v_y of the filter"),
    Port("rate", "m/s^2", "a_y - v_x r of the last sample"),
    Port("running", "-", "1 after a sample in motion"),
)


def build_step() -> ca.Function:
    """Return the step; cutoff, vehicle and sampling stay inputs of it.

    Carried: washed, rate, running. Constant: cutoff ω [1/s]. Where a_y is not there, the
    last rate holds. The forces are those of the linear tires of the vehicle at that v_y.
    """
    given = given_ports()
    s, washed, rate, running = given.sample, *(ca.SX.sym(name) for name in CARRY)
    p, dt, cutoff = s.parameters, s.sampling[0], ca.SX.sym("cutoff")
    steady = steady_v_y(p, s.speed, given.r, s.u)
    now = ca.if_else(given.has_a_y, given.a_y - s.v_x * given.r, rate)
    keep = ca.exp(-cutoff * dt)
    moved = keep * washed + (1 - keep) * (steady + (rate + now) / (2 * cutoff))
    v_y = ca.if_else(ca.logic_and(s.moving, running > 0.5), moved, steady)
    linear = CURVES["linear"]
    alpha = linear.slip(p, s.speed, ca.vertcat(v_y, given.r), s.u)
    force = linear.force(ca.vertcat(p.C_f, p.C_r), None, alpha, s.u)
    return ca.Function(
        "washout",
        [washed, rate, running, *given.ports, cutoff],
        [
            v_y,
            now,
            ca.if_else(s.moving, 1, 0),
            ca.if_else(s.moving, force, 0),
            ca.if_else(s.moving, v_y, 0),
        ],
        [*CARRY, *WITH_A_Y, "vehicle", "sampling", "cutoff"],
        [*(f"{port}_next" for port in CARRY), "axle_force", "v_y"],
    )


@cache
def _scan() -> Scan:
    return Scan(build_step(), carry=CARRY, over=WITH_A_Y)


@dataclass(frozen=True, slots=True, kw_only=True)
class Washout(Method):
    """Lateral velocity by integration, with what is slow taken from the linear tires.
    cutoff : ω, below which the linear model counts [1/s].   dt : sampling interval [s].
    min_speed : below this speed [m/s] forces and v_y read zero.
    """

    ports = PORTS
    remark = "by integration, and below its cutoff on the vehicle's linear tires"
    estimates = "lateral velocity"
    needs = ("a_y",)  # it estimates v_y

    cutoff: float
    dt: float = 0.01
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        require_positive_fields(self)

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> Self:
        """Return the filter for a car: ω = 8 sqrt(g/L), 15 1/s for a sedan.

        Chosen on random cars of our plant, whose roads bank and whose sensors are biased: a higher
        one errs less there by a tenth at most, and is the linear model alone.
        """
        return cls(cutoff=8.0 / vehicle.froude_time, dt=dt, min_speed=vehicle.lowest_speed)

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs; it begins afresh, with no stored model."""
        require_fresh(start)
        return Setup(
            scan=_scan(),
            carry={name: np.zeros(1) for name in CARRY},
            constants={
                "cutoff": np.array(self.cutoff),
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )
