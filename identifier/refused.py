"""Samples that are refused, and the gap in time that they leave: one rule for Python, C and FMU.

A sample is refused where a number is not finite or beyond what any car reaches (`SampleLimits`). It
counts as time. No sample is refused for a_y, nor for v_y where the method tells it itself: a v_y
that no car reaches is taken for NaN there, as without a sensor. A method that judges samples
itself, whose step carries a gate, is given a sample at `NOWHERE` in place of one that is refused,
which no gate believes: it holds its last one for a moment, then rests. The others rest at the first
sample after the gap, once, before they take it: observers take the measurement and filters begin
anew, as at a start, and what was learnt stays. So no difference over the gap is ever taken for one
over a sampling interval. From `STALE_TIME` on forces read zero.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.vehicle import GRAVITY, Vehicle

_FROUDE = 60.0  # largest speed, in sqrt(g wheelbase): 300 m/s for a sedan
TURN = 4.0  # largest yaw rate, in sqrt(g/wheelbase): 8 rad/s for a sedan
STEERING = 1.5  # rad
WEIGHTS = 5.0  # largest force of an axle, in weights of the car
STALE_TIME = 0.5  # s: a driver's reaction; forces follow steering and yaw within less
NOWHERE = 1e6  # m/s, of no car; its square is a number in float too
GATE = "gate"  # the carried port of a step that judges samples itself


class SampleLimits(NamedTuple):
    """What no car reaches: speed [m/s], yaw rate [rad/s], steering [rad], axle force [N]."""

    speed: float
    yaw_rate: float
    steering: float
    force: float

    @classmethod
    def of(cls, vehicle: Vehicle) -> "SampleLimits":
        return cls(
            speed=_FROUDE * vehicle.froude_speed,
            yaw_rate=TURN * math.sqrt(GRAVITY / vehicle.wheelbase),
            steering=STEERING,
            force=WEIGHTS * vehicle.weight,
        )

    def accept(
        self,
        v_x: float,
        v_y: float,
        r: float,
        delta_f: float,
        delta_r: float,
        *,
        needs_v_y: bool = True,
    ) -> bool:
        """Return whether a sample holds numbers within them; NaN is not.
        v_x : longitudinal speed [m/s].   v_y : lateral velocity [m/s].   r : yaw rate [rad/s].
        delta_f : steering in front [rad].   delta_r : steering at the rear [rad].
        needs_v_y : False accepts any v_y, of which `plausible` is what is left.
        """
        return (
            abs(v_x) <= self.speed
            and (abs(v_y) <= self.speed or not needs_v_y)
            and abs(r) <= self.yaw_rate
            and abs(delta_f) <= self.steering
            and abs(delta_r) <= self.steering
        )

    def plausible(self, v_y: float) -> float:
        """Return a lateral velocity that a car may have [m/s], NaN in place of any other number.
        v_y : as it was measured [m/s].
        """
        return v_y if abs(v_y) <= self.speed else math.nan


def judges_samples(carry: Mapping[str, Any]) -> bool:
    return GATE in carry


def stale_samples(stale_time: float, dt: float) -> int:
    """Return how many refused samples in a row make forces stale, at least one.
    stale_time : [s].   dt : sampling interval [s].
    """
    return max(1, int(stale_time / dt + 0.5))


class _Rests(NamedTuple):
    """Samples with rests between segments, N of them.
    rows : of the recording that each is, at rests the one that follows, (N,).
    resting : whether it is a rest (N,).   at : which of them each sample is (n,).
    """

    rows: NDArray[np.intp]
    resting: NDArray[np.bool_]
    at: NDArray[np.intp]


def with_rests(n: int, breaks: Sequence[int], rest: int) -> _Rests:
    """Return n samples with rests before each segment but the first.
    breaks : samples with which segments begin, rising.
    """
    begins = np.repeat(np.asarray(breaks, dtype=np.intp), rest)
    samples = np.arange(n)
    resting = np.insert(np.zeros(n, dtype=np.bool_), begins, np.ones(begins.size, dtype=np.bool_))
    at = np.flatnonzero(~resting)
    return _Rests(np.insert(samples, begins, begins), resting, at)
