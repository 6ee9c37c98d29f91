"""Is the verdict right where nobody measured v_y? Clean logs of inertial sensors, and faulty ones.

    python -m benchmarks.verdicts_without_v_y [--each N] [--first SEED] [--record]

Drives of random cars of four classes as in `benchmarks.inertial`: banked roads, noise, bias, roll,
an accelerometer ahead of the center of gravity, which a repair tells, and beside it, which nobody
does. The first part of each is learnt on by the default; the rest is asked, with the same sensors,
v_y estimated too. Beside each clean log stands one with a fault that is drawn. An answer is wrong
above `WRONG` of the force of an axle there, and right below `RIGHT` in both. Bounds of the verdict
were chosen on seeds below `FIRST_SEED`.
"""

import argparse
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import tireid as ti
from benchmarks.answers import RIGHT, WRONG
from benchmarks.inertial import inertial_drive
from benchmarks.random_cars import CLASSES
from benchmarks.targets import Targets, keeps, show
from models.recordings import Recording, Repair
from models.vehicle import Vehicle

EACH, FIRST = 15, 7000  # drives of each class
TAUGHT = 0.7  # of a drive
SCALES = (0.8, 1.25)  # of a channel
LATE = (0.05, 0.1)  # s
INERTIA = (0.4, 2.5)  # times the told yaw inertia
PROCESSES = 2
SCALED, DELAYED = ("v_x", "r", "delta_f", "a_y"), ("r", "delta_f", "a_y")
FAULTS = (*(f"{name} scaled" for name in SCALED), *(f"{name} late" for name in DELAYED),
          "yaw inertia", "l_f and l_r swapped")  # fmt: skip


class Told(NamedTuple):
    """An answer: class, fault, what is missed of an axle force at most [%], whether valid."""

    kind: str
    fault: str
    missed: float
    valid: bool


def faulty(
    log: Recording, car: Vehicle, fault: str, rng: np.random.Generator
) -> tuple[Recording, Vehicle]:
    """Return a log and its car with a fault of a size that is drawn.

    Parameters
    ----------
    log : without.
    car : as it was told.
    fault : one of `FAULTS`, or empty.
    rng : source of the size.
    """
    channel, _, what = fault.partition(" ")
    if what == "scaled":
        changed: dict[str, Any] = {channel: rng.choice(SCALES) * getattr(log, channel)}
        return replace(log, **changed), car
    if what == "late":
        signal, k = getattr(log, channel), round(rng.choice(LATE) / log.dt)
        changed = {channel: np.append(np.full(k, signal[0]), signal[:-k])}
        return replace(log, **changed), car
    if fault == "yaw inertia":
        return log, replace(car, yaw_inertia=rng.choice(INERTIA) * car.yaw_inertia)
    if fault:
        return log, replace(car, l_f=car.l_r, l_r=car.l_f)
    return log, car


def answers(each: int, first: int, kind: str) -> list[Told]:
    """Return what is answered to the drives of a class, clean and faulty.

    Parameters
    ----------
    each : drives.
    first : seed of the first.
    kind : of cars.
    """
    told = []
    for k in range(each):
        seed = first + len(CLASSES) * k + list(CLASSES).index(kind)
        drive, rng = inertial_drive(kind, seed), np.random.default_rng(seed)
        force = drive.exact.axle_force
        own = replace(drive.shown, v_y=None, axle_force=force)
        placed = Repair(acceleration_sensor_x=drive.position[0])
        own, car = placed.apply(own, drive.told)
        for fault in ("", str(rng.choice(FAULTS))):
            log, known = faulty(own, car, fault, rng)
            end = float(log.t[0]) + TAUGHT * log.duration
            run = ti.identify(log.between(log.t[0], end), known, check=False)
            asked = ti.replay(log.between(end, log.t[-1]), run.freeze())
            assert asked.against_truth is not None and asked.true_force is not None
            missed = 100.0 * max(
                asked.against_truth.front / asked.true_force.front,
                asked.against_truth.rear / asked.true_force.rear,
            )
            told.append(Told(kind, fault, missed, run.verdict.valid))
    return told


def main() -> int:
    """Print and judge; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=EACH, help="drives of a class (%(default)s)")
    parser.add_argument("--first", type=int, default=FIRST, help="first seed (%(default)s)")
    options = parser.parse_args()
    targets = Targets("verdicts_without_v_y")
    with ProcessPoolExecutor(PROCESSES) as pool:
        several = pool.map(partial(answers, options.each, options.first), CLASSES)
        found = [one for some in several for one in some]
    clean, faults = ([one for one in found if bool(one.fault) == bad] for bad in (False, True))
    for name, some in (("clean", clean), ("faulty", faults)):
        wrong = [one for one in some if one.missed > WRONG]
        right = [one for one in some if one.missed < RIGHT]
        valid = [one for one in wrong if one.valid]
        refused = [one for one in right if not one.valid]
        show(f"{name}: {len(some)} answers", f"{len(wrong)} wrong, {len(right)} right")
        show(
            "  wrong and valid",
            ", ".join(f"{one.kind} {one.fault} {one.missed:.0f} %" for one in valid),
        )
        show("  right and refused", ", ".join(f"{one.kind} {one.missed:.0f} %" for one in refused))
        for key, value in (("answers", some), ("wrong", wrong), ("right", right)):
            targets.record(f"{name}/{key}", len(value))
        targets.record(f"{name}/right_refused", len(refused))
        targets.record(f"{name}/wrong_valid", len(valid))
    missed = Counter(one.fault for one in faults if one.valid and one.missed > WRONG)
    for fault in FAULTS:
        every = [one for one in faults if one.fault == fault]
        wrong = [one for one in every if one.missed > WRONG]
        show(f"  {fault}", f"{len(every)}, {len(wrong)} wrong, {missed[fault]} of them valid")
    share = 100.0 * float(np.mean([one.valid for one in clean if one.missed < RIGHT]))
    targets.at_least("right answers that are valid", share, 97.0, "%", key="clean/valid")
    targets.at_most(
        "clean answers that are wrong and valid",
        float(sum(one.valid and one.missed > WRONG for one in clean)),
        0.0,
        "",
        key="clean/silent",
    )
    usual = (options.each, options.first) == (EACH, FIRST)
    return targets.finish(keep=keep and usual)


if __name__ == "__main__":
    sys.exit(main())
