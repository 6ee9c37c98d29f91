"""Many gain sets at once in SIMD lanes against the same compiled C one at a time.

    python -m benchmarks.batch_speed [GAIN_SETS] [--record]

45 s of driving (4500 steps), the paper's law, 10 hidden units. Both loops are compiled from the
same CasADi function and record nothing but where they end; they take turns, the shortest of
several processor times counts. Then `identify_batch` as a user calls it, with set-up, packing and
errors, on every processor, against `identify` one at a time. Fails where a run differs in a bit.
"""

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from benchmarks.targets import Targets, keeps
from codegen import BatchScan
from codegen.batch import processors
from codegen.lanes import find_target
from identifier.compare.batch import BatchRun, identify_batch
from identifier.methods import make_method
from identifier.paper.design import PaperIdentifier
from identifier.run import History, identify
from models.maneuvers import Slalom
from models.plant import Plant
from models.recordings import Recording
from models.vehicle import Vehicle, sedan

SLALOM = Slalom(amplitude=np.radians(4.0), frequency=0.5, onset=1.0, rate_limit=1.0, duration=44.99)
TURNS = 15
GAIN_SETS = 1000
METHODS = ("integral", "instantaneous", "pi_lead", "rls", "axle", "magic_formula_ekf")


def shortest(
    actions: Mapping[str, Callable[[], object]],
    turns: int = TURNS,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, float]:
    """Return the shortest time of each action [s]; they take turns."""
    best = dict.fromkeys(actions, float("inf"))
    for _ in range(turns):
        for name, action in actions.items():
            start = clock()
            action()
            best[name] = min(best[name], clock() - start)
    return best


def per_step(name: str, car: Vehicle, recording: Recording) -> tuple[float, float]:
    """Return the time of a step of one run [s]: alone, and in lanes on one core."""
    setup, n = make_method(name, car).setup(car).begin(recording.x[0]), len(recording)
    sampled = setup.shown(recording).signals
    numbers = {**setup.carry, **setup.constants}
    scan = setup.scan
    batch = BatchScan(scan.step, carry=scan.carry, over=scan.over, lanes_over=tuple(numbers))
    target = find_target()
    runs = 8 * (target.lanes if target else 1)
    many = {port: np.repeat(np.asarray(v)[None], runs, axis=0) for port, v in numbers.items()}
    alone = scan(n, {**numbers, **sampled}, every=n)
    lanes = batch(n, {**many, **sampled}, workers=1)
    for port in scan.carry:
        for value in lanes[f"{port}_final"]:
            np.testing.assert_array_equal(value, alone[f"{port}_final"])
    times = shortest(
        {
            "alone": lambda: scan(n, {**numbers, **sampled}, every=n),
            "lanes": lambda: batch(n, {**many, **sampled}, workers=1),
        },
        clock=time.process_time,  # of this one thread: a busy machine does not count
    )
    return times["alone"] / n, times["lanes"] / n / runs


def gain_sets(car: Vehicle, count: int) -> list[PaperIdentifier]:
    """Return designs whose gains are drawn around those of the vehicle, each with its own seed."""
    rng, base = np.random.default_rng(0), PaperIdentifier.for_vehicle(car)
    drawn = []
    for seed, (rate, leak, forgetting) in enumerate(np.exp(rng.uniform(-1, 1, (count, 3)))):
        gains = replace(
            base.gains,
            eta_W=base.gains.eta_W * rate,
            rho_W=base.gains.rho_W * leak,
            forgetting=base.gains.forgetting * forgetting,
        )
        drawn.append(replace(base, gains=gains, seed=seed))
    return drawn


def check(run: BatchRun, history: History) -> None:
    """Fail where a run in a lane is not that of the same design alone, in every bit."""
    for port, value in run.state[np.inf].items():
        np.testing.assert_array_equal(value, history.state[port][-1])


def main(count: int = GAIN_SETS) -> int:
    """Print the table; record the times of the batch [s] and the ratios by method."""
    keep, targets, car = keeps() and count == GAIN_SETS, Targets("batch_speed"), sedan()
    recording = Plant(car).simulate(SLALOM, speed=20.0).recording()
    target = find_target()
    print(f"{target.lanes if target else 1} lanes, {processors()} processors")
    print("one step of one run, one core       alone [ns]   in lanes [ns]   ratio")
    for name in METHODS:
        alone, lanes = per_step(name, car, recording)
        print(f"{name:34}{1e9 * alone:12.1f}{1e9 * lanes:16.1f}{alone / lanes:8.1f}")
        targets.record(f"lanes/{name}", alone / lanes, "-")
    designs = gain_sets(car, count)
    runs = identify_batch(recording, car, designs)
    for k in range(0, count, max(count // 20, 1)):
        check(runs[k], identify(recording, car, designs[k]))
    few = designs[: min(count, 20)]
    times = shortest(
        {
            "one core": lambda: identify_batch(recording, car, designs, workers=1),
            "all cores": lambda: identify_batch(recording, car, designs),
            "alone": lambda: [identify(recording, car, design) for design in few],
        },
        turns=5,
    )
    alone = times["alone"] / len(few) * count
    print(f"{count} gain sets over {recording.duration:.0f} s, n_h = {designs[0].network.hidden}:")
    print(f"  identify_batch, one core   {times['one core']:8.3f} s")
    print(f"  identify_batch, all cores  {times['all cores']:8.3f} s")
    print(f"  identify, one at a time    {alone:8.3f} s (from {len(few)})")
    print(f"  ratio on all cores         {alone / times['all cores']:8.1f}")
    targets.record("gain_sets", count)
    targets.record("batch/one_core", times["one core"], "s")
    targets.record("batch/all_cores", times["all cores"], "s")
    targets.record("batch/one_at_a_time", alone, "s")
    targets.record("batch/ratio", alone / times["all cores"], "-")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in sys.argv[1:] if word != "--record")))
