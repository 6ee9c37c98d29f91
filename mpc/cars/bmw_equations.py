"""Equations of motion of commonroad-vehicle-models for the BMW: multi-body, and single-track drift.

Multi-body: 29 states, as published or repaired. Repaired on request: their two centers of gravity
(`bmw_parameters`), and their side slip, which adds the velocity of the sprung mass to the roll rate
of the axle and so misses the sway of the axle under the rolling body.
Drift (STD): combined slip, wheels that spin; X, Y, steering, speed, heading, yaw rate, side slip β
of the center of gravity, speeds of the front and the rear wheel.
"""

import math
from collections.abc import Callable
from itertools import count
from types import FunctionType
from typing import Any, Protocol

import numpy as np

from codegen.arrays import Array
from models.vehicle import Vehicle
from mpc.cars.bmw import require_commonroad
from mpc.cars.car import CarState


class Equations(Protocol):
    """Their equations of motion, of a state that only they read."""

    def start(self, core: list[float], parameters: Any) -> Array:
        """Return their state.

        Parameters
        ----------
        core : X, Y, steering, speed, heading, yaw rate, side slip.
        """

    def derivative(self, x: Array, rate: float, demand: float, parameters: Any) -> Array:
        """Return the derivative of their state.

        Parameters
        ----------
        x : their state (n,).
        rate : of the steering [rad/s].
        demand : acceleration asked for [m/s^2].
        """

    def car_state(self, t: float, x: Array, x_dot: Array, inner: Any, parameters: Any) -> CarState:
        """Return the state in our words.

        Parameters
        ----------
        t : time [s].
        x, x_dot : their state and its derivative, (n,).
        """


def axle_force(vehicle: Vehicle, a_y: float, r_dot: float) -> Array:
    """Return the side forces (2,) [N] that move the car like this: m a_y = ΣF, I_z dr/dt = Σ l F.

    Moments of driving forces are taken for moments of side forces.

    Parameters
    ----------
    a_y : acceleration of the center of gravity to the left [m/s^2].
    r_dot : yaw acceleration [rad/s^2].
    """
    force, moment = vehicle.mass * a_y, vehicle.yaw_inertia * r_dot
    front = (vehicle.l_r * force + moment) / vehicle.wheelbase
    return np.array([front, force - front])


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
    """Their equations, and what their state says.

    Raises
    ------
    MissingCommonRoadError
        Where the package is not installed.
    """

    def __init__(self, vehicle: Vehicle, *, repaired: bool = False) -> None:
        require_commonroad()
        from vehiclemodels.init_mb import init_mb
        from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

        self.vehicle = vehicle
        self._repaired = repaired
        self._start, self._dynamics = init_mb, vehicle_dynamics_mb

    def start(self, core: list[float], parameters: Any) -> Array:
        """Return their state, as `Equations`."""
        return np.array(self._start(core, parameters), dtype=np.float64)

    def derivative(self, x: Array, rate: float, demand: float, parameters: Any) -> Array:
        """Return the derivative of their state, as `Equations`.

        Parameters
        ----------
        x : their state (29,).
        """
        dynamics = self._dynamics
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

    def car_state(self, t: float, x: Array, x_dot: Array, inner: Any, parameters: Any) -> CarState:
        """Return the state in our words, as `Equations`.

        Parameters
        ----------
        x, x_dot : their state and its derivative, (29,).
        """
        v_x, r = float(x[V_X]), float(x[YAW_RATE])
        v_y = self.lateral(x, parameters)
        a_y = self.lateral(x_dot, parameters) + v_x * r
        return CarState(
            t=t,
            X=float(x[0]),
            Y=float(x[1]),
            psi=float(x[HEADING]),
            v_x=v_x,
            v_y=v_y,
            r=r,
            delta=float(x[STEERING]),
            a_x=float(x_dot[V_X]) - v_y * r,
            a_y=a_y,
            roll=float(x[ROLL]),
            axle_force=axle_force(self.vehicle, a_y, float(x_dot[YAW_RATE])),
            inner=inner,
        )


# Single track, with tires that slip both ways.


class Drift:
    """Their equations, and what their state says.

    Raises
    ------
    MissingCommonRoadError
        Where the package is not installed.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        require_commonroad()
        from vehiclemodels.init_std import init_std
        from vehiclemodels.vehicle_dynamics_std import vehicle_dynamics_std

        self.vehicle = vehicle
        self._start, self._dynamics = init_std, vehicle_dynamics_std

    def start(self, core: list[float], parameters: Any) -> Array:
        """Return their state, as `Equations`."""
        return np.array(self._start(core, parameters), dtype=np.float64)

    def derivative(self, x: Array, rate: float, demand: float, parameters: Any) -> Array:
        """Return the derivative of their state, as `Equations`.

        Parameters
        ----------
        x : their state (9,).
        """
        # The list is a copy: their function changes the state it is given.
        return np.array(self._dynamics(list(x), [rate, demand], parameters))

    def car_state(self, t: float, x: Array, x_dot: Array, inner: Any, parameters: Any) -> CarState:
        """Return the state in our words, as `Equations`.

        Parameters
        ----------
        x, x_dot : their state and its derivative, (9,).
        """
        del parameters
        X, Y, delta, v, psi, r, beta = (float(value) for value in x[:7])
        v_dot, r_dot, beta_dot = (float(x_dot[k]) for k in (3, 5, 6))
        c, s = math.cos(beta), math.sin(beta)
        v_x, v_y = v * c, v * s
        a_y = v_dot * s + v_x * beta_dot + r * v_x
        return CarState(
            t=t,
            X=X,
            Y=Y,
            psi=psi,
            v_x=v_x,
            v_y=v_y,
            r=r,
            delta=delta,
            a_x=v_dot * c - v_y * beta_dot - r * v_y,
            a_y=a_y,
            roll=0.0,  # a single track has none
            axle_force=axle_force(self.vehicle, a_y, r_dot),
            inner=inner,
        )
