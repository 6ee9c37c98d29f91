"""How long things take: a 45 s recording learnt, a 45 s plant run, the first use with compiling.

Times are of this process on its processor, so that a busy machine does not count, minimum and
median of repeated calls; the first use is wall clock, and starts from an empty cache in a process
of its own. Run it by `python -m benchmarks.speed [--record]`.
"""

import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.targets import Targets, keeps
from identifier.methods import LIVE, REFERENCE, make_method
from identifier.run import identify
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
        start = time.process_time()
        action()
        durations.append(time.process_time() - start)
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


def main() -> int:
    """Print the table; record minimum and median of each."""
    car, targets = sedan(), Targets("speed")
    plant = Plant(car)
    recording = plant.simulate(SLALOM, speed=20.0).recording()
    methods = {name: make_method(name, car) for name in (REFERENCE, LIVE)}
    print(f"{platform.processor() or platform.machine()}, Python {platform.python_version()}")
    actions: dict[str, tuple[Callable[[], object], int]] = {
        name: (partial(identify, recording, car, method), REPEATS)
        for name, method in methods.items()
    }
    actions["plant"] = (lambda: plant.simulate(SLALOM, speed=20.0), 5)
    for name, (action, repeats) in actions.items():
        low, median, high = (1e3 * value for value in timed(action, repeats))
        cells = f"min {low:8.2f}  median {median:8.2f}  max {high:8.2f}"
        print(f"{name + ', 45 s':44} [ms] {cells} of {repeats}")
        targets.record(f"{name}/least", low, "ms")
        targets.record(f"{name}/median", median, "ms")
    simulate = "Plant(sedan()).simulate(SLALOM, speed=20.0)"
    for name, statement in {
        "plant": simulate,
        "plant_and_identifier": f"identify({simulate}.recording(), sedan(), "
        f"make_method({REFERENCE!r}, sedan()))",
        "plant_and_default": f"identify({simulate}.recording(), sedan(), "
        f"make_method({LIVE!r}, sedan()))",
    }.items():
        duration = first_use(statement)
        print(f"{name + ', first use with compiling':44} {duration:8.2f} s")
        targets.record(f"first_use/{name}", duration, "s")
    return targets.finish(keep=keeps())


if __name__ == "__main__":
    sys.exit(main())
