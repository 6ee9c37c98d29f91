"""The multi-body car of commonroad-vehicle-models, 29 states, published or repaired.

Repaired on request: their two centers of gravity (`bmw_parameters`), and their side slip, which
adds the velocity of the sprung mass to the roll rate of the axle and so misses the sway of the axle
under the rolling body.
"""

from collections.abc import Callable
from functools import partial
from itertools import count
from types import FunctionType
from typing import Any

import numpy as np
from vehiclemodels.init_mb import init_mb
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

from codegen.arrays import Array
from models.maneuvers import Maneuver
from models.plant import Driver

# Indices of the multi-body state: steering, v_x, heading, yaw rate, roll; lateral velocity of the
# sprung mass, of the front and of the rear axle.
STEERING, V_X, HEADING, YAW_RATE, ROLL, V_Y, V_Y_FRONT, V_Y_REAR = 2, 3, 4, 5, 6, 10, 15, 20


class SlipAtTheAxles:
    """Their tire functions, with the slip by the velocity of the axle, not of the sprung mass.

    Their program calls each for the front pair and then for the rear pair; what the slip angle
    lacks is added to what it gives.

    Parameters
    ----------
    x : their state (29,).
    """

    def __init__(self, tires: Any, x: Array, parameters: Any) -> None:
        p = parameters
        self._lacking = (
            (x[V_Y_FRONT] - x[V_Y] - p.a * x[YAW_RATE]) / x[V_X],
            (x[V_Y_REAR] - x[V_Y] + p.b * x[YAW_RATE]) / x[V_X],
        )
        self.formula_longitudinal = tires.formula_longitudinal
        self.formula_lateral = self._shifted(tires.formula_lateral, 0)
        self.formula_longitudinal_comb = self._shifted(tires.formula_longitudinal_comb, 1)
        self.formula_lateral_comb = self._shifted(tires.formula_lateral_comb, 1)

    def _shifted(self, formula: Callable[..., Any], place: int) -> Callable[..., Any]:
        """Return a formula whose argument at a place, the slip angle, is that of the axle."""
        calls = count()

        def shifted(*arguments: Any) -> Any:
            values = list(arguments)
            values[place] += self._lacking[next(calls) % 4 // 2]
            return formula(*values)

        return shifted


def with_tires(dynamics: Callable[..., Any], tires: object) -> Callable[..., Any]:
    """Return their equations on other tire functions: the same code, in a namespace of its own.

    Parameters
    ----------
    dynamics : their function, which calls its tires `tireModel`; it stays as it is.
    """
    return FunctionType(dynamics.__code__, {**dynamics.__globals__, "tireModel": tires})


class MultiBody:
    """Their equations, and what their state says."""

    def __init__(self, *, repaired: bool = False) -> None:
        self._repaired = repaired

    def start(self, core: list[float], parameters: Any) -> Array:
        """Return their state (29,).

        Parameters
        ----------
        core : X, Y, steering, speed, heading, yaw rate, side slip.
        """
        return np.array(init_mb(core, parameters), dtype=np.float64)

    def derivative(self, x: Array, rate: float, demand: float, parameters: Any) -> Array:
        """Return the derivative of their state.

        Parameters
        ----------
        x : their state (29,).
        rate : of the steering [rad/s].
        demand : acceleration asked for [m/s^2].
        """
        dynamics = vehicle_dynamics_mb
        if self._repaired:
            tires = SlipAtTheAxles(dynamics.__globals__["tireModel"], x, parameters)
            dynamics = with_tires(dynamics, tires)
        # The list is a copy: their function changes the state it is given.
        return np.array(dynamics(list(x), [rate, demand], parameters))

    def lateral(self, values: Array, parameters: Any) -> float:
        """Return what all masses together have of a lateral velocity or its derivative.

        Parameters
        ----------
        values : their state, or its derivative, (29,).
        """
        p = parameters
        parts = p.m_s * values[V_Y] + p.m_uf * values[V_Y_FRONT] + p.m_ur * values[V_Y_REAR]
        return float(parts / p.m)


def runge_kutta_step(f: Callable[[Array], Array], x: Array, dt: float) -> Array:
    """Return the state after a classical fourth-order step, inputs held.

    Parameters
    ----------
    x : state before (n,).
    dt : step [s].
    """
    k1 = f(x)
    k2 = f(x + 0.5 * dt * k1)
    k3 = f(x + 0.5 * dt * k2)
    return x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + f(x + dt * k3))


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
