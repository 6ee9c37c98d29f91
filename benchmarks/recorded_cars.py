"""The paper's laws on recorded cars: a high-fidelity simulation and a real 1:10 car.

Needs the recordings, which are not part of the project, in the folder that TIREID_DATA names or in
../shared/data beside the checkout; without them it says so and skips. For each law: the online
error, and the error of the weights frozen at the end, on the drive that was learnt and on another;
in percent of the rms axle force, front / rear, median over seeds. Run it by
`python -m benchmarks.recorded_cars [--record]`.
"""

import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.targets import Table, Targets, Values, parse
from identifier.methods import make_method
from identifier.paper.design import VARIANTS
from identifier.reproducibility import AxleRmse, force_rms, online_error, replay
from identifier.run import identify
from models.recordings import Recording, read_recording, runs
from models.vehicle import Vehicle

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"
DATA = Path(os.environ.get("TIREID_DATA", BESIDE))
SEEDS = 10
PARTS, AXLES = ("online", "frozen", "other"), ("front", "rear")
CARMAKER = Vehicle(
    name="CarMaker sedan, effective",
    mass=2027.0,
    yaw_inertia=2877.0,
    l_f=0.924,
    l_r=1.626,
    cornering_stiffness_front=110e3,
    cornering_stiffness_rear=130e3,
)
DART = Vehicle(
    name="DART 1:10",
    mass=1.58,
    yaw_inertia=0.00481,
    l_f=0.0805,
    l_r=0.0930,
    cornering_stiffness_front=40.0,
    cornering_stiffness_rear=40.0,
)
FERRARI = Vehicle(
    name="Ferrari 250 LM",
    mass=982.0,
    yaw_inertia=1605.0,
    l_f=1.33,
    l_r=1.07,
    cornering_stiffness_front=66e3,
    cornering_stiffness_rear=105e3,
)
GTI = Vehicle(
    name="VW GTI",
    mass=1926.2,
    yaw_inertia=2763.49,
    l_f=1.264,
    l_r=1.367,
    cornering_stiffness_front=130e3,
    cornering_stiffness_rear=140e3,
)
CARMAKER_RUNS = ("slalom1_14_5ms", "experiment2_40kmh")
GTI_RUNS = ("exp8", "exp12")  # two days
TASKS = {
    "hard": (CARMAKER, "carmaker.csv.gz", "slalom1_14_5ms", "experiment2_40kmh"),
    "mild": (CARMAKER, "carmaker.csv.gz", "experiment2_40kmh", "slalom1_14_5ms"),
    "free": (DART, "dart.csv.gz", "free_10_02_28", "free_10_12_05"),
    "ramp": (DART, "dart.csv.gz", "ramp_steer02", "free_10_12_05"),
}


OWN = {"r": "r_imu", "ay": "ay_imu", "vx": "vx_encoder"}  # of the 1:10 car, as they come
LATE = 6  # samples by which their fresh numbers are late


def own_sensors() -> dict[str, tuple[Recording, Recording]]:
    """Return what the 1:10 car's own sensors and Vicon show of each run, by its name."""
    path, found = DATA / "dart_imu.csv.gz", {}
    for run in runs(path):
        own, vicon = (
            read_recording(path, run=run, columns=columns, check=False) for columns in (OWN, {})
        )
        late: dict[str, Any] = {
            name: np.append(signal[LATE:], np.full(LATE, signal[-1]))
            for name, signal in (("v_x", own.v_x), ("r", own.r), ("a_y", own.needed("a_y")))
        }
        found[run] = replace(vicon, **late, axle_force=None), vicon
    return found


def percent(error: AxleRmse | None, size: AxleRmse | None) -> tuple[float, float]:
    """Return an error in percent of the rms force, front and rear."""
    assert error is not None and size is not None
    return 100.0 * error.front / size.front, 100.0 * error.rear / size.rear


def errors_of(task: str, law: str, seed: int) -> tuple[float, ...]:
    """Return three errors, each front and rear [%]: online, frozen, frozen on the other drive.

    Parameters
    ----------
    task : one of `TASKS`.
    law : of the paper.
    seed : of the initial weights.
    """
    car, log, learn, other = TASKS[task]
    known, unknown = (read_recording(DATA / log, run=run) for run in (learn, other))
    method = make_method(law, car, seed)
    history, elsewhere = (identify(one, car, method) for one in (known, unknown))
    model = history.freeze(float(known.t[-1]))
    own, there = replay(model, history), replay(model, elsewhere)
    return (
        *percent(online_error(history), force_rms(history)),
        *percent(own.against_truth, force_rms(history)),
        *percent(there.against_truth, force_rms(elsewhere)),
    )


def canary() -> Values:
    """Return errors of one law on one recording [%]."""
    rows = errors_of("ramp", "integral", 0)
    return {f"{part}/{axle}": rows[k] for k, (part, axle) in enumerate(product(PARTS, AXLES))}


def tables(v: Values) -> dict[str, Table]:
    """Return the table of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    rows = [
        [
            f"{car.name}: {learn}",
            other,
            law,
            *(f"{v[f'{task}/{law}/{part}/front']:.0f} / {v[f'{task}/{law}/{part}/rear']:.0f}"
              for part in PARTS),
        ]
        for (task, (car, _, learn, other)), law in product(TASKS.items(), VARIANTS)
        if f"{task}/{law}/online/front" in v
    ]  # fmt: skip
    errors = ("online [%]", "frozen [%]", "frozen, other drive [%]")
    return {"recorded_cars": Table(("identified", "other drive", "law", *errors), rows)}


def main() -> int:
    """Print medians over the seeds, front / rear."""
    targets, options = Targets("recorded_cars"), parse("recorded_cars", __doc__)
    if not DATA.is_dir():
        print(f"skipped: the recordings are not there: {DATA} (set TIREID_DATA)")
        return 0
    seeds = range(1 if options.quick else SEEDS)
    with ProcessPoolExecutor() as pool:
        for task, law in product(TASKS, VARIANTS):
            rows = list(pool.map(errors_of, *zip(*product([task], [law], seeds), strict=True)))
            medians = np.median(rows, axis=0).tolist()
            for k, (part, axle) in enumerate(product(PARTS, AXLES)):
                targets.record(f"{task}/{law}/{part}/{axle}", medians[k])
            print(f"  {task:6}{law:22}", *(f"{value:6.1f}" for value in medians), flush=True)
    return targets.finish(canary, keep=options.record)


if __name__ == "__main__":
    sys.exit(main())
