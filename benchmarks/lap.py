"""How fast do cars lap on tires that they identified, and how near are they to leaving their path?

    python -m benchmarks.lap [--quick] [--record]

Random compact cars and sedans, front-, rear- and four-wheel driven, on roads of friction 0.45 to 1:
tires of Fiala, Dugoff and a Magic Formula, others in front than behind, or of the sedan's file.
Each is steered until its sensors show that it slides, identified, and drives five laps of one of
two courses, as `tireid lap` does. Speeds see no true grip; what does is only compared with them: a
lap planned on the largest steady lateral acceleration of the plant, and the fastest acceleration
that suits all cars. A car is safe within 0.5 m of its path.

The margin of a first lap is ln(last safe share of the limits / the share in use): the share grows
by 2 % until the car is unsafe. Cars on a friction of 1 drive laps that confirm, and meet 0.6 of it.
"""

import math
import sys
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from math import radians
from typing import NamedTuple

import numpy as np

from benchmarks.mpc_cases import cornering_limit
from benchmarks.random_cars import FIRST_SEED, LIKE, random_car
from benchmarks.targets import Table, Targets, Values, parse, show
from identifier.speed_limits import SpeedLimits
from identifier.tire_model import TireModel
from models.friction import Friction
from models.tires import MagicFormula, Tire
from models.vehicle import GRAVITY, Vehicle
from mpc.cars import BRAKES, DoubleTrackCar
from mpc.handover.learner import Learner
from mpc.handover.rules import Verdict
from mpc.loop.sensing import inertial_unit
from mpc.path import Path, SpeedProfile, handling_course, speed_profile
from mpc.path.courses import Straight, Turn, line_along
from mpc.path.speed import BRAKED, SHARE
from tireid.driving.laps import drive_laps, first_limits
from tireid.driving.learn import learning_drive
from tireid.driving.runs import ClosedLoop, drive
from tireid.driving.setup import PERIOD
from tireid.learning import identify

CARS, LAPS = 80, 5
MARGINS = 40  # cars whose margin is measured
WET_CARS = 20  # cars that learn on friction 1
FRICTIONS = (0.45, 1.0)
WET = 0.6  # of the friction that was learnt on
WITHIN = 0.5  # m
STEP = 1.02  # of the share of the limits
SAFE = 3.85  # sd of the margin: at most 1 of 1000 unsafe, 95 % sure of it from 40 normal ones
TRUE_SHARE = 0.95  # of the true limit
A_Y_STEP = 0.05 * GRAVITY  # m/s², steps of the given acceleration
_FEW = 8  # cars that are driven at a given acceleration before the next ones
DAYS = 1000  # added to the seed of the noise of each car


class LapCar(NamedTuple):
    """A car, its true tires in front and behind, its course, and the friction of road over tire."""

    number: int
    vehicle: Vehicle
    tires: tuple[Tire, Tire]
    course: Path
    friction: float

    @property
    def limit(self) -> float:
        """Largest steady lateral acceleration on its road [m/s²]."""
        front, rear = self.tires
        return cornering_limit(self.vehicle, front, self.friction, rear)

    def learnt(self) -> TireModel:
        """Return its tires, identified from a drive on an open field of its road."""
        front, rear = self.tires
        road = Friction(scale=self.friction)
        car = DoubleTrackCar(self.vehicle, front, rear_tire=rear, friction=road, period=PERIOD)
        rng = np.random.default_rng([DAYS, self.number])
        log = learning_drive(car, inertial_unit(), rng, seed=self.number)
        return identify(log, self.vehicle, check=False).tire

    def drive(
        self,
        tire: TireModel,
        limits: SpeedLimits,
        share: float,
        *,
        friction: float = 1.0,
        confirm: bool = False,
    ) -> ClosedLoop:
        """Return a lap.

        Parameters
        ----------
        tire : that is steered on.
        limits : that speeds are planned on.
        share : of them.
        friction : of the road over that which the car learnt on.
        confirm : whether the speed has to be earned.
        """
        return drive(
            self.course, self.vehicle, tire, speeds=planned(self.course, limits, share),
            friction=friction * self.friction, tires=self.tires, confirm=confirm,
            seed=DAYS * self.number,
        )  # fmt: skip


