"""Does the default find tires? Frozen force on drives that were not identified, beside all rivals.

    python -m benchmarks.estimate [--quick] [--record] [--only PART ...]

By the road of a user: `ti.identify`, `freeze`, forces of another log, as `ti.replay` and `compare`
have them: each method with that log's own zeros of the sensors. Rivals are all methods of `compare`
that use v_y, but the paper's laws. The error is that of both axles in percent of their rms force;
where a drive has no measured force, against what its motion shows (inverse single-track forces).
Places: random cars of four classes with good sensors, identified from a full drive, a gentle one or
a single step; CarMaker, either run from the other; a real race car, 100 s and the rest; a real 1:10
car, each run from every other; a real hatchback, on two days. Beside them: several logs together,
load transfer and friction circle against slip alone, a wrong steering ratio, and the time that it
takes.
Recordings are those of `recorded_cars`; without them these parts are skipped.
"""

import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from itertools import permutations
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.random_cars import CLASSES, FIRST_SEED, random_car, random_drive, random_steering
from benchmarks.recorded_cars import CARMAKER, CARMAKER_RUNS, DART, DATA, FERRARI, GTI
from benchmarks.targets import Table, Targets, Values, parse, show
from codegen.arrays import Array
from identifier.compare.zeros import replayed
from identifier.estimate.drive import Drive
from identifier.estimate.fit import fit
from identifier.estimate.priors import Priors
from identifier.method import CannotFreezeError
from identifier.methods import DEFAULT, LIVE, draws_weights, make_method, methods
from identifier.run import DivergedError
from identifier.tire_model import STIFFNESS, TireModel
from models.maneuvers import StepSteer
from models.plant import PlantError
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle

CARS = 6  # of each class
GENTLE = 0.3  # of the steering that reaches the limit
STEPS = (0.5, 0.35, 0.2, 0.1)  # of it, the first that the car survives
CORNER = 8.5  # s, when the corners of a random drive have begun
SLOW = 0.8  # m/s, below which the 1:10 car is not asked
LIMITS = {"full": 2.7, "gentle": 12.0, "step": 8.5, "carmaker": 5.3}  # %
GTI_LIMITS = {"exp8": (8.0, 9.0), "exp12": (12.0, 20.0)}  # front, rear [%], by what taught
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
RATIO, WRONG_RATIOS = 20.8, (16.0, 26.0, 30.0)
BEGUN = 12.0  # s, until when the slalom slips by 1.1 degrees alone
BEHIND = 1.1  # times the best of the other methods
PARTS = (
    "random", "carmaker", "ferrari", "dart", "gti", "together", "circle", "ratio", "cost",
)  # fmt: skip


class Taught(NamedTuple):
    """What teaches, and what is asked: each of `asked` is one error, over all of its logs."""

    car: Vehicle
    log: Recording
    asked: tuple[tuple[Recording, ...], ...]
    since: float = 0.0
    slow: float = 0.0


class Driven(NamedTuple):
    """Drives of a random car: that teach, by kind, and two others."""

    declared: Vehicle
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
        run = car.plant.simulate(maneuver, speed=speed, name=name)  # type: ignore[arg-type]  # any
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
    return Driven(car.declared, teach, (others[0], others[1]))


@cache
def random_cars(count: int = CARS) -> tuple[Driven, ...]:
    """Return the drives of all random cars.

    Parameters
    ----------
    count : of each class.
    """
    seeds = range(FIRST_SEED, FIRST_SEED + count)
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


def of_random_cars(count: int = CARS) -> dict[str, list[Taught]]:
    """Return what is identified of random cars and what is evaluated, by kind of drive.

    Parameters
    ----------
    count : of cars of each class.
    """
    found: dict[str, list[Taught]] = defaultdict(list)
    for one in random_cars(count):
        for kind, task in tasks_of(one).items():
            found[kind].append(task)
    return found


def tasks_of(one: Driven) -> dict[str, Taught]:
    """Return what is identified of a random car and what is evaluated, by kind of drive."""
    asked = tuple((other,) for other in one.others)
    return {kind: Taught(one.declared, log, asked, since=CORNER) for kind, log in one.teach.items()}


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
        truth, force = one.axle_force, replayed(tire, one)
        assert truth is not None
        counts = (one.t >= since) & (one.v_x >= max(slow, tire.min_speed))
        error += np.sum((force - truth)[counts] ** 2, axis=0)
        size += np.sum(truth[counts] ** 2, axis=0)
    return error, size


def both(error: Array, size: Array) -> float:
    """Return the error of both axles over their force [%]."""
    return 100.0 * float(np.sqrt(error.sum() / size.sum()))


