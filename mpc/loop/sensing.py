"""What a driving car measures of itself, sample by sample, and sees of the path before it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from models.faults import FaultError, SensorFault
from models.sensors import Sensor, SensorError
from models.vehicle import GRAVITY
from mpc.cars import CarState

_BIAS_A_Y = 0.05  # m/s²: standard deviation from one unit to the next
_BIAS_R = 0.001  # rad/s: standard deviation from one unit to the next

_EXACT = Sensor()


class Measured(NamedTuple):
    """One sample, SI; NaN where there is no such sensor."""

    t: float
    X: float
    Y: float
    psi: float
    v_x: float
    v_y: float
    r: float
    delta: float
    a_y: float


_CHANNELS = Measured._fields[1:]


@dataclass(frozen=True, slots=True, kw_only=True)
class CarSensors:
    """The sensors of a car, one for each channel; the defaults are exact.
    X, Y : position [m].
    psi : heading [rad].
    v_x, v_y : speed over ground [m/s]; v_y None where nothing measures it.
    r : yaw rate [rad/s].
    delta : angle of the front road wheels [rad].
    a_y : lateral acceleration [m/s^2].
    body_fixed : whether the accelerometer rolls with the body and feels gravity then; else a_y is
        in the plane of the road.
    """

    X: Sensor = _EXACT
    Y: Sensor = _EXACT
    psi: Sensor = _EXACT
    v_x: Sensor = _EXACT
    v_y: Sensor | None = _EXACT
    r: Sensor = _EXACT
    delta: Sensor = _EXACT
    a_y: Sensor = _EXACT
    body_fixed: bool = False

    def __post_init__(self) -> None:
        for name in self.channels:
            if getattr(self, name).delay != 0.0:
                raise SensorError(f"{name}: a delay belongs to the loop, not to its sensors")

    @property
    def channels(self) -> tuple[str, ...]:
        """What there is a sensor for, in the order of `Measured`."""
        return tuple(name for name in _CHANNELS if getattr(self, name) is not None)

    def measure(self, state: CarState, rng: np.random.Generator) -> Measured:
        """Return what is measured at one instant.

        rng : source of the noise; drawn from even without noise, so that channels stay in step.
        """
        noise = rng.standard_normal(len(_CHANNELS))
        values = []
        for name, draw in zip(_CHANNELS, noise, strict=True):
            sensor: Sensor | None = getattr(self, name)
            if sensor is None:
                values.append(math.nan)
                continue
            value = getattr(state, name)
            if name == "a_y" and self.body_fixed:
                value = value * math.cos(state.roll) + GRAVITY * math.sin(state.roll)
            value = value + sensor.bias + sensor.noise * float(draw)
            if sensor.resolution > 0.0:
                value = sensor.resolution * round(value / sensor.resolution)
            values.append(value)
        return Measured(state.t, *values)


def inertial_unit(size: float = 1.0) -> CarSensors:
    """Return sensors as test cars carry them: satellite position and inertial unit, coupled.

    Noise as data sheets of coupled receivers with correction data state it: 2 cm, 0.002 rad,
    0.03 m/s and 0.003 rad/s.
    size : of the car, of `mpc.problem.size_of`: of a model car positions are measured as in a lab,
        1 mm and 0.01 m/s at 1:10.
    """
    place, speed = Sensor(noise=0.02 * size), Sensor(noise=0.03 * size**0.5)
    return CarSensors(
        X=place,
        Y=place,
        psi=Sensor(noise=0.002),
        v_x=speed,
        v_y=speed,
        r=Sensor(noise=0.003),
        delta=Sensor(noise=0.0005),
        a_y=Sensor(noise=0.1),
    )


def imu_and_localization(rng: np.random.Generator | None, size: float = 1.0) -> CarSensors:
    """Return the sensors of a car without v_y: inertial unit, wheel speed, steering, localization.

    As noisy as those of `inertial_unit`: position 2 cm, heading 0.002 rad, wheel speed 0.03 m/s,
    yaw rate 0.003 rad/s, acceleration 0.1 m/s², steering 0.5 mrad, new at every sample. Yaw rate
    and acceleration are biased, and the accelerometer is fixed to the body and rolls with it.

    rng : draws the biases, of 0.001 rad/s and 0.05 m/s² standard deviation; None takes sensors
    without noise and bias.   size : as of `inertial_unit`.
    """
    if rng is None:
        return CarSensors(v_y=None, body_fixed=True)
    same, (bias_r, bias_a_y) = inertial_unit(size), rng.normal(0.0, [_BIAS_R, _BIAS_A_Y])
    return replace(
        same,
        v_y=None,
        r=replace(same.r, bias=float(bias_r)),
        a_y=replace(same.a_y, bias=float(bias_a_y)),
        body_fixed=True,
    )


class FaultySensors:
    """Sensors of which some channels break for some time; a stuck one shows its last good value.
    faults : what breaks, where channels are those of `Measured`.
    """

    def __init__(self, sensors: CarSensors, faults: Sequence[SensorFault]) -> None:
        for fault in faults:
            if fault.channel not in sensors.channels:
                channels = ", ".join(sensors.channels)
                raise FaultError(f"channel must be one of {channels}, it is {fault.channel!r}")
        self._sensors, self._faults = sensors, tuple(faults)
        self._good: Measured | None = None

    def measure(self, state: CarState, rng: np.random.Generator) -> Measured:
        """Return what is measured at one instant, calls in the order of time.

        rng : source of the noise; of a fault's own noise too, so that it changes no other draw.
        """
        measured = self._sensors.measure(state, rng)
        last_good = self._good if self._good is not None else measured
        good = measured
        for fault in self._faults:
            name = fault.channel
            if fault.active(state.t):
                noise = np.random.default_rng(round(1e6 * state.t)).standard_normal()
                value = fault.measured(
                    state.t, getattr(measured, name), getattr(last_good, name), noise
                )
                measured = measured._replace(**{name: float(value)})
                good = good._replace(**{name: getattr(last_good, name)})
        self._good = good
        return measured


Measures: TypeAlias = CarSensors | FaultySensors  # what a loop measures a car with
