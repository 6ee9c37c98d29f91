"""Lateral velocity without its sensor: the inertial identifier beside what it is compared with.

    python -m benchmarks.without_v_y [--quick] [--record] [--only PART ...]

Beside it all rivals that are installed and estimate v_y, on random cars on banked roads with what
inertial sensors add, on CarMaker, and on the own sensors of a real 1:10 car. v_y only scores, from
the first sample. Where the accelerometer sits is declared to all: the inertial identifier takes it,
for the others a_y is moved to the center of gravity. Then the inertial identifier on tires that an
estimate from a log without v_y found, the same log and another: CarMaker and a real race car.
Numbers of the methods were chosen on random cars with seeds below `FIRST_SEED`, and on no
recording.
"""

import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.answers import force_error
from benchmarks.random_cars import CLASSES, FIRST_SEED, inertial_drive
from benchmarks.recorded_cars import (
    CARMAKER,
    CARMAKER_RUNS,
    DART,
    DATA,
    FERRARI,
    GTI,
    GTI_RUNS,
    own_sensors,
)
from benchmarks.targets import Table, Targets, Values, parse
from identifier.compare.course import side_slip
from identifier.inertial import InertialIdentifier
from identifier.method import CannotFreezeError
from identifier.methods import METHODS, continuing, make_method, methods
from identifier.run import History, identify
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle

CARS = 80
OWN = "inertial"
BRISK = 1.0  # m/s, from which the 1:10 car's side slip counts
SLOWEST = 0.3  # m/s, from which that of other cars does
FAST = 3.0  # m/s, from which that of the race car and the hatchback does
MOST = {"slalom1_14_5ms": 0.15, "experiment2_40kmh": 0.05, "ferrari": 0.32}  # degrees
MOST_ESTIMATED = {"slalom1_14_5ms": 0.1, "ferrari": 0.25, "exp8": 0.45}  # degrees, the estimate
PARTS = ("cars", "carmaker", "dart", "held")


@cache
def rivals() -> tuple[str, ...]:
    """Return the methods that estimate v_y and are not tireid's own."""
    installed = [name for name in methods() if name not in METHODS]
    return tuple(name for name in installed if "v_y" not in make_method(name, CARMAKER).needs)


class Told(NamedTuple):
    """How well a method told side slip, and what its frozen tires miss.

    Parameters
    ----------
    rms : error of side slip from the first sample [degrees].
    share : of that over side slip itself [-].
    within : share of errors of v_y within two standard deviations [%]; None without one.
    force : frozen force error [% of the rms force], mean of both axles; None without tires.
    """

    rms: float
    share: float
    within: float | None
    force: float | None


def judged(history: History, exact: Recording, slowest: float) -> Told:
    """Return how a run was, by the true v_y.

    Parameters
    ----------
    history : of a method that was not shown v_y.
    exact : the truth.
    slowest : speed from which samples count [m/s].
    """
    found = side_slip(history, slowest, exact.v_y)
    assert found is not None and found.rms is not None and exact.v_y is not None
    counts = exact.v_x >= slowest
    true = float(np.degrees(np.std(np.arctan2(exact.v_y, exact.v_x)[counts])))
    try:
        force: float | None = float(np.mean(force_error(history.freeze(), exact)))
    except CannotFreezeError:
        force = None
    return Told(rms=found.rms, share=found.rms / true, within=found.within, force=force)


def inertial(
    recording: Recording, vehicle: Vehicle, position: tuple[float, float], *, roll: bool = True
) -> History:
    """Return the run of the inertial identifier, to which v_y is not even given.

    Parameters
    ----------
    recording : the log; its v_y is put to zero.
    vehicle : the car as declared.
    position : of the accelerometer [m].
    roll : whether the accelerometer rolls with the body; else a_y is in the plane of the road.
    """
    method = InertialIdentifier.for_vehicle(vehicle, dt=recording.dt)
    method = replace(method, sensor_position=position)
    if not roll:
        method = replace(method, beliefs=replace(method.beliefs, roll=1e-6, sd_roll=0.002))
    return identify(replace(recording, v_y=np.zeros(len(recording))), vehicle, method)


def runs(
    recording: Recording, vehicle: Vehicle, position: tuple[float, float], *, roll: bool = True
) -> dict[str, History]:
    """Return the run of every method, none of which is shown v_y.

    Parameters
    ----------
    recording : the log.
    vehicle : the car as told.
    position : of the accelerometer before and left of the center of gravity [m].
    roll : whether it rolls with the body; the inertial identifier is told.
    """
    x, y = position
    assert recording.a_y is not None
    turning = np.gradient(recording.r, recording.dt)
    central = recording.a_y - x * turning + y * recording.r**2
    blind = replace(recording, v_y=None, a_y=central, axle_force=None)
    return {
        OWN: inertial(recording, vehicle, position, roll=roll),
        **{name: identify(blind, vehicle, make_method(name, vehicle)) for name in rivals()},
    }


