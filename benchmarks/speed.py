"""How long things take: a 45 s recording learnt, a 45 s plant run, the first use with compiling.

Times are wall clock of one process, minimum and median of repeated calls; the first use starts from
an empty cache in a process of its own. Run it with `python benchmarks/speed.py`.
"""

import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np

from identifier.defaults import default_design
from identifier.identify import identify
from models.maneuvers import Slalom
from models.plant import Plant
from models.vehicle import sedan

REPEATS = 30
SLALOM = Slalom(amplitude=np.radians(4.0), frequency=0.5, onset=1.0, rate_limit=1.0, duration=44.99)


def timed(action: Callable[[], object], repeats: int = REPEATS) -> tuple[float, float, float]:
    """Return minimum, median and maximum duration [s] of an action that has run once before."""
    action()
    durations = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        durations.append(time.perf_counter() - start)
    return min(durations), statistics.median(durations), max(durations)


def first_use(statement: str) -> float:
    """Return the duration [s] of the first call in a new process with an empty cache."""
    code = (
        "import time\n"
        "from benchmarks.speed import *\n"
        f"start = time.perf_counter(); {statement}; print(time.perf_counter() - start)"
    )
    with tempfile.TemporaryDirectory() as cache:
        answer = subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "TIREID_CACHE": cache},
            capture_output=True,
            text=True,
            check=True,
        )
    return float(answer.stdout.split()[-1])


def main() -> dict[str, tuple[float, float, float]]:
    """Print the table; return minimum, median and maximum by name [s]."""
    car = sedan()
    plant, design = Plant(car), default_design(car)
    recording = plant.simulate(SLALOM, speed=20.0).recording()
    results = {
        "identifier, 45 s (4500 steps, n_h = 10)": timed(lambda: identify(recording, car, design)),
        "plant, 45 s at 1 ms": timed(lambda: plant.simulate(SLALOM, speed=20.0), repeats=5),
    }
    print(f"{platform.processor() or platform.machine()}, Python {platform.python_version()}")
    for name, (low, median, high) in results.items():
        times = [f"{1e3 * value:8.2f}" for value in (low, median, high)]
        print(f"{name:44} [ms] min {times[0]}  median {times[1]}  max {times[2]}")
    for name, statement in {
        "plant, first use with compiling": "Plant(sedan()).simulate(SLALOM, speed=20.0)",
        "plant and identifier, first use": (
            "identify(Plant(sedan()).simulate(SLALOM, speed=20.0).recording(), sedan(), "
            "default_design(sedan()))"
        ),
    }.items():
        print(f"{name:44} {first_use(statement):8.2f} s")
    return results


if __name__ == "__main__":
    main()
