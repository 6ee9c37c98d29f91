"""Driving a maneuver with the multi-body car of commonroad-vehicle-models."""

from functools import partial
from typing import Any

import numpy as np

from codegen.arrays import Array
from models.maneuvers import Maneuver
from models.plant import Driver
from mpc.cars.bmw_equations import ROLL, V_X, YAW_RATE, MultiBody
from mpc.cars.commonroad import runge_kutta_step


def drive(
    equations: MultiBody,
    parameters: Any,
    maneuver: Maneuver,
    *,
    speed: float,
    driver: Driver,
    dt: float = 1e-3,
    every: int = 10,
) -> dict[str, Array]:
    """Drive their car with classical Runge-Kutta steps.

    Parameters
    ----------
    equations : theirs.
    parameters : theirs.
    maneuver : the steering; the angle follows it exactly, by its rate.
    speed : held by a proportional driver [m/s].
    driver : its gain and limit.
    dt : step [s].
    every : steps between two samples.

    Returns
    -------
    a_y and v_y of all masses together, r, v_x and roll (positive when the right side dips) over
    time, each (n,), from 0 to the maneuver's duration.
    """
    n = every * round(maneuver.duration / (every * dt)) + 1
    path = maneuver.steering(dt * np.arange(n + 1, dtype=np.float64))[:, 0]
    rate, limit = np.diff(path) / dt, driver.acceleration_limit
    x = equations.start([0.0, 0.0, float(path[0]), speed, 0.0, 0.0, 0.0], parameters)
    samples = []

    def f(x: Array, k: int) -> Array:
        demand = min(max(driver.gain * (speed - float(x[V_X])), -limit), limit)
        return equations.derivative(x, float(rate[k]), demand, parameters)

    for k in range(n):
        if k % every == 0:
            a_y = equations.lateral(f(x, k), parameters) + x[V_X] * x[YAW_RATE]
            v_y = equations.lateral(x, parameters)
            samples.append((a_y, v_y, x[YAW_RATE], x[V_X], -x[ROLL]))
        x = runge_kutta_step(partial(f, k=k), x, dt)
    return dict(zip(("a_y", "v_y", "r", "v_x", "roll"), np.array(samples).T, strict=True))
