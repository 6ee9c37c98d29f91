"""Does the default find tires? Frozen force on drives that taught nothing, beside all rivals.

    python -m benchmarks.estimate [--only PART ...] [--methods NAME ...] [--record]

By the road of a user: `ti.identify`, `freeze`, `ti.replay`; rivals are all methods of `compare`
but the paper's laws. The error is that of both axles in
percent of their rms force; where a drive has no measured force, against what its motion shows
(inverse single-track forces). Places: random cars of four classes with good sensors, of whose
drives a full one, a gentle one and a single step teach; CarMaker, either run of what the other
taught; a real race car, of which 100 s teach and the rest is asked; a real 1:10 car, each run of
what every other taught. Beside them: several logs together, load transfer and friction circle
against slip alone, told stiffness, a wrong steering ratio, bands, and the time that it takes.
Recordings are those of `recorded_cars`; without them these parts are skipped.
"""

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import combinations, pairwise, permutations
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.random_cars import CLASSES, FIRST_SEED, random_car, random_drive, random_steering
from benchmarks.recorded_cars import CARMAKER, DART, DATA
from benchmarks.targets import Targets, keeps, show
from codegen.arrays import Array
from identifier.estimate.drive import Drive
from identifier.estimate.fit import fit
from identifier.estimate.model import FittedModel
from identifier.estimate.priors import Priors
from identifier.method import CannotFreezeError
from identifier.methods import DEFAULT, LIVE, METHODS, make_method
from identifier.run import DivergedError
from identifier.tire_model import STIFFNESS, TireModel
from models.maneuvers import StepSteer
from models.plant import PlantError
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle

ASKED = tuple(  # the paper's laws are not: `learn_and_extrapolate` has them, at 60 % elsewhere
    name
    for name in METHODS
    if name not in ("integral", "instantaneous", "instantaneous_scaled", "pi_lead")
)
CARS = 6  # of each class
GENTLE = 0.3  # of the steering that reaches the limit
STEPS = (0.5, 0.35, 0.2, 0.1)  # of it, the first that the car survives
CORNER = 8.5  # s, when the corners of a random drive have begun
SLOW = 0.8  # m/s, below which the 1:10 car is not asked
LIMITS = {"full": 2.7, "gentle": 12.0, "step": 8.5, "carmaker": 5.3}  # %
CARMAKER_RUNS = ("slalom1_14_5ms", "experiment2_40kmh")
FERRARI = Vehicle(
    name="Ferrari 250 LM",
    mass=982.0,
    yaw_inertia=1605.0,
    l_f=1.33,
    l_r=1.07,
    cornering_stiffness_front=66e3,
    cornering_stiffness_rear=105e3,
)
PIECES, PIECE = 12, 100.0  # of the race car's drive, and how long one is [s]
FLOORS = {  # of the real 1:10 car
    "dart": ("dart.csv.gz", ("ramp_steer02", "free_10_02_28", "free_10_12_05")),
    "rubber": (
        "dart_imu.csv.gz",
        (
            *("free_10_01_01", "free_10_02_28", "free_10_12_05"),
            *("ramp_steerneg025", "rubber_12_37_59"),
        ),
    ),
}
PULLED = {"laps": ("mpcc1", "mpccpp"), "slippery": ("slip1", "slip2")}  # of dart_2025
A_X = 2.0  # m/s²
CIRCLE = ("load_transfer", "braking_f", "braking_r", "driving_f", "driving_r")
TOLD = (0.25, 4.0)  # times the stiffness of the vehicle file
RATIO, WRONG_RATIOS = 20.8, (16.0, 30.0)
LEVEL = 0.9
BEHIND = 1.1  # times the best of the other methods
PARTS = (
    "random",
    "carmaker",
    "ferrari",
    "dart",
    "together",
    "circle",
    "told",
    "ratio",
    "bands",
    "cost",
)


class Taught(NamedTuple):
    """What teaches, and what is asked: each of `asked` is one error, over all of its logs."""

    car: Vehicle
    log: Recording
    asked: tuple[tuple[Recording, ...], ...]
    since: float = 0.0
    slow: float = 0.0


class Driven(NamedTuple):
    """Drives of a random car: that teach, by kind, and two others."""

    told: Vehicle
    teach: dict[str, Recording]
    others: tuple[Recording, Recording]


