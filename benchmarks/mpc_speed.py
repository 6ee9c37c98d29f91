"""Time of one real-time step on `mpc_double_lane_change`: the tracker beside its peers, in one run.

    python -m benchmarks.mpc_speed [--quick] [--record]

Thread CPU time of the solver call alone; of each step the least of ROUNDS identical drives, which
take turns: what other programs on the machine cost is in all but that one. Every solver drives its
own closed loop; the closed-loop cost says that none of them is fast by being wrong. Where a step is
prepared its time is the latency from the measurement to the command. The tracker once more with the
sensor noise of `tireid drive`.
"""

import sys
from collections.abc import Callable, Mapping
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
from benchmarks.mpc_peers import Ours, Peer, hpipm, ipopt
from benchmarks.targets import Table, Targets, Values, parse
from codegen.arrays import Array
from mpc.tires.tire import PredictionTire

ROUNDS = 5
NOISE = np.array([0.02, 0.002, 0.03, 0.003, 0.0])  # m, rad, m/s, rad/s: of `tireid drive`
QUANTILES: Mapping[str, float] = {"median": 50.0, "p99": 99.0, "max": 100.0}
WAYS = {
    "tireid": "tireid, active sets and interior point",
    "prepared": "tireid, prepared: latency",
    "interior": "tireid, interior point alone",
    "noisy": "tireid, with sensor noise",
    "hpipm": "CasADi sqpmethod + HPIPM, 1 iteration",
    "ipopt": "IPOPT, converged",
}


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


def canary() -> Values:
    """Return the cost of a closed loop."""
    tire = network_fitted_to_curve()
    return {"tireid/cost": drive(Ours(tire), Plant(tire), tire).cost}


def tables(v: Values) -> dict[str, Table]:
    """Return the table of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    rows = [
        [words, *(f"{v[f'{way}/{q}']:.3f}" for q in QUANTILES), f"{v[f'{way}/cost']:.3f}"]
        for way, words in WAYS.items()
    ]
    header = ("solver; time of a step [ms]", "median", "99 %", "longest", "closed-loop cost")
    return {"mpc_speed": Table(header, rows)}


def main() -> int:
    """Print the table; return 1 where a target was missed."""
    targets, options = Targets("mpc_speed"), parse("mpc_speed", __doc__)
    tire = network_fitted_to_curve()
    plant = Plant(tire)
    makers: Mapping[str, Callable[[], Peer]] = {
        "tireid": lambda: Ours(tire),
        "prepared": lambda: Ours(tire, prepared=True),
        "interior": lambda: Ours(tire, max_active_sets=0),
        "noisy": lambda: Ours(tire),
        "hpipm": lambda: hpipm(tire),
        "ipopt": lambda: ipopt(tire),
    }
    names = ("tireid", "prepared", "noisy") if options.quick else tuple(makers)
    solvers = {name: makers[name]() for name in names}
    times: dict[str, list[Array]] = {name: [] for name in names}
    last = {}
    for _ in range(1 + (1 if options.quick else ROUNDS)):  # the first one warms
        for name, solver in solvers.items():
            last[name] = drive(solver, plant, tire, 0 if name == "noisy" else None)
            times[name].append(1e3 * last[name].times)
    for name, rounds in times.items():
        least = np.min(rounds[1:], axis=0)
        for q, share in QUANTILES.items():
            targets.record(f"{name}/{q}", float(np.percentile(least, share)))
        targets.record(f"{name}/cost", last[name].cost)
        cells = " ".join(f"{targets.values[f'{name}/{q}']:9.4f}" for q in QUANTILES)
        print(f"{WAYS[name]:40}{cells} ms, {last[name].failures} failed, {last[name].cost:.4f}")
    targets.at_most("steps that failed", last["tireid"].failures, 0, "")
    if not options.quick:
        slow = float(targets.values["noisy/p99"]) / float(targets.values["noisy/median"])
        targets.at_most("99 % under noise over the median", slow, 2.0, "-")
        ours, best = (float(targets.values[f"{name}/median"]) for name in ("tireid", "hpipm"))
        targets.at_most("median over that of HPIPM", ours / best, 1.0, "-")
        loss = 100.0 * (last["tireid"].cost / last["ipopt"].cost - 1.0)
        targets.at_most("closed-loop cost over the converged one", loss, 1.0, key="loss")
    return targets.finish(canary, keep=options.record)


if __name__ == "__main__":
    sys.exit(main())
