"""What a driving car measures of itself, sample by sample."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple, Protocol

import numpy as np

from models.faults import FaultError, SensorFault
from models.sensors import Sensor, SensorError
from mpc.cars.car import CarState

EXACT = Sensor()


class Measured(NamedTuple):
    """One sample, SI."""

    t: float
    X: float
    Y: float
    psi: float
    v_x: float
    v_y: float
    r: float
    delta: float
    a_y: float


class Measures(Protocol):
    """What a loop measures a car with."""

    def measure(self, state: CarState, rng: np.random.Generator) -> Measured:
        """Return what is measured at one instant.

        Parameters
        ----------
        state : the truth.
        rng : source of the noise.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class CarSensors:
    """The sensors of a car, one for each channel; the defaults are exact.

    Parameters
    ----------
    X, Y : position [m].
    psi : heading [rad].
    v_x, v_y : speed over ground [m/s].
    r : yaw rate [rad/s].
    delta : angle of the front road wheels [rad].
    a_y : lateral acceleration [m/s^2].

    Raises
    ------
    SensorError
        For a sensor with a delay of its own: the delay of the loop is that of its command.
    """

    X: Sensor = EXACT
    Y: Sensor = EXACT
    psi: Sensor = EXACT
    v_x: Sensor = EXACT
    v_y: Sensor = EXACT
    r: Sensor = EXACT
    delta: Sensor = EXACT
    a_y: Sensor = EXACT

    def __post_init__(self) -> None:
        for field in fields(self):
            delay = getattr(self, field.name).delay
            if delay != 0.0:
                raise SensorError(f"{field.name}: a delay belongs to the loop, not to its sensors")

    def measure(self, state: CarState, rng: np.random.Generator) -> Measured:
        """Return what is measured at one instant.

        Parameters
        ----------
        state : the truth.
        rng : source of the noise; drawn from even without noise, so that channels stay in step.
        """
        noise = rng.standard_normal(len(fields(self)))
        values = []
        for field, draw in zip(fields(self), noise, strict=True):
            sensor: Sensor = getattr(self, field.name)
            value = getattr(state, field.name) + sensor.bias + sensor.noise * float(draw)
            if sensor.resolution > 0.0:
                value = sensor.resolution * round(value / sensor.resolution)
            values.append(value)
        return Measured(state.t, *values)


def inertial_unit() -> CarSensors:
    """Return sensors as test cars carry them: satellite position and inertial unit, coupled.

    Noise as data sheets of coupled receivers with correction data state it: 2 cm, 0.002 rad,
    0.03 m/s and 0.003 rad/s.
    """
    return CarSensors(
        X=Sensor(noise=0.02),
        Y=Sensor(noise=0.02),
        psi=Sensor(noise=0.002),
        v_x=Sensor(noise=0.03),
        v_y=Sensor(noise=0.03),
        r=Sensor(noise=0.003),
        delta=Sensor(noise=0.0005),
        a_y=Sensor(noise=0.1),
    )


class FaultySensors:
    """Sensors of which some channels break for some time; a stuck one shows its last good value.

    Parameters
    ----------
    sensors : the good ones.
    faults : what breaks, where channels are those of `Measured`.

    Raises
    ------
    FaultError
        For a channel that is not measured.
    """

    def __init__(self, sensors: CarSensors, faults: Sequence[SensorFault]) -> None:
        for fault in faults:
            if fault.channel not in Measured._fields[1:]:
                channels = ", ".join(Measured._fields[1:])
                raise FaultError(f"channel must be one of {channels}, it is {fault.channel!r}")
        self._sensors, self._faults = sensors, tuple(faults)
        self._good: Measured | None = None

    def measure(self, state: CarState, rng: np.random.Generator) -> Measured:
        """Return what is measured at one instant, calls in the order of time.

        Parameters
        ----------
        state : the truth.
        rng : source of the noise; of a fault's own noise too, so that it changes no other draw.
        """
        shown = self._sensors.measure(state, rng)
        held = self._good if self._good is not None else shown
        good = shown
        for fault in self._faults:
            name = fault.channel
            if fault.active(state.t):
                own = np.random.default_rng(round(1e6 * state.t)).standard_normal()
                value = fault.shown(state.t, getattr(shown, name), getattr(held, name), own)
                shown = shown._replace(**{name: float(value)})
                good = good._replace(**{name: getattr(held, name)})
        self._good = good
        return shown
