"""The linear tire as the vehicle states it, which is the least to beat."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from codegen.arrays import Array
from identifier.baselines.curves import CurveModel
from identifier.method import Method, require_fresh
from identifier.setup import Setup
from identifier.tire_model import TireModel
from models.rules import require_positive_fields
from models.vehicle import Vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearBaseline(Method):
    """F = C α of (3) with the stiffness that the vehicle states.
    dt : sampling interval [s].   min_speed : below this speed [m/s] forces read zero.
    """

    dt: float = 0.01
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        require_positive_fields(self)

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> Self:
        return cls(dt=dt, min_speed=vehicle.lowest_speed)

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs; it begins afresh, with no stored model."""
        require_fresh(start)
        return self.frozen(vehicle, {}).setup(self.dt)

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> CurveModel:
        del state
        stiffness = [[vehicle.cornering_stiffness_front], [vehicle.cornering_stiffness_rear]]
        return CurveModel(
            vehicle=vehicle,
            curve="linear",
            parameters=np.array(stiffness),
            min_speed=self.min_speed,
        )