def errors_of(one: Taught, name: str) -> list[float] | None:
    """Return the errors of a method on what is evaluated [%]: inf where it diverged.

    Parameters
    ----------
    one : what is identified and what is evaluated.
    name : of the method; None is returned of one that identifies no tire.
    """
    try:
        tire = learnt(one.log, one.car, name)
    except DivergedError:
        return [np.inf] * len(one.asked)
    except CannotFreezeError:
        return None
    return [both(*missed(tire, logs, since=one.since, slow=one.slow)) for logs in one.asked]


def rivals(car: Vehicle) -> list[str]:
    """Return the methods of `compare` that use v_y, but the paper's laws, the default first."""
    known = (name for name in methods() if not draws_weights(name))
    return [name for name in known if "v_y" in make_method(name, car).needs]


def judge_place(targets: Targets, place: str, tasks: Sequence[Taught], *, quick: bool) -> None:
    """Judge the default on a place, beside every other method that identifies a tire with v_y.

    Parameters
    ----------
    targets : collects what is missed.
    place : its name.
    tasks : what is identified and what is evaluated.
    quick : beside the linear tire alone.
    """
    print(f"{place}: {len(tasks)} drives identified; mean, median and worst [% of rms force]")
    names = [DEFAULT, "linear"] if quick else rivals(tasks[0].car)
    pairs = [(one, name) for name in names for one in tasks]
    with ProcessPoolExecutor() as pool:
        answers = list(pool.map(errors_of, *zip(*pairs, strict=True)))
    means: dict[str, float] = {}
    for k, name in enumerate(names):
        found = answers[k * len(tasks) : (k + 1) * len(tasks)]
        errors = [error for some in found if some is not None for error in some]
        if None in found:
            continue
        means[name] = float(np.mean(errors))
        three = means[name], float(np.median(errors)), max(errors)
        show(name, " ".join(f"{value:7.1f}" for value in three))
        for what, value in zip(("mean", "median", "worst"), three, strict=True):
            if np.isfinite(value):
                targets.record(f"{place}/{name}/{what}", value)
        if name == DEFAULT and place in LIMITS:
            targets.at_most(f"{place}: mean", three[0], LIMITS[place])
        if name == DEFAULT and place == "ferrari":
            targets.at_most("ferrari: median", three[1], 10.7)
            targets.at_most("ferrari: worst", three[2], 12.0)
    own = means.pop(DEFAULT)
    if LIVE in means and place in FLOORS:
        targets.at_most(f"{place}: error over that of {LIVE}", own / means[LIVE], 0.82, "-")
    best = min(means, key=means.__getitem__)
    limit = 1.0 if place in FLOORS else BEHIND
    targets.at_most(
        f"{place}: error over that of the best rival, {best}", own / means[best], limit, "-"
    )


def judge_together(targets: Targets) -> None:
    """Judge both runs of CarMaker taught together, each on itself.

    Parameters
    ----------
    targets : collects what is missed.
    """
    runs = read("carmaker.csv.gz", CARMAKER_RUNS)
    tire = fit(runs, CARMAKER).model
    error = float(np.mean([both(*missed(tire, [one])) for one in runs]))
    targets.at_most("carmaker: both runs identified together", error, 3.5, key="together/carmaker")


def judge_gti(targets: Targets) -> None:
    """Judge two drives of a real hatchback, on two days, each by what the other teaches.

    Parameters
    ----------
    targets : collects what is missed.
    """
    for learn, ask in permutations(read("gti.csv.gz", list(GTI_LIMITS))):
        error, size = missed(learnt(learn, GTI, DEFAULT), [ask])
        name = learn.name.split(":")[-1]
        found = 100.0 * np.sqrt(error / size)
        for axle, value, limit in zip(("front", "rear"), found, GTI_LIMITS[name], strict=True):
            targets.at_most(
                f"hatchback, identified from {name}: {axle}",
                float(value),
                limit,
                key=f"gti/{name}/{axle}",
            )


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
            targets.record(f"{key}/with", pair[0])
            targets.record(f"{key}/without", pair[1])
    with_it, without = np.array(rows).T
    ratio = float(with_it.mean() / without.mean())
    targets.at_most("load and circle over slip alone, mean", ratio, 1.0, "-", key="circle/mean")
    worst = float((with_it / without).max())
    targets.at_most("the same, worst pair", worst, 1.1, "-", key="circle/worst")


