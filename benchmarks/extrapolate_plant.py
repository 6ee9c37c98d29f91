"""Learn on a noisy slalom of our plant, freeze, predict other maneuvers; and a drop of friction."""

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.answers import force_error
from benchmarks.extrapolate_recorded import BEHIND, TEXTBOOK, key_of
from benchmarks.floor import axle_structure, fit_floor
from benchmarks.random_cars import CLASSES, FIRST_SEED, random_car, random_drive
from benchmarks.targets import Targets, show
from identifier.axle import AxleIdentifier
from identifier.compare.course import Course
from identifier.method import Method
from identifier.methods import LIVE, METHODS, REFERENCE, make_method
from identifier.reproducibility import AxleRmse
from identifier.run import identify
from models.friction import Friction, FrictionChange
from models.maneuvers import Slalom
from models.plant import Plant
from models.recordings import Recording
from models.vehicle import Vehicle, sedan
from tireid.commands.demo_story import DRIVES, RATE_LIMIT, SENSORS, SLALOM, plant_recordings

SEEDS = 5
CARS = 6  # of each class
CHANGE, BACK, END = 20.0, 40.0, 60.0  # s
SETTLED = 2.0  # s of excitation
DROPS = (0.5, 0.7)
AXLES = ("front", "rear")


def maneuvers(targets: Targets) -> None:
    """Judge the default on maneuvers that it did not learn on, with several seeds of the noise.

    Parameters
    ----------
    targets : collects what is missed.
    """
    car = sedan()
    slowest = max(make_method(name, car).min_speed for name in METHODS)
    rows: list[dict[str, dict[str, AxleRmse]]] = []
    for seed in range(SEEDS):
        recordings = _drives(np.random.default_rng(seed))
        course = Course(vehicle=car, recordings=recordings, min_speed=slowest)
        row = {name: _learnt_on_first(name, course, seed) for name in (LIVE, REFERENCE)}
        structure = axle_structure(AxleIdentifier.for_vehicle(car), car)
        for label, fitted in (("floor", recordings[:1]), ("best of all", recordings)):
            model = fit_floor(structure, fitted, rng=np.random.default_rng(seed))
            row[label] = course.replays(model)
        rows.append(row)
    names = list(rows[0][LIVE])
    print(f"Plant with noise, learnt on {names[0]}, median (smallest-largest) of {SEEDS} seeds")
    worst = max(max(e.front, e.rear) for row in rows for e in [row[LIVE][names[0]]]) / 1e3
    label = "in-sample, larger axle, worst seed"
    targets.at_most(label, worst, 0.15, "kN", key="plant/in_sample/worst")
    for name in names:
        for label in rows[0]:
            fronts, rears = ([getattr(r[label][name], a) / 1e3 for r in rows] for a in AXLES)
            show(f"{name}, {label}: front / rear [kN]", f"{_spread(fronts)} / {_spread(rears)}")
            for axle, values in zip(AXLES, (fronts, rears), strict=True):
                targets.record(
                    f"plant/{name}/{label.replace(' ', '_')}/{axle}", _median(values), "kN"
                )
        ratios = {
            other: [row[LIVE][name].both / row[other][name].both for row in rows]
            for other in rows[0]
        }
        if name != names[0]:
            floor, law = _median(ratios["floor"]), _median(ratios[REFERENCE])
            label = f"{name}: over the floor, median"
            targets.at_most(label, floor, 1.3, "-", key=f"plant/{name}/over_floor")
            show(f"{name}: over the best of all", _spread(ratios["best of all"]))
            label = f"{name}: over the integral law, median"
            targets.at_most(label, law, 1 / 3, "-", key=f"plant/{name}/over_integral")
    laws = [
        _median([row[LIVE][name].both / row[REFERENCE][name].both for row in rows])
        for name in names[1:]
    ]
    targets.record("plant/over_integral/least", min(laws), "-")
    targets.record("plant/over_integral/most", max(laws), "-")
    exact = Course(vehicle=car, recordings=_drives(None)[:1], min_speed=slowest)
    (clean,) = _learnt_on_first(LIVE, exact, 0).values()
    largest = max(clean.front, clean.rear) / 1e3
    label = "in-sample without noise, larger axle"
    targets.at_most(label, largest, 0.1, "kN", key="plant/in_sample/exact")


