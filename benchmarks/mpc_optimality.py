"""What one iteration a step loses against the converged solution, in closed loop on every path.

Each built-in path at 90 % of the limit of grip is driven by trackers that differ in one number,
the linearizations a step: 1, 3, and 20, which is converged. Once with exact sensors, where the plan
of one step leads into the next, and over seeds of sensor noise, which throws the car off it at
every step. The tracker knows the true tire, which lags and saturates: the hardest prediction there
is. The cost is that of the problem, from what the car did.
"""

from typing import NamedTuple

import numpy as np

from benchmarks.mpc_cases import Case, profile, road, tires
from models.vehicle import sedan
from mpc.cars import DoubleTrackCar
from mpc.cost import tracking_errors
from mpc.loop import Drive, drive, inertial_unit
from mpc.path import BUILT_IN
from mpc.problem import Problem
from mpc.realtime import Tracker

TRIED, CONVERGED = (1, 3), 20  # linearizations a step
SHARE, TIRES, SEEDS = 0.9, "oracle", 3


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
    car = DoubleTrackCar(sedan())
    lag = sedan().require_chassis().steering_lag
    tracker = Tracker(
        tires(case.tires, case.mu, case.seed),
        period=car.period,
        delay=case.delay * car.period + lag,
        linearizations=linearizations,
    )
    return drive(
        road(case.path),
        car,
        tracker,
        speed=profile(case.path, case.share, case.mu),
        sensors=inertial_unit() if noise else None,
        delay=case.delay,
        rng=np.random.default_rng([case.seed, 2]),
        plan_every=0,
    )


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


def main() -> dict[tuple[str, bool, int], float]:
    """Print the table; return the excess of cost by path, noise and linearizations."""
    print(f"{'path':12} sensors  iterations  mean cost  excess  peak e_y  angle   rate  failed")
    excess = {}
    for name in BUILT_IN:
        for noise in (False, True):
            best = mean_outcome(name, CONVERGED, noise=noise)
            for n in (*TRIED, CONVERGED):
                came = best if n == CONVERGED else mean_outcome(name, n, noise=noise)
                excess[name, noise, n] = came.cost / best.cost - 1.0
                print(
                    f"{name:12} {'noisy' if noise else 'exact':8} {n:9d} {came.cost:11.5f}"
                    f" {excess[name, noise, n]:7.2%} {came.peak_e_y:7.3f} m {came.steering:6.3f}"
                    f" {came.rate:6.3f} {came.failures:6d}",
                    flush=True,
                )
    return excess


if __name__ == "__main__":
    main()
