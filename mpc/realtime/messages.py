"""What goes into a tracker and what comes out."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Status(IntEnum):
    """What a step did; below QP_FAILED the plan is new, above the steering is a fall-back."""

    OK = 0
    ITERATION_LIMIT = 1
    QP_FAILED = 2
    NOT_FINITE = 3
    OFF_PATH = 4
    OFF_MAP = 5
    TOO_SLOW = 6
    LATE = 7
    BAD_CALL = 8


class Measurement(NamedTuple):
    """The car against the path, and the road ahead.

    e_y [m], e_psi [rad], v_y [m/s], r [rad/s]; curvature [1/m] and speed [m/s] at the tracker's
    times, (N + 1,).
    """

    e_y: float
    e_psi: float
    v_y: float
    r: float
    kappa: Array
    v_x: Array


class Command(NamedTuple):
    """What to steer with the front road wheels [rad], and the plan that it is from.

    status: of `Status`; plan_x (N + 1, n_x), plan_u (N,) [rad/s]; solve_time_s; iterations of the
    solver, zero where it was not asked.
    """

    steering: float
    status: int
    plan_x: Array
    plan_u: Array
    solve_time_s: float
    iterations: int