def record(targets: Targets, key: str, found: Mapping[str, Told]) -> None:
    """Print and keep what each method reached.

    Parameters
    ----------
    targets : collects what is recorded.
    key : of the place.
    found : by method.
    """
    for name, one in found.items():
        within = "" if one.within is None else f"{one.within:5.0f} % within two sigma"
        force = "" if one.force is None else f"force {one.force:5.1f} %"
        print(f"  {key:28} {name:10} {one.rms:7.3f} deg {one.share:6.2f}  {within:24} {force}")
        for what, value in one._asdict().items():
            if value is not None:
                targets.record(f"{key}/{name}/{what}", value)


def median(found: Sequence[Told]) -> Told:
    """Return medians of errors, and the mean of what is within two sigma.

    Parameters
    ----------
    found : one for each drive.
    """
    within = [one.within for one in found if one.within is not None]
    force = [one.force for one in found if one.force is not None]
    return Told(
        rms=float(np.median([one.rms for one in found])),
        share=float(np.median([one.share for one in found])),
        within=float(np.mean(within)) if within else None,
        force=float(np.median(force)) if force else None,
    )


def of_car(job: tuple[str, int]) -> dict[str, Told]:
    """Return how every method did on a drive of a random car.

    Parameters
    ----------
    job : class of the car, and seed.
    """
    drive = inertial_drive(*job)
    found = runs(drive.shown, drive.declared, drive.position)
    return {name: judged(one, drive.exact, SLOWEST) for name, one in found.items()}


def random_drives(targets: Targets, count: int) -> None:
    """Judge all on random cars: medians, of classes and of all.

    Parameters
    ----------
    targets : collects what is missed.
    count : how many cars.
    """
    print(f"{count} random cars, medians: error of side slip, over side slip itself, tires")
    jobs = [(list(CLASSES)[k % len(CLASSES)], FIRST_SEED + k) for k in range(count)]
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(of_car, jobs))
    targets.record("cars", count)
    every = {name: [one[name] for one in found] for name in found[0]}
    for kind in CLASSES:
        own = [one for (of, _), one in zip(jobs, found, strict=True) if of == kind]
        medians = {name: median([one[name] for one in own]) for name in every}
        record(targets, f"cars/{kind}", medians)
    record(targets, "cars/all", {name: median(some) for name, some in every.items()})
    for name in rivals():
        over = median(every[OWN]).share / median(every[name]).share
        label = f"random cars, side slip of {OWN} over {name}"
        targets.at_most(label, over, 1.0, "-", key=f"cars/all/over_{name}")


def carmaker(targets: Targets) -> None:
    """Judge all on both runs of CarMaker, whose a_y is in the plane of the road.

    Parameters
    ----------
    targets : collects what is missed.
    """
    print("CarMaker: the same")
    for run in CARMAKER_RUNS:
        recording = read_recording(DATA / "carmaker.csv.gz", run=run)
        found = {
            name: judged(history, recording, SLOWEST)
            for name, history in runs(recording, CARMAKER, (0.0, 0.0), roll=False).items()
        }
        record(targets, f"carmaker/{run}", found)
        best = min(found[name].rms for name in rivals())
        targets.at_most(f"{run}, {OWN} over the best rival", found[OWN].rms / best, 1.0, "-")


def dart(targets: Targets) -> None:
    """Judge all on the 1:10 car with its own sensors, above `BRISK`; Vicon scores.

    Parameters
    ----------
    targets : collects what is missed.
    """
    print(f"Real 1:10 car, encoder, IMU and steering, above {BRISK:g} m/s: the same, medians")
    every: dict[str, list[Told]] = {}
    for own, vicon in own_sensors().values():
        for name, history in runs(own, DART, (0.0, 0.0)).items():
            every.setdefault(name, []).append(judged(history, vicon, BRISK))
    record(targets, "dart", {name: median(one) for name, one in every.items()})


