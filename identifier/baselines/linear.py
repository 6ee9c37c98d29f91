"""The linear tire as the vehicle states it, which is the least to beat."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.axle.car import step_function, symbols
from identifier.frozen import FORMAT, require_min_speed, vehicle_from, vehicle_numbers
from identifier.method import Method, require_fresh
from identifier.setup import Setup
from identifier.tire_model import TireModel
from models.bicycle import BicycleParameters, linear_axle_force
from models.rules import Positive
from models.schema import Table
from models.vehicle import Vehicle


@cache
def _scan() -> Scan:
    """Return F = C α of (3) as a step that carries nothing; at rest 0."""
    ports, s = symbols(x=2, u=2, v_x=1, vehicle=BicycleParameters, sampling=2)
    slowest = s.sampling[1]
    force = linear_axle_force(s.vehicle, ca.fmax(s.v_x, slowest), s.x, s.u)
    moving = ca.if_else(s.v_x >= slowest, force, 0)
    step = step_function("frozen_linear", ports, {}, {"axle_force": moving})
    return Scan(step, carry=(), over=("x", "u", "v_x"))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class LinearModel(TireModel):
    """F = C α of (3), C of the vehicle.   min_speed : below this speed [m/s] forces read zero."""

    kind = "linear"

    vehicle: Vehicle
    min_speed: float

    def __post_init__(self) -> None:
        require_min_speed(self.min_speed)

    def setup(self, dt: float) -> Setup:
        numbers = {
            "vehicle": np.array(self.vehicle.bicycle),
            "sampling": np.array([dt, self.min_speed]),
        }
        return Setup(scan=_scan(), carry={}, constants=numbers)

    def curve_expression(self, alpha: Any, v_x: Any) -> Any:
        del v_x
        return ca.DM(self.vehicle.bicycle[4:]) * alpha

    def force_expression(
        self, slip: Any, x: Any, delta: Any, v_x: Any, least_lag: Any = 0.0
    ) -> tuple[Any, Any]:
        del slip, least_lag
        force = linear_axle_force(self.vehicle.bicycle, v_x, x, ca.vertcat(delta, 0))
        return force, ca.MX(0, 1)

    def to_dict(self) -> dict[str, Any]:
        return {
            "format": FORMAT,
            "kind": self.kind,
            "vehicle": vehicle_numbers(self.vehicle),
            "min_speed_m_s": self.min_speed,
        }

    @classmethod
    def _read(cls, table: Table) -> Self:
        vehicle = vehicle_from(table.value("vehicle"))
        return cls(vehicle=vehicle, min_speed=table.number("min_speed_m_s"))


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearBaseline(Positive, Method):
    """The linear tire with the stiffness that the vehicle states.
    dt : sampling interval [s].   min_speed : below this speed [m/s] forces read zero.
    """

    dt: float = 0.01
    min_speed: float = 1.0

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> Self:
        return cls(dt=dt, min_speed=vehicle.lowest_speed)

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs; it begins afresh, with no stored model."""
        require_fresh(start)
        return self.frozen(vehicle, {}).setup(self.dt)

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> LinearModel:
        del state
        return LinearModel(vehicle=vehicle, min_speed=self.min_speed)
