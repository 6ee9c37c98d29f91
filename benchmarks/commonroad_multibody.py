"""Driving the multi-body car of commonroad-vehicle-models, as published or repaired."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vehiclemodels.init_mb import init_mb
from vehiclemodels.utils import tire_model
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

from models.maneuvers import Maneuver
from models.plant import Driver

Array = NDArray[np.float64]

# Indices of their state: v_x, yaw rate, roll and its rate; lateral velocity of the sprung mass, of
# the front and of the rear axle.
V_X, YAW_RATE, ROLL, V_Y, V_Y_FRONT, V_Y_REAR = 3, 5, 6, 10, 15, 20


@contextmanager
def slip_at_the_axles(parameters: Any) -> Iterator[Callable[[Array], None]]:
    """Let their tires slip by the velocity of the axle instead of that of the sprung mass.

    Their tire functions are called for the front pair and then for the rear pair; each is wrapped
    so that it adds what the slip angle lacks. Gives the function to call before each evaluation.

    Parameters
    ----------
    parameters : theirs, with the axle distances a and b.
    """
    lacking = [0.0, 0.0]
    names = {"formula_lateral": 0, "formula_longitudinal_comb": 1, "formula_lateral_comb": 1}
    originals = {name: getattr(tire_model, name) for name in names}
    calls = dict.fromkeys(names, 0)

    def wrapped(name: str) -> Callable[..., Any]:
        def shifted(*arguments: Any) -> Any:
            axle = calls[name] % 4 // 2
            calls[name] += 1
            values = list(arguments)
            values[names[name]] += lacking[axle]
            return originals[name](*values)

        return shifted

    def prepare(x: Array) -> None:
        p = parameters
        lacking[0] = (x[V_Y_FRONT] - x[V_Y] - p.a * x[YAW_RATE]) / x[V_X]
        lacking[1] = (x[V_Y_REAR] - x[V_Y] + p.b * x[YAW_RATE]) / x[V_X]

    try:
        for name in names:
            setattr(tire_model, name, wrapped(name))
        yield prepare
    finally:
        for name, original in originals.items():
            setattr(tire_model, name, original)


@contextmanager
def as_published(parameters: Any) -> Iterator[Callable[[Array], None]]:  # noqa: ARG001
    """Leave their program as it is.

    Parameters
    ----------
    parameters : theirs, not needed.
    """
    yield lambda x: None  # noqa: ARG005


def drive(
    parameters: Any,
    maneuver: Maneuver,
    *,
    speed: float,
    driver: Driver,
    repaired: bool,
    dt: float = 1e-3,
    every: int = 10,
) -> dict[str, Array]:
    """Drive their car with classical Runge-Kutta steps.

    Parameters
    ----------
    parameters : theirs.
    maneuver : the steering; the angle follows it exactly, by its rate.
    speed : held by a proportional driver [m/s].
    driver : its gain and limit.
    repaired : let the tires slip at the axles.
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
    x = np.array(init_mb([0.0, 0.0, path[0], speed, 0.0, 0.0, 0.0], parameters))
    lateral = [V_Y, V_Y_FRONT, V_Y_REAR]
    masses = np.array([parameters.m_s, parameters.m_uf, parameters.m_ur]) / parameters.m
    samples = []
    with (slip_at_the_axles if repaired else as_published)(parameters) as prepare:

        def f(x: Array, k: int) -> Array:
            prepare(x)
            demand = min(max(driver.gain * (speed - x[V_X]), -limit), limit)
            # The list is a copy: their function changes the state it is given.
            return np.array(vehicle_dynamics_mb(list(x), [rate[k], demand], parameters))

        for k in range(n):
            k1 = f(x, k)
            if k % every == 0:
                a_y = masses @ k1[lateral] + x[V_X] * x[YAW_RATE]
                samples.append((a_y, masses @ x[lateral], x[YAW_RATE], x[V_X], -x[ROLL]))
            k2 = f(x + 0.5 * dt * k1, k)
            k3 = f(x + 0.5 * dt * k2, k)
            x = x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + f(x + dt * k3, k))
    return dict(zip(("a_y", "v_y", "r", "v_x", "roll"), np.array(samples).T, strict=True))