def drives_of(kind: str, seed: int) -> Driven:
    """Return drives of a random car as good sensors show them.

    Parameters
    ----------
    kind : class of the car.
    seed : of everything.
    """
    rng = np.random.default_rng([seed, len(kind)])
    while True:
        car = random_car(kind, rng)
        try:
            drives = [random_drive(car, rng) for _ in range(3)]
            break
        except PlantError:
            continue
    full, *others = (one.log(rng) for one in drives)
    speed, steer = drives[0].speed, None
    while steer is None:
        steer = random_steering(car, speed, 2.0, rng)

    def driven(maneuver: object, name: str) -> Recording:
        run = car.plant.simulate(maneuver, speed=speed, name=name)  # type: ignore[arg-type]
        return car.sensors.apply(run.recording(), rng)

    teach = {
        "full": full,
        "gentle": driven(replace(steer, amplitude=GENTLE * steer.amplitude), "gentle"),
    }
    for share in STEPS:
        step = StepSteer(
            amplitude=share * steer.amplitude, onset=2.0, rate_limit=1.0, duration=10.0
        )
        try:
            teach["step"] = driven(step, "step")
            break
        except PlantError:
            continue
    return Driven(car.told, teach, (others[0], others[1]))


@cache
def random_cars(first: int = FIRST_SEED, count: int = CARS) -> tuple[Driven, ...]:
    """Return the drives of all random cars.

    Parameters
    ----------
    first : seed of the first of each class.
    count : of each class.
    """
    seeds = range(first, first + count)
    return tuple(drives_of(kind, seed) for seed in seeds for kind in CLASSES)


def read(file: str, runs: Sequence[str]) -> tuple[Recording, ...]:
    """Return runs of a recording.

    Parameters
    ----------
    file : in the folder of the recordings.
    runs : their names.
    """
    return tuple(read_recording(DATA / file, run=run) for run in runs)


def pieces(recording: Recording, count: int, length: float) -> Iterator[tuple[Recording, ...]]:
    """Yield pieces of a drive, evenly spread: the piece, then what is before and behind it.

    Parameters
    ----------
    recording : the drive.
    count : of pieces.
    length : of one [s].
    """
    first, last = float(recording.t[0]), float(recording.t[-1])
    for begin in np.linspace(first, last - length, count):
        end = begin + length
        spans = ((begin, end), (first, begin), (end, last))
        yield tuple(recording.between(a, b) for a, b in spans if b - a > 5.0)


def of_random_cars() -> dict[str, list[Taught]]:
    """Return what random cars teach and what is asked of them, by kind of drive."""
    found: dict[str, list[Taught]] = defaultdict(list)
    for one in random_cars():
        asked = tuple((other,) for other in one.others)
        for kind, log in one.teach.items():
            found[kind].append(Taught(one.told, log, asked, since=CORNER))
    return found


def of_carmaker() -> dict[str, list[Taught]]:
    """Return the two runs of the simulated sedan, each of what the other teaches."""
    runs = permutations(read("carmaker.csv.gz", CARMAKER_RUNS))
    return {"carmaker": [Taught(CARMAKER, learn, ((ask,),)) for learn, ask in runs]}


def of_ferrari() -> dict[str, list[Taught]]:
    """Return pieces of the drive of a real race car, of each all the rest."""
    whole = read_recording(DATA / "ferrari.csv.gz")
    cut = pieces(whole, PIECES, PIECE)
    return {"ferrari": [Taught(FERRARI, learn, (tuple(rest),)) for learn, *rest in cut]}


def of_dart() -> dict[str, list[Taught]]:
    """Return runs of the real 1:10 car on one floor, each of what every other teaches."""
    found: dict[str, list[Taught]] = defaultdict(list)
    for place, (file, names) in FLOORS.items():
        runs = read(file, names)
        for learn in runs:
            others = tuple((one,) for one in runs if one is not learn)
            found[place].append(Taught(DART, learn, others, slow=SLOW))
    return found


PLACES = {
    "random": of_random_cars,
    "carmaker": of_carmaker,
    "ferrari": of_ferrari,
    "dart": of_dart,
}


def learnt(log: Recording, car: Vehicle, name: str) -> TireModel:
    """Return the tires that a method learns of a drive, as a user asks for them.

    Parameters
    ----------
    log : the drive.
    car : as it is told.
    name : of the method.
    """
    method = None if name == DEFAULT else make_method(name, car)
    return ti.identify(log, car, method, check=False).freeze()


