"""Time of one real-time step on `mpc_double_lane_change`: ours against its peers, in one run.

Thread CPU time of the solver call alone; of each step the least of ROUNDS identical drives, which
take turns: what other programs on the machine cost is in all but that one. Every solver drives its
own closed loop; the closed-loop cost says that none of them is fast by being wrong. A last line
says how long it takes from nothing to the first solution, and at the second start.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.mpc_double_lane_change import (
    PROBLEM,
    SPEED,
    STEPS,
    Plant,
    network_fitted_to_curve,
    road,
)
from benchmarks.mpc_peers import CondensedDaqp, Ours, Peer, hpipm, ipopt
from mpc.converged import build_errors
from mpc.tires.structure import TireModel

Array = NDArray[np.float64]

ROUNDS = 5
FIRST_USE = """
import time; start = time.perf_counter()
import numpy as np
from benchmarks.mpc_double_lane_change import PROBLEM, SPEED, network_fitted_to_curve
from mpc.realtime import Measurement, Tracker
tracker = Tracker(network_fitted_to_curve(), PROBLEM)
still = np.zeros(PROBLEM.horizon + 1)
status = tracker.step(Measurement(0.1, 0.0, 0.0, 0.0, still, still + SPEED)).status
assert status == 0, status
print(time.perf_counter() - start)
"""


class Loop(NamedTuple):
    """times (STEPS,) [s], failures, and the closed-loop cost."""

    times: Array
    failures: int
    cost: float


def drive(solver: Peer, plant: Plant, tire: TireModel) -> Loop:
    """Drive the double lane change from the start."""
    errors, q = build_errors(tire.structure), PROBLEM.cost.numbers()
    ahead, now = road()
    x, times, cost, failures = np.zeros(5), [], 0.0, 0
    for k in range(STEPS):
        answer = solver.step(x, ahead[k])
        times.append(answer.time)
        failures += answer.failed
        u = float(answer.u[0])
        y = np.asarray(errors(x, now[k], SPEED, tire.car, tire.weights)[0]).ravel()
        over = max(abs(float(x[0])) - PROBLEM.limits.e_y, 0.0)
        cost += 0.5 * float(q @ y**2 + PROBLEM.cost.R * u**2 + PROBLEM.limits.soft_e_y * over**2)
        x = plant.step(x, u, now[k])
    return Loop(np.array(times), failures, cost)


def first_use() -> list[float]:
    """Return the time from a new process to the first solution [s]: nothing built, then built."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "TIREID_CACHE": cache}
        answers = [
            subprocess.run(
                [sys.executable, "-c", FIRST_USE],
                env=environment,
                capture_output=True,
                text=True,
                check=True,
            )
            for _ in range(2)
        ]
    return [float(answer.stdout.split()[-1]) for answer in answers]


def main() -> dict[str, Array]:
    """Print the table; return median, p99 and max by solver [ms]."""
    tire = network_fitted_to_curve()
    plant = Plant(tire)
    makers: Mapping[str, Callable[[], Peer]] = {
        "tireid, Riccati interior point": lambda: Ours(tire),
        "same linearization, condensed, DAQP": lambda: CondensedDaqp(tire),
        "CasADi sqpmethod + HPIPM, 1 iteration": lambda: hpipm(tire),
        "IPOPT, converged": lambda: ipopt(tire),
    }
    times: dict[str, list[Array]] = {name: [] for name in makers}
    built, last = {}, {}
    solvers = {}
    for name, make in makers.items():
        start = time.perf_counter()
        solvers[name] = make()
        built[name] = time.perf_counter() - start
        drive(solvers[name], plant, tire)  # warm
    for _ in range(ROUNDS):
        for name, solver in solvers.items():
            last[name] = drive(solver, plant, tire)
            times[name].append(1e3 * last[name].times)
    columns = "median ms      p99      max   of its median   of ours   failed   cost   build s"
    print(f"{'':40}{columns}")
    table = {}
    for name, rounds in times.items():
        least = np.min(rounds, axis=0)
        table[name] = np.array([np.median(least), np.percentile(least, 99), least.max()])
        median, p99, most = table[name]
        ours = median / next(iter(table.values()))[0]
        print(
            f"{name:40}{median:9.4f} {p99:8.4f} {most:8.4f} {p99 / median:11.2f} {ours:13.1f}"
            f" {last[name].failures:8d} {last[name].cost:8.4f} {built[name]:6.1f}"
        )
    first, second = first_use()
    print(f"from nothing to the first solution {first:.1f} s, second start {second:.2f} s")
    return table


if __name__ == "__main__":
    main()
