"""The tracker from random states, under noise, with other weights every 20 steps: nothing fails.

Each episode begins at a random state beside a random road, up to the limit of grip, with random
wheels, grip and speed, and follows its own plan with noise on every measurement. Hard limits are
checked on every command and plan. Then the same C replays every step under AddressSanitizer and
UndefinedBehaviorSanitizer, and must steer the same.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.mpc_double_lane_change import HIDDEN, network_fitted_to_curve
from benchmarks.targets import Targets, keeps
from codegen import find_compiler
from codegen.arrays import Array
from models.vehicle import sedan
from mpc.problem import Limits, Problem
from mpc.realtime import Measurement, Status, Tracker
from mpc.realtime.instance import tracker_source
from mpc.tires import PredictionTire, prediction_tire
from mpc.tires.ladder import oracle_tire

STEPS = 6000  # of each tire
EPISODE = 20  # steps between two swaps
PERIOD, DELAY = 0.02, 0.03  # s
LATERAL = 7.0  # most lateral acceleration of roads, and of wheels to begin with [m/s²]
PROBLEM = Problem(limits=Limits(slip=(0.15, 0.15)))
SPREAD = np.array([1.0, 0.15, 1.2, 0.4])  # of e_y [m], e_psi [rad], v_y [m/s], r [rad/s]
NOISE = np.array([0.03, 0.005, 0.05, 0.01])
BEYOND = 1e-14  # of a limit that is kept exactly: rounding
SANITIZED = ("-std=c99", "-O1", "-g", "-ffp-contract=off", "-fsanitize=address,undefined")


class Stress(NamedTuple):
    """What came of it; CPU times in ms, limits in parts of themselves."""

    statuses: Mapping[str, int]
    iterations: NDArray[np.int64]
    times: Array
    beyond_angle: float
    beyond_rate: float
    recorded: bytes


def tires() -> dict[str, list[PredictionTire]]:
    """Return tires of each size of prediction, 2 weights, 82, and lagging, of different grip."""
    car, grips = sedan(), np.linspace(0.7, 1.2, 6)
    linear, network = prediction_tire(car), network_fitted_to_curve()
    scaled = np.zeros(network.weights.size)
    scaled[: 2 + 2 * HIDDEN] = 1.0  # forces; what they depend on stays
    return {
        "linear": [linear._replace(weights=linear.weights * grip) for grip in grips],
        "network": [network._replace(weights=network.weights * grip**scaled) for grip in grips],
        "lagging curve": [oracle_tire(car, mu=float(grip)) for grip in grips],
    }


def random_road(times: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return curvature and speed at some times."""
    v_x = rng.uniform(8.0, 35.0) + rng.uniform(-2.0, 1.0) * times
    most = rng.uniform(0.0, LATERAL) / v_x.max() ** 2
    turns = np.sin(rng.uniform(0.3, 4.0) * times + rng.uniform(0.0, 2.0 * np.pi))
    return most * turns, v_x


def stress(choice: list[PredictionTire], steps: int, rng: np.random.Generator) -> Stress:
    """Drive random episodes."""
    tracker = Tracker(choice[0], PROBLEM, period=PERIOD, delay=DELAY, clock=time.thread_time)
    limits, share = PROBLEM.limits, PERIOD / PROBLEM.dt
    records, iterations, times = [], [], []
    angle = rate = last = 0.0
    state, kappa, v_x = np.zeros(4), np.zeros(0), np.zeros(0)
    for k in range(steps):
        does = 0.0
        if k % EPISODE == 0:
            does = 2.0
            tracker.set_tire(choice[rng.integers(len(choice))])
            kappa, v_x = random_road(tracker.times, rng)
            last = rng.uniform(-1.0, 1.0) * (0.02 + LATERAL * 2.7 / v_x[0] ** 2)
            tracker.reset(last)
            state = SPREAD * rng.uniform(-1.0, 1.0, 4)
        begin = last
        e_y, e_psi, v_y, r = (state + NOISE * rng.standard_normal(4)).tolist()
        command = tracker.step(Measurement(e_y, e_psi, v_y, r, kappa, v_x))
        iterations.append(command.iterations)
        times.append(1e3 * command.solve_time_s)
        planned = np.abs(command.plan_x[1:, 4]).max()
        angle = max(angle, abs(command.steering) / limits.steering, planned / limits.steering)
        moved = max(abs(command.steering - last) / PERIOD, np.abs(command.plan_u).max())
        rate = max(rate, moved / limits.steering_rate)
        last = command.steering
        state = ((1.0 - share) * command.plan_x[0] + share * command.plan_x[1])[:4]
        records.append(np.array([does, begin, command.steering]).tobytes())
        records += [tracker.params.tobytes()] if does else []
        records.append(tracker.instance.input.tobytes())
    return Stress(
        {status.name: count for status, count in tracker.faults.items() if count},
        np.array(iterations),
        np.array(times),
        angle - 1.0,
        rate - 1.0,
        b"".join(records),
    )


