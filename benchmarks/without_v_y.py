"""Lateral velocity without its sensor: the inertial identifier beside what it is compared with.

    python -m benchmarks.without_v_y [--record] [--only PART ...] [--cars N]

A linear Kalman filter on the vehicle's tires, a naive joint filter of state and tires, a washout,
and moving-horizon estimation, those of benchmarks/rivals, on recordings of CarMaker, the own
sensors of the real 1:10 car, and random cars on banked roads with what inertial sensors add; all in
one run. Nobody is shown v_y; the true one scores, from the first sample. Numbers of the baselines
were chosen on random cars with seeds below `FIRST_SEED`, and on no recording. Where the
accelerometer sits is told to all: the inertial identifier takes it, for the others a_y is moved to
the center of gravity. Then the inertial identifier as a car with logs runs it, on tires that an
estimate from a log without v_y found, the same log and another: CarMaker and a real race car.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.estimate import FERRARI
from benchmarks.inertial import (
    BRISK,
    CARMAKER_RUNS,
    frozen_error,
    inertial_drive,
    own_sensors,
    without_v_y,
)
from benchmarks.random_cars import CLASSES, FIRST_SEED
from benchmarks.recorded_cars import CARMAKER, DART, DATA
from benchmarks.targets import Targets, keeps
from identifier.compare.course import side_slip, step_times
from identifier.estimate.fit import fit
from identifier.inertial import InertialIdentifier
from identifier.method import CannotFreezeError
from identifier.methods import continuing, make_method
from identifier.run import History, identify
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle
from tireid_rivals import NAMES

CARS = 80
OWN = "inertial"
SLOWEST = 0.3  # m/s, from which a random drive counts
FAST = 3.0  # m/s, from which the race car's counts
MOST = {"slalom1_14_5ms": 0.15, "experiment2_40kmh": 0.05, "ferrari": 0.32}  # degrees
PARTS = ("carmaker", "dart", "cost", "held", "cars")


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """How well a method told side slip, and what its frozen tires miss.

    Parameters
    ----------
    rms : error of side slip from the first sample [degrees].
    share : of that over side slip itself [-].
    within : share of errors of v_y within two standard deviations [%]; None without one.
    force : frozen force error over the rms force [-]; None of a method without tires.
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
        force: float | None = frozen_error(history.freeze(), exact)
    except CannotFreezeError:
        force = None
    return Told(rms=found.rms, share=found.rms / true, within=found.within, force=force)


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
        OWN: without_v_y(recording, vehicle, position, roll=roll),
        **{name: identify(blind, vehicle, make_method(name, vehicle)) for name in NAMES},
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
        force = "" if one.force is None else f"force {100.0 * one.force:5.1f} %"
        print(f"  {key:28} {name:10} {one.rms:7.3f} deg {one.share:6.2f}  {within:24} {force}")
        targets.record(f"{key}/{name}/rms", one.rms, "deg")
        targets.record(f"{key}/{name}/share", one.share, "-")
        if one.within is not None:
            targets.record(f"{key}/{name}/within", one.within, "%")
        if one.force is not None:
            targets.record(f"{key}/{name}/force", 100.0 * one.force, "%")
    if OWN in found:
        best = min(one.rms for name, one in found.items() if name != OWN)
        targets.record(f"{key}/over_best", found[OWN].rms / best, "-")


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


def random_drives(targets: Targets, cars: int) -> None:
    """Judge all on random cars: medians, of classes and of all.

    Parameters
    ----------
    targets : collects what is missed.
    cars : how many, a multiple of the classes.
    """
    print(f"{cars} random cars, medians: error of side slip, over side slip itself, honesty, tires")
    found: dict[str, dict[str, list[Told]]] = {kind: {} for kind in CLASSES}
    for k in range(cars):
        kind = list(CLASSES)[k % len(CLASSES)]
        drive = inertial_drive(kind, FIRST_SEED + k)
        for name, history in runs(drive.shown, drive.told, drive.position).items():
            told = judged(history, drive.exact, SLOWEST)
            found[kind].setdefault(name, []).append(told)
    for kind, by_name in found.items():
        record(targets, f"cars/{kind}", {name: median(one) for name, one in by_name.items()})
    every = {name: [one for kind in CLASSES for one in found[kind][name]] for name in found[kind]}
    record(targets, "cars/all", {name: median(one) for name, one in every.items()})
    for name in NAMES:
        wins = np.mean([o.rms < b.rms for o, b in zip(every[OWN], every[name], strict=True)])
        targets.record(f"cars/all/wins_over_{name}", 100.0 * float(wins), "%")
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
        best = min(found[name].rms for name in NAMES)
        targets.at_most(f"{run}, {OWN} over the best baseline", found[OWN].rms / best, 1.0, "-")


