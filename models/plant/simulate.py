"""A plant ready to drive: the car, its tires and the compiled loop over time."""

import os
from collections.abc import Callable, Hashable
from functools import cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from models.friction import Friction
from models.maneuvers import Maneuver
from models.plant.driver import Driver
from models.plant.dynamics import N_STATES, dynamics, runge_kutta
from models.plant.run import PlantRun
from models.tires import MagicFormula, Tire
from models.vehicle import Vehicle, VehicleError

Array = NDArray[np.float64]
Speed = float | Callable[[Array], Array]


class PlantError(ArithmeticError):
    """The car left the range of its equations; the message says when."""


@cache
def compiled_loop(vehicle: Vehicle, tire: Tire, driver: Driver, dt: float) -> Scan:
    """Return the compiled loop of a plant over time, built once.

    Parameters
    ----------
    vehicle : the car, with chassis.
    tire : of all four wheels, hashable.
    driver : who holds the speed.
    dt : step of the integration [s].
    """
    step = runge_kutta(dynamics(vehicle, tire, driver), dt)
    return Scan(step, carry=("x",), over=("command", "v_ref", "mu"))


class Plant:
    """A double-track car on its tires.

    Parameters
    ----------
    vehicle : the car; it needs a chassis.
    tire : of all four wheels, a frozen record; None reads the file named by the chassis.
    driver : who holds the speed.

    Raises
    ------
    VehicleError
        When the vehicle has no chassis, or names no tire where none is given.
    """

    def __init__(
        self, vehicle: Vehicle, tire: Tire | None = None, *, driver: Driver | None = None
    ) -> None:
        file = vehicle.require_chassis().tire
        if tire is None and file is None:
            raise VehicleError(f"vehicle '{vehicle.name}' names no tire file and none was given")
        self.vehicle = vehicle
        if tire is None:
            tire = MagicFormula.from_tir(os.fspath(file or ""))
        self.tire: Tire = tire
        self.driver = driver if driver is not None else Driver()

    def simulate(
        self,
        maneuver: Maneuver,
        *,
        speed: Speed,
        friction: Friction | None = None,
        dt: float = 1e-3,
        sample_time: float = 0.01,
        name: str | None = None,
    ) -> PlantRun:
        """Drive a maneuver from straight ahead, with classical Runge-Kutta steps.

        Parameters
        ----------
        maneuver : what the wheels are asked to do, and for how long.
        speed : wanted speed [m/s], a number or a function of the times (n,) [s].
        friction : of the road; None is what the tire was measured on.
        dt : step of the integration [s].
        sample_time : step of the record [s], a multiple of `dt`.
        name : of the run; None takes the name of the maneuver's class.

        Returns
        -------
        The run at every `sample_time` from 0 to the maneuver's duration.

        Raises
        ------
        ValueError
            For steps that do not fit, or a speed that is not positive at the start.
        PlantError
            When a state stops being a finite number.
        """
        every = round(sample_time / dt) if dt > 0.0 else 0
        if not (every >= 1 and abs(every * dt - sample_time) < 1e-9 * sample_time):
            raise ValueError(f"sample_time {sample_time} must be a multiple of dt {dt}")
        n = every * round(maneuver.duration / sample_time) + 1
        t = dt * np.arange(n, dtype=np.float64)
        middle = t + 0.5 * dt  # inputs are held over a step: at its middle they are not late
        command = maneuver.steering(middle)
        v_ref = speed(middle) if callable(speed) else np.full(n, float(speed))
        for label, given, shape in (("steering", command, (n, 2)), ("speed", v_ref, (n,))):
            if np.shape(given) != shape or not np.isfinite(given).all():
                raise ValueError(f"{label} must be finite and of shape {shape}")
        if not v_ref[0] > 0.0:
            raise ValueError(f"speed must be positive at the start, it is {v_ref[0]}")
        road = friction if friction is not None else Friction()
        start = np.zeros(N_STATES)
        start[0] = v_ref[0]
        values = {"x": start, "command": command, "v_ref": v_ref}
        values |= {"mu": road.over_time(middle), "places": road.over_place()}
        record = compiled_loop(self.vehicle, cast(Hashable, self.tire), self.driver, dt)(
            n, values, every=every
        )
        finite = np.isfinite(record["x"]).all(axis=1)
        if not finite.all():
            raise PlantError(f"the car's state is not finite from t = {t[::every][~finite][0]} s")
        name = name if name is not None else type(maneuver).__name__
        t = t[::every]
        return PlantRun.from_record(name, self.vehicle, t, maneuver.steering(t), record)
