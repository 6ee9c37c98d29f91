"""Gross faults of a log at random, one of each kind, and how the doctor must call them."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from benchmarks.doctor_answers import Right
from benchmarks.fault_cases import Case, Scale, StraightOnly, other_car
from benchmarks.faults import (
    AnotherCar,
    ClockJump,
    Held,
    Jitter,
    Mirrored,
    Together,
    WrongNumber,
    WrongUnit,
)
from benchmarks.random_cars import good_sensors
from identifier.doctor.chosen import CHOSEN as DOCTOR_CHOSEN
from models.faults import SensorFault
from models.recordings import Recording
from models.vehicle import Vehicle


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


def _of_one(kind: str, code: str) -> Draw:
    """A fault of a kind of v_y, r or the steering, drawn."""

    def draw(_: Vehicle, rng: np.random.Generator) -> Gross:
        channel = str(rng.choice(["v_y", "r", "delta_f"]))
        return Gross(Case(SensorFault(channel=channel, kind=kind)), ((code, channel),))

    return draw


def _flipped(channel: str) -> Draw:
    def draw(_: Vehicle, __: np.random.Generator) -> Gross:
        fault = SensorFault(channel=channel, kind="flipped")
        return Gross(Case(fault), (("sign", channel),))

    return draw


def _mirrored(*channels: str) -> Draw:
    """One half of the axes: it cannot be told from the other half."""

    def draw(_: Vehicle, __: np.random.Generator) -> Gross:
        return Gross(Case(Mirrored(channels=channels)), (("sign", "v_y"), ("sign", "r")))

    return draw


def _unit(channel: str, unit: str) -> Draw:
    def draw(_: Vehicle, __: np.random.Generator) -> Gross:
        return Gross(Case(WrongUnit(channel=channel, unit=unit)), (("unit", channel),))

    return draw


def _both_in_kmh(_: Vehicle, __: np.random.Generator) -> Gross:
    faults = (_scaled("v_x", 3.6), _scaled("v_y", 3.6))
    return Gross(Case(Together(faults=faults)), (("unit", "v_x"),))


def _sideslip(per_rad: float) -> Draw:
    """At a constant speed the angle is v_y in some unit of speed."""

    def draw(_: Vehicle, __: np.random.Generator) -> Gross:
        return Gross(Case(Sideslip(per_rad=per_rad)), (("sideslip", "v_y"), ("unit", "v_y")))

    return draw


def _ratio(per_rad: float) -> Draw:
    def draw(_: Vehicle, rng: np.random.Generator) -> Gross:
        size = rng.uniform(8.0, 20.0) * float(rng.choice([-1.0, 1.0]))
        return Gross(Case(_scaled("delta_f", per_rad * size)), (("steering_ratio", "delta_f"),))

    return draw


def _stuck(_: Vehicle, rng: np.random.Generator) -> Gross:
    channel, length = str(rng.choice(["v_y", "r", "delta_f"])), rng.uniform(1.0, 6.0)
    start = rng.uniform(10.0, 45.0)
    fault = SensorFault(channel=channel, kind="stuck", start=start, duration=length)
    return Gross(Case(fault), (("frozen", channel),))


def _spiking(vehicle: Vehicle, rng: np.random.Generator) -> Gross:
    by = Scale.of(vehicle)
    channel = str(rng.choice(["v_y", "r", "delta_f"]))
    size = {"v_y": 1.0 * by.speed, "r": 0.2 / by.time, "delta_f": 0.1}[channel]
    fault = SensorFault(channel=channel, kind="spiking", size=size)
    return Gross(Case(fault), (("spikes", channel),))


def _held(_: Vehicle, rng: np.random.Generator) -> Gross:
    channel = str(rng.choice(["v_y", "r", "delta_f"]))
    fault = Held(channels=(channel,), every=0.5, lasts=math.exp(rng.uniform(-3.5, -0.9)))
    return Gross(Case(fault), (("held", channel),))


def _stairs(_: Vehicle, __: np.random.Generator) -> Gross:
    fault = Held(channels=("v_x", "v_y"), every=0.1, lasts=0.1)
    return Gross(Case(fault), (("held", "v_y"), ("held", "v_x")))


def _late(vehicle: Vehicle, rng: np.random.Generator) -> Gross:
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


def _inertia(_: Vehicle, rng: np.random.Generator) -> Gross:
    factor = math.exp(float(rng.choice([-1.0, 1.0])) * rng.uniform(1.0, 2.0))
    told = WrongNumber(field="yaw_inertia", factor=factor)
    return Gross(Case(told=told), (("yaw_inertia", ""),))


KINDS: Mapping[str, Draw] = {
    **{f"{name} flipped": _flipped(name) for name in ("v_x", "v_y", "r", "delta_f", "a_y")},
    "r and steering mirrored": _mirrored("r", "delta_f"),
    "v_y and a_y mirrored": _mirrored("v_y", "a_y"),
    "r in degrees": _unit("r", "deg"),
    "steering in degrees": _unit("delta_f", "deg"),
    "v_x in km/h": _unit("v_x", "km/h"),
    "speeds in km/h": _both_in_kmh,
    "a_y in g": _unit("a_y", "g"),
    "sideslip in rad": _sideslip(1.0),
    "sideslip in degrees": _sideslip(DOCTOR_CHOSEN.degrees),
    "steering wheel in rad": _ratio(1.0),
    "steering wheel in degrees": _ratio(DOCTOR_CHOSEN.degrees),
    "zero": _of_one("zero", "frozen"),
    "stuck": _stuck,
    "spiking": _spiking,
    "held": _held,
    "stairs": _stairs,
    "late at random": _late,
    "time missing": _jump(1.0),
    "logged twice": _jump(-1.0),
    "straight": _straight,
    "another car": _another,
    "yaw inertia": _inertia,
}
