"""The single-track drift car of commonroad-vehicle-models (STD): combined slip, wheels that spin.

Its states: X, Y, steering, speed, heading, yaw rate, side slip β of the center of gravity, speeds
of the front and the rear wheel.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.vehicle import Vehicle
from mpc.cars.car import CarState
from mpc.cars.commonroad.motion import axle_force
from mpc.cars.commonroad.package import require_commonroad

Array = NDArray[np.float64]


class Drift:
    """Their equations, and what their state says.

    Parameters
    ----------
    vehicle : the same car for us.

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
        # The list is a copy: their function changes the state it is given.
        return np.array(self._dynamics(list(x), [rate, demand], parameters))

    def seen(self, t: float, x: Array, x_dot: Array, inner: Any, parameters: Any) -> CarState:
        """Return the state in our words.

        Parameters
        ----------
        t : time [s].
        x, x_dot : their state and its derivative.
        inner : what the car reads when it goes on.
        parameters : theirs, not needed.
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
            axle_force=axle_force(self.vehicle, a_y, r_dot),
            inner=inner,
        )
