"""What one iteration a step loses against the converged solution, in closed loop on every path.

Each built-in path at 90 % of the limit of grip is driven by trackers that differ in one number,
the linearizations a step: 1, 3, and 20, which is converged. Once with exact sensors, where the plan
of one step leads into the next, and over seeds of sensor noise, which throws the car off it at
every step. The tracker knows the true tire, which lags and saturates: the hardest prediction there
is. The cost is that of the problem, from what the car did.
"""

import sys
from typing import NamedTuple

import numpy as np

from benchmarks.mpc_cases import Case, options_of
from benchmarks.targets import Targets, keeps
from mpc.loop.record import Drive
from mpc.path import BUILT_IN
from mpc.problem import Problem, tracking_errors
from tireid.commands.drive_case import conditions_of
from tireid.driving.runs import ORACLE, run_drive

TRIED, CONVERGED = (1, 3), 20  # linearizations a step
SHARE, TIRES, SEEDS = 0.9, "oracle", 3
EXACT_EXCESS = 0.05  # % of cost that one iteration may lose with exact sensors
NOISY_EXCESS = 2.0  # % with noise


class Outcome(NamedTuple):
    """Mean cost a stage, peak |e_y| [m], |steering| and |rate| in parts of their limits, and steps
    that failed.
    """

    cost: float
    peak_e_y: float
    steering: float
    rate: float
    failures: int


def driven(case: Case, linearizations: int, *, noise: bool) -> Drive:
    """Return the drive of a case."""
    options = options_of([*case.words, "--noise" if noise else "--no-noise"])
    return run_drive(ORACLE, conditions_of(options), None, linearizations=linearizations).drive


def outcome(run: Drive) -> Outcome:
    """Return what a drive cost by the tracker's own measure."""
    problem = Problem()
    cost, limits = problem.cost, problem.limits
    s_dot = (run.v_x * np.cos(run.e_psi) - run.v_y * np.sin(run.e_psi)) / (1 - run.kappa * run.e_y)
    x = [run.e_y, run.e_psi, run.v_y, run.r, run.command]
    errors = np.array(
        [
            np.asarray(tracking_errors(one, kappa, v_x, rate)).ravel()
            for *one, kappa, v_x, rate in zip(*x, run.kappa, run.v_x, s_dot, strict=True)
        ]
    )
    u = np.diff(run.command, prepend=0.0) / run.period
    over = np.maximum(np.abs(run.e_y) - limits.e_y, 0.0)
    total = errors**2 @ cost.numbers() + cost.R * u**2 + limits.soft_e_y * over**2
    return Outcome(
        float(0.5 * total.mean()),
        float(np.abs(run.e_y).max()),
        float(np.abs(run.command).max() / limits.steering),
        float(np.abs(u).max() / limits.steering_rate),
        int((run.status != 0).sum()),
    )


def mean_outcome(name: str, linearizations: int, *, noise: bool) -> Outcome:
    """Return the mean cost and the worst of everything else over the seeds."""
    cases = [Case(name, SHARE, 1.0, TIRES, seed) for seed in range(SEEDS if noise else 1)]
    seen = [outcome(driven(case, linearizations, noise=noise)) for case in cases]
    cost, *others = np.array(seen).T
    peak_e_y, steering, rate, failures = (float(values.max()) for values in others)
    return Outcome(float(cost.mean()), peak_e_y, steering, rate, int(failures))


def main(*, keep: bool = False) -> int:
    """Print the table; return 1 where one iteration loses more than it may.

    Parameters
    ----------
    keep : record the numbers for the documents.
    """
    print(f"{'path':12} sensors  iterations  mean cost  excess  peak e_y  angle   rate  failed")
    targets, worst = Targets("mpc_optimality"), {"exact": 0.0, "noisy": 0.0}
    for name in BUILT_IN:
        for noise in (False, True):
            sensors = "noisy" if noise else "exact"
            best = mean_outcome(name, CONVERGED, noise=noise)
            for n in (*TRIED, CONVERGED):
                came = best if n == CONVERGED else mean_outcome(name, n, noise=noise)
                excess = 100.0 * (came.cost / best.cost - 1.0)
                print(
                    f"{name:12} {sensors:8} {n:9d} {came.cost:11.5f} {excess:6.2f}%"
                    f" {came.peak_e_y:7.3f} m {came.steering:6.3f} {came.rate:6.3f}"
                    f" {came.failures:6d}",
                    flush=True,
                )
                if n == 1:
                    targets.record(f"{name}/{sensors}/excess", excess, "%")
                    targets.record(f"{name}/{sensors}/failures", came.failures, "")
                    worst[sensors] = max(worst[sensors], excess)
    for sensors, most in (("exact", EXACT_EXCESS), ("noisy", NOISY_EXCESS)):
        label = f"cost of one iteration over convergence, {sensors} sensors"
        targets.at_most(label, worst[sensors], most, key=f"{sensors}/worst_excess")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    sys.exit(main(keep=keeps()))
