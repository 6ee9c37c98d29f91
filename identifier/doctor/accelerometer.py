"""What an accelerometer says of a motion, beside what the balance of the tires says.

K - g sin β = a_y(t + τ)/c - b - x ṙ,   K = v̇_y + v_x r of the motion without its sensors' faults,
a line over [1, a_y, a_y', ṙ] with the noise of K on its other side: b offset, c factor, τ delay or
low pass, x place ahead of the center of gravity. A body that rolls shows a little more than a_y.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.estimate.drive import SMOOTHED, Drive, box, gradient, thinned
from identifier.estimate.solve import DELAYS, autocorrelation_time
from identifier.motion.model import SENSORS, true_signals
from identifier.motion.parameters import INDEX
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

_FILTERED = 0.25  # [s] of means
_STRIDE = 0.1  # [s] between means
_ERROR = 0.02  # of g, an error of the accelerometer
_RELATIVE = 0.03  # of the acceleration, an error of the accelerometer
_LEAST_SCALE = 0.3  # of the scale of what is missed
_LEAST_MEMORY = 0.25  # [s]

OF_A_Y = ("a_y.offset", "a_y.factor", "a_y.delay", "a_y.place", "a_y.lag")


class Line(NamedTuple):
    """What an accelerometer says of a motion: J [nats], its numbers as `OF_A_Y`, deviations."""

    cost: float
    numbers: Array
    deviations: Array

    def of(self, parameter: str) -> tuple[float, float]:
        k = OF_A_Y.index(parameter)
        value = float(self.numbers[k])
        return 1.0 / value - 1.0 if parameter == "a_y.factor" else value, float(self.deviations[k])


class Accelerometer:
    """a_y over the motion of drives."""

    def __init__(
        self, segments: Sequence[Recording], drives: Sequence[Drive], vehicle: Vehicle
    ) -> None:
        self.drives, L = drives, vehicle.wheelbase
        roll = 0.008 * vehicle.scale  # s, by which weight follows it
        self.mean = np.array([0.0, 0.97, 0.0, 0.0, 0.0])  # a body rolls by 0 to 6 degrees per g
        self.usual = np.array([0.04, 0.03, roll, 0.012 * L, 1e-6])
        self.memory = 0.0
        width = vehicle.scale * SMOOTHED
        self.measured = [
            box(thinned(one.needed("a_y"), drive.every), round(width / drive.dt) | 1)
            for one, drive in zip(segments, drives, strict=True)
        ]
        self._kept = [np.flatnonzero(one.counts[:: _every(one)]) * _every(one) for one in drives]
        self._on_time = self._felt(0.0)

    def _felt(self, late: float) -> list[tuple[Array, Array]]:
        """Return a_y and its slope where they are kept, by drive, a_y being read later."""
        found = []
        for one, measured, kept in zip(self.drives, self.measured, self._kept, strict=True):
            at = np.arange(measured.size)
            felt = box(np.interp(at + late / one.dt, at, measured), _FILTERED / one.dt)
            found.append((felt[kept], gradient(felt, one.dt)[kept]))
        return found

    def line(self, p: Array, wide: Mapping[str, float]) -> Line:
        """Return how well a_y follows from the motion without the sensors' faults p.
        wide : standard deviations, by `OF_A_Y`, of what may be wrong with it.
        """
        sd = np.array([wide.get(name, one) for name, one in zip(OF_A_Y, self.usual, strict=True)])
        late = 0.0
        for _ in range(4 if "a_y.delay" in wide else 1):
            found, moved = self._line(p, sd, late)
            late += moved
        numbers = found.numbers.copy()
        numbers[2] = late
        return found._replace(numbers=numbers)

    def _line(self, p: Array, sd: Array, late: float) -> tuple[Line, float]:
        """Return the line where a_y is read later, and by how much more it is late."""
        y, X, seconds = [], [], 0.0
        felts = self._felt(late) if late else self._on_time
        for one, kept, felt in zip(self.drives, self._kept, felts, strict=True):
            v_x, v_y, r = _motion(one, p)
            count = _FILTERED / one.dt
            K = box(gradient(box(v_y, count / 3), one.dt) + v_x * r, count)[kept]
            turning = gradient(box(r, count), one.dt)[kept]
            y.append(K - GRAVITY * p[INDEX["bank"]])
            X.append(np.column_stack([-np.ones(K.size), *felt, -turning, felt[1]]))
            seconds += kept.size * _every(one) * one.dt
        moved, rows = np.concatenate(y), np.concatenate(X)
        mean = self.mean.copy()
        mean[2] = -late
        S2, w, theta = 1.0, np.ones(moved.size), mean
        n = seconds / max(self.memory, _STRIDE) / moved.size  # of each residual
        for _ in range(5):  # to shrink the motion explains nothing: the size of errors shrinks too
            size = np.hypot(_ERROR * GRAVITY, _RELATIVE * rows[:, 1]) * min(theta[1], 1.0)
            of_size = rows / size[:, None]
            H = n / S2 * (of_size.T * w) @ of_size + np.diag(sd**-2.0)
            g = n / S2 * (of_size.T * w) @ (moved / size - of_size @ mean)
            theta = mean + np.linalg.solve(H, g)
            e = moved / size - of_size @ theta
            w = 5.0 / (4.0 + e**2 / S2)  # Student, 4 degrees
            S2 = max(float(np.mean(w * e**2)), _LEAST_SCALE**2)
        if not self.memory:
            found = autocorrelation_time([np.clip(e, -4.0, 4.0)], _STRIDE, e.size)
            self.memory = max(found, _LEAST_MEMORY)
            n = seconds / self.memory / moved.size
        away = (theta - mean) / sd
        loss = 2.5 * np.log1p(e**2 / (4.0 * S2)).sum() + 0.5 * moved.size * math.log(S2)
        cost = float(n * loss + 0.5 * away @ away)
        return Line(cost, theta, np.sqrt(np.diag(np.linalg.inv(H)))), float(theta[2])


def _every(one: Drive) -> int:
    """Return how many samples a mean is behind the one before."""
    return max(1, round(_STRIDE / one.dt))


def _motion(one: Drive, p: Array) -> tuple[Array, Array, Array]:
    """Return v_x, v_y and r without the sensors' faults, (n,) each."""
    late, q = p[DELAYS], p.copy()
    q[DELAYS] = 0.0
    read = one.on_time(late) if late.any() else one
    signals = [*read.signals[:, :4].T, *read.rates.T]
    v_x, v_y, r, _ = true_signals(signals, [q[INDEX[name]] for name in SENSORS])
    return v_x, v_y, r


def descended(cost: Callable[[float], float], width: float) -> tuple[float, float, float]:
    """Return where a function of one number is least, its curvature there, and its value.
    width : of the parabola that bounds it from below; it begins at 0.
    """
    x, h, here = 0.0, 0.1 * width, cost(0.0)
    curvature = width**-2
    for _ in range(4):
        up, down = cost(x + h), cost(x - h)
        curvature = max((up + down - 2.0 * here) / h**2, width**-2)
        step = min(max((down - up) / (2.0 * h * curvature), -3.0 * width), 3.0 * width)
        for _ in range(3):
            there = cost(x + step)
            if there <= here:
                break
            step /= 3.0
        else:
            break
        x, gained, here = x + step, here - there, there
        h = min(h, max(0.5 * abs(step), 0.5 / math.sqrt(curvature)))
        if gained < 0.1:
            break
    return x, curvature, here
