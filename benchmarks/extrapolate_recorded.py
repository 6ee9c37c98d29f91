"""Learn on one recorded drive, freeze, predict another: CarMaker both ways and a real 1:10 car.

The recordings of ../shared/data are not part of the project; without them this part is skipped.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from benchmarks.recorded_cars import CARMAKER, DART, DATA
from benchmarks.targets import Targets, show
from identifier.axle import AxleDesign, AxleModel
from identifier.cross_replay import Course, cross_replay
from identifier.floors import fit_floors
from identifier.identify import identify
from identifier.methods import DEFAULT, METHODS, REFERENCE, make_method
from identifier.reproducibility import AxleRmse, axle_rms
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle

Array = NDArray[np.float64]
HARD, MILD = "slalom1_14_5ms", "experiment2_40kmh"
RUNS = ("ramp_steer02", "free_10_02_28", "free_10_12_05")
SEEDS = 10
BASELINES = ("linear", "stiffness_rls", "magic_formula_ekf", "dugoff_ekf", "integral")


def carmaker(targets: Targets) -> None:
    """Judge the default and the paper's law on the high-fidelity simulation.

    Parameters
    ----------
    targets : collects what is missed.
    """
    hard, mild = (read_recording(DATA / "carmaker.csv.gz", run=run) for run in (HARD, MILD))
    course = _course(CARMAKER, (hard, mild))
    floors = fit_floors([DEFAULT], course, starts=3, seed=0, workers=1)["axle units"]
    print(f"CarMaker, effective vehicle, {DEFAULT} [% of rms force]")
    frozen = cross_replay(make_method(DEFAULT, CARMAKER), course).frozen
    assert frozen is not None
    limits = {(hard.name, hard.name): (9.0, 5.0), (hard.name, mild.name): (15.0, 15.0)}
    for learnt in (hard, mild):
        for unseen in (hard, mild):
            error, floor = (
                _percent(course, unseen, found[learnt.name][unseen.name])
                for found in (frozen, floors)
            )
            label = f"learnt on {_run(learnt)}, replayed on {_run(unseen)}"
            for axle, value, limit in zip(
                ("front", "rear"), error, limits.get((learnt.name, unseen.name), ()), strict=False
            ):
                targets.at_most(f"{label}, {axle}", value, limit)
            show(f"{label}: front / rear", f"{_pair(error)} %; floor {_pair(floor)} %")
    _outside(targets, mild, hard)
    _paper(course, hard, mild)


def _outside(targets: Targets, learnt: Recording, unseen: Recording) -> None:
    """Judge the model of a mild drive on a hard one, inside and outside the slip it knows."""
    history = identify(learnt, CARMAKER, AxleDesign.for_vehicle(CARMAKER))
    model = history.freeze(float(learnt.t[-1]))
    assert isinstance(model, AxleModel) and unseen.axle_force is not None
    stiffness = [CARMAKER.cornering_stiffness_front, CARMAKER.cornering_stiffness_rear]
    linear = unseen.alpha(CARMAKER.l_f, CARMAKER.l_r) * stiffness
    outside, known = model.outside(unseen), np.degrees(model.known_slip_range)
    force, truth = model.axle_force(unseen), unseen.axle_force
    show("slip known after it, front / rear", f"{known[0]:.2f} / {known[1]:.2f} deg")
    for axle, name in enumerate(("front", "rear")):
        inside = ~outside[:, axle]
        share = _error(force[inside, axle], truth[inside, axle])
        targets.at_most(
            f"then replayed on {_run(unseen)}, inside the known slip, {name}", share, 15
        )
        if not inside.all():
            own, line = (_error(f[~inside, axle], truth[~inside, axle]) for f in (force, linear))
            part = 100.0 * np.mean(~inside)
            show(f"  outside, {name}", f"{part:.0f} % of samples; linear tire {line:.1f} %")
            targets.at_most(f"  outside, {name}, no worse than the linear tire", own, line)
    grid = np.linspace(-0.5, 0.5, 201)
    curve = np.abs(model.force_at(grid)).max(axis=0) / CARMAKER.axle_loads
    targets.at_most("  largest force up to 29 deg, over the axle's load", curve.max(), 1.5, "-")


def _paper(course: Course, hard: Recording, mild: Recording) -> None:
    print(f"The paper's network on the same, median (quartiles) of {SEEDS} seeds [% of rms force]")
    rows: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for seed in range(SEEDS):
        frozen = cross_replay(make_method(REFERENCE, CARMAKER, seed), course).frozen
        for learnt, replays in (frozen or {}).items():
            for recording in (hard, mild):
                rows.setdefault((learnt, recording.name), []).append(
                    _percent(course, recording, replays[recording.name])
                )
    for (learnt, replayed), values in rows.items():
        label = f"learnt on {learnt.split(':')[1]}, replayed on {replayed.split(':')[1]}"
        show(label, f"{_spread(values, 0)} / {_spread(values, 1)}")


def dart(targets: Targets) -> None:
    """Judge every method on the real car: learnt on each run, replayed on the two others.

    Parameters
    ----------
    targets : collects what is missed.
    """
    runs = tuple(read_recording(DATA / "dart.csv.gz", run=run) for run in RUNS)
    course = _course(DART, runs)
    print("Real 1:10 car, frozen, on the other runs: both axles [% of rms force]")
    floors = fit_floors([DEFAULT], course, starts=3, seed=0, workers=1)["axle units"]
    means = {"floor, axle units": _elsewhere(course, floors)}
    for name in (DEFAULT, *BASELINES):
        frozen = cross_replay(make_method(name, DART), course).frozen
        if frozen is None or len(frozen) < len(runs):
            show(name, "diverged")
            continue
        means[name] = _elsewhere(course, frozen)
    for name, values in means.items():
        cells = "  ".join(f"{value:5.1f}" for value in values)
        show(f"{name}: from ramp to both, from 02_28 to both, from 12_05 to both", cells)
    best = min((float(np.mean(means[name])), name) for name in BASELINES if name in means)
    show("best baseline", best[1])
    targets.at_most(
        "real car: mean over the six, against it", float(np.mean(means[DEFAULT])), best[0]
    )


def _course(vehicle: Vehicle, recordings: tuple[Recording, ...]) -> Course:
    slowest = max(make_method(name, vehicle).min_speed for name in METHODS)
    return Course(vehicle=vehicle, recordings=recordings, min_speed=slowest)


def _elsewhere(course: Course, frozen: Mapping[str, Mapping[str, AxleRmse]]) -> list[float]:
    return [
        course.share(name, error)
        for learnt, replays in frozen.items()
        for name, error in replays.items()
        if name != learnt
    ]


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


def _run(recording: Recording) -> str:
    return recording.name.split(":")[1]


def _pair(values: tuple[float, float]) -> str:
    return f"{values[0]:.1f} / {values[1]:.1f}"


def _spread(values: list[tuple[float, float]], axle: int) -> str:
    low, middle, high = np.percentile([value[axle] for value in values], [25, 50, 75])
    return f"{middle:.1f} ({low:.1f}-{high:.1f})"
