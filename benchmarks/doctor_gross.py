"""Whether the doctor names gross faults first or second, and is silent on drives that are right.

    python -m benchmarks.doctor_gross [--cars N] [--clean N] [--first SEED] [--record]

Every kind of `gross_cases` on minutes of everyday driving, one lane change or slalom in each, of
cars of four classes; half of the logs have no a_y. Steering ratios are compared with the planted.
"""

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.answers import blind
from benchmarks.doctor_answers import (
    FIRST,
    NAMED,
    PROCESSES,
    Clean,
    judge_clean,
    rank_of,
    recorded_runs,
    said_of_clean,
)
from benchmarks.everyday_drives import KINDS as MANEUVERS
from benchmarks.everyday_drives import drawn_everyday
from benchmarks.gross_cases import KINDS, Gross
from benchmarks.random_cars import CLASSES
from benchmarks.recorded_cars import DATA
from benchmarks.targets import Targets, keeps, show
from identifier.doctor import Finding
from identifier.doctor.chosen import CHOSEN as DOCTOR_CHOSEN
from identifier.doctor.suspects import SUSPECTS
from models.faults import SensorFault
from models.recordings import Recording
from models.vehicle import Vehicle

CARS, CLEAN = 3, 12  # of each class


class Outcome(NamedTuple):
    """What was said of a log with one fault.

    kind : class of the car.   fault : its kind.   named : first or second.   error : of a steering
    ratio, over the ratio, NaN else.   seconds : of one processor.   said : first findings.
    """

    kind: str
    fault: str
    named: bool
    error: float
    seconds: float
    said: str


def drawn(kind: str, seed: int) -> tuple[Recording, Vehicle]:
    """Return the log of a seed, without a_y where the seed is odd, and the car as it is told.

    Parameters
    ----------
    kind : class of the car.
    seed : of car, drive and noise.
    """
    drive = drawn_everyday(kind, MANEUVERS[(seed // 2) % len(MANEUVERS)], seed)
    log = blind(drive.log(np.random.default_rng([seed, 1])))
    return replace(log, a_y=None) if seed % 2 else log, drive.car.told


def needs(fault: str, log: Recording) -> bool:
    """Return whether a log has what a fault is of.

    Parameters
    ----------
    fault : kind of it.
    log : with or without a_y.
    """
    return "a_y" not in fault or log.a_y is not None


def of_car(job: tuple[str, int]) -> list[Outcome]:
    """Return what is said of one car's drive with each kind of fault.

    Parameters
    ----------
    job : class of the car, and its seed.
    """
    kind, seed = job
    log, told = drawn(kind, seed)
    found = []
    for k, (name, draw) in enumerate(KINDS.items()):
        if not needs(name, log):
            continue
        fault = draw(told, np.random.default_rng([seed, k, 8, *kind.encode()]))
        begin = time.process_time()
        listed = ti.diagnose(fault.case.log(log), fault.case.car(told)).findings
        seconds = time.process_time() - begin
        rank = rank_of(listed[:NAMED], fault.right)
        said = ", ".join(f"{one.code} {one.channel}".strip() for one in listed[:NAMED])
        error = ratio_error(listed[rank - 1], fault) if rank else np.nan
        found.append(Outcome(kind, name, rank > 0, error, seconds, said or "nothing"))
    return found


def ratio_error(finding: Finding, fault: Gross) -> float:
    """Return the error of a steering ratio over it, NaN for another fault.

    Parameters
    ----------
    finding : of the doctor.
    fault : that was planted.
    """
    planted = fault.case.fault
    if finding.code != "steering_ratio" or not isinstance(planted, SensorFault):
        return np.nan
    size = abs(planted.size)
    return finding.size / (size / DOCTOR_CHOSEN.degrees if size > 100.0 else size) - 1.0


def clean_car(job: tuple[str, int]) -> Clean:
    """Return what is said against a drive without a fault.

    Parameters
    ----------
    job : class of the car, and its seed.
    """
    return said_of_clean(*job, *drawn(*job))


def recordings(targets: Targets) -> None:
    """Record the alarms on recorded drives that are no sizes, where the drives are there.

    Parameters
    ----------
    targets : collects what is missed.
    """
    if not DATA.is_dir():
        print(f"  without recordings: they are not there: {DATA} (set TIREID_DATA)")
        return
    alarms = 0
    for name, (log, car) in recorded_runs().items():
        loud = [one for one in ti.diagnose(log, car).findings if one.matters and is_gross(one)]
        alarms += bool(loud)
        for one in loud:
            show(name, f"{one.text} ({one.confidence:.2f})")
    targets.at_most("recorded drives with a gross alarm", alarms, 0.0, "", "alarms/recorded")


def is_gross(finding: Finding) -> bool:
    """Return whether a finding is none of the sizes that `benchmarks.doctor` judges.

    Parameters
    ----------
    finding : of the doctor.
    """
    return finding.code == "yaw_inertia" or finding.code not in {one.code for one in SUSPECTS}


def report(outcomes: list[Outcome], targets: Targets) -> None:
    """Print, record and judge what was said of planted faults.

    Parameters
    ----------
    outcomes : of all cars and faults.
    targets : collects what is missed.
    """
    groups: Mapping[str, list[Outcome]] = defaultdict(list)
    for one in outcomes:
        groups[one.fault].append(one)
    for fault, some in groups.items():
        share = 100.0 * float(np.mean([one.named for one in some]))
        targets.record(f"named/{fault.replace(' ', '_')}", share, "%")
        show(f"{fault} named", f"{share:.0f} % of {len(some)}")
        for one in some:
            if not one.named:
                show(f"  not named: {one.kind}", one.said)
    share = 100.0 * float(np.mean([one.named for one in outcomes]))
    targets.at_least("gross faults named first or second", share, 95.0, "%", "named/all")
    errors = [100.0 * abs(one.error) for one in outcomes if np.isfinite(one.error)]
    if errors:
        targets.record("ratio/median", float(np.median(errors)), "%")
        high = float(np.percentile(errors, 95.0))
        targets.at_most("steering ratio: 95 % of errors within", high, 2.0, "%", "ratio/95")
    seconds = [one.seconds for one in outcomes]
    targets.record("seconds/median", float(np.median(seconds)), "s")
    show("seconds of one processor", f"{np.median(seconds):.2f}, at most {max(seconds):.2f}")


def main() -> int:
    """Run everything; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cars", type=int, default=CARS, help="of each class")
    parser.add_argument("--clean", type=int, default=CLEAN, help="drives of each class")
    parser.add_argument("--first", type=int, default=FIRST, help="seed of the first car")
    options, targets = parser.parse_args(), Targets("doctor_gross")
    first = options.first
    jobs = [(kind, first + k) for kind in CLASSES for k in range(options.cars)]
    clean = [(kind, first + 500 + k) for kind in CLASSES for k in range(options.clean)]
    with ProcessPoolExecutor(PROCESSES) as pool:
        outcomes = [one for some in pool.map(of_car, jobs) for one in some]
        said = list(pool.map(clean_car, clean))
    targets.record("faults", len(outcomes))
    report(outcomes, targets)
    judge_clean(said, targets)
    recordings(targets)
    whole = (options.cars, options.clean, first) == (CARS, CLEAN, FIRST) and DATA.is_dir()
    return targets.finish(keep=keep and whole)


if __name__ == "__main__":
    sys.exit(main())
