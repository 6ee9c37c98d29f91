"""The linear tire that the car was told of: no learning, the least that a method must beat."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from identifier.baselines.curve_model import CurveModel, curve_scan
from identifier.baselines.similarity import lowest_speed, require_positive
from identifier.method import FrozenModel, Setup
from models.recordings import Recording
from models.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearBaseline:
    """F = C α of (3) with the stiffness that the vehicle states.

    Parameters
    ----------
    dt : sampling interval [s].
    min_speed : below this speed [m/s] forces read zero.
    """

    dt: float = 0.01
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        require_positive(dt=self.dt, min_speed=self.min_speed)

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> Self:
        """Return the method for a car.

        Parameters
        ----------
        vehicle : the car.
        dt : sampling interval [s].
        """
        return cls(dt=dt, min_speed=lowest_speed(vehicle))

    def setup(
        self, vehicle: Vehicle, recording: Recording, start: FrozenModel | None = None
    ) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        vehicle : the car, whose stiffness is used.
        recording : what it will run over; not looked at.
        start : None; there is nothing that a stored model could begin.

        Raises
        ------
        ValueError
            Where a stored model is given.
        """
        del recording
        if start is not None:
            raise ValueError("the linear tire learns nothing, it cannot begin with a stored model")
        return Setup(
            scan=curve_scan("linear"),
            carry={},
            constants={
                "parameters": self.frozen(vehicle, {}).parameters,
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )

    def frozen(self, vehicle: Vehicle, carried: Mapping[str, Array]) -> CurveModel:
        """Return the linear tire itself.

        Parameters
        ----------
        vehicle : the car.
        carried : nothing is carried.
        """
        del carried
        stiffness = [[vehicle.cornering_stiffness_front], [vehicle.cornering_stiffness_rear]]
        return CurveModel(
            vehicle=vehicle,
            curve="linear",
            parameters=np.array(stiffness),
            min_speed=self.min_speed,
        )