def dart(targets: Targets) -> None:
    """Judge all on the 1:10 car with its own sensors, above `BRISK`; Vicon scores.

    Parameters
    ----------
    targets : collects what is missed.
    """
    print(f"Real 1:10 car, encoder, IMU and steering, above {BRISK:g} m/s: the same")
    every: dict[str, list[Told]] = {}
    for run, (own, vicon) in own_sensors().items():
        found = {
            name: judged(history, vicon, BRISK)
            for name, history in runs(own, DART, (0.0, 0.0)).items()
        }
        record(targets, f"dart/{run}", found)
        for name, one in found.items():
            every.setdefault(name, []).append(one)
    record(targets, "dart/all", {name: median(one) for name, one in every.items()})


def held(targets: Targets) -> None:
    """Judge the inertial identifier on tires of an estimate, of the same log and of another.

    Parameters
    ----------
    targets : collects what is missed.
    """
    print("On tires of an estimate from a log without v_y, beside typical ones: the same")
    logs = {run: read_recording(DATA / "carmaker.csv.gz", run=run) for run in CARMAKER_RUNS}
    logs["ferrari"] = race = read_recording(DATA / "ferrari.csv.gz")
    middle = float(race.t[len(race) // 2])
    logs["first half"] = race.between(float(race.t[0]), middle)
    logs["second half"] = race.between(middle, float(race.t[-1]))
    slalom, sine = CARMAKER_RUNS
    teachers = {
        slalom: {"itself": slalom, "other": sine},
        sine: {"itself": sine, "other": slalom},
        "ferrari": {"itself": "ferrari"},
        "second half": {"other": "first half"},
    }
    within = []
    for name, by_name in teachers.items():
        log, car = logs[name], CARMAKER if name in CARMAKER_RUNS else FERRARI
        slowest = SLOWEST if name in CARMAKER_RUNS else FAST
        blind = replace(log, v_y=None, axle_force=None)
        key = f"held/{name.replace(' ', '_')}"
        typical = identify(blind, car, InertialIdentifier.for_vehicle(car, dt=log.dt))
        record(targets, key, {"typical": judged(typical, log, slowest)})
        for of, teacher in by_name.items():
            shown = replace(logs[teacher], v_y=None, axle_force=None)
            model = fit([shown], car).model
            method = continuing(model, car, log.dt, v_y=False)
            found = judged(identify(blind, car, method, model), log, slowest)
            record(targets, key, {of: replace(found, force=None)})
            within.append(found.within or 0.0)
            if of == "itself":
                label = f"{name}, on tires of its own estimate: side slip"
                targets.at_most(label, found.rms, MOST[name], "deg")
    share = float(np.mean(within))
    targets.at_least("errors within two sigma, mean of these", share, 90.0, key="held/within")


def cost(targets: Targets) -> None:
    """Time a step of each in C on this machine, on a run of CarMaker.

    Parameters
    ----------
    targets : collects what is recorded.
    """
    recording = read_recording(DATA / "carmaker.csv.gz", run=CARMAKER_RUNS[0])
    methods = {name: make_method(name, CARMAKER) for name in (OWN, *NAMES)}
    for name, seconds in step_times(methods, CARMAKER, recording, repeats=5).items():
        print(f"  a step of {name:10} {1e6 * seconds:8.2f} us")
        targets.record(f"step/{name}", 1e6 * seconds, "us")


def main() -> int:
    """Print every table; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cars", type=int, default=CARS, help="random cars (default: %(default)s)")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, metavar="PART")
    options = parser.parse_args()
    targets = Targets("without_v_y")
    for name, part in (("carmaker", carmaker), ("dart", dart), ("cost", cost), ("held", held)):
        if name in options.only and DATA.is_dir():
            part(targets)
    if not DATA.is_dir():
        print(f"no recordings in {DATA}: only random cars are judged")
    if "cars" in options.only:
        random_drives(targets, options.cars)
    whole = options.cars == CARS and DATA.is_dir() and tuple(options.only) == PARTS
    return targets.finish(keep=keep and whole)


if __name__ == "__main__":
    sys.exit(main())