def judge_ratio(targets: Targets) -> None:
    """Judge that a wrong steering ratio reaches the doubt of the stiffness, or the verdict.

    Parameters
    ----------
    targets : collects what is missed.
    """
    silent = 0
    for run, end in (*((run, np.inf) for run in CARMAKER_RUNS), (CARMAKER_RUNS[0], BEGUN)):
        found = {}
        for ratio in (RATIO, *WRONG_RATIOS):
            log = read_recording(
                DATA / "carmaker.csv.gz",
                run=run,
                columns={"delta_f": f"delta_sw /{ratio}"},
            ).between(0.0, end)
            history = ti.identify(log, CARMAKER, check=False)
            stiff = [one for one in history.freeze().estimates() if one.title == STIFFNESS]
            found[ratio] = stiff, history.verdict.valid
        right = [one.value for one in found[RATIO][0]]
        for ratio in WRONG_RATIOS:
            stiff, valid = found[ratio]
            told = [(one.value, one.sd or 0.0, x) for one, x in zip(stiff, right, strict=True)]
            silent += valid and any(abs(value - x) > 2.0 * sd for value, sd, x in told)
            words = ", ".join(
                f"{1e-3 * value:.0f} ± {1e-3 * sd:.0f} for {1e-3 * x:.0f}" for value, sd, x in told
            )
            judged = "valid" if valid else "not valid"
            known = "" if all(one.identified for one in stiff) else ", not known"
            said = f"{words}; {judged}{known}"
            show(f"{run} to {end:g} s, ratio {ratio:g}: kN/rad, front, rear", said)
    targets.at_most(
        "wrong steering ratios, valid, truth outside two deviations", silent, 0, "", "ratio/silent"
    )


def judge_cost(targets: Targets) -> None:
    """Judge the CPU time of a minute of log against that of the method of a car.

    Parameters
    ----------
    targets : collects what is missed.
    """
    one = next(one for one in random_cars() if one.declared.name == "sedan")
    log = one.teach["full"]
    spent = {}
    for name in (DEFAULT, LIVE):
        learnt(log, one.declared, name)  # compiled and warm
        begin = time.process_time()
        learnt(log, one.declared, name)
        spent[name] = (time.process_time() - begin) * 60.0 / log.duration
        targets.record(f"cost/{name}", spent[name])
    more = spent[DEFAULT] - spent[LIVE]
    targets.at_most("a minute of log, CPU beyond that of a car", more, 1.0, "s", key="cost/more")


COLUMNS = {
    "full": ("24 random cars, full drive", "mean"),
    "gentle": ("the same, gentle drive", "mean"),
    "step": ("the same, single step", "mean"),
    "carmaker": ("CarMaker, 2 pairs", "mean"),
    "ferrari": ("race car, 12 pieces", "median"),
    "dart": ("1:10 car, 6 pairs", "mean"),
    "rubber": ("1:10 car on rubber, 20 pairs", "mean"),
}


def canary() -> Values:
    """Return errors of two methods on one random car [%]."""
    full = tasks_of(drives_of("sedan", FIRST_SEED))["full"]
    found = {name: errors_of(full, name) or [] for name in (DEFAULT, LIVE)}
    return {f"{name}/{i}": value for name, some in found.items() for i, value in enumerate(some)}


def tables(v: Values) -> dict[str, Table]:
    """Return the tables of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    names = dict.fromkeys(key.split("/")[1] for key in v if key.endswith("/mean"))
    names.pop("mean", None)
    rows = []
    for name in (one for one in names if f"full/{one}/mean" in v):
        keys = [f"{place}/{name}/{how}" for place, (_, how) in COLUMNS.items()]
        rows.append([f"`{name}`", *(f"{v[key]:.1f}" if key in v else "diverged" for key in keys)])
    header = ("method; error [%]", *(f"{what}, {how}" for what, how in COLUMNS.values()))
    circle = [
        [f"{floor}: {run}", f"{v[f'circle/{floor}/{run}/with']:.1f}",
         f"{v[f'circle/{floor}/{run}/without']:.1f}"]
        for floor, runs in PULLED.items() for run in runs
    ]  # fmt: skip
    cost = [[f"`{name}`", f"{v[f'cost/{name}']:.2f}"] for name in (DEFAULT, LIVE)]
    return {
        "estimate": Table(header, rows),
        "estimate/circle": Table(
            ("1:10 car, identified run", "rear error [%], load transfer and friction circle",
             "slip alone"),
            circle,
        ),
        "estimate/cost": Table(("method", "processor time of a minute of log [s]"), cost),
    }  # fmt: skip


def main() -> int:
    """Print every number; return 1 where a target is missed."""
    targets, options = Targets("estimate"), parse("estimate", __doc__, PARTS)
    only = options.only[:2] if options.quick else options.only
    if not DATA.is_dir():
        print(f"skipped recorded cars: the recordings are not there: {DATA} (set TIREID_DATA)")
    for part, drives in PLACES.items():
        if part in only and (part == "random" or DATA.is_dir()):
            places = of_random_cars(1) if options.quick and part == "random" else drives()
            for place, tasks in places.items():
                judge_place(targets, place, tasks, quick=options.quick)
    recorded = {
        "gti": judge_gti,
        "together": judge_together,
        "circle": judge_circle,
        "ratio": judge_ratio,
    }
    for part, judge in recorded.items():
        if part in only and DATA.is_dir():
            judge(targets)
    if "cost" in only:
        judge_cost(targets)
    return targets.finish(canary, keep=options.record and DATA.is_dir())


if __name__ == "__main__":
    sys.exit(main())
