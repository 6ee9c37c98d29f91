"""Faults that the doctor estimates, in sizes that matter, at random: one of each kind.

Sizes are those of a sedan and grow with a car by Froude's similarity, as in `fault_cases`; they are
spread evenly over their logarithm, with either sign.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from benchmarks.doctor_answers import Right
from benchmarks.fault_cases import Case, Scale
from benchmarks.faults import (
    Bank,
    Lagging,
    Late,
    Misaligned,
    SensorElsewhere,
    ShiftedCenter,
    WrongNumber,
)
from identifier.doctor.readings import DEGREE
from models.faults import SensorFault
from models.vehicle import Vehicle


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


def _offset(channel: str, shape: str) -> Plant:
    def plant(vehicle: Vehicle, size: float) -> Planted:
        by = Scale.of(vehicle)
        size *= {"": 1.0, "speed": by.speed, "rate": 1.0 / by.time}[shape]
        fault = SensorFault(channel=channel, kind="biased", size=size)
        return Planted(Case(fault), "offset", channel, size)

    return plant


def _factor(channel: str) -> Plant:
    def plant(_: Vehicle, size: float) -> Planted:
        fault = SensorFault(channel=channel, kind="scaled", size=math.exp(size))
        return Planted(Case(fault), "factor", channel, math.exp(size))

    return plant


def _late(channel: str) -> Plant:
    def plant(vehicle: Vehicle, size: float) -> Planted:
        size *= Scale.of(vehicle).time
        return Planted(Case(Late(channels=(channel,), delay=size)), "delay", channel, size)

    return plant


def _lagging(channel: str) -> Plant:
    def plant(vehicle: Vehicle, size: float) -> Planted:
        size *= Scale.of(vehicle).time
        fault = Lagging(channels=(channel,), time_constant=size)
        return Planted(Case(fault), "lag", channel, size)

    return plant


def _elsewhere(sensor: str, code: str, channel: str) -> Plant:
    def plant(vehicle: Vehicle, size: float) -> Planted:
        size *= Scale.of(vehicle).length
        return Planted(Case(SensorElsewhere(sensor=sensor, x=size)), code, channel, size)

    return plant


def _misaligned(_: Vehicle, size: float) -> Planted:
    return Planted(Case(Misaligned(angle=size)), "velocity_sensor_angle", "v_y", size)


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
    "misaligned": (_misaligned, 0.5 * DEGREE, 3.0 * DEGREE, True),
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
