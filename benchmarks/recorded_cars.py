"""The paper's laws on recorded cars: a high-fidelity simulation and a real 1:10 car.

Needs the recordings, which are not part of the project, in the folder that TIREID_DATA names or in
../shared/data beside the checkout; without them it says so and skips. For each law: the online
error, and the error of the weights frozen at the end, on the drive that was learnt and on another;
in percent of the rms axle force, front / rear, median over seeds. Run it by
`python -m benchmarks.recorded_cars [--record]`.
"""

import os
import sys
from pathlib import Path

import numpy as np

from benchmarks.targets import Targets, keeps
from identifier.methods import make_method
from identifier.paper.design import VARIANTS
from identifier.reproducibility import AxleRmse, force_rms, online_error, replay
from identifier.run import identify
from models.recordings import read_recording
from models.vehicle import Vehicle

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"
DATA = Path(os.environ.get("TIREID_DATA", BESIDE))
SEEDS = 10
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
TASKS = {
    "hard": (CARMAKER, "carmaker.csv.gz", "slalom1_14_5ms", "experiment2_40kmh"),
    "mild": (CARMAKER, "carmaker.csv.gz", "experiment2_40kmh", "slalom1_14_5ms"),
    "free": (DART, "dart.csv.gz", "free_10_02_28", "free_10_12_05"),
    "ramp": (DART, "dart.csv.gz", "ramp_steer02", "free_10_12_05"),
}


def percent(error: AxleRmse | None, size: AxleRmse | None) -> tuple[float, float]:
    """Return an error in percent of the rms force, front and rear."""
    assert error is not None and size is not None
    return 100.0 * error.front / size.front, 100.0 * error.rear / size.rear


def measure(targets: Targets) -> None:
    """Print one table for each task; record its medians.

    Parameters
    ----------
    targets : collects what is recorded.
    """
    for task, (car, log, learn, other) in TASKS.items():
        learnt, unseen = (read_recording(DATA / log, run=run) for run in (learn, other))
        print(f"{car.name}: learnt on {learn}, frozen, replayed on {other} [% of rms force]")
        for law in VARIANTS:
            rows = []
            for seed in range(SEEDS):
                design = make_method(law, car, seed)
                history = identify(learnt, car, design)
                model = history.freeze(float(learnt.t[-1]))
                elsewhere = identify(unseen, car, design)
                own, there = replay(model, history), replay(model, elsewhere)
                rows.append(
                    percent(online_error(history), force_rms(history))
                    + percent(own.against_truth, force_rms(history))
                    + percent(there.against_truth, force_rms(elsewhere))
                )
            medians = np.median(rows, axis=0).tolist()
            for k, part in enumerate(("online", "frozen", "other")):
                targets.record(f"{task}/{law}/{part}/front", medians[2 * k], "%")
                targets.record(f"{task}/{law}/{part}/rear", medians[2 * k + 1], "%")
            cells = [f"{value:5.1f}" for value in medians]
            print(
                f"  {law:22} online {cells[0]} /{cells[1]}   frozen {cells[2]} /{cells[3]}   "
                f"other drive {cells[4]} /{cells[5]}"
            )


def main() -> int:
    """Measure where the recordings are there."""
    targets = Targets("recorded_cars")
    if not DATA.is_dir():
        print(f"skipped: the recordings are not there: {DATA} (set TIREID_DATA)")
        return 0
    measure(targets)
    return targets.finish(keep=keeps())


if __name__ == "__main__":
    sys.exit(main())
