"""Faults that the doctor names, at random, one of each kind: sizes that matter, and gross ones.

Sizes are those of a sedan and grow with a car by Froude's similarity, as in `fault_cases`; they are
spread evenly over their logarithm, with either sign.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from benchmarks.fault_cases import Case, Scale, StraightOnly, other_car
from benchmarks.faults import (
    AnotherCar,
    Bank,
    ClockJump,
    Fault,
    Held,
    Jitter,
    Lagging,
    Late,
    Mirrored,
    Misaligned,
    SensorElsewhere,
    ShiftedCenter,
    Together,
    WrongNumber,
    WrongUnit,
)
from benchmarks.random_cars import good_sensors
from identifier.doctor.readings import DEGREE
from models.faults import SensorFault
from models.recordings import Recording
from models.vehicle import Vehicle

Right = tuple[tuple[str, str], ...]  # codes and channels of findings that are right, "" for any


class Planted(NamedTuple):
    """A fault, how a finding calls it, and its size as a finding tells it; NaN where none is."""

    case: Case
    code: str
    channel: str
    size: float

    @property
    def right(self) -> Right:
        """How it may be called."""
        return ((self.code, self.channel),)


Plant = Callable[[Vehicle, float], Planted]  # of a car and a size of a sedan, with sign


def _of(make: Callable[[float], Fault], code: str, channel: str, unit: str = "") -> Plant:
    """A fault whose size grows with a unit of the car."""

    def plant(vehicle: Vehicle, size: float) -> Planted:
        by = Scale.of(vehicle)._asdict()
        size *= {"": 1.0, "rate": 1.0 / by["time"], **by}[unit]
        return Planted(Case(make(size)), code, channel, size)

    return plant


def _offset(channel: str, unit: str) -> Plant:
    def make(size: float) -> Fault:
        return SensorFault(channel=channel, kind="biased", size=size)

    return _of(make, "offset", channel, unit)


def _factor(channel: str) -> Plant:
    def plant(_: Vehicle, size: float) -> Planted:
        fault = SensorFault(channel=channel, kind="scaled", size=math.exp(size))
        return Planted(Case(fault), "factor", channel, math.exp(size))

    return plant


def _late(channel: str) -> Plant:
    return _of(lambda size: Late(channels=(channel,), delay=size), "delay", channel, "time")


def _lagging(channel: str) -> Plant:
    return _of(
        lambda size: Lagging(channels=(channel,), time_constant=size), "lag", channel, "time"
    )


def _elsewhere(sensor: str, code: str, channel: str) -> Plant:
    return _of(lambda size: SensorElsewhere(sensor=sensor, x=size), code, channel, "length")


def _center(vehicle: Vehicle, size: float) -> Planted:
    told = ShiftedCenter(share=size)
    return Planted(Case(told=told), "center_of_gravity", "", size * vehicle.wheelbase)


def _inertia(_: Vehicle, size: float) -> Planted:
    told = WrongNumber(field="yaw_inertia", factor=math.exp(size))
    return Planted(Case(told=told), "yaw_inertia", "", math.exp(size))


def _bank(vehicle: Vehicle, size: float) -> Planted:
    return Planted(Case(Bank(vehicle=vehicle, angle=size)), "bank", "", size)


# By name: how it is planted, from what size to what, and whether it has a sign.
KINDS: Mapping[str, tuple[Plant, float, float, bool]] = {
    "offset v_y": (_offset("v_y", "speed"), 0.1, 0.5, True),
    "offset r": (_offset("r", "rate"), 0.01, 0.05, True),
    "offset a_y": (_offset("a_y", ""), 0.2, 1.0, True),
    "offset delta_f": (_offset("delta_f", ""), 0.4 * DEGREE, 2.0 * DEGREE, True),
    "factor v_x": (_factor("v_x"), 0.05, 0.3, True),
    "factor delta_f": (_factor("delta_f"), 0.1, 0.4, True),
    "factor a_y": (_factor("a_y"), 0.05, 0.3, True),
    "delay v_y": (_late("v_y"), 0.03, 0.2, False),
    "delay r": (_late("r"), 0.03, 0.2, False),
    "delay delta_f": (_late("delta_f"), 0.04, 0.2, False),
    "delay a_y": (_late("a_y"), 0.03, 0.2, False),
    "lag v_y": (_lagging("v_y"), 0.05, 0.3, False),
    "lag r": (_lagging("r"), 0.05, 0.3, False),
    "lag delta_f": (_lagging("delta_f"), 0.05, 0.3, False),
    "lag a_y": (_lagging("a_y"), 0.05, 0.3, False),
    "misaligned": (
        _of(lambda size: Misaligned(angle=size), "velocity_sensor_angle", "v_y"),
        0.5 * DEGREE, 3.0 * DEGREE, True,
    ),
    "velocity sensor": (_elsewhere("velocity", "velocity_sensor_x", "v_y"), 0.2, 1.5, True),
    "accelerometer": (
        _elsewhere("accelerometer", "acceleration_sensor_x", "a_y"), 0.2, 1.5, True,
    ),
    "center of gravity": (_center, 0.12, 0.2, True),
    "yaw inertia": (_inertia, 0.4, 2.0, True),
    "bank": (_bank, 1.0 * DEGREE, 4.0 * DEGREE, True),
}  # fmt: skip


def planted(kind: str, vehicle: Vehicle, rng: np.random.Generator) -> Planted:
    """Return a fault of a kind.

    Parameters
    ----------
    kind : one of `KINDS`.
    vehicle : that drives, told rightly.
    rng : source of the size.
    """
    plant, least, most, signed = KINDS[kind]
    size = math.exp(rng.uniform(math.log(least), math.log(most)))
    sign = float(rng.choice([-1.0, 1.0])) if signed else 1.0
    return plant(vehicle, sign * size)


# Gross faults.


@dataclass(frozen=True, slots=True, kw_only=True)
class Sideslip:
    """The sideslip angle in place of v_y.

    Parameters
    ----------
    per_rad : 1 in rad, 57.3 in degrees.
    """

    per_rad: float

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the angle.

        Parameters
        ----------
        recording : the drive without it.
        """
        angle = np.arctan2(recording.needed("v_y"), recording.v_x)
        return replace(recording, v_y=self.per_rad * angle)


