"""Channels of other rates on one clock: what learning loses by a slow channel, and by which rule.

    python -m benchmarks.several_rates [CARS] [--record]

Drives of random cars of four classes, and CarMaker where it is there, are logged with v_y at 50, 20
and 10 Hz and v_x at 10 Hz, the rest at 100 Hz, and brought to 100 Hz by three rules that look at no
later sample: the last value held, the last two samples gone on along for one interval (which is
what is shipped), and for half an interval. The shipped one takes the road of a user: a table whose
slow channels have empty cells is written and read; the others are computed beside it. What a model
learnt so misses of the true force of the drive stands beside what one misses that was taught at
full rate.
"""

import csv
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import tireid as ti
from benchmarks.random_cars import CLASSES, FIRST_SEED, random_car, random_drive
from benchmarks.targets import Targets, keeps, show
from codegen.arrays import Array
from identifier.prediction import predict
from models.logs.clock import Raw, sampled
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle

CARS = 4  # of each class
RATES = (50, 20, 10)  # of v_y [Hz]
SPEED_RATE = 10  # of v_x [Hz]
SHORT = {"v_y": "vy", "v_x": "vx"}  # columns of a table
SHIPPED = "extrapolated"
RULES = (SHIPPED, "held", "half extrapolated")
CARMAKER = Path(__file__).resolve().parents[2] / "shared" / "data" / "carmaker.csv.gz"
Rule = Callable[[Raw, Array, float], Array]


def held(raw: Raw, grid: Array, dt: float) -> Array:
    """Return the last sample at each instant."""
    last: Array = raw.values[np.searchsorted(raw.t, grid + 0.01 * dt, side="right") - 1]
    return last


def halfway(raw: Raw, grid: Array, dt: float) -> Array:
    """Return the mean of the last sample and the one that goes on along two."""
    return 0.5 * (held(raw, grid, dt) + sampled(raw, grid, dt))


OTHERS: dict[str, Rule] = {"held": held, "half extrapolated": halfway}


def read_back(recording: Recording, rates: dict[str, int]) -> Recording:
    """Return a recording as it is read from a table in which slow channels have empty cells.

    Parameters
    ----------
    recording : at full rate.
    rates : by channel [Hz].
    """
    columns = {"t": recording.t, "vx": recording.v_x, "vy": recording.needed("v_y")}
    columns |= {"r": recording.r, "delta_f": recording.delta_f}
    columns |= {} if recording.a_y is None else {"ay": recording.a_y}
    every = {SHORT[name]: round(1.0 / (rate * recording.dt)) for name, rate in rates.items()}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.csv"
        with path.open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file)
            table.writerow(columns)
            for k in range(len(recording)):
                table.writerow(
                    "" if k % every.get(name, 1) else repr(float(values[k]))
                    for name, values in columns.items()
                )
        return read_recording(path)


def slower(recording: Recording, rates: dict[str, int], rule: Rule) -> Recording:
    """Return a recording of which some channels were logged more slowly.

    Parameters
    ----------
    recording : at full rate.
    rates : by channel [Hz].
    rule : how they are brought to the clock of the recording.
    """
    t, dt = recording.t, recording.dt
    changed: dict[str, Any] = {}
    for name, rate in rates.items():
        every = round(1.0 / (rate * dt))
        rows = np.arange(0, len(recording), every)
        raw = Raw(t[rows], getattr(recording, name)[rows], "index", rows)
        changed[name] = rule(raw, t, dt)
    return replace(recording, **changed)


def missed(log: Recording, exact: Recording, car: Vehicle) -> float:
    """Return the share of the true force that a model misses which a log taught [%]."""
    found = predict(ti.identify(log, car, check=False).freeze(), exact)
    assert found.against_truth is not None and found.true_force is not None
    return 100.0 * found.against_truth.both / found.true_force.both


def cases(cars: int) -> dict[str, list[tuple[Recording, Recording, Vehicle]]]:
    """Return logs with noise, the same without, and cars, by class."""
    found: dict[str, list[tuple[Recording, Recording, Vehicle]]] = defaultdict(list)
    for kind in CLASSES:
        for seed in range(FIRST_SEED, FIRST_SEED + cars):
            rng = np.random.default_rng(seed)
            drive = random_drive(random_car(kind, rng), rng)
            found[kind].append((drive.log(rng), drive.exact, drive.car.vehicle))
    if CARMAKER.exists():
        car = Vehicle(
            name="CarMaker", mass=2027.0, yaw_inertia=2877.0, l_f=0.924, l_r=1.626,
            cornering_stiffness_front=110e3, cornering_stiffness_rear=130e3,
        )  # fmt: skip
        for run in ("slalom1_14_5ms", "experiment2_40kmh"):
            log = read_recording(CARMAKER, run)
            found["CarMaker"].append((log, log, car))
    return dict(found)


def main() -> int:
    """Measure; return 1 where the shipped rule is not the best or loses too much."""
    keep, targets = keeps(), Targets("several_rates")
    cars = int(sys.argv[1]) if len(sys.argv) > 1 else CARS
    total: dict[tuple[str, int], list[float]] = defaultdict(list)
    for kind, listed in cases(cars).items():
        full = [missed(log, exact, car) for log, exact, car in listed]
        show(f"{kind}: missed at full rate", f"{np.mean(full):.2f} %")
        targets.record(f"{kind}/full", float(np.mean(full)), "%")
        for rate in RATES:
            rates = {"v_y": rate, "v_x": SPEED_RATE}
            for rule in RULES:
                read = [
                    read_back(log, rates) if rule == SHIPPED else slower(log, rates, OTHERS[rule])
                    for log, _, _ in listed
                ]
                now = [missed(one, e, car) for one, (_, e, car) in zip(read, listed, strict=True)]
                more = float(np.mean(np.array(now) / np.array(full)))
                total[rule, rate] += (np.array(now) / np.array(full)).tolist()
                show(f"  v_y at {rate} Hz, {rule}", f"{np.mean(now):.2f} %, {more:.2f} times")
                targets.record(f"{kind}/{rate}/{rule}", float(np.mean(now)), "%")
    for rate in RATES:
        means = {rule: float(np.mean(total[rule, rate])) for rule in RULES}
        for rule, mean in means.items():
            targets.record(f"all/{rate}/{rule}", mean, "times")
        best = min(means.values())
        targets.at_most(
            f"v_y at {rate} Hz: error over that of the best rule", means[SHIPPED] / best, 1.05, ""
        )
    return targets.finish(keep=keep and cars == CARS)


if __name__ == "__main__":
    sys.exit(main())
