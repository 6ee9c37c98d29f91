"""A tracker that knows what it does not know: `tireid drive --caution` on tires that are wrong.

    python -m benchmarks.mpc_caution OUT [CARS] [--record]

Random cars of two classes (`random_cars`, on the tire of the sedan's file, seeds from `FIRST_SEED`
on: nothing was chosen on them), each of them driven without caution and with all of it

short: on the first 10 s of the drive to learn on, in the slalom of 36 m and on ISO 3888-1.
wet: on the dry road before a wet one: the slalom through 12 cones 36 m apart at 95 % of the wet
  limit, where friction halves between the fifth and the seventh cone.
biased: learnt and driven with a sensor that is off, channel and size as `random_cars` draws them.
learnt: on the whole drive to learn on, without a fault: what caution costs where it is not needed.

A car has left the path where it is more than 0.5 m off, spins, or gives up. Constants of the
tracker were chosen on cars of seeds below `FIRST_SEED`. Times are those of steps on the learnt
tires of the first `TIMED` cars, each step's least of `ROUNDS` drives.
Prints a table, writes OUT/mpc_caution.json.
"""

import json
import math
import sys
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path as File
from typing import NamedTuple

import numpy as np

from benchmarks.mpc_cases import options_of
from benchmarks.random_cars import FIRST_SEED, random_beginning, random_car
from benchmarks.targets import Targets, keeps
from identifier.compare.work import spread
from identifier.tire_model import TireModel
from models.faults import SensorFault
from models.recordings import Recording
from models.vehicle import Vehicle, sedan
from mpc.loop.sensing import cornering_limit
from mpc.path import Path, iso_3888_1, slalom, steady_speed
from tireid.commands.drive_case import conditions_of, make_setup
from tireid.driving.learn import learning_drive
from tireid.driving.runs import FROZEN, Conditions, run_drive
from tireid.driving.setup import SpeedWish
from tireid.learning import identify

CLASSES = ("compact", "sedan")
SITUATIONS = ("short", "wet", "biased", "learnt")
CAUTIONS = (0.0, 1.0)
SHORT = 10.0  # s
WET = 0.5
WITHIN = 0.5  # m
SHARES = {"slalom": 0.95, "lane change": 0.97}
CHANNELS = {"delta_f": "delta"}  # of a drive, by those of a recording
CARS = 80
WORKERS = 2
ROUNDS, TIMED = 3, 2  # drives of a car whose steps are timed, such cars


class Case(NamedTuple):
    """One drive: situation, course, number of the car, caution."""

    situation: str
    course: str
    car: int
    caution: float


class Result(NamedTuple):
    """Deviation from the path [m], whether it was kept, and the median time of a step [ms]."""

    rms: float
    peak: float
    kept: bool
    step: float


@cache
def vehicle_of(car: int) -> Vehicle:
    """Return a random car on the tire of the sedan.

    Parameters
    ----------
    car : its number.
    """
    rng = np.random.default_rng([FIRST_SEED + car, 16])
    drawn = random_car(CLASSES[car % len(CLASSES)], rng).vehicle
    chassis = replace(drawn.require_chassis(), tire=sedan().require_chassis().tire)
    return replace(drawn, chassis=chassis)


def fault_of(car: int) -> SensorFault:
    """Return what a sensor of a car is off by, from the first to the last sample.

    Parameters
    ----------
    car : its number.
    """
    rng = np.random.default_rng([FIRST_SEED + car, 17])
    ((channel, size),) = random_beginning("biased", vehicle_of(car), rng).constant
    name = CHANNELS.get(channel, channel)
    return SensorFault(channel=name, kind="biased", start=0.0, duration=math.inf, size=size)


@cache
def path_of(course: str) -> Path:
    """Return the path of a course, planned once.

    Parameters
    ----------
    course : its name.
    """
    return slalom(gap=36.0, cones=12) if course == "slalom" else iso_3888_1()


def conditions(case: Case) -> Conditions:
    """Return what `tireid drive` would drive, in a car and on a path of our own.

    Parameters
    ----------
    case : what to drive.
    """
    car, wet = vehicle_of(case.car), case.situation == "wet"
    path = path_of(case.course)
    limit = cornering_limit(car, None, WET if wet else 1.0)
    speed = steady_speed(path, a_y_max=limit, share=SHARES[case.course])
    place = 40.0 + 36.0 * (25.0 + case.car % 10) / 6.0
    setup = make_setup(
        path,
        vehicle=car,
        mu=1.0,
        drops=[(place, WET)] if wet else [],
        wish=SpeedWish(None, speed),
    )
    words = ["--seed", str(case.car), "--caution", f"{case.caution:g}"]
    return replace(
        conditions_of(options_of(words)),
        setup=setup,
        faults=(fault_of(case.car),) if case.situation == "biased" else (),
    )