@dataclass(frozen=True, slots=True, kw_only=True)
class JumpInTurn:
    """A jump of the clock while the car changes its turn most: elsewhere it does no harm.

    Parameters
    ----------
    size : of the jump [s]; negative where samples are logged twice.
    """

    size: float

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the jump.

        Parameters
        ----------
        recording : the drive without it.
        """
        smooth = np.convolve(recording.r, np.ones(20) / 20.0, "same")
        at = float(recording.t[np.argmax(np.abs(np.gradient(smooth)))])
        return ClockJump(at=at, size=self.size).apply(recording)


class Gross(NamedTuple):
    """A fault, and how it may be called."""

    case: Case
    right: Right


Draw = Callable[[Vehicle, np.random.Generator], Gross]


def _scaled(channel: str, size: float) -> SensorFault:
    return SensorFault(channel=channel, kind="scaled", size=size)


def _any(rng: np.random.Generator) -> str:
    return str(rng.choice(["v_y", "r", "delta_f"]))


def _always(fault: Fault, *right: tuple[str, str]) -> Draw:
    return lambda *_: Gross(Case(fault), right)


def _flipped(channel: str) -> Draw:
    return _always(SensorFault(channel=channel, kind="flipped"), ("sign", channel))


def _mirrored(*channels: str) -> Draw:
    """One half of the axes: it cannot be told from the other half."""
    return _always(Mirrored(channels=channels), ("sign", "v_y"), ("sign", "r"))


def _unit(channel: str, unit: str) -> Draw:
    return _always(WrongUnit(channel=channel, unit=unit), ("unit", channel))


def _sideslip(per_rad: float) -> Draw:
    """At a constant speed the angle is v_y in some unit of speed."""
    return _always(Sideslip(per_rad=per_rad), ("sideslip", "v_y"), ("unit", "v_y"))


def _zero(_: Vehicle, rng: np.random.Generator) -> Gross:
    channel = _any(rng)
    return Gross(Case(SensorFault(channel=channel, kind="zero")), (("frozen", channel),))


def _ratio(per_rad: float) -> Draw:
    def draw(_: Vehicle, rng: np.random.Generator) -> Gross:
        size = rng.uniform(8.0, 20.0) * float(rng.choice([-1.0, 1.0]))
        return Gross(Case(_scaled("delta_f", per_rad * size)), (("steering_ratio", "delta_f"),))

    return draw


def _stuck(_: Vehicle, rng: np.random.Generator) -> Gross:
    channel, length = _any(rng), rng.uniform(1.0, 6.0)
    start = rng.uniform(10.0, 45.0)
    fault = SensorFault(channel=channel, kind="stuck", start=start, duration=length)
    return Gross(Case(fault), (("frozen", channel),))


def _spiking(vehicle: Vehicle, rng: np.random.Generator) -> Gross:
    by = Scale.of(vehicle)
    channel = _any(rng)
    size = {"v_y": 1.0 * by.speed, "r": 0.2 / by.time, "delta_f": 0.1}[channel]
    fault = SensorFault(channel=channel, kind="spiking", size=size)
    return Gross(Case(fault), (("spikes", channel),))


def _held(_: Vehicle, rng: np.random.Generator) -> Gross:
    channel = _any(rng)
    fault = Held(channels=(channel,), every=0.5, lasts=math.exp(rng.uniform(-3.5, -0.9)))
    return Gross(Case(fault), (("held", channel),))


def _late_at_random(vehicle: Vehicle, rng: np.random.Generator) -> Gross:
    size = Scale.of(vehicle).time * rng.uniform(0.04, 0.08)
    fault = Jitter(size=size, seed=int(rng.integers(1 << 30)))
    return Gross(Case(fault), (("jitter", ""),))


def _jump(sign: float) -> Draw:
    def draw(_: Vehicle, rng: np.random.Generator) -> Gross:
        size = sign * math.exp(rng.uniform(math.log(0.3), math.log(2.0)))
        return Gross(Case(JumpInTurn(size=size)), (("clock", ""),))

    return draw


def _straight(vehicle: Vehicle, rng: np.random.Generator) -> Gross:
    fault = StraightOnly(sensors=good_sensors(vehicle), seed=int(rng.integers(1 << 30)))
    return Gross(Case(fault), (("straight", ""),))


def _another(vehicle: Vehicle, _: np.random.Generator) -> Gross:
    return Gross(Case(told=AnotherCar(declared=other_car(vehicle))), (("other_car", ""),))


def _far_inertia(_: Vehicle, rng: np.random.Generator) -> Gross:
    factor = math.exp(float(rng.choice([-1.0, 1.0])) * rng.uniform(1.0, 2.0))
    told = WrongNumber(field="yaw_inertia", factor=factor)
    return Gross(Case(told=told), (("yaw_inertia", ""),))


GROSS: Mapping[str, Draw] = {
    **{f"{name} flipped": _flipped(name) for name in ("v_x", "v_y", "r", "delta_f", "a_y")},
    "r and steering mirrored": _mirrored("r", "delta_f"),
    "v_y and a_y mirrored": _mirrored("v_y", "a_y"),
    "r in degrees": _unit("r", "deg"),
    "steering in degrees": _unit("delta_f", "deg"),
    "v_x in km/h": _unit("v_x", "km/h"),
    "speeds in km/h": _always(
        Together(faults=(_scaled("v_x", 3.6), _scaled("v_y", 3.6))), ("unit", "v_x")
    ),
    "a_y in g": _unit("a_y", "g"),
    "sideslip in rad": _sideslip(1.0),
    "sideslip in degrees": _sideslip(math.degrees(1.0)),
    "steering wheel in rad": _ratio(1.0),
    "steering wheel in degrees": _ratio(math.degrees(1.0)),
    "zero": _zero,
    "stuck": _stuck,
    "spiking": _spiking,
    "held": _held,
    "stairs": _always(
        Held(channels=("v_x", "v_y"), every=0.1, lasts=0.1), ("held", "v_y"), ("held", "v_x")
    ),
    "late at random": _late_at_random,
    "time missing": _jump(1.0),
    "logged twice": _jump(-1.0),
    "straight": _straight,
    "another car": _another,
    "yaw inertia": _far_inertia,
}
