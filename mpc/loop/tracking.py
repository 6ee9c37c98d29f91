"""What the loop asks of a tracker, whatever solves its problem."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mpc.realtime.messages import Command, Measurement

Array = NDArray[np.float64]


class PathTracker(Protocol):
    """Steers a car along a path, one control period at a time; `mpc.realtime.Tracker` is one."""

    @property
    def period(self) -> float:
        """Control period [s]."""

    @property
    def times(self) -> Array:
        """Times after the measurement at which it wants to know the road [s], (k,)."""

    @property
    def plan_times(self) -> Array:
        """Times after the measurement of the states of its plan [s], (N + 1,)."""

    def step(self, measurement: Measurement) -> Command:
        """Return what to steer.

        Parameters
        ----------
        measurement : the car against the path, and the road ahead.
        """

    def reset(self) -> None:
        """Forget what was planned and steered."""
