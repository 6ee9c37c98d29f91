"""What driving their two cars has in common: an integration, friction, and forces from motion."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from models.friction import Friction, place_change
from models.vehicle import Vehicle

Array = NDArray[np.float64]


def runge_kutta_step(f: Callable[[Array], Array], x: Array, dt: float) -> Array:
    """Return the state after a classical fourth-order step.

    Parameters
    ----------
    f : derivative of the state, inputs held.
    x : state before.
    dt : step [s].
    """
    k1 = f(x)
    k2 = f(x + 0.5 * dt * k1)
    k3 = f(x + 0.5 * dt * k2)
    return x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + f(x + dt * k3))


def friction_at(friction: Friction, t: float, X: float) -> float:
    """Return the scale [-] under a car, the same for all its wheels.

    Parameters
    ----------
    friction : of the road.
    t : time [s].
    X : where its center of gravity is [m].
    """
    scale = float(friction.over_time(np.array([t]))[0])
    return scale + float(place_change(friction.over_place(), X)) if friction.by_place else scale


def axle_force(vehicle: Vehicle, a_y: float, r_dot: float) -> Array:
    """Return the side forces (2,) [N] that move the car like this: m a_y = ΣF, I_z dr/dt = Σ l F.

    Moments of driving forces are taken for moments of side forces.

    Parameters
    ----------
    vehicle : the car.
    a_y : acceleration of the center of gravity to the left [m/s^2].
    r_dot : yaw acceleration [rad/s^2].
    """
    force, moment = vehicle.mass * a_y, vehicle.yaw_inertia * r_dot
    front = (vehicle.l_r * force + moment) / vehicle.wheelbase
    return np.array([front, force - front])
