"""The multi-body car of commonroad-vehicle-models: 29 states, as published or repaired.

Repaired on request: their two centers of gravity (`bmw_parameters`), and their side slip, which
adds the velocity of the sprung mass to the roll rate of the axle and so misses the sway of the axle
under the rolling body.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.vehicle import Vehicle
from mpc.cars.car import CarState
from mpc.cars.commonroad.motion import axle_force
from mpc.cars.commonroad.package import require_commonroad

Array = NDArray[np.float64]

# Indices of their state: steering, v_x, heading, yaw rate, roll and its rate; lateral velocity of
# the sprung mass, of the front and of the rear axle.
STEERING, V_X, HEADING, YAW_RATE, ROLL, V_Y, V_Y_FRONT, V_Y_REAR = 2, 3, 4, 5, 6, 10, 15, 20


@contextmanager
def slip_at_the_axles(parameters: Any) -> Iterator[Callable[[Array], None]]:
    """Let their tires slip by the velocity of the axle instead of that of the sprung mass.

    Their tire functions are called for the front pair and then for the rear pair; each is wrapped
    so that it adds what the slip angle lacks. Gives the function to call before each evaluation.

    Parameters
    ----------
    parameters : theirs, with the axle distances a and b.
    """
    from vehiclemodels.utils import tire_model

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


class MultiBody:
    """Their equations, and what their state says.

    Parameters
    ----------
    vehicle : the same car for us.
    repaired : let the tires slip at the axles.

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
        self._slip = slip_at_the_axles if repaired else as_published
        self._start, self._dynamics = init_mb, vehicle_dynamics_mb

    def start(self, core: list[float], parameters: Any) -> Array:
        """Return their state.

        Parameters
        ----------
        core : X, Y, steering, speed, heading, yaw rate, side slip.
        parameters : theirs.
        """
        return np.array(self._start(core, parameters), dtype=np.float64)

    def derivative(self, x: Array, rate: float, demand: float, parameters: Any) -> Array:
        """Return the derivative of their state.

        Parameters
        ----------
        x : their state.
        rate : of the steering [rad/s].
        demand : acceleration asked for [m/s^2].
        parameters : theirs.
        """
        with self._slip(parameters) as prepare:
            prepare(x)
            # The list is a copy: their function changes the state it is given.
            return np.array(self._dynamics(list(x), [rate, demand], parameters))

    def lateral(self, values: Array, parameters: Any) -> float:
        """Return what all masses together have of a lateral velocity or its derivative.

        Parameters
        ----------
        values : their state, or its derivative.
        parameters : theirs.
        """
        p = parameters
        parts = p.m_s * values[V_Y] + p.m_uf * values[V_Y_FRONT] + p.m_ur * values[V_Y_REAR]
        return float(parts / p.m)

    def seen(self, t: float, x: Array, x_dot: Array, inner: Any, parameters: Any) -> CarState:
        """Return the state in our words.

        Parameters
        ----------
        t : time [s].
        x, x_dot : their state and its derivative.
        inner : what the car reads when it goes on.
        parameters : theirs.
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
            axle_force=axle_force(self.vehicle, a_y, float(x_dot[YAW_RATE])),
            inner=inner,
        )