def random_fleet(targets: Targets) -> None:
    """Judge the default beside the baselines on random cars: one drive learnt, another asked about.

    The cars are others than those on which the numbers of the baselines were chosen.

    Parameters
    ----------
    targets : collects what is missed.
    """
    makes: dict[str, Callable[[Vehicle], Method]] = {
        **{name: partial(make_method, name) for name in (LIVE, *TEXTBOOK)},
        **{f"{name}, textbook": make for name, make in TEXTBOOK.items()},
    }
    errors: dict[str, list[float]] = {name: [] for name in makes}
    for number, kind in enumerate(CLASSES):
        for seed in range(FIRST_SEED, FIRST_SEED + CARS):
            rng = np.random.default_rng([seed, number])
            car = random_car(kind, rng)
            learnt, unseen = (random_drive(car, rng).log(rng) for _ in range(2))
            for name, make in makes.items():
                model = identify(learnt, car.told, make(car.told)).freeze()
                errors[name].append(float(np.mean(force_error(model, unseen))))
    means = {name: float(np.mean(values)) for name, values in errors.items()}
    print(
        f"{CARS} random cars of each of {len(CLASSES)} classes, learnt on one drive, frozen, asked"
    )
    print("about another, mean of both axles [% of rms force]")
    for name, value in means.items():
        show(name, f"{value:.1f}, worst {max(errors[name]):.1f}")
        targets.record(f"fleet/{key_of(name)}", value, "%")
    best = min((name for name in means if name != LIVE), key=means.__getitem__)
    targets.record("fleet/best", best)
    label = f"random cars, over {best}"
    targets.at_most(label, means[LIVE] / means[best], BEHIND, "-", key="fleet/over_best")
    for name in TEXTBOOK:
        gain = means[name] / means[f"{name}, textbook"]
        targets.at_most(
            f"{name}, over its textbook's form", gain, 1.0, "-", key=f"fleet/gain/{name}"
        )


def friction_drop(targets: Targets) -> None:
    """Judge how fast a drop of friction in the middle of a slalom is followed, and the return.

    Parameters
    ----------
    targets : collects what is missed.
    """
    car = sedan()
    plant = Plant(car)
    slalom = Slalom(
        amplitude=SLALOM.amplitude,
        frequency=SLALOM.frequency,
        onset=SLALOM.onset,
        rate_limit=RATE_LIMIT,
        duration=END,
    )
    for drop in DROPS:
        changes = (
            FrictionChange(scale=drop, at_time=CHANGE),
            FrictionChange(scale=1.0, at_time=BACK),
        )
        run = plant.simulate(slalom, speed=20.0, friction=Friction(changes=changes), name="drop")
        print(
            f"Friction 1 to {drop} at {CHANGE:g} s and back at {BACK:g} s, worst of {SEEDS} seeds"
        )
        for name in (LIVE, REFERENCE):
            recordings = [run.recording(SENSORS, np.random.default_rng(s)) for s in range(SEEDS)]
            errors = [_phases(recording, name, seed) for seed, recording in enumerate(recordings)]
            for (label, *_), value in zip(PHASES, np.max(errors, axis=0).tolist(), strict=True):
                phase = label.replace(",", "").replace(" ", "_")
                if name == LIVE and drop == DROPS[0] and "from 2 s on" in label:
                    targets.at_most(
                        f"{name}, {label}", value, 15.0, key=f"drop/{drop}/{name}/{phase}"
                    )
                else:
                    show(f"{name}, {label}", f"{value:8.2f} %")
                    targets.record(f"drop/{drop}/{name}/{phase}", value, "%")


PHASES = (
    ("before", CHANGE - 5.0, CHANGE),
    ("dropped, first 2 s", CHANGE, CHANGE + SETTLED),
    ("dropped, from 2 s on", CHANGE + SETTLED, BACK),
    ("returned, first 2 s", BACK, BACK + SETTLED),
    ("returned, from 2 s on", BACK + SETTLED, END),
)


def _phases(recording: Recording, name: str, seed: int) -> list[float]:
    """Online error of both axles in each phase, over the rms force of the phase [%].

    From 2 s on it is that of the worst second, over the rms force of all that phase.
    """
    history = identify(recording, sedan(), make_method(name, sedan(), seed))
    assert recording.axle_force is not None
    squares = np.mean((history.axle_force - recording.axle_force) ** 2, axis=1)
    forces = np.mean(recording.axle_force**2, axis=1)
    found = []
    for label, first, last in PHASES:
        now = (recording.t >= first) & (recording.t < last)
        error = np.mean(squares[now])
        if "from 2 s on" in label:
            second = round(1.0 / recording.dt)
            error = np.convolve(squares[now], np.ones(second) / second, "valid").max()
        found.append(100.0 * float(np.sqrt(error / np.mean(forces[now]))))
    return found


def _drives(rng: np.random.Generator | None) -> tuple[Recording, ...]:
    """The drives of `tireid compare`, and the slalom at 15 m/s."""
    slow = Plant(sedan()).simulate(SLALOM, speed=15.0, name="slalom_15")
    sensors = None if rng is None else SENSORS
    assert next(iter(DRIVES)).startswith("slalom")  # the first is learnt on
    return (*plant_recordings(sedan(), rng), slow.recording(sensors, rng))


def _learnt_on_first(name: str, course: Course, seed: int) -> dict[str, AxleRmse]:
    first = course.recordings[0]
    history = identify(first, course.vehicle, make_method(name, course.vehicle, seed))
    return course.replays(history.freeze(float(first.t[-1])))


def _median(values: list[float]) -> float:
    return float(np.median(values))


def _spread(values: list[float]) -> str:
    return f"{np.median(values):.3f} ({min(values):.3f}-{max(values):.3f})"