def missed(
    tire: TireModel, asked: Sequence[Recording], *, since: float = 0.0, slow: float = 0.0
) -> tuple[Array, Array]:
    """Return sums of squares of error and true force of each axle over logs, (2,) each [N²].

    Parameters
    ----------
    tire : that is asked.
    asked : drives with forces.
    since : samples before this time [s] do not count.
    slow : nor those below this speed [m/s].
    """
    error, size = np.zeros(2), np.zeros(2)
    for one in asked:
        truth, force = one.axle_force, ti.replay(one, tire).axle_force
        assert truth is not None
        counts = (one.t >= since) & (one.v_x >= max(slow, tire.min_speed))
        error += np.sum((force - truth)[counts] ** 2, axis=0)
        size += np.sum(truth[counts] ** 2, axis=0)
    return error, size


def both(error: Array, size: Array) -> float:
    """Return the error of both axles over their force [%]."""
    return 100.0 * float(np.sqrt(error.sum() / size.sum()))


def errors_of(one: Taught, name: str) -> list[float]:
    """Return the errors of a method on what is asked [%]; inf where it diverged.

    Parameters
    ----------
    one : what teaches and what is asked.
    name : of the method.

    Raises
    ------
    CannotFreezeError
        Where it learns no tire.
    """
    try:
        tire = learnt(one.log, one.car, name)
    except DivergedError:
        return [np.inf] * len(one.asked)
    return [both(*missed(tire, logs, since=one.since, slow=one.slow)) for logs in one.asked]


def judge_place(
    targets: Targets, place: str, tasks: Sequence[Taught], names: Sequence[str]
) -> None:
    """Judge the default on a place, beside every other method that learns a tire of a v_y.

    Parameters
    ----------
    targets : collects what is missed.
    place : its name.
    tasks : what teaches and what is asked.
    names : of the methods.
    """
    print(f"{place}: {len(tasks)} drives teach; mean, median and worst [% of rms force]")
    means: dict[str, float] = {}
    for name in names:
        if "v_y" not in make_method(name, tasks[0].car).needs:
            continue  # it tells v_y: `without_v_y`
        try:
            errors = [error for one in tasks for error in errors_of(one, name)]
        except CannotFreezeError:
            continue
        means[name] = float(np.mean(errors))
        three = means[name], float(np.median(errors)), max(errors)
        show(name, " ".join(f"{value:7.1f}" for value in three))
        sys.stdout.flush()
        for what, value in zip(("mean", "median", "worst"), three, strict=True):
            if np.isfinite(value):
                targets.record(f"{place}/{name}/{what}", value, "%")
        if name == DEFAULT and place in LIMITS:
            targets.at_most(f"{place}: mean", three[0], LIMITS[place], key=f"{place}/mean")
        if name == DEFAULT and place == "ferrari":
            targets.at_most("ferrari: median", three[1], 10.7, key="ferrari/median")
            targets.at_most("ferrari: worst", three[2], 12.0, key="ferrari/worst")
    if DEFAULT not in means or len(means) == 1:
        return
    own = means.pop(DEFAULT)
    if LIVE in means and place in FLOORS:
        label, ratio = f"{place}: over {LIVE}", own / means[LIVE]
        targets.at_most(label, ratio, 0.82, "-", key=f"{place}/over_live")
    best = min(means, key=means.__getitem__)
    targets.record(f"{place}/best_rival", best)
    limit = 1.0 if place in FLOORS else BEHIND
    label = f"{place}: over the best rival, {best}"
    targets.at_most(label, own / means[best], limit, "-", key=f"{place}/over_best")


def judge_together(targets: Targets) -> None:
    """Judge both runs of CarMaker taught together, each on itself.

    Parameters
    ----------
    targets : collects what is missed.
    """
    runs = read("carmaker.csv.gz", CARMAKER_RUNS)
    tire = fit(runs, CARMAKER).model
    error = float(np.mean([both(*missed(tire, [one])) for one in runs]))
    targets.at_most("carmaker: both taught together", error, 3.5, key="together/carmaker")


