"""Time of one real-time step on `mpc_double_lane_change`: ours against its peers, in one run.

Thread CPU time of the solver call alone; of each step the least of ROUNDS identical drives, which
take turns: what other programs on the machine cost is in all but that one. Every solver drives its
own closed loop; the closed-loop cost says that none of them is fast by being wrong. Where a step is
prepared its time is the latency from the measurement to the command; what was done ahead stands
beside it. The same once more with the sensor noise of `tireid drive`, over SEEDS. A last line says
how long it takes from nothing to the first solution, and at the second start.

The tracker is compared with the one before it tried sets of active limits. No checkout builds that
one any more: mpc_speed_before.json keeps instructions of its steps, and as `over_interior` its mean
over that of today's interior point alone on the same drive, which takes the same iterations. By
that part of the interior point's times in this run its own are told.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.converged import build_errors
from benchmarks.mpc_double_lane_change import (
    PROBLEM,
    SPEED,
    STEPS,
    Plant,
    network_fitted_to_curve,
    road,
)
from benchmarks.mpc_peers import CondensedDaqp, Ours, Peer, hpipm, ipopt
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from mpc.tires.tire import PredictionTire

ROUNDS = 5
SEEDS = 3  # of noise
NOISE = np.array([0.02, 0.002, 0.03, 0.003, 0.0])  # m, rad, m/s, rad/s: of `tireid drive`
BEFORE = Path(__file__).with_name("mpc_speed_before.json")
QUANTILES: Mapping[str, float] = {"median": 50.0, "p99": 99.0, "max": 100.0}
MEDIAN, P99 = 0.45, 0.6  # of the tracker before, at most
LATENCY = 25.0 / 70.0  # of its median
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


def drive(solver: Peer, plant: Plant, tire: PredictionTire, seed: int | None = None) -> Loop:
    """Drive the double lane change from the start, where there is a seed with noise."""
    rng = np.random.default_rng(seed)
    errors, q = build_errors(tire.structure), PROBLEM.cost.numbers()
    ahead, now = road()
    x, times, cost, failures = np.zeros(5), [], 0.0, 0
    for k in range(STEPS):
        noise = NOISE * rng.standard_normal(5) if seed is not None else np.zeros(5)
        answer = solver.step(x + noise, ahead[k])
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


def noisy(tire: PredictionTire, plant: Plant, targets: Targets) -> None:
    """Compare the tracker with the one before under sensor noise.

    Parameters
    ----------
    plant : that is driven.
    targets : record what is measured.
    """
    before = json.loads(BEFORE.read_text(encoding="utf-8"))["over_interior"]
    makers: Mapping[str, Callable[[], Ours]] = {
        "interior": lambda: Ours(tire, max_active_sets=0),
        "tireid": lambda: Ours(tire),
        "prepared": lambda: Ours(tire, prepared=True),
    }
    times: dict[str, Array] = {}
    for name, make in makers.items():
        loops = [[drive(make(), plant, tire, seed) for _ in range(3)] for seed in range(SEEDS)]
        least = [np.min([1e3 * loop.times for loop in rounds], axis=0) for rounds in loops]
        times[name] = np.percentile(np.concatenate(least), list(QUANTILES.values()))
        cost = float(np.mean([rounds[0].cost for rounds in loops]))
        told = ", ".join(
            f"{q} {t:.4f} ms" for q, t in zip(QUANTILES, times[name].tolist(), strict=True)
        )
        print(f"with noise: {name:10} {told}, cost {cost:.4f}")
        for q, t in zip(QUANTILES, times[name].tolist(), strict=True):
            targets.record(f"noisy/{name}/{q}", t, "ms")
        targets.record(f"noisy/{name}/cost", cost, "-")
    for name in ("tireid", "prepared"):
        median, p99, most = (times[name] / (times["interior"] * before)).tolist()
        label, key = f"with noise, {name} over the one before: ", f"noisy/{name}/of_before"
        targets.at_most(f"{label}median", median, MEDIAN, "-", key=f"{key}/median")
        targets.at_most(f"{label}p99", p99, P99, "-", key=f"{key}/p99")
        targets.record(f"{key}/max", most, "-")


def main(*, keep: bool = False) -> int:
    """Print the table; return 1 where a target was missed.

    Parameters
    ----------
    keep : record the numbers for the documents.
    """
    tire = network_fitted_to_curve()
    plant = Plant(tire)
    makers: Mapping[str, tuple[str, Callable[[], Peer]]] = {
        "tireid": ("tireid, active sets and interior point", lambda: Ours(tire)),
        "prepared": ("tireid, prepared: latency", lambda: Ours(tire, prepared=True)),
        "interior": ("tireid, interior point alone", lambda: Ours(tire, max_active_sets=0)),
        "daqp": ("same linearization, condensed, DAQP", lambda: CondensedDaqp(tire)),
        "hpipm": ("CasADi sqpmethod + HPIPM, 1 iteration", lambda: hpipm(tire)),
        "ipopt": ("IPOPT, converged", lambda: ipopt(tire)),
    }
    times: dict[str, list[Array]] = {name: [] for name in makers}
    built, last = {}, {}
    solvers = {}
    for name, (_, make) in makers.items():
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
    targets, median, late = Targets("mpc_speed"), {}, {}
    for name, rounds in times.items():
        least = np.min(rounds, axis=0)
        median[name], late[name], most = (float(np.percentile(least, q)) for q in (50, 99, 100))
        p99 = late[name]
        of_ours = median[name] / median["tireid"]
        print(
            f"{makers[name][0]:40}{median[name]:9.4f} {p99:8.4f} {most:8.4f}"
            f" {p99 / median[name]:11.2f} {of_ours:13.1f} {last[name].failures:8d}"
            f" {last[name].cost:8.4f} {built[name]:6.1f}"
        )
        targets.record(f"{name}/median", median[name], "ms")
        targets.record(f"{name}/p99", p99, "ms")
        targets.record(f"{name}/max", most, "ms")
        targets.record(f"{name}/of_ours", of_ours, "-")
        targets.record(f"{name}/cost", last[name].cost, "-")
    first, second = first_use()
    targets.record("first_use", first, "s")
    targets.record("second_start", second, "s")
    print(f"from nothing to the first solution {first:.1f} s, second start {second:.2f} s")
    ahead = solvers["prepared"]
    assert isinstance(ahead, Ours)
    work = 1e3 * float(np.median(ahead.ahead))
    targets.record("prepared/ahead", work, "ms")
    print(f"prepared: {work:.4f} ms ahead of the measurement, {median['prepared']:.4f} ms after it")
    peers = [median[name] for name in ("daqp", "hpipm", "ipopt")]
    ratio = median["tireid"] / min(peers)
    targets.at_most("median over that of the quickest peer", ratio, 1.0, "-")
    before = json.loads(BEFORE.read_text(encoding="utf-8"))["over_interior"]
    for label, value, most in (
        ("median", median["tireid"] / (before * median["interior"]), MEDIAN),
        ("p99", late["tireid"] / (before * late["interior"]), P99),
        ("latency", median["prepared"] / (before * median["interior"]), LATENCY),
    ):
        targets.at_most(f"{label} over the one before", value, most, "-", key=f"of_before/{label}")
    noisy(tire, plant, targets)
    loss = 100.0 * (last["tireid"].cost / last["ipopt"].cost - 1.0)
    targets.at_most("closed-loop cost over the converged one", loss, 1.0, key="loss")
    targets.at_most("steps that failed", last["tireid"].failures, 0, "")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    sys.exit(main(keep=keeps()))
