"""20 000 noisy logs are learnt from, frozen and judged: no exception, and every number is finite.

    python -m benchmarks.noisy_runs [--runs N] [--record]

Drives of random cars of four classes, of which each run takes 4 to 12 s from anywhere, standing
starts among them, sampled every 2 to 20 ms, with fresh noise of 0.01 to 100 times that of good
sensors in each channel, and in half of the runs with any fault of `random_case`. Logs that
contradict the car are not refused but learnt from: a user may insist. Of every `JUDGED`-th run,
which takes twenty times as long as learning, the verdict is asked.
"""

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

import tireid as ti
from benchmarks.answers import blind, drawn
from benchmarks.fault_cases import Case, random_case
from benchmarks.random_cars import (
    BEGINNINGS,
    CLASSES,
    FIRST_SEED,
    RandomDrive,
    random_beginning,
)
from benchmarks.targets import Targets, keeps, show
from models.faults import FaultError
from models.recordings import Recording
from models.recordings.record import CHANNELS
from models.sensors import Sensors

RUNS, DRIVES = 20_000, 40  # drives are shared by runs
JUDGED = 29  # shares no factor with `DRIVES`, so that runs of all drives are judged
LASTS = (4.0, 12.0)  # s
NOISE = (0.01, 100.0)  # times that of good sensors
SAMPLED = (0.002, 0.005, 0.01, 0.02)  # s
PROCESSES = 2


class Ended(NamedTuple):
    """How a run ended: the exception, or what was not finite; empty where all is well."""

    seed: int
    kind: str
    what: str


@cache
def drive_of(number: int) -> RandomDrive:
    """Return a drive that runs share.

    Parameters
    ----------
    number : of it, in turns of classes and beginnings.
    """
    kind = list(CLASSES)[number % len(CLASSES)]
    begin = partial(random_beginning, BEGINNINGS[number // len(CLASSES) % len(BEGINNINGS)])
    return drawn(kind, FIRST_SEED + number, begin)


def noisy(sensors: Sensors, rng: np.random.Generator) -> Sensors:
    """Return sensors of a random noise each.

    Parameters
    ----------
    sensors : good ones.
    rng : source of randomness.
    """
    times = np.exp(rng.uniform(np.log(NOISE[0]), np.log(NOISE[1]), size=4))
    channels = ("v_x", "v_y", "r", "delta")
    return Sensors(
        **{
            name: replace(getattr(sensors, name), noise=factor * getattr(sensors, name).noise)
            for name, factor in zip(channels, times, strict=True)
        }
    )


def sampled(recording: Recording, dt: float) -> Recording:
    """Return a recording from time zero on, sampled anew by straight lines, without true forces.

    Parameters
    ----------
    recording : with a_y.
    dt : sampling interval [s].
    """
    t = np.arange(0.0, recording.duration, dt)
    anew: dict[str, Any] = {
        name: np.interp(t, recording.t - recording.t[0], getattr(recording, name))
        for name in CHANNELS
    }
    return replace(blind(recording), t=t, **anew)


def noisy_log(drive: RandomDrive, rng: np.random.Generator) -> tuple[Recording, ti.Vehicle, Case]:
    """Return a part of a drive with noise and maybe a fault, the car as it is told, and the fault.

    Parameters
    ----------
    drive : shared.
    rng : source of randomness.
    """
    exact = drive.exact
    lasts = rng.uniform(*LASTS)
    start = rng.choice([0.0, rng.uniform(0.0, exact.duration - lasts)])
    part = sampled(exact.between(start, start + lasts), float(rng.choice(SAMPLED)))
    shown = noisy(drive.car.sensors, rng).apply(part, rng)
    case = random_case(drive.car.told, rng) if rng.integers(2) else Case()
    try:
        return case.log(shown), case.car(drive.car.told), case
    except FaultError:  # of a clock that jumps after the end
        return shown, drive.car.told, Case()


def run(seed: int) -> Ended:
    """Learn from a noisy log and freeze, in the middle and at the end.

    Parameters
    ----------
    seed : of the run.
    """
    rng = np.random.default_rng([FIRST_SEED, seed])
    drive = drive_of(seed % DRIVES)
    log, told, _ = noisy_log(drive, rng)
    try:
        history = ti.identify(log, told, check=False)
        for t in (float(log.t[len(log) // 2]), None):
            tire = history.freeze(t)
            if not np.isfinite(tire.predict(log)).all():
                return Ended(seed, drive.car.kind, "force that is not finite")
        stiffness = tire.stiffness
        assert stiffness is not None
        if not (np.isfinite(stiffness).all() and (np.array(stiffness) > 0.0).all()):
            return Ended(seed, drive.car.kind, "stiffness that is none")
        if seed % JUDGED == 0 and not is_sound(history.verdict):
            return Ended(seed, drive.car.kind, "verdict that is none")
    except Exception as error:
        return Ended(seed, drive.car.kind, f"{type(error).__name__}: {error}")
    sound = np.isfinite(history.force).all()
    return Ended(seed, drive.car.kind, "" if sound else "force online that is not finite")


def is_sound(verdict: ti.Verdict) -> bool:
    """Return whether a verdict can be told: strict JSON, and all of it numbers.

    Parameters
    ----------
    verdict : on a run.
    """
    try:
        json.dumps(verdict.to_dict(), allow_nan=False)
    except ValueError:
        return False
    return len(verdict.lines) > 1


def chunk(seeds: Sequence[int]) -> list[Ended]:
    """Return what did not end well of some runs.

    Parameters
    ----------
    seeds : of the runs.
    """
    return [ended for ended in map(run, seeds) if ended.what]


def main() -> int:
    """Run everything; return the exit code."""
    keep, begin = keeps(), time.perf_counter()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=RUNS)
    runs, targets = parser.parse_args().runs, Targets("noisy_runs")
    parts = [range(k, min(k + 200, runs)) for k in range(0, runs, 200)]
    with ProcessPoolExecutor(PROCESSES) as pool:
        bad = [ended for some in pool.map(chunk, parts) for ended in some]
    seconds = time.perf_counter() - begin
    targets.record("runs", runs)
    targets.record("judged", len(range(0, runs, JUDGED)))
    targets.record("seconds", seconds, "s")
    for what, count in Counter(one.what.split(":")[0] for one in bad).most_common():
        show(what, f"{count} runs")
    for one in bad[:10]:
        show(f"seed {one.seed}, {one.kind}", one.what[:200])
    stopped = sum(":" in one.what for one in bad)
    targets.at_most("runs that ended in an exception", stopped, 0, "", "exceptions")
    targets.at_most("runs with a number that is not one", len(bad) - stopped, 0, "", "unsound")
    targets.at_most("time", seconds / 60.0, 15.0, "min")
    return targets.finish(keep=keep and runs == RUNS)


if __name__ == "__main__":
    sys.exit(main())