def judge_circle(targets: Targets) -> None:
    """Judge load transfer and friction circle against slip alone, where the car pulls and brakes.

    Parameters
    ----------
    targets : collects what is missed.
    """
    slip_alone = Priors.of(DART).without(CIRCLE)
    rows = []
    for floor, names in PULLED.items():
        for learn, ask in permutations(read("dart_2025.csv.gz", names)):
            a_x = Drive.of(ask, DART, replay=True).signals[:, 5]
            truth = ask.axle_force
            assert truth is not None
            pulls = (np.abs(a_x) > A_X) & (ask.v_x > SLOW)
            pair = []
            for priors in (None, slip_alone):
                force = ti.replay(ask, fit([learn], DART, priors).model).axle_force
                error, size = (np.sum(one[pulls, 1] ** 2) for one in (force - truth, truth))
                pair.append(100.0 * float(np.sqrt(error / size)))
            rows.append(pair)
            key = f"circle/{floor}/{learn.name.split(':')[-1]}"
            show(
                f"{key}: rear, with load and circle / slip alone", f"{pair[0]:.1f} / {pair[1]:.1f}"
            )
            targets.record(f"{key}/with", pair[0], "%")
            targets.record(f"{key}/without", pair[1], "%")
    with_it, without = np.array(rows).T
    ratio = float(with_it.mean() / without.mean())
    targets.at_most("load and circle over slip alone, mean", ratio, 1.0, "-", key="circle/mean")
    worst = float((with_it / without).max())
    targets.at_most("the same, worst pair", worst, 1.1, "-", key="circle/worst")


def judge_told(targets: Targets) -> None:
    """Judge that the stiffness of a vehicle file does not reach the tires.

    Parameters
    ----------
    targets : collects what is missed.
    """
    learn, ask = read("carmaker.csv.gz", CARMAKER_RUNS)
    found = []
    for factor in (1.0, *TOLD):
        car = replace(
            CARMAKER,
            cornering_stiffness_front=factor * CARMAKER.cornering_stiffness_front,
            cornering_stiffness_rear=factor * CARMAKER.cornering_stiffness_rear,
        )
        found.append(both(*missed(learnt(learn, car, DEFAULT), [ask])))
    change = float(np.max(np.abs(np.diff(found))))
    targets.at_most("told stiffness, largest change", change, 0.01, key="told/change")


def judge_ratio(targets: Targets) -> None:
    """Judge that a wrong steering ratio reaches the doubt of the stiffness, or the verdict.

    Parameters
    ----------
    targets : collects what is missed.
    """
    silent = 0
    for run in CARMAKER_RUNS:
        found = {}
        for ratio in (RATIO, *WRONG_RATIOS):
            log = read_recording(
                DATA / "carmaker.csv.gz",
                run=run,
                columns={"delta_f": f"delta_sw /{ratio}"},
            )
            history = ti.identify(log, CARMAKER, check=False)
            stiff = [one for one in history.freeze().estimates() if one.title == STIFFNESS]
            found[ratio] = stiff, history.verdict.valid
        right = [one.value for one in found[RATIO][0]]
        for ratio in WRONG_RATIOS:
            stiff, valid = found[ratio]
            covers = all(
                abs(one.value - value) <= 2.0 * (one.sd or 0.0)
                for one, value in zip(stiff, right, strict=True)
            )
            silent += valid and not covers
            words = ", ".join(
                f"{1e-3 * one.value:.0f} ± {1e-3 * (one.sd or 0.0):.0f} for {1e-3 * value:.0f}"
                for one, value in zip(stiff, right, strict=True)
            )
            judged = "valid" if valid else "not valid"
            show(f"{run}, ratio {ratio:g}: kN/rad, front, rear", f"{words}; {judged}")
    targets.at_most("wrong ratios that are valid without the truth", silent, 0, "", "ratio/silent")


def held(tire: TireModel, asked: Recording, *, since: float = 0.0, slow: float = 0.0) -> float:
    """Return the share of samples whose true force lies in the band, mean of both axles [%].

    Parameters
    ----------
    tire, since, slow : as of `missed`.
    asked : a drive with forces.
    """
    assert isinstance(tire, FittedModel) and asked.axle_force is not None
    counts = (asked.t >= since) & (asked.v_x >= max(slow, tire.min_speed))
    away = np.abs(tire.predict(asked) - asked.axle_force)
    return 100.0 * float(np.mean((away <= tire.band.over(asked, LEVEL))[counts]))


Case = tuple[str, Vehicle, Sequence[Recording], Recording, float, float]


