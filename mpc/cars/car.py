"""What every car that can be driven has in common: a state, and a step of one control period."""

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from models.friction import Friction
from models.tires import Tire
from models.vehicle import Vehicle

Array = NDArray[np.float64]


class CarState(NamedTuple):
    """The truth about a car at one instant, SI, ISO axes; nothing changes it."""

    t: float
    """Time since the start [s]."""
    X: float
    """Position of the center of gravity [m]."""
    Y: float
    """Position of the center of gravity [m]."""
    psi: float
    """Heading, not wrapped [rad]."""
    v_x: float
    """Velocity of the center of gravity along the body [m/s]."""
    v_y: float
    """Velocity of the center of gravity to the left [m/s]."""
    r: float
    """Yaw rate [rad/s]."""
    delta: float
    """Actual angle of the front road wheels [rad]."""
    a_x: float
    """Acceleration of the center of gravity along the body [m/s^2]."""
    a_y: float
    """Acceleration of the center of gravity to the left, dv_y/dt + v_x r [m/s^2]."""
    axle_force: Array
    """Side force of the front and the rear axle, frame of the body, (2,) [N]."""
    inner: Any
    """What only the car itself reads."""


class Car(Protocol):
    """A car that is driven by steering angle and wanted speed, one period at a time."""

    @property
    def vehicle(self) -> Vehicle:
        """The car as a controller is told of it."""

    @property
    def tire(self) -> Tire:
        """What is mounted on its wheels: what only an oracle is told."""

    @property
    def friction(self) -> Friction:
        """Friction of the road over the tire's own."""

    @property
    def period(self) -> float:
        """For which the inputs are held [s]."""

    @property
    def speed_gain(self) -> float:
        """Acceleration that the driver asks for, per error of the speed [1/s]."""

    def start(self, v_x: float, *, X: float = 0.0, Y: float = 0.0, psi: float = 0.0) -> CarState:
        """Return the car rolling straight ahead.

        Parameters
        ----------
        v_x : speed [m/s].
        X, Y : position of the center of gravity [m].
        psi : heading [rad].
        """

    def step(self, state: CarState, command: float, v_ref: float) -> CarState:
        """Return the car one period later.

        Parameters
        ----------
        state : now.
        command : angle asked of the front road wheels [rad].
        v_ref : wanted speed [m/s].

        Raises
        ------
        ArithmeticError
            When the car left the range of its equations.
        """