def sanitized(tire: PredictionTire, recorded: bytes) -> tuple[int, int, float]:
    """Return steps, failures and the largest difference of the steering [rad] of the replay."""
    compiler = find_compiler()
    assert compiler is not None, "this benchmark needs a C compiler"
    replay = Path(__file__).with_suffix(".c").read_text(encoding="utf-8")
    source = tracker_source(tire.structure, PROBLEM.horizon, single=False) + replay
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "replay.c").write_text(source, encoding="utf-8")
        (folder / "steps.bin").write_bytes(recorded)
        command = [*compiler, *SANITIZED, "-fno-sanitize-recover=all", "replay.c", "-lm"]
        subprocess.run([*command, "-o", "replay"], cwd=folder, check=True)
        run = ["./replay", "steps.bin"]
        answer = subprocess.run(run, cwd=folder, check=True, capture_output=True, text=True)
    steps, failures, difference = answer.stdout.split()
    return int(steps), int(failures), float(difference)


def main(steps: int = STEPS, seed: int = 0, *, keep: bool = False) -> int:
    """Print what came of it for each tire; return 1 where something failed.

    Parameters
    ----------
    steps : of each tire.
    seed : of everything that is random.
    keep : record the numbers for the documents.
    """
    print(f"{'tire':14} steps  not OK  iterations med p99 max   ms med   p99   angle  rate beyond")
    targets, solves, failed, replayed = Targets("mpc_stress"), 0, 0, 0
    beyond, differs = [], []
    for name, choice in tires().items():
        came = stress(choice, steps, np.random.default_rng(seed))
        counts, ms = (
            np.percentile(came.iterations, [50, 99, 100]),
            np.percentile(came.times, [50, 99]),
        )
        bad = steps - came.statuses.get(Status.OK.name, 0)
        print(
            f"{name:14} {steps:5d} {bad:7d} {counts[0]:14.0f} {counts[1]:3.0f} {counts[2]:3.0f}"
            f" {ms[0]:8.3f} {ms[1]:6.3f} {came.beyond_angle:8.0e} {came.beyond_rate:6.0e}"
        )
        again, failures, difference = sanitized(choice[0], came.recorded)
        print(
            f"{'':14} sanitizers: {again} steps, {failures} not OK,"
            f" steering differs by {difference:.1e} rad"
        )
        solves, failed, replayed = solves + steps, failed + bad + failures, replayed + again
        beyond += [came.beyond_angle, came.beyond_rate]
        differs.append(difference)
    targets.record("solves", solves)
    targets.record("swap_every", EPISODE, "steps")
    targets.at_most("solves that failed", failed, 0, "", key="failed")
    targets.at_least("steps that sanitizers replayed", replayed, solves, "", key="replayed")
    label = "angle and rate beyond their limits, in parts of them"
    targets.at_most(label, max(beyond), BEYOND, "-", key="beyond_limits")
    label = "steering under sanitizers differs by"
    targets.at_most(label, max(differs), 0.0, "rad", key="sanitizers_differ")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    sys.exit(main(keep=keeps()))