def band_cases() -> Iterator[Case]:
    """Yield place, car, what teaches, what is asked, since when and from what speed."""
    for one in random_cars():
        first, second = one.others
        full = one.teach["full"]
        yield "random", one.told, [full], first, CORNER, 0.0
        yield "random", one.told, [full, first], second, CORNER, 0.0
    if not DATA.is_dir():
        return
    groups: dict[str, tuple[Vehicle, Sequence[Recording], float]] = {}
    halves = []
    for run in read("carmaker.csv.gz", CARMAKER_RUNS):
        middle, end = 0.5 * float(run.t[0] + run.t[-1]), float(run.t[-1])
        halves.append((run.between(float(run.t[0]), middle), run.between(middle, end)))
    for a, b in ((0, 1), (1, 0)):
        for whose in halves:
            yield "carmaker", CARMAKER, [one[a] for one in halves], whose[b], 0.0, 0.0
    for learn, ask in permutations(read("carmaker.csv.gz", CARMAKER_RUNS)):
        yield "carmaker", CARMAKER, [learn], ask, 0.0, 0.0
    whole = read_recording(DATA / "ferrari.csv.gz")
    edges = np.linspace(float(whole.t[0]), float(whole.t[-1]), 6)
    laps = [whole.between(a, b) for a, b in pairwise(edges)]
    groups["ferrari"] = FERRARI, laps, 0.0
    for place, (file, names) in FLOORS.items():
        groups[place] = DART, read(file, names), SLOW
    for place, (car, runs, slow) in groups.items():
        for count in (1, 2):
            for teach in combinations(runs, count):
                for ask in runs:
                    if not any(ask is one for one in teach):
                        yield place, car, teach, ask, 0.0, slow


def judge_bands(targets: Targets) -> None:
    """Judge how often bands of 90 % hold the true force of other drives.

    Parameters
    ----------
    targets : collects what is missed.
    """
    found: dict[tuple[str, int], list[float]] = defaultdict(list)
    models: dict[tuple[int, ...], tuple[TireModel, Sequence[Recording]]] = {}
    for place, car, teach, ask, since, slow in band_cases():
        whose = tuple(id(one) for one in teach)
        if whose not in models:
            models[whose] = fit(teach, car).model, teach  # kept, so that no other has its id
        share = held(models[whose][0], ask, since=since, slow=slow)
        found[place, len(teach)].append(share)
    for (place, count), shares in found.items():
        mean, label = float(np.mean(shares)), f"{place}: band of 90 % of {count} logs holds"
        key = f"bands/{place}/{count}"
        if count == 1:
            targets.at_least(label, mean, 80.0, key=key)
        else:
            targets.at_least(label, mean, 85.0, key=f"{key}/least")
            targets.at_most(label, mean, 95.0, key=f"{key}/most")


def judge_cost(targets: Targets) -> None:
    """Judge the CPU time of a minute of log against that of the method of a car.

    Parameters
    ----------
    targets : collects what is missed.
    """
    one = next(one for one in random_cars() if one.told.name == "sedan")
    log = one.teach["full"]
    spent = {}
    for name in (DEFAULT, LIVE):
        learnt(log, one.told, name)  # compiled and warm
        begin = time.process_time()
        learnt(log, one.told, name)
        spent[name] = (time.process_time() - begin) * 60.0 / log.duration
        targets.record(f"cost/{name}", spent[name], "s")
    more = spent[DEFAULT] - spent[LIVE]
    targets.at_most("a minute of log, CPU beyond that of a car", more, 1.0, "s", key="cost/more")


def main() -> int:
    """Print every number; return 1 where a target is missed."""
    targets, record = Targets("estimate"), keeps()
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, metavar="PART")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=ASKED, metavar="NAME")
    told = parser.parse_args()
    if not DATA.is_dir():
        print(f"skipped recorded cars: the recordings are not there: {DATA} (set TIREID_DATA)")
    for part, drives in PLACES.items():
        if part in told.only and (part == "random" or DATA.is_dir()):
            for place, tasks in drives().items():
                judge_place(targets, place, tasks, list(told.methods))
    recorded = {
        "together": judge_together,
        "circle": judge_circle,
        "told": judge_told,
        "ratio": judge_ratio,
    }
    for part, judge in recorded.items():
        if part in told.only and DATA.is_dir():
            judge(targets)
    if "bands" in told.only:
        judge_bands(targets)
    if "cost" in told.only:
        judge_cost(targets)
    whole = tuple(told.only) == PARTS and set(ASKED) <= set(told.methods)
    return targets.finish(keep=record and whole)


if __name__ == "__main__":
    sys.exit(main())
