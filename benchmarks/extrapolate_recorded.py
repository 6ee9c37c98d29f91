"""Learn on one recorded drive, freeze, predict another: CarMaker both ways and a real 1:10 car.

Every number but those inside and outside the known slip is one of `tireid compare`, on the
vehicles of `recorded_cars`. The recordings of ../shared/data are not part of the project; without
them this part is skipped.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.floor import axle_structure, fit_floor
from benchmarks.recorded_cars import CARMAKER, DART, DATA
from benchmarks.targets import Targets, show
from codegen.arrays import Array
from identifier.axle import AxleIdentifier, AxleModel
from identifier.baselines import magic_formula_ekf
from identifier.compare.course import (
    Course,
    Shares,
    Trial,
    cross_replay,
    same_and_other,
    shares,
)
from identifier.compare.study import Comparison, run_comparison
from identifier.method import Method
from identifier.methods import LIVE, METHODS, REFERENCE, make_method
from identifier.reproducibility import AxleRmse, axle_rms
from identifier.run import identify
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle

Frozen = Mapping[str, Mapping[str, AxleRmse]]
RUNS = {"hard": "slalom1_14_5ms", "mild": "experiment2_40kmh"}
REAL_RUNS = ("ramp_steer02", "free_10_02_28", "free_10_12_05")
SEEDS = 10
BRISK = "ramp_steerneg025"  # of the real car, too
SLOW = ("free_10_01_01", "rubber_12_37_59")  # forces below 1 N rms, of which half is not motion
TILES = "tape_tiles_steer_neg03"  # another floor: nothing learnt elsewhere knows its friction
BEHIND = 1.0 / 0.9  # the default over any other method: none is better by more than 10 %
BASELINES = ("linear", "magic_formula_ekf", REFERENCE)
TEXTBOOK: dict[str, Callable[[Vehicle], Method]] = {
    "magic_formula_ekf": partial(magic_formula_ekf, textbook=True),
}
AXLES = ("front", "rear")
LIMITS = {("hard", "hard"): (9.0, 5.0), ("hard", "mild"): (15.0, 15.0)}  # front, rear [%]
INSIDE = 15.0  # %, of the hard drive within the slip that the mild one teaches
TOLD = ((110e3, 130e3), (80e3, 100e3), (150e3, 200e3))  # N/rad: each target holds for the worst


def told_cars() -> tuple[Vehicle, ...]:
    """Return the CarMaker car as it is told with each pair of stiffnesses, the usual one first."""
    return tuple(
        replace(CARMAKER, cornering_stiffness_front=front, cornering_stiffness_rear=rear)
        for front, rear in TOLD
    )


def carmaker(targets: Targets) -> None:
    """Judge the default and the paper's law on the high-fidelity simulation.

    Parameters
    ----------
    targets : collects what is missed.
    """
    drives = {n: read_recording(DATA / "carmaker.csv.gz", run=run) for n, run in RUNS.items()}
    runs = tuple(drives.values())
    found = _compare((LIVE,), CARMAKER, runs)
    others = [_compare((LIVE,), car, runs) for car in told_cars()[1:]]
    every = [one.trials[LIVE].frozen for one in (found, *others)]
    course = found.course
    floors = _floors(course)
    print(f"CarMaker, effective vehicle, {LIVE} [% of rms force]")
    for learnt, first in drives.items():
        for unseen, other in drives.items():
            errors = [_percent(course, other, one[first.name][other.name]) for one in every if one]
            assert len(errors) == len(TOLD)
            error, worst = errors[0], np.max(errors, axis=0).tolist()
            floor = _percent(course, other, floors[first.name][other.name])
            label = f"learnt on {RUNS[learnt]}, replayed on {RUNS[unseen]}"
            for k, axle in enumerate(AXLES):
                key = f"carmaker/{learnt}/{unseen}"
                targets.record(f"{key}/{LIVE}/{axle}", error[k], "%")
                targets.record(f"{key}/floor/{axle}", floor[k], "%")
                told = f"{label}, {axle}, worst told stiffness"
                if (learnt, unseen) in LIMITS:
                    limit = LIMITS[learnt, unseen][k]
                    targets.at_most(told, worst[k], limit, key=f"{key}/worst_told/{axle}")
                else:
                    targets.record(f"{key}/worst_told/{axle}", worst[k], "%")
            show(f"{label}: front / rear", f"{_pair(error)} %; floor {_pair(floor)} %")
    for name, drive in drives.items():
        slip = np.degrees(np.abs(drive.alpha(CARMAKER.l_f, CARMAKER.l_r)).max(axis=0))
        show(f"largest slip of {RUNS[name]}, front / rear", f"{slip[0]:.2f} / {slip[1]:.2f} deg")
        for axle, value in zip(AXLES, slip.tolist(), strict=True):
            targets.record(f"carmaker/slip/{name}/{axle}", value, "deg")
    _outside(targets, drives["mild"], drives["hard"])
    _paper(targets, drives)


def _outside(targets: Targets, learnt: Recording, unseen: Recording) -> None:
    """Judge the model of a mild drive on a hard one, inside and outside the slip it knows."""
    models = [_learnt(car, learnt) for car in told_cars()]
    known = np.degrees(models[0].known_slip)
    targets.record("carmaker/slip_known/front", float(known[0]), "deg")
    targets.record("carmaker/slip_known/rear", float(known[1]), "deg")
    show("slip known after it, front / rear", f"{known[0]:.2f} / {known[1]:.2f} deg")
    for axle, name in enumerate(AXLES):
        errors = [_by_slip(model, unseen, axle) for model in models]
        inside = [one.inside for one in errors]
        targets.record(f"carmaker/inside/{name}", inside[0], "%")
        label = f"then on {RUNS['hard']}, inside the known slip, {name}, worst told stiffness"
        targets.at_most(label, max(inside), INSIDE, key=f"carmaker/inside/worst_told/{name}")
        for told, one in zip(TOLD, errors, strict=True):
            if one.outside is not None and one.linear is not None:
                car = f"{told[0]:.0f}_{told[1]:.0f}"
                label = f"  outside ({100.0 * one.share:.0f} %), {name}, told {car}: its line"
                key = f"carmaker/outside/{car}/{name}"
                targets.at_most(label, one.outside, one.linear, key=key)
                targets.record(f"{key}_linear", one.linear, "%")
    grid = np.linspace(-0.5, 0.5, 201)
    curve = max(
        float((np.abs(model.force(grid)).max(axis=0) / CARMAKER.axle_loads).max())
        for model in models
    )
    label = "  largest force up to 29 deg, over the axle's load"
    targets.at_most(label, curve, 1.5, "-", key="carmaker/largest_force")


class BySlip(NamedTuple):
    """Errors of an axle inside and outside the known slip, of the told line there [%]; share."""

    inside: float
    outside: float | None
    linear: float | None
    share: float


def _learnt(car: Vehicle, recording: Recording) -> AxleModel:
    """What a drive teaches of a car as it is told."""
    model = identify(recording, car, make_method(LIVE, car)).freeze()
    assert isinstance(model, AxleModel)
    return model


def outside_known(model: AxleModel, recording: Recording) -> NDArray[np.bool_]:
    """Return where the slip of a drive leaves the range that a model knows, (n, 2)."""
    slip = model.setup(recording.dt).output(recording, "slip_size")
    outside: NDArray[np.bool_] = slip > model.known_slip
    return outside


def _by_slip(model: AxleModel, recording: Recording, axle: int) -> BySlip:
    """Errors of a model on a drive, by whether it knows the slip."""
    car, truth = model.vehicle, recording.axle_force
    assert truth is not None
    stiffness = [car.cornering_stiffness_front, car.cornering_stiffness_rear]
    linear = recording.alpha(car.l_f, car.l_r) * stiffness
    force, outside = model.predict(recording), outside_known(model, recording)[:, axle]
    own, line, right = force[:, axle], linear[:, axle], truth[:, axle]
    inside = _error(own[~outside], right[~outside])
    if not outside.any():
        return BySlip(inside, None, None, 0.0)
    return BySlip(
        inside,
        _error(own[outside], right[outside]),
        _error(line[outside], right[outside]),
        float(np.mean(outside)),
    )


def _paper(targets: Targets, drives: dict[str, Recording]) -> None:
    print(f"The paper's network on the same, median (quartiles) of {SEEDS} seeds [% of rms force]")
    rows: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for seed in range(SEEDS):
        found = _compare((REFERENCE,), CARMAKER, tuple(drives.values()), seed=seed)
        frozen = found.trials[REFERENCE].frozen or {}
        for learnt, first in drives.items():
            for unseen, other in drives.items():
                error = frozen[first.name][other.name]
                rows.setdefault((learnt, unseen), []).append(_percent(found.course, other, error))
    for (learnt, unseen), values in rows.items():
        label = f"learnt on {RUNS[learnt]}, replayed on {RUNS[unseen]}"
        show(label, f"{_spread(values, 0)} / {_spread(values, 1)}")
        for axle, value in zip(AXLES, np.median(values, axis=0).tolist(), strict=True):
            targets.record(f"carmaker/{learnt}/{unseen}/{REFERENCE}/{axle}", value, "%")


def dart(targets: Targets) -> None:
    """Judge every method on the real car: learnt on each run, replayed on the two others.

    Parameters
    ----------
    targets : collects what is missed.
    """
    runs = tuple(read_recording(DATA / "dart.csv.gz", run=run) for run in REAL_RUNS)
    found = _compare((LIVE, *BASELINES), DART, runs)
    print("Real 1:10 car, frozen, on the other runs: both axles [% of rms force]")
    rows: dict[str, Frozen] = {"floor": _floors(found.course)}
    for name, trial in found.trials.items():
        if trial.frozen is None or trial.diverged_at:
            show(name, "diverged")
        else:
            rows[name] = trial.frozen
    for name, trial in _textbooks(found.course).items():
        if trial.frozen is not None:
            rows[name] = trial.frozen
    means: dict[str, float] = {}
    for name, frozen in rows.items():
        both, axles = _elsewhere(found.course, frozen)
        means[name] = float(np.mean(both))
        cells = "  ".join(f"{value:5.1f}" for value in both)
        show(f"{name}: from ramp to both, from 02_28 to both, from 12_05 to both", cells)
        show(f"{name}: mean, front / rear", f"{means[name]:.1f}, {_pair(axles)}")
        targets.record(f"dart/{key_of(name)}/both", means[name], "%")
        for axle, value in zip(AXLES, axles, strict=True):
            targets.record(f"dart/{key_of(name)}/{axle}", value, "%")
    best = min((name for name in means if name not in (LIVE, "floor")), key=means.__getitem__)
    targets.record("dart/best_baseline", best)
    label = f"real car: mean over the six, against {best}"
    targets.at_most(label, means[LIVE], means[best], key="dart/mean_against_best")


def side_by_side(targets: Targets) -> None:
    """Judge the default beside every method that has a model, on every recording of both cars.

    Baselines with the lag of the tires and the offsets of the sensors, as `tireid compare` runs
    them; below them the textbook's. Errors of both axles, means over learnt and replayed drives.

    Parameters
    ----------
    targets : collects what is missed.
    """
    print("Every method on every recording, both axles [% of rms force]: online, frozen where")
    print("learnt, frozen elsewhere; CarMaker, the real car's 4 brisk drives, all its 6, on tiles")
    rows: dict[str, dict[str, Shares]] = {}
    for place, (vehicle, recordings) in _courses().items():
        found = _compare(tuple(METHODS), vehicle, recordings)
        errors = {name: found.shares(name) for name in METHODS}
        for name, trial in _textbooks(found.course).items():
            errors[name] = shares(trial, found.course)
        for name, error in errors.items():
            if error.in_sample is not None:
                rows.setdefault(name, {})[place] = error
                for part, value in error._asdict().items():
                    if value is not None:
                        key = f"side_by_side/{place}/{key_of(name)}/{part}"
                        targets.record(key, float(value), "%")
    for where in ("carmaker", "brisk"):
        others = {name: errors[where].other for name, errors in rows.items() if name != LIVE}
        least = {name: float(value) for name, value in others.items() if value is not None}
        best = min(least, key=least.__getitem__)
        own = rows[LIVE][where].other
        assert own is not None
        targets.record(f"side_by_side/best_of_{where}", best)
        targets.record(f"side_by_side/best_of_{where}/other", least[best], "%")
        targets.record(f"side_by_side/over_best_of_{where}", float(own) / least[best], "-")
        show(f"{where} alone: default over {best}", f"{float(own) / least[best]:.2f}")
    for where in ("brisk", "dart"):
        means = {
            name: float(np.mean([errors[place].other for place in ("carmaker", where)]))
            for name, errors in rows.items()
        }
        for name, value in means.items():
            targets.record(f"side_by_side/both_{where}/{key_of(name)}", value, "%")
        best = min((name for name in means if name != LIVE), key=means.__getitem__)
        targets.record(f"side_by_side/best_{where}", best)
        label = f"elsewhere, CarMaker and {where}, {means[LIVE]:.1f} % over that of {best}"
        over, key = means[LIVE] / means[best], f"side_by_side/over_best_{where}"
        targets.at_most(label, over, BEHIND, "-", key=key)
    for name in sorted(means, key=means.__getitem__):
        cells = (
            "  ".join("     " if value is None else f"{value:5.1f}" for value in error)
            for error in rows[name].values()
        )
        print(f"  {name:28} {'   '.join(cells)}   {means[name]:5.1f}")


def _textbooks(course: Course) -> dict[str, Trial]:
    """Return what the forms of the textbooks make of a course, by their name in a table."""
    return {
        f"{name}, textbook": cross_replay(make(course.vehicle), course)
        for name, make in TEXTBOOK.items()
    }


def key_of(name: str) -> str:
    """Return the name of a method in a table as a word of a key."""
    return name.replace(", ", "_")


def _courses() -> dict[str, tuple[Vehicle, tuple[Recording, ...]]]:
    """Cars and their recordings, by place."""

    def read(file: str, runs: Iterable[str]) -> tuple[Recording, ...]:
        return tuple(read_recording(DATA / file, run=run) for run in runs)

    brisk = read("dart.csv.gz", REAL_RUNS) + read("dart_imu.csv.gz", [BRISK])
    return {
        "carmaker": (CARMAKER, read("carmaker.csv.gz", RUNS.values())),
        "brisk": (DART, brisk),
        "dart": (DART, brisk + read("dart_imu.csv.gz", SLOW)),
        "tiles": (DART, read("dart_imu.csv.gz", [TILES])),
    }


def _compare(
    names: tuple[str, ...],
    vehicle: Vehicle,
    recordings: tuple[Recording, ...],
    *,
    seed: int = 0,
) -> Comparison:
    """Compare as `tireid compare` does."""
    return run_comparison(names, vehicle, recordings, seed=seed, progress=lambda _: None)


def _floors(course: Course) -> Frozen:
    """Return the errors of the axle identifier's curves fitted to the true forces of each drive."""
    structure = axle_structure(AxleIdentifier.for_vehicle(course.vehicle), course.vehicle)
    return {
        one.name: course.replays(fit_floor(structure, [one], rng=np.random.default_rng(0)))
        for one in course.recordings
    }