def held(targets: Targets) -> None:
    """Judge the inertial identifier on tires of an estimate, of the same log and of another.

    Parameters
    ----------
    targets : collects what is missed.
    """
    print("On tires of an estimate from a log without v_y, beside typical ones: the same")
    logs = {run: read_recording(DATA / "carmaker.csv.gz", run=run) for run in CARMAKER_RUNS}
    logs |= {run: read_recording(DATA / "gti.csv.gz", run=run) for run in GTI_RUNS}
    logs["ferrari"] = race = read_recording(DATA / "ferrari.csv.gz")
    middle = float(race.t[len(race) // 2])
    logs["first half"] = race.between(float(race.t[0]), middle)
    logs["second half"] = race.between(middle, float(race.t[-1]))
    slalom, sine = CARMAKER_RUNS
    cars = dict.fromkeys(CARMAKER_RUNS, CARMAKER) | dict.fromkeys(GTI_RUNS, GTI)
    track, pad = GTI_RUNS
    teachers = {
        slalom: {"itself": slalom, "other": sine},
        sine: {"itself": sine, "other": slalom},
        "ferrari": {"itself": "ferrari"},
        "second half": {"other": "first half"},
        track: {"itself": track, "other": pad},
    }
    within = []
    for name, by_name in teachers.items():
        log, car = logs[name], cars.get(name, FERRARI)
        slowest = SLOWEST if name in CARMAKER_RUNS else FAST
        blind = replace(log, v_y=None, axle_force=None)
        key = f"held/{name.replace(' ', '_')}"
        typical = identify(blind, car, InertialIdentifier.for_vehicle(car, dt=log.dt))
        record(targets, key, {"typical": judged(typical, log, slowest)})
        for of, teacher in by_name.items():
            shown = replace(logs[teacher], v_y=None, axle_force=None)
            taught = ti.identify(shown, car, check=False)
            model = taught.freeze()
            method = continuing(model, car, log.dt, v_y=False)
            found = judged(identify(blind, car, method, model), log, slowest)
            record(targets, key, {of: found._replace(force=None)})
            within.append(found.within or 0.0)
            if of == "itself":
                own = judged(taught.history, log, slowest)
                record(targets, key, {"estimate": own})
                for words, one, most in (
                    ("of the estimate", own, MOST_ESTIMATED),
                    ("on tires of its own estimate", found, MOST),
                ):
                    if name in most:
                        label = f"{name}, side slip {words}"
                        targets.at_most(label, one.rms, most[name], "deg")
    share = float(np.mean(within))
    targets.at_least("errors within two sigma, mean of these", share, 90.0, key="held/within")


def canary() -> Values:
    """Return errors of side slip on one random car [deg]."""
    return {name: one.rms for name, one in of_car(("sedan", FIRST_SEED)).items()}


def tables(v: Values) -> dict[str, Table]:
    """Return the tables of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    names = [key.split("/")[2] for key in v if key.startswith("cars/all/") and key.endswith("/rms")]
    slalom, sine = CARMAKER_RUNS
    places = {
        f"{v['cars']} random cars, median": "cars/all",
        "CarMaker, slalom": f"carmaker/{slalom}",
        "CarMaker, sine": f"carmaker/{sine}",
        "1:10 car, own sensors, median": "dart",
    }
    rows = []
    for name in names:
        cells = [f"{v[f'{place}/{name}/rms']:.2f}" for place in places.values()]
        more = [f"cars/all/{name}/within", f"cars/all/{name}/force"]
        rows.append([f"`{name}`", *cells, *(f"{v[key]:.0f}" if key in v else "" for key in more)])
    header = ("method; rms error of side slip [deg]", *places, "random cars: within 2 sd [%]",
              "frozen force error [%]")  # fmt: skip
    own = [[kind, *(f"{v[f'cars/{kind}/{OWN}/{key}']:.{n}f}"
                    for key, n in (("rms", 2), ("share", 2), ("within", 0), ("force", 1)))]
           for kind in CLASSES]  # fmt: skip
    held = [
        [words, *(f"{v[key]:.2f}" if (key := f"held/{log}/{of}/rms") in v else ""
                for of in ("typical", "itself", "other", "estimate"))]
        for log, words in (
            (slalom, "CarMaker, slalom"), (sine, "CarMaker, sine"), ("ferrari", "race car"),
            ("second_half", "race car, second half"), ("exp8", "hatchback"),
        )
    ]  # fmt: skip
    return {
        "without_v_y": Table(header, rows),
        "without_v_y/classes": Table(
            (f"`{OWN}`, median of {v['cars']} random cars", "side slip error [deg]",
             "over side slip [-]", "within 2 sd [%]", "frozen force error [%]"), own),
        "without_v_y/held": Table(
            ("rms error of side slip [deg]", "typical tires", "tires of the same log",
             "tires of another log", "the estimate itself"), held),
    }  # fmt: skip


def main() -> int:
    """Print every table; return the exit code."""
    targets, options = Targets("without_v_y"), parse("without_v_y", __doc__, PARTS)
    if "cars" in options.only:
        random_drives(targets, 4 if options.quick else CARS)
    if not DATA.is_dir():
        print(f"no recordings in {DATA}: only random cars are judged")
    for name, part in (("carmaker", carmaker), ("dart", dart), ("held", held)):
        if name in options.only and DATA.is_dir() and not options.quick:
            part(targets)
    return targets.finish(canary, keep=options.record and DATA.is_dir())


if __name__ == "__main__":
    sys.exit(main())
