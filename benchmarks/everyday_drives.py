"""A minute of everyday driving of a random car, with one lane change or slalom in it.

The road bends gently and the speed varies a little, as on any road; once in the minute the driver
changes lanes or drives a slalom, up to half the grip at least. Everything follows from a seed.
"""

import math
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.random_cars import (
    REACHED,
    Beginning,
    RandomCar,
    RandomDrive,
    first_good,
    is_good,
    steering_gradient,
)
from codegen.arrays import Array
from models.maneuvers import Maneuver, RandomSteer
from models.plant import PlantError
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

DURATION = 60.0  # s
GENTLE = (0.1, 0.25)  # of the grip, that the road's bends take
BRISK = (0.6, 0.95)  # of the grip, asked for by the maneuver
VARIES = 0.1  # of the speed
KINDS = ("lane change", "slalom")
SWINGS = {"lane change": (1, 1), "slalom": (3, 6)}  # periods of a sine
DRAWS = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Everyday:
    """Bends of a road and one maneuver: a sine of some periods between smooth ends.

    Parameters
    ----------
    road : the bends.
    amplitude : of the maneuver [rad].
    frequency : of the maneuver [Hz].
    periods : how many.
    onset : when it begins [s].
    """

    road: Maneuver
    amplitude: float
    frequency: float
    periods: int
    onset: float

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.road.duration

    def steering(self, t: Array) -> Array:
        """Commanded [delta_f, delta_r] [rad], (n, 2).

        Parameters
        ----------
        t : times [s], (n,).
        """
        since = self.frequency * (t - self.onset)
        swings = (since >= 0.0) & (since <= self.periods)
        steering = self.road.steering(t)
        steering[:, 0] += swings * self.amplitude * np.sin(2.0 * math.pi * since)
        return steering


def everyday_drive(car: RandomCar, kind: str, rng: np.random.Generator) -> RandomDrive:
    """Return a minute of a car that excites both axles and does not spin.

    Parameters
    ----------
    car : that drives.
    kind : one of `KINDS`.
    rng : source of speed and steering.

    Raises
    ------
    PlantError
        Where none of `DRAWS` drives is such.
    """
    begin, vehicle = Beginning(lead=0.0), car.vehicle
    for _ in range(DRAWS):
        speed = rng.uniform(2.6, 4.5) * vehicle.froude_speed
        per_a_y = steering_gradient(vehicle, speed)
        if per_a_y is None:
            continue
        per_grip = min(car.friction) * GRAVITY * per_a_y
        gentle = min(rng.uniform(*GENTLE) * per_grip, 0.1)
        drive = Everyday(
            road=RandomSteer(
                amplitude=gentle,
                frequency=0.3 * car.frequency,
                seed=int(rng.integers(1 << 30)),
                onset=0.5,
                rate_limit=1.0,
                duration=DURATION,
            ),
            amplitude=min(1.5 * rng.uniform(*BRISK) * per_grip, 0.35) * rng.choice([-1.0, 1.0]),
            frequency=car.frequency,
            periods=int(rng.integers(*SWINGS[kind], endpoint=True)),
            onset=rng.uniform(10.0, 45.0),
        )
        phase, turn = rng.uniform(0.0, 2.0 * math.pi), 2.0 * math.pi / rng.uniform(20.0, 40.0)

        def wanted(t: Array, v: float = speed, phase: float = phase, turn: float = turn) -> Array:
            return np.asarray(v * (1.0 + VARIES * np.sin(turn * t + phase)), dtype=np.float64)

        with suppress(PlantError):
            run = car.plant.simulate(drive, speed=wanted, name=f"{car.kind}, {kind}")
            if is_good(car, run, begin, (1.0 - VARIES) * speed):
                exact = run.recording()
                return RandomDrive(car=car, beginning=begin, exact=exact, speed=speed)
    raise PlantError(f"{DRAWS} drives of a {car.kind} did not excite {REACHED:g} of the grip")


def drawn_everyday(kind: str, maneuver: str, seed: int) -> RandomDrive:
    """Return the drive of a seed; where its car has no good one, another car is drawn.

    Parameters
    ----------
    kind : class of the car.
    maneuver : one of `KINDS`.
    seed : of the car.
    """

    def drive(car: RandomCar, attempt: int) -> RandomDrive:
        rng = np.random.default_rng([seed, attempt, 60, *maneuver.encode()])
        return everyday_drive(car, maneuver, rng)

    return first_good(kind, seed, drive)


def everyday_log(kind: str, seed: int) -> tuple[Recording, Vehicle, Recording]:
    """Return a log, the car as it is declared, and the drive without noise, with true forces.

    Parameters
    ----------
    kind : class of the car.
    seed : of car, drive and noise; where it is odd, the log has no a_y.
    """
    drive = drawn_everyday(kind, KINDS[(seed // 2) % len(KINDS)], seed)
    log = replace(drive.log(np.random.default_rng([seed, 1])), axle_force=None)
    return replace(log, a_y=None) if seed % 2 else log, drive.car.declared, drive.exact