def _elsewhere(course: Course, frozen: Frozen) -> tuple[list[float], tuple[float, float]]:
    """Errors on runs that were not learnt: of both axles, by run, and the mean of each [%]."""
    _, other = same_and_other(frozen)
    by_name = {recording.name: recording for recording in course.recordings}
    axles = np.mean([_percent(course, by_name[name], error) for name, error in other], axis=0)
    return [course.share(name, error) for name, error in other], (float(axles[0]), float(axles[1]))


def _percent(course: Course, recording: Recording, error: AxleRmse) -> tuple[float, float]:
    size = course.size(recording)
    return 100.0 * error.front / size.front, 100.0 * error.rear / size.rear


def _error(force: Array, truth: Array) -> float:
    """RMSE over the rms of the truth, on the given samples alone [%]."""
    error, size = (
        axle_rms(np.column_stack([force - truth, truth])).front,
        float(np.sqrt(np.mean(truth**2))),
    )
    return 100.0 * error / size


def _pair(values: tuple[float, float]) -> str:
    return f"{values[0]:.1f} / {values[1]:.1f}"


def _spread(values: list[tuple[float, float]], axle: int) -> str:
    low, middle, high = np.percentile([value[axle] for value in values], [25, 50, 75])
    return f"{middle:.1f} ({low:.1f}-{high:.1f})"
