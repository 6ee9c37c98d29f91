"""Does the guaranteed band hold? Forces of random drives that nobody learnt from, and its width.

    python -m benchmarks.guaranteed [--each N] [--drives N] [--first SEED] [--record]

Random cars of four classes learn on a drive with good sensors, and `run.guarantee()` states which
forces they can have, by the motion alone. Then other random drives of each, of other speeds: one
counts as outside where at any instant the true force of an axle is outside of `guarantee.over`,
known slip or not, with exact signals, as the band says nothing of sensors. Half the width of the
band is meant over the known slip, and set over the largest error of the frozen model there, as
`bounds_monte_carlo` sets bounds over the largest error that was observed; and over the rms error.
Beside it stand the same with a bound that is told and true, the least that a curve keeps in the
drive that taught and in those that are asked.
Last, where the recordings of CarMaker are there, each run is asked of what the other taught.
The reserve over the least bound was chosen on seeds below 1000.
"""

import argparse
import sys
import time
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.answers import blind, drawn
from benchmarks.random_cars import CLASSES, FIRST_SEED, Beginning
from benchmarks.recorded_cars import CARMAKER, DATA
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from identifier.axle import AxleIdentifier, AxleModel
from identifier.axle.guarantee import ForceBound, Strips, least_bound, prior_box
from identifier.run import History, identify
from identifier.verdict import guaranteed
from identifier.verdict.guaranteed import strips_of
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle

EACH, DRIVES, PROCESSES, FEWEST = 50, 50, 2, 50  # cars of a class; drives of a car; samples
STRAIGHT = 2.0  # s straight ahead, with which a drive that is asked begins
RUNS = ("slalom1_14_5ms", "experiment2_40kmh")
TRUE = 1.001  # over the least bound that is true


class Asked(NamedTuple):
    """What became of a drive: whether any force was outside, by how much [static axle loads]; half
    the width over the largest and over the rms error, where slip is known, front and rear (2,).
    """

    outside: bool
    beyond: float
    over_largest: Array
    over_rms: Array


class Car(NamedTuple):
    """A car: its class, its drives by kind of bound, the CPU seconds that a guarantee took."""

    group: str
    drives: dict[str, list[Asked]]
    seconds: float


def learnt(log: Recording, car: Vehicle) -> History:
    """Return the run over a log whose forces nobody sees."""
    return identify(blind(log), car, AxleIdentifier.for_vehicle(car, dt=log.dt))


def moving(drive: Recording, lead: float) -> NDArray[np.bool_]:
    """Return the samples that count (n,): the car drives, its beginning is over."""
    counts: NDArray[np.bool_] = drive.t >= drive.t[0] + lead
    return counts


def asked(models: dict[str, AxleModel], drive: Recording, lead: float) -> dict[str, Asked]:
    """Return how a drive went, by kind of bound.

    Parameters
    ----------
    models : with a guaranteed band each, of the same weights.
    drive : exact, with its forces.
    lead : of it that does not count [s].
    """
    force, hidden, model = drive.axle_force, blind(drive), next(iter(models.values()))
    loads = np.array(model.vehicle.axle_loads)
    assert force is not None
    counts = (drive.v_x >= model.min_speed) & moving(drive, lead)
    force = force[counts]
    error = np.abs(model.predict(hidden)[counts] - force)
    known = np.abs(model.lagged_slip(hidden))[counts] <= model.known_slip
    found = {}
    for kind, one in models.items():
        assert one.guarantee is not None
        low, high = (side[counts] for side in one.guarantee.over(hidden))
        beyond = float((np.maximum(low - force, force - high) / loads).max())
        largest, rms = np.full(2, np.nan), np.full(2, np.nan)
        for i in range(2):
            mine = known[:, i]
            if mine.sum() >= FEWEST:
                width = 0.5 * (high - low)[mine, i].mean()
                largest[i] = width / error[mine, i].max()
                rms[i] = width / np.sqrt(np.mean(error[mine, i] ** 2))
        found[kind] = Asked(beyond > 0.0, beyond, largest, rms)
    return found


def true_bound(run: History, drives: list[Recording]) -> ForceBound:
    """Return the least bound that a curve keeps in what taught and at each instant of drives."""
    model, design = run.freeze(), run.design
    assert isinstance(model, AxleModel) and isinstance(design, AxleIdentifier)
    told, parts = strips_of(model, run.recording), []
    assert told is not None
    parts.append(told)
    for drive in drives:
        force, counts = drive.axle_force, moving(drive, STRAIGHT)
        assert force is not None
        units, doubt = model.signals_of(blind(drive))
        y = force / np.array(model.vehicle.axle_loads)
        signals = (y, units, *doubt, drive.v_x, drive.t)
        parts.append(Strips(*(values[counts] for values in signals)))
    all_of = Strips(*(np.concatenate(values) for values in zip(*parts, strict=True)))
    none_late = all_of._replace(rate=np.zeros_like(all_of.rate))
    box = prior_box(design.bounds, design.ladder)
    front, rear = (TRUE * least_bound(none_late, axle, box)[0] for axle in range(2))
    return ForceBound(error=(front, rear))