@cache
def recording(car: int, situation: str) -> Recording:
    """Return the drive that a car learns on, as the command has it.

    Parameters
    ----------
    car : its number.
    situation : learnt, or biased.
    """
    told = conditions(Case(situation, "slalom", car, 1.0))
    return learning_drive(
        told.setup.car(open_field=True),
        told.driving_sensors,
        np.random.default_rng([told.seed, 1]),
        grip=told.setup.grip,
        seed=told.seed,
    )


@cache
def learnt(car: int, situation: str) -> TireModel:
    """Return what is learnt before a car is driven, as the command learns it.

    Parameters
    ----------
    car : its number.
    situation : short, biased or learnt.
    """
    if situation == "short":
        taught = recording(car, "learnt").between(0.0, SHORT)
    else:
        taught = recording(car, situation)
    return identify(taught, vehicle_of(car), check=False).tire


def is_timed(case: Case) -> bool:
    """Return whether the steps of a drive are timed, which takes `ROUNDS` drives."""
    return case.situation == "learnt" and case.car < TIMED


def score(case: Case) -> Result:
    """Return what became of a drive.

    Parameters
    ----------
    case : to drive.
    """
    of = case.situation if case.situation in ("short", "biased") else "learnt"
    rounds = ROUNDS if is_timed(case) else 1
    runs = [run_drive(FROZEN, conditions(case), learnt(case.car, of)) for _ in range(rounds)]
    driven, found = runs[0].drive, runs[0].scores
    step = 1e3 * np.median(np.min([run.drive.solve_time for run in runs], axis=0))
    kept = found.completed and found.peak_e_y_m <= WITHIN
    return Result(float(np.sqrt(np.mean(driven.e_y**2))), found.peak_e_y_m, kept, float(step))


def cases_of(car: int) -> list[Case]:
    """Return all drives of a car.

    Parameters
    ----------
    car : its number.
    """
    pairs = [
        (situation, course)
        for situation, course in product(SITUATIONS, SHARES)
        if situation != "wet" or course == "slalom"
    ]
    return [Case(*pair, car, caution) for pair, caution in product(pairs, CAUTIONS)]


def judge(found: dict[Case, Result], targets: Targets) -> None:
    """Print and record the numbers beside their targets.

    Parameters
    ----------
    found : what was driven.
    targets : collects what is missed.
    """
    places = list(dict.fromkeys((case.situation, case.course) for case in found))
    for situation, course in places:
        key = f"{situation}/{course.replace(' ', '_')}"
        for caution in CAUTIONS:
            row = [r for case, r in found.items() if case[:2] == (situation, course)
                   and case.caution == caution]  # fmt: skip
            left, word = sum(not r.kept for r in row), f"{key}/{caution:g}"
            targets.record(f"{word}/drives", len(row))
            targets.record(f"{word}/peak", max(r.peak for r in row), "m")
            targets.record(f"{word}/rms", 100.0 * float(np.median([r.rms for r in row])), "cm")
            if caution == 1.0:
                label = f"{situation}, {course}: cautious cars that leave the path"
                targets.at_most(label, left, 0, "", key=f"{word}/left")
            else:
                targets.record(f"{word}/left", left)
            print(f"{word:28} left {left:3} of {len(row)}, worst {max(r.peak for r in row):.2f} m")
    for course in SHARES:
        pairs = [
            (r, found[case._replace(caution=1.0)])
            for case, r in found.items()
            if case.situation == "learnt" and case.course == course and case.caution == 0.0
        ]
        more = [100.0 * (there.rms / here.rms - 1.0) for here, there in pairs]
        key = course.replace(" ", "_")
        label = f"{course}: median of more deviation on tires learnt well"
        targets.at_most(label, float(np.median(more)), 5.0, "%", key=f"learnt/{key}/more")
        targets.record(f"learnt/{key}/more_90", float(np.quantile(more, 0.9)), "%")
    times = [
        np.median(
            [r.step for case, r in found.items() if is_timed(case) and case.caution == caution]
        )
        for caution in CAUTIONS
    ]
    label = "time of a step with caution over without"
    targets.at_most(label, float(times[1] / times[0]), 1.3, "-", key="step")


def main(out: File, cars: int = CARS, *, keep: bool = False) -> int:
    """Drive, print; return 1 where a target was missed.

    Parameters
    ----------
    out : folder of the JSON.
    cars : how many.
    keep : record the numbers for the documents.
    """
    out.mkdir(parents=True, exist_ok=True)
    cases = [case for car in range(cars) for case in cases_of(car)]
    with spread(WORKERS, chunk=len(cases_of(0))) as over:
        found = dict(zip(cases, over(score, cases), strict=True))
    targets = Targets("mpc_caution")
    judge(found, targets)
    rows = [{**case._asdict(), **r._asdict()} for case, r in found.items()]
    (out / "mpc_caution.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
    print(f"wrote {out / 'mpc_caution.json'}")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    records = keeps()
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: mpc_caution OUT [CARS] [--record]")
    sys.exit(main(File(sys.argv[1]), *(int(word) for word in sys.argv[2:]), keep=records))
