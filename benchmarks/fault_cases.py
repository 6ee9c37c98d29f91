"""What goes wrong with logs of cars, in the sizes in which it does: at random.

Sizes are those of a sedan, 2.7 m between the axles; a car of another size has them by Froude's
similarity: lengths with the wheelbase L, speeds with sqrt(g L), times with sqrt(L/g), angles as
they are. The same sizes so mean the same to a car of 1:10.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

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
    SwappedAxles,
    Together,
    WrongNumber,
    WrongUnit,
)
from benchmarks.random_cars import LIKE, good_sensors
from benchmarks.recorded_cars import DART
from models.faults import SensorFault
from models.recordings import Recording
from models.sensors import Sensors
from models.vehicle import Vehicle

STRAIGHT = 0.005  # of the lateral motion of a drive is left on a straight road


class Told(Protocol):
    """What is asked of a wrong number of a car."""

    def tell(self, vehicle: Vehicle) -> Vehicle:
        """Return the car as it is told.

        Parameters
        ----------
        vehicle : that drives.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class StraightOnly:
    """A drive that never corners: all lateral signals shrink to `STRAIGHT` of themselves.

    Parameters
    ----------
    sensors : whose noise does not shrink.
    seed : of that noise.
    """

    sensors: Sensors
    seed: int = 0

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with next to no lateral motion, its forces shrunk alike.

        Parameters
        ----------
        recording : a drive with corners.
        """
        s, force, a_y = STRAIGHT, recording.axle_force, recording.a_y
        straight = replace(
            recording,
            v_y=s * recording.needed("v_y"),
            r=s * recording.r,
            delta_f=s * recording.delta_f,
            delta_r=s * recording.delta_r,
            a_y=None if a_y is None else s * a_y,
            axle_force=None if force is None else s * force,
        )
        return self.sensors.apply(straight, np.random.default_rng(self.seed))


class Case(NamedTuple):
    """A log and a car as they reach the identifier; nothing is wrong where both are None."""

    fault: Fault | None = None
    told: Told | None = None

    def __str__(self) -> str:
        """Return it in words."""
        return "; ".join(str(one) for one in self if one is not None) or "nothing wrong"

    def log(self, recording: Recording) -> Recording:
        """Return the recording as it is logged.

        Parameters
        ----------
        recording : of good sensors.
        """
        return recording if self.fault is None else self.fault.apply(recording)

    def judged(self, recording: Recording) -> Recording:
        """Return the drive on which what was learnt is judged: what stays wrong is wrong there too.

        Sensors are mounted, biased, scaled and late as they were, but noise, samples that are held
        or stamped wrongly, and the lack of corners are of one log only.

        Parameters
        ----------
        recording : of good sensors.
        """
        parts = self.fault.faults if isinstance(self.fault, Together) else (self.fault,)
        for part in parts:
            passing = isinstance(part, StraightOnly | Held | Jitter | ClockJump)
            noise = isinstance(part, SensorFault) and part.kind == "noisy"
            if part is not None and not passing and not noise:
                recording = part.apply(recording)
        return recording

    def car(self, vehicle: Vehicle) -> Vehicle:
        """Return the car as it is told.

        Parameters
        ----------
        vehicle : told rightly.
        """
        return vehicle if self.told is None else self.told.tell(vehicle)


class Scale(NamedTuple):
    """Length, speed and time of a car over those of the sedan, by Froude's similarity."""

    length: float
    speed: float
    time: float

    @classmethod
    def of(cls, vehicle: Vehicle) -> "Scale":
        """Return that of a car.

        Parameters
        ----------
        vehicle : the car.
        """
        return cls(
            vehicle.wheelbase / LIKE.wheelbase,
            vehicle.froude_speed / LIKE.froude_speed,
            vehicle.froude_time / LIKE.froude_time,
        )


def random_case(vehicle: Vehicle, rng: np.random.Generator) -> Case:
    """Return something that is wrong, of any kind, from next to nothing to plainly too much.

    A wrong mass is not seen in motion, nor is the center of gravity but for a little: these are
    told within 14 % and within 8 % of the wheelbase, as from a data sheet.

    Parameters
    ----------
    vehicle : the car that drives, told rightly.
    rng : source of randomness.
    """
    if rng.uniform() < 0.25:
        return Case(told=_random_told(vehicle, rng))
    first = _random_fault(vehicle, rng)
    if rng.uniform() < 0.8:
        return Case(first)
    return Case(Together(faults=(first, _random_fault(vehicle, rng))))


