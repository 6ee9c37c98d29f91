"""What a tire is to the prediction: a structure of formulas, and numbers that fill it at run time.

v_y [m/s], r [rad/s] and δ of the front wheel [rad] make slip angles α = δ - (v_y ± l r)/v_x in the
paper's sign, the negative of ISO 8855, and slip makes lateral axle forces F = +C α [N] in the frame
of the body. Only the structure is compiled; the car and the weights are read while driving.
"""

from typing import Any, NamedTuple, Protocol, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from models.vehicle import Vehicle

Array = NDArray[np.float64]
Pair: TypeAlias = tuple[Any, Any]  # front, rear: SX expressions or numbers


class Car(NamedTuple):
    """What the equations of motion read: m [kg], I_z [kg m²], l_f and l_r [m]."""

    m: Any
    I_z: Any
    l_f: Any
    l_r: Any


class Point(NamedTuple):
    """Where a tire is asked: v_y [m/s], r [rad/s], δ in front [rad], v_x > 0 [m/s], car, w."""

    v_y: Any
    r: Any
    delta: Any
    v_x: Any
    car: Car
    w: Any


class PredictionTire(Protocol):
    """Formulas of the axle forces, hashable and equal where they compile to the same code.

    Written with `ca.tanh`, `ca.atan` and the like: the stage replaces them by our own, after it has
    taken the derivatives.
    """

    def __hash__(self) -> int: ...

    @property
    def n_weights(self) -> int:
        """Numbers in w."""

    @property
    def lagged(self) -> bool:
        """Whether force follows a lagged slip, two more states [rad]."""

    def slip(self, at: Point) -> Pair:
        """Return the kinematic slip angles [rad], paper's sign.

        Parameters
        ----------
        at : motion, car and weights.
        """

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body.

        Parameters
        ----------
        slip : what makes the force [rad]: lagged slip where `lagged`, else the kinematic one.
        at : motion, car and weights.
        """

    def lag_length(self, slip: Pair, at: Point) -> Pair:
        """Return the relaxation lengths [m]; asked only where `lagged`.

        Parameters
        ----------
        slip : lagged slip [rad].
        at : motion, car and weights.
        """


class TireModel(NamedTuple):
    """A structure with its weights (n_weights,), and the car that they are of."""

    structure: PredictionTire
    weights: Array
    vehicle: Vehicle

    @property
    def car(self) -> Array:
        """The numbers of `Car`, (4,)."""
        return np.array(self.vehicle.bicycle[:4])


def wheel_slip(self: PredictionTire, at: Point) -> Pair:
    """Return α = δ - atan((v_y ± l r)/v_x) [rad]; the rear wheels do not steer. A method `slip`.

    Parameters
    ----------
    at : motion and car.
    """
    del self
    v_y, r, delta, v_x, car, _ = at
    per_speed = 1 / v_x
    front = delta - ca.atan((v_y + car.l_f * r) * per_speed)
    return front, -ca.atan((v_y - car.l_r * r) * per_speed)


def small_slip(self: PredictionTire, at: Point) -> Pair:
    """Return α = δ - (v_y ± l r)/v_x [rad], as the paper's (3) has it. A method `slip`.

    Parameters
    ----------
    at : motion and car.
    """
    del self
    v_y, r, delta, v_x, car, _ = at
    per_speed = 1 / v_x
    return delta - (v_y + car.l_f * r) * per_speed, -(v_y - car.l_r * r) * per_speed


def no_lag(self: PredictionTire, slip: Pair, at: Point) -> Pair:
    """Return 0 m: force follows slip at once. A method `lag_length`.

    Parameters
    ----------
    slip : not looked at.
    at : not looked at.
    """
    del self, slip, at
    return 0.0, 0.0