@cache
def courses() -> tuple[Path, Path]:
    """Return the handling course, and one of 713 m with a long straight and fewer tight turns."""
    line = line_along(
        [
            Straight(length=11.487055586538235),  # this one and the longest close the course
            Turn(radius=50.0, angle=radians(95.0), easing=18.0),
            Straight(length=25.0),
            Turn(radius=28.0, angle=radians(-75.0), easing=12.0),
            Turn(radius=20.0, angle=radians(150.0), easing=9.0),
            Straight(length=75.0),
            Turn(radius=70.0, angle=radians(-50.0), easing=25.0),
            Turn(radius=16.0, angle=radians(170.0), easing=8.0),
            Straight(length=133.60613934739945),
            Turn(radius=32.0, angle=radians(-40.0), easing=12.0),
            Turn(radius=35.0, angle=radians(110.0), easing=14.0),
        ]
    )
    return handling_course(), Path.from_line(line, name="country course", closed=True)


def lap_car(number: int, friction: float | None = None) -> LapCar:
    """Return one of the cars; its course and class go by its number.

    Parameters
    ----------
    number : of the car.
    friction : of its front tires on the road; None draws it.
    """
    rng = np.random.default_rng([FIRST_SEED + number])
    car = random_car(("compact", "sedan")[number % 2], rng)
    drawn = float(rng.uniform(*FRICTIONS))
    tires, own = car.tires, car.friction[0]
    if not rng.integers(4):
        file = MagicFormula.from_tir(str(LIKE.require_chassis().tire))
        tires, own = (file, file), 1.0
    vehicle = replace(car.declared, chassis=car.vehicle.chassis)
    course = courses()[number // 2 % 2]
    return LapCar(number, vehicle, tires, course, (drawn if friction is None else friction) / own)


def planned(course: Path, limits: SpeedLimits, share: float) -> SpeedProfile:
    """Return the speeds of a lap, as `drive_laps` plans them."""
    return speed_profile(course, limits, share=share, brakes=BRAKES)


def is_safe(lap: ClosedLoop) -> bool:
    """Return whether a car stayed on its path."""
    return lap.scores.completed and lap.scores.peak_e_y_m <= WITHIN


def last_safe(safe: Callable[[int], bool], guess: int) -> int:
    """Return the last step that is safe before the first one that is not.

    Parameters
    ----------
    safe : says it of a step.
    guess : where to look first.
    """
    low, high = guess, guess + 1
    while not safe(low):
        low, high = low - 2 * (high - low), low
    if high == guess + 1:
        while safe(high):
            low, high = high, high + 2 * (high - low)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if safe(middle) else (low, middle)
    return low


class Laps(NamedTuple):
    """What became of a car.

    limit : true one [m/s²].   true_time : of a lap planned on it [s].   tire : learnt before.
    peaks : largest deviation of each lap [m].   safe : all laps of it.   shares : of the limits.
    a_y : the limits' from standing [m/s²].   planned, driven : times of the laps [s].
    margin : of the first lap; None where it was not measured.
    """

    car: int
    limit: float
    true_time: float
    tire: TireModel
    peaks: tuple[float, ...]
    safe: bool
    shares: tuple[float, ...]
    a_y: tuple[float, ...]
    planned: tuple[float, ...]
    driven: tuple[float, ...]
    margin: float | None


def laps_of(number: int, margins: int, laps: int) -> Laps:
    """Return what became of a car that learnt and drove laps.

    Parameters
    ----------
    number : of the car.
    margins : how many cars, from the first one on, are driven to find their margin.
    laps : how many.
    """
    car = lap_car(number)
    tire, limit = car.learnt(), car.limit
    true = SpeedLimits.ellipse(limit, brake=limit / BRAKED)  # who knows it brakes with all of it
    found = list(
        drive_laps(
            car.course, car.vehicle, tire, laps, friction=car.friction, tires=car.tires,
            seed=DAYS * number,
        )
    )  # fmt: skip
    return Laps(
        car=number,
        limit=limit,
        true_time=planned(car.course, true, TRUE_SHARE).lap_time,
        tire=tire,
        peaks=tuple(one.driven.scores.peak_e_y_m for one in found),
        safe=len(found) == laps and all(is_safe(one.driven) for one in found),
        shares=tuple(one.share for one in found),
        a_y=tuple(float(one.limits.a_y[0]) for one in found),
        planned=tuple(one.profile.lap_time for one in found),
        driven=tuple(float(one.driven.drive.t[-1]) for one in found),
        margin=margin_of(car, tire, limit) if number < margins else None,
    )


def margin_of(car: LapCar, tire: TireModel, limit: float) -> float:
    """Return ln(last safe share / the share in use) of a first lap.

    Parameters
    ----------
    car : that drives.
    tire : that it learnt.
    limit : true one, near which the search begins [m/s²].
    """
    limits, step = first_limits(tire), math.log(STEP)
    guess = round(math.log(limit / (SHARE * float(limits.a_y[0]))) / step)
    return step * last_safe(lambda k: is_safe(car.drive(tire, limits, SHARE * STEP**k)), guess)


class Dry(NamedTuple):
    """What became of a car that learnt on a friction of 1.

    time : of a lap that does not confirm [s].   laps : times of those that do [s].
    alarms : of these, laps with an alarm of lost friction.   safe : on the wet road.   peak : there
    [m].
    """

    time: float
    laps: tuple[float, ...]
    alarms: int
    safe: bool
    peak: float


def dry_and_wet(number: int, laps: int) -> Dry:
    """Return what became of a car that learnt on a dry road and met a wet one.

    Parameters
    ----------
    number : of the car.
    laps : on the dry road.
    """
    car = lap_car(number, friction=1.0)
    tire = car.learnt()
    limits = first_limits(tire)
    plain = car.drive(tire, limits, SHARE)
    wet = car.drive(tire, limits, SHARE, friction=WET, confirm=True)
    confirmed = [
        lap.driven
        for lap in drive_laps(
            car.course, car.vehicle, tire, laps, confirm=True, friction=car.friction,
            tires=car.tires, seed=DAYS * number,
        )
    ]  # fmt: skip
    return Dry(
        time=float(plain.drive.t[-1]),
        laps=tuple(float(lap.drive.t[-1]) for lap in confirmed),
        alarms=sum(map(is_alarmed, confirmed)),
        safe=is_safe(wet),
        peak=wet.scores.peak_e_y_m,
    )


def is_alarmed(lap: ClosedLoop) -> bool:
    """Return whether a lap had an alarm of lost friction."""
    assert isinstance(lap.learner, Learner)
    return any(one.verdict is Verdict.FRICTION for one in lap.learner.supervisor.decisions)


def given_lap(given: tuple[int, TireModel, float]) -> tuple[bool, float]:
    """Return whether a car is safe at a given acceleration, and the time of its lap [s].

    Parameters
    ----------
    given : its number, the tires that it steers on, and the acceleration [m/s²].
    """
    number, tire, a_y = given
    lap = lap_car(number).drive(tire, SpeedLimits.ellipse(a_y), 1.0)
    return is_safe(lap), float(lap.drive.t[-1])


def fastest_given(pool: Executor, cars: Sequence[Laps]) -> tuple[float, list[float]]:
    """Return the largest acceleration that keeps all cars [m/s²], and their laps at it [s].

    Parameters
    ----------
    pool : that drives them.
    cars : that learnt.
    """
    weakest = sorted(cars, key=lambda one: one.limit)
    a_y = A_Y_STEP * math.ceil(weakest[0].limit / A_Y_STEP)
    while a_y > A_Y_STEP / 2.0:
        times: dict[int, float] = {}
        for i in range(0, len(weakest), _FEW):  # the first ones are lost where any is
            some = weakest[i : i + _FEW]
            drives = [(one.car, one.tire, a_y) for one in some]
            laps = list(pool.map(given_lap, drives))
            if not all(safe for safe, _ in laps):
                break
            times |= {one.car: time for one, (_, time) in zip(some, laps, strict=True)}
        if len(times) == len(cars):
            return a_y, [times[one.car] for one in cars]
        a_y -= A_Y_STEP
    raise ValueError(f"some car of {len(cars)} is lost at {a_y + A_Y_STEP:g} m/s² already")


def judge_laps(targets: Targets, cars: Sequence[Laps]) -> None:
    """Print, record and judge five laps and the margins of the first one."""
    targets.record("cars", len(cars))
    for k in range(max(len(one.peaks) for one in cars)):
        there = [one for one in cars if k < len(one.peaks)]
        time = float(np.median([one.planned[k] / one.true_time for one in there]))
        share = float(np.median([one.shares[k] for one in there]))
        a_y = float(np.median([one.a_y[k] / one.limit for one in there]))
        peak = max(one.peaks[k] for one in there)
        targets.record(f"lap/{k + 1}/share", share)
        targets.record(f"lap/{k + 1}/limit", a_y)
        targets.record(f"lap/{k + 1}/time", time)
        targets.record(f"lap/{k + 1}/peak", peak)
        said = f"{share:.2f} of limits of {a_y:.2f} of the true ones"
        show(f"lap {k + 1}", f"{said}, {time:.3f} of their time, at most {peak:.2f} m off")
    lost = [one.car for one in cars if not one.safe]
    if lost:
        show("cars that were not safe", ", ".join(map(str, lost)))
    targets.at_most(f"cars beyond {WITHIN} m in a lap", len(lost), 0, "", key="left")
    margins = np.array([one.margin for one in cars if one.margin is not None])
    mean, sd = float(margins.mean()), float(margins.std(ddof=1)) if margins.size > 1 else math.nan
    least = float(margins.min())
    for name, value in (("cars", margins.size), ("mean", mean), ("sd", sd), ("least", least)):
        targets.record(f"margin/{name}", value)
    show("margin of the first lap", f"{mean:.3f}, sd {sd:.3f}, least {least:.3f}")
    targets.at_least("margin of the first lap over its sd", mean / sd, SAFE, "", key="margin/over")
    last = float(np.median([one.planned[-1] / one.true_time for one in cars]))
    targets.at_most("last lap over that of the true limit, median", last, 1.12, "-")


def judge_given(targets: Targets, cars: Sequence[Laps], a_y: float, times: Iterable[float]) -> None:
    """Print, record and judge last laps against those at a given acceleration."""
    show("fastest given acceleration that keeps all", f"{a_y / GRAVITY:.2f} g")
    ratio = [one.driven[-1] / time for one, time in zip(cars, times, strict=True)]
    targets.record("given/g", a_y / GRAVITY)
    label = "last lap over that of the fastest given acceleration, median"
    targets.at_most(label, float(np.median(ratio)), 0.92, "-", key="given/over")


def judge_dry(targets: Targets, cars: Sequence[Dry]) -> None:
    """Print, record and judge what it costs to confirm, and what it saves."""
    laps, alarms = sum(len(one.laps) for one in cars), sum(one.alarms for one in cars)
    cost = 100.0 * float(np.median([one.laps[0] / one.time for one in cars]) - 1.0)
    peak = max(one.peak for one in cars)
    for name, value in (("cars", len(cars)), ("laps", laps), ("cost", cost), ("peak", peak)):
        targets.record(f"confirm/{name}", value)
    show("time that confirming costs on a dry lap, median", f"{cost:.1f} %")
    lost = sum(not one.safe for one in cars)
    label = f"cars beyond {WITHIN} m on {WET} of the friction learnt on"
    targets.at_most(label, lost, 0, "", key="confirm/left")
    targets.record("confirm/alarms", alarms)
    targets.at_most("false alarms of 100 dry laps", 100.0 * alarms / laps, 1.0, "")


def canary() -> Values:
    """Return what one car plans for its first lap, and the true limit."""
    car = lap_car(0)
    limits = first_limits(car.learnt())
    return {
        "limit": car.limit,
        "a_y": float(limits.a_y[0]),
        "planned": planned(car.course, limits, SHARE).lap_time,
    }


def tables(v: Values) -> dict[str, Table]:
    """Return the tables of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    laps = [
        [str(k), *(f"{v[f'lap/{k}/{name}']:.2f}" for name in ("share", "limit", "time", "peak"))]
        for k in range(1, LAPS + 1)
    ]
    header = ("lap", "share of the limits in use", "limits over the true ones",
              "planned time over that of the true limits", "largest deviation [m]")  # fmt: skip
    rows = [
        [f"cars beyond {WITHIN} m in five laps", f"{v['left']} of {v['cars']}"],
        ["margin of the first lap: mean, standard deviation, least of "
         f"{v['margin/cars']} cars",
         ", ".join(f"{v[f'margin/{name}']:.3f}" for name in ("mean", "sd", "least"))],
        ["fastest given acceleration that keeps all cars [g]", f"{v['given/g']:.2f}"],
        ["last lap over that lap, median", f"{v['given/over']:.2f}"],
        [f"cars beyond {WITHIN} m on {WET:g} of the friction learnt on, confirming",
         f"{v['confirm/left']} of {v['confirm/cars']}"],
        ["confirming costs of a dry lap, median [%]", f"{v['confirm/cost']:.1f}"],
        ["dry laps with an alarm of lost friction",
         f"{v['confirm/alarms']} of {v['confirm/laps']}"],
    ]  # fmt: skip
    return {"lap": Table(header, laps), "lap/safe": Table(("what", "measured"), rows)}


def main() -> int:
    """Drive and print; return 1 where a target was missed."""
    targets, options = Targets("lap"), parse("lap", __doc__)
    cars, margins, laps, wet = (4, 2, 2, 1) if options.quick else (CARS, MARGINS, LAPS, WET_CARS)
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(laps_of, range(cars), [margins] * cars, [laps] * cars))
        judge_laps(targets, found)
        judge_given(targets, found, *fastest_given(pool, found))
        judge_dry(targets, list(pool.map(dry_and_wet, range(wet), [laps] * wet)))
    return targets.finish(canary, keep=options.record)


if __name__ == "__main__":
    sys.exit(main())