def short_straight(vehicle: Vehicle, rng: np.random.Generator) -> Beginning:
    """Return how a drive that is asked begins.

    Parameters
    ----------
    vehicle, rng : not asked.
    """
    del vehicle, rng
    return Beginning(lead=STRAIGHT)


def plant_case(job: tuple[str, int, int]) -> Car | None:
    """Return how the bands of a random car held on others of its drives; None where it has none.

    Parameters
    ----------
    job : class of the car, seed, number of other drives.
    """
    kind, seed, count = job
    drive = drawn(kind, seed)
    others = [drawn(kind, seed, short_straight, 1 + k) for k in range(count)]
    exact = [one.exact for one in others if one.car.vehicle == drive.car.vehicle]
    if not exact:  # the first car of the seed has one drive alone
        return None
    run = learnt(drive.log(np.random.default_rng([seed, 1])), drive.car.told)
    begin = time.process_time()
    model = guaranteed(run)
    seconds = time.process_time() - begin
    told = guaranteed(run, true_bound(run, exact))
    assert isinstance(model, AxleModel) and isinstance(told, AxleModel)
    models = {"estimated": model, "told": told}
    each = [asked(models, one, STRAIGHT) for one in exact]
    found = {bound: [one[bound] for one in each] for bound in models}
    return Car(kind, found, seconds)


def carmaker_cases() -> dict[str, Asked]:
    """Return how the band of either CarMaker run held on the other, by the name of the other."""
    runs = [read_recording(DATA / "carmaker.csv.gz", run=name) for name in RUNS]
    found = {}
    for taught, other in (runs, runs[::-1]):
        model = guaranteed(learnt(taught, CARMAKER))
        assert isinstance(model, AxleModel)
        found[other.name.split(":")[-1].split("_")[0]] = asked({"": model}, other, 1.0)[""]
    return found


def report(cars: list[Car], recorded: dict[str, Asked], targets: Targets) -> None:
    """Print tables, record their numbers and judge them.

    Parameters
    ----------
    cars, recorded : what was found.
    targets : collects what is missed.
    """
    print(
        f"  {'bound: class':24} {'drives':>7} {'outside':>8} {'farthest':>9}  width over largest,"
        " rms error (median)"
    )
    totals = {}
    for kind in ("estimated", "told"):
        table: dict[str, list[Asked]] = defaultdict(list)
        for car in cars:
            table["all"] += car.drives[kind]
            table[car.group] += car.drives[kind]
        for group, some in table.items():
            outside, farthest = sum(one.outside for one in some), max(one.beyond for one in some)
            largest, rms = (
                float(np.nanmedian([getattr(one, name) for one in some]))
                for name in ("over_largest", "over_rms")
            )
            print(
                f"  {kind + ': ' + group:24} {len(some):7} {outside:8} {farthest:9.3f}"
                f"  {largest:6.2f} {rms:6.2f}"
            )
            key = f"{kind}/{group}"
            targets.record(f"{key}/drives", len(some))
            targets.record(f"{key}/farthest", farthest, "static axle loads")
            targets.record(f"{key}/over_rms", rms)
            if group == "all":
                totals[kind] = outside, largest
            else:
                targets.record(f"{key}/outside", outside)
                targets.record(f"{key}/over_largest", largest)
    targets.record("seconds", float(np.median([car.seconds for car in cars])), "s")
    for name, one in recorded.items():
        for axle, ratio in zip(("front", "rear"), one.over_largest, strict=True):
            targets.record(f"recorded/{name}/{axle}/over_largest", float(ratio))
        targets.record(f"recorded/{name}/farthest", one.beyond, "static axle loads")
        print(f"  {name}: farthest {one.beyond:.3f}, width over largest error {one.over_largest}")
    print("Targets")
    for kind, (outside, largest) in totals.items():
        key = f"{kind}/all"
        targets.at_most(f"{kind} bound: drives outside", outside, 0, "", f"{key}/outside")
        targets.at_most(
            f"{kind} bound: half-width over largest error", largest, 3.0, "", f"{key}/over_largest"
        )
    for name, one in recorded.items():
        targets.at_most(f"{name}: forces outside", one.outside, 0, "", f"recorded/{name}/outside")
    targets.at_most("CPU time of a guarantee", float(targets.values["seconds"]), 0.5, "s")


def main() -> int:
    """Run everything; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=EACH, help="cars of each class")
    parser.add_argument("--drives", type=int, default=DRIVES, help="other drives of a car")
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="seed")
    options, targets = parser.parse_args(), Targets("guaranteed")
    jobs = [
        (kind, options.first + k, options.drives) for k in range(options.each) for kind in CLASSES
    ]
    with ProcessPoolExecutor(PROCESSES) as pool:
        cars = [car for car in pool.map(plant_case, jobs) if car is not None]
    recorded: dict[str, Asked] = {}
    if DATA.is_dir():
        recorded = carmaker_cases()
    else:
        print(f"  without recordings: they are not there: {DATA} (set TIREID_DATA)")
    report(cars, recorded, targets)
    everything = (options.each, options.drives, options.first) == (EACH, DRIVES, FIRST_SEED)
    return targets.finish(keep=keep and everything and bool(recorded))


if __name__ == "__main__":
    sys.exit(main())
