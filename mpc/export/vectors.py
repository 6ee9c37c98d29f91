"""The self-test of a package: a closed-loop record, and what Python's tracker steered in it."""

from collections import deque
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mpc.motion import state_size
from mpc.prediction import build_stage
from mpc.realtime import Measurement, Tracker
from mpc.tires.reach import ALL

Array = NDArray[np.float64]

STEPS = 200
SPEED = 20.0  # m/s
HEAVIER = 1.08  # mass of the car that is driven, over that of the prediction
LATERAL = 4.0  # m/s^2, peak of what the path asks for
LANE_CHANGE = 1.5  # s
DIGITS = 9
OFF_PATH, OFF_MAP = 120, 140  # steps with faults of the sensors
SLOW = 10  # steps before the end, the road ahead wants a halt at one place
FAULTS: dict[int, dict[str, float]] = {
    OFF_PATH: {"e_y": 9.0},
    OFF_PATH + 1: {"e_psi": -2.0},
    OFF_MAP: {"r": 8.0},
    OFF_MAP + 1: {"v_y": -30.0},
}


class Vectors(NamedTuple):
    """Measurements e_y, e_psi, v_y, r (n, 4), steering [rad] and status (n, 2), road.

    The road is curvature [1/m] and speed [m/s] each period, (m, 2). Step k reads row k as now, and
    row k + offset + stride j as stage j.
    """

    measured: Array
    expected: Array
    road: Array
    offset: int
    stride: int

    def measurement(self, k: int, horizon: int) -> Measurement:
        """Return what the tracker is told at a step.

        Parameters
        ----------
        k : number of the step.
        horizon : number of stages.
        """
        rows = np.append(k, k + self.offset + self.stride * np.arange(horizon))
        e_y, e_psi, v_y, r = map(float, self.measured[k])
        kappa, v_x = self.road[rows].T
        return Measurement(e_y, e_psi, v_y, r, kappa, v_x)


def record(tracker: Tracker, steps: int = STEPS) -> Vectors:
    """Return a drive of a heavier car through a lane change, with faults of the sensors in between.

    Numbers are rounded, and the car is computed without a function of a library: the record does
    not depend on the machine.

    Parameters
    ----------
    tracker : in double; it is reset before, and steers.
    steps : of the tracker.
    """
    tracker.reset()
    problem, period = tracker.problem, tracker.period
    stride = max(1, round(problem.dt / period))
    offset = round(float(tracker.times[1]) / period)
    road = _road(steps + offset + stride * problem.horizon, period)
    road[steps - SLOW + offset + stride * (problem.horizon - 1), 1] = 1.0
    blank = np.zeros((steps, 4)), np.zeros((steps, 2))
    vectors = Vectors(*blank, road, offset, stride)
    car = _Car(tracker)
    for k in range(steps):
        vectors.measured[k] = np.round(car.x[:4], DIGITS)
        for name, value in FAULTS.get(k, {}).items():
            vectors.measured[k, Measurement._fields.index(name)] = value
        command = tracker.step(vectors.measurement(k, problem.horizon))
        vectors.expected[k] = command.steering, int(command.status)
        car.advance(command.steering, road[k, 0], SPEED)
    tracker.reset()
    return vectors


class _Car:
    """The prediction with more mass, which commands reach after whole periods."""

    def __init__(self, tracker: Tracker) -> None:
        tire = tracker.tire
        self.step, self.period, self.weights = build_stage(tire.structure), tracker.period, tire
        self.x = np.zeros(state_size(tire.structure))
        self.x[0] = 0.3
        self.car = tire.car * np.array([HEAVIER, HEAVIER, 1.0, 1.0])
        self.on_the_way = deque([0.0] * round(tracker.delay / tracker.period))

    def advance(self, command: float, kappa: float, v_x: float) -> None:
        self.on_the_way.append(command)
        self.x[4] = self.on_the_way.popleft()
        numbers = (0.0, kappa, v_x, self.period, self.car, self.weights.weights)
        self.x = np.array(self.step(self.x, *numbers, *ALL, ca.DM.zeros(7))[0]).ravel()


def _road(n: int, period: float) -> Array:
    """Return a lane change and its way back, bent by cubics, (n, 2)."""
    t = period * np.arange(n, dtype=np.float64)
    kappa = np.zeros(n)
    for begin, sign in ((0.4, 1.0), (0.4 + LANE_CHANGE, -1.0)):
        z = np.clip((t - begin) / LANE_CHANGE, 0.0, 1.0)
        kappa += sign * (1.0 - 2.0 * z) * z * (1.0 - z)
    kappa *= LATERAL / SPEED**2 / 0.0962  # the largest value of the cubic
    road = np.stack([kappa, SPEED - 0.25 * t], axis=1)
    return road.round(DIGITS)


def vectors_header(found: Vectors) -> str:
    """Return the vectors as a C header.

    Parameters
    ----------
    found : the vectors.
    """
    return (
        "/* Generated. Measurements e_y, e_psi, v_y, r; steering [rad] and status that follow; "
        "curvature\n * and speed each period: row k now, k + offset + stride j in stage j. SI. */\n"
        f"#define VECTORS {len(found.measured)}U\n"
        f"#define VECTOR_OFFSET {found.offset}U\n#define VECTOR_STRIDE {found.stride}U\n\n"
        f"static const double vector_input[VECTORS][4] = {{\n{_rows(found.measured)}}};\n\n"
        f"static const double vector_output[VECTORS][2] = {{\n{_rows(found.expected)}}};\n\n"
        f"static const double vector_road[{len(found.road)}][2] = {{\n{_rows(found.road)}}};\n"
    )


def _rows(table: Array) -> str:
    return "".join(f"    {{ {', '.join(repr(float(v)) for v in row)} }},\n" for row in table)
