"""Sensors as data: what noise, bias, delay and resolution do to an exact recording, and what is
no number of a sensor at all.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from models.recordings import Recording

# What a sensor can show at all: beyond it, and NaN, is no number of a sensor.
LARGEST_MEASURED: Mapping[str, float] = {
    "X": 1e7,  # m: maps count up to the distance from the equator to a pole
    "Y": 1e7,
    "psi": 1e4,  # rad, turns counted
    "v_x": 300.0,  # m/s
    "v_y": 300.0,
    "r": 10.0,  # rad/s
    "delta": 2.0,  # rad
    "a_y": 500.0,  # m/s²: a crash
}


class SensorError(TireidError, ValueError):
    """A number of a sensor breaks a rule; the message names it, the rule and the value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """One channel; the signal is delayed, then biased, then noisy, then rounded.
    noise : standard deviation of white Gaussian noise, in the unit of the signal.
    delay : the signal comes this much later [s], by interpolation; before, its first value holds.
    resolution : step of the quantization, in the unit of the signal; 0 for none.
    """

    noise: float = 0.0
    bias: float = 0.0
    delay: float = 0.0
    resolution: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not math.isfinite(value):
                raise SensorError(f"{field.name} must be finite, it is {value}")
            if field.name != "bias" and value < 0.0:
                raise SensorError(f"{field.name} must not be negative, it is {value}")

    def measure(self, t: Array, signal: Array, rng: np.random.Generator) -> Array:
        """Return what the sensor makes of a signal (n,).
        t : time [s], (n,).   signal : the exact signal, (n,).
        rng : source of the noise; drawn from even without noise, so that channels stay in step.
        """
        measured = np.interp(t - self.delay, t, signal) if self.delay > 0.0 else signal
        measured = measured + self.bias + self.noise * rng.standard_normal(len(t))
        if self.resolution > 0.0:
            measured = self.resolution * np.round(measured / self.resolution)
        return measured


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """The sensors of a car; a channel left out is exact.
    v_x, v_y : speed over ground [m/s].   r : yaw rate [rad/s].
    delta : steering angle [rad], of each axle that steers.
    """

    v_x: Sensor = Sensor()
    v_y: Sensor = Sensor()
    r: Sensor = Sensor()
    delta: Sensor = Sensor()

    def apply(self, recording: Recording, rng: np.random.Generator) -> Recording:
        """Return the recording as these sensors would have taken it; its force truth stays exact.
        rng : source of the noise; the same generator state gives the same noise.
        """
        t = recording.t
        rear = recording.delta_r
        return replace(
            recording,
            v_x=self.v_x.measure(t, recording.v_x, rng),
            v_y=None if recording.v_y is None else self.v_y.measure(t, recording.v_y, rng),
            r=self.r.measure(t, recording.r, rng),
            delta_f=self.delta.measure(t, recording.delta_f, rng),
            delta_r=self.delta.measure(t, rear, rng) if np.any(rear != 0.0) else rear,
        )


def is_measured(channel: str, value: float) -> bool:
    """Return whether a channel shows a number.
    channel : one of `LARGEST_MEASURED`.   value : in its SI unit.
    """
    return abs(value) <= LARGEST_MEASURED[channel]