def _random_told(vehicle: Vehicle, rng: np.random.Generator) -> Told:
    """A wrong number of the car, or another car."""
    sign = float(rng.choice([-1.0, 1.0]))
    makes = (
        lambda: WrongNumber(field="mass", factor=math.exp(sign * rng.uniform(0.02, 0.13))),
        lambda: WrongNumber(field="yaw_inertia", factor=math.exp(sign * rng.uniform(0.05, 2.0))),
        lambda: WrongNumber(
            field=f"cornering_stiffness_{rng.choice(['front', 'rear'])}",
            factor=math.exp(sign * rng.uniform(0.1, 1.0)),
        ),
        lambda: ShiftedCenter(share=sign * rng.uniform(0.01, 0.08)),
        SwappedAxles,
        lambda: AnotherCar(declared=other_car(vehicle)),
    )
    return makes[int(rng.integers(len(makes)))]()


def other_car(vehicle: Vehicle) -> Vehicle:
    """Return a 1:10 car for a full-size one, and the other way round.

    Parameters
    ----------
    vehicle : the car that drives.
    """
    return DART if vehicle.mass > 100.0 else replace(LIKE, chassis=None)


def _random_fault(vehicle: Vehicle, rng: np.random.Generator) -> Fault:
    """A fault of the log; sizes are spread evenly over their logarithm."""
    by, seed = Scale.of(vehicle), int(rng.integers(1 << 30))
    sign = float(rng.choice([-1.0, 1.0]))

    def size(least: float, most: float) -> float:
        return math.exp(rng.uniform(math.log(least), math.log(most)))

    channel = str(rng.choice(["v_y", "r", "delta_f"]))
    unit = {"v_y": by.speed, "r": 1.0 / by.time, "delta_f": 1.0, "v_x": by.speed}
    most = {"v_y": 0.6, "r": 0.05, "delta_f": 0.04}[channel] * unit[channel]
    late = rng.choice(["v_y", "r", "delta_f"], size=int(rng.integers(1, 3)), replace=False)
    makes = (
        lambda: SensorFault(channel=channel, kind="biased", size=sign * most * size(0.03, 1.0)),
        lambda: SensorFault(channel=channel, kind="noisy", size=most * size(0.05, 1.0), seed=seed),
        lambda: SensorFault(channel=channel, kind="scaled", size=1.0 + sign * size(0.01, 0.5)),
        lambda: SensorFault(channel=channel, kind=str(rng.choice(["flipped", "zero"]))),
        lambda: SensorFault(channel="v_x", kind="scaled", size=1.0 + sign * size(0.01, 0.3)),
        lambda: WrongUnit(channel=str(rng.choice(["r", "delta_f"])), unit="deg"),
        lambda: SensorFault(channel="delta_f", kind="scaled", size=rng.uniform(8.0, 20.0)),
        lambda: Mirrored(channels=(("v_y", "a_y"), ("r", "delta_f"))[int(rng.integers(2))]),
        lambda: Misaligned(angle=sign * size(0.002, 0.05)),
        lambda: SensorElsewhere(
            sensor="velocity",
            x=sign * by.length * size(0.05, 1.5),
            y=by.length * rng.uniform(-0.5, 0.5),
        ),
        lambda: Late(channels=tuple(map(str, late)), delay=by.time * size(0.005, 0.15)),
        lambda: Lagging(channels=tuple(map(str, late)), time_constant=by.time * size(0.01, 0.4)),
        lambda: Held(channels=(channel,), every=0.5, lasts=size(0.02, 0.5)),
        lambda: Held(channels=("v_x", "v_y"), every=0.1, lasts=0.1),
        lambda: Jitter(size=by.time * size(0.005, 0.08), seed=seed),
        lambda: ClockJump(at=rng.uniform(3.0, 9.0), size=sign * size(0.05, 2.0)),
        lambda: Bank(vehicle=vehicle, angle=sign * size(0.005, 0.08), period=size(10.0, 300.0)),
        lambda: StraightOnly(sensors=good_sensors(vehicle), seed=seed),
    )
    return makes[int(rng.integers(len(makes)))]()
