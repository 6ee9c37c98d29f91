"""Extended Kalman filter with axle forces as random walks: a signal estimator.

θ = [F_f, F_r]/F_z, in static axle loads.   Source of the idea: Ray, "Nonlinear state and tire force
estimation for advanced vehicle control", IEEE Trans. Control Systems Technology 3(1), 1995.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from identifier.baselines.kalman import CARRY, NOISE, build_step
from identifier.baselines.ports import OVER, axle_loads
from identifier.baselines.similarity import around, lowest_speed, require_positive, scales
from identifier.method import CannotFreezeError, FrozenModel, Setup
from identifier.tuning import Range
from models.bicycle import BicycleParameters
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

Array = NDArray[np.float64]
LIMIT = 5.0  # static axle loads: no tire reaches it


def _force(p: BicycleParameters, known: Any, theta: Any, v_x: Any, x: Any, u: Any) -> Any:
    del known, v_x, x, u
    return axle_loads(p, GRAVITY) * theta


@cache
def _scan() -> Scan:
    step = build_step("force_ekf", _force, unknowns=2, prior=1, follows=True)
    return Scan(step, carry=CARRY, over=OVER)


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceEkf:
    """Forces that walk at random: no tire, only how fast a force may change.

    Parameters
    ----------
    force_walk : of each force, in static axle loads per root of time [1/√s].
    v_y_noise : standard deviation of measured v_y [m/s].
    r_noise : standard deviation of the measured yaw rate [rad/s].
    v_y_disturbance : random change of v_y that no force explains [m/s/√s].
    r_disturbance : random change of the yaw rate that no force explains [rad/s/√s].
    outlier : standard deviations from which an innovation counts no more.
    dt : sampling interval [s].
    min_speed : below this speed [m/s] forces read zero.

    Raises
    ------
    ValueError
        Where a number is not positive.
    """

    force_walk: float
    v_y_noise: float
    r_noise: float
    v_y_disturbance: float
    r_disturbance: float
    outlier: float = 5.0
    dt: float = 0.01
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        require_positive(
            **{name: getattr(self, name) for name in ("force_walk", *NOISE, "dt", "min_speed")}
        )

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01) -> Self:
        """Return the filter for a car: for a sedan noise of 0.02 m/s and 0.002 rad/s.

        The forces walk by half a load in a second, which gives about the bandwidth of the
        extended state observer.

        Parameters
        ----------
        vehicle : the car.
        dt : sampling interval [s].
        """
        time, speed = scales(vehicle).time, scales(vehicle).speed
        return cls(
            force_walk=0.36 / math.sqrt(time),
            v_y_noise=0.004 * speed,
            r_noise=0.001 / time,
            v_y_disturbance=0.001 * speed / math.sqrt(time),
            r_disturbance=0.001 / time**1.5,
            dt=dt,
            min_speed=lowest_speed(vehicle),
        )

    @property
    def tunables(self) -> Mapping[str, Range]:
        """What a search may vary, around the numbers that it has."""
        return {
            "force_walk": around(self.force_walk, 10.0),
            "v_y_noise": around(self.v_y_noise, 4.0),
            "r_noise": around(self.r_noise, 4.0),
        }

    def setup(
        self, vehicle: Vehicle, recording: Recording, start: FrozenModel | None = None
    ) -> Setup:
        """Return what a run needs.

        Parameters
        ----------
        vehicle : the car; its stiffness is not looked at.
        recording : what it will run over.
        start : None; a signal estimator cannot begin with a model.

        Raises
        ------
        ValueError
            Where a stored model is given.
        """
        del recording
        if start is not None:
            raise ValueError("a filter of forces cannot begin with a stored model")
        R = np.array([self.v_y_noise, self.r_noise]) ** 2
        return Setup(
            scan=_scan(),
            carry={
                "estimate": np.zeros(4),
                "P": np.diag([*R, 1.0, 1.0]),
                "before": np.zeros(3),
                "running": np.zeros(1),
            },
            constants={
                "noise": np.array([getattr(self, name) for name in NOISE]),
                "walk": np.full(2, self.force_walk),
                "limit": np.full(2, LIMIT),
                "prior": np.zeros(1),
                "learning_speed": np.array(self.min_speed),
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )

    def frozen(self, vehicle: Vehicle, carried: Mapping[str, Array]) -> FrozenModel:
        """Refuse: there is no model.

        Parameters
        ----------
        vehicle : the car.
        carried : of the run.

        Raises
        ------
        CannotFreezeError
            Always.
        """
        del vehicle, carried
        raise CannotFreezeError("a filter of forces estimates forces, not a tire")
