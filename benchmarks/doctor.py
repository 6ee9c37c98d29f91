"""Does the doctor find what is wrong with a log, size it well, and what is its repair worth?

    python -m benchmarks.doctor [--quick] [--record]

Faults of every kind of `doctor_cases` on minutes of everyday driving with one lane change or slalom
of cars of four classes, by `ti.diagnose`; half of the logs with gross faults have no a_y. A fault
is named where a finding of its code and channel is the first or the second. Drives without a fault,
and the recordings where they are there: any finding that matters is an alarm then, but that half a
drive has too few corners.

What a repair is worth: the repair of the diagnosis, as `--repair` applies it, which may be none;
the log is identified, frozen, and its force on the drive without the fault compared with the truth.
A log that is refused has no model, and an error without bound.
"""

import math
import sys
from collections import defaultdict
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.answers import blind, force_error
from benchmarks.doctor_cases import GROSS, KINDS, Right, planted
from benchmarks.everyday_drives import everyday_log
from benchmarks.random_cars import CLASSES
from benchmarks.recorded_cars import CARMAKER, DART, DATA
from benchmarks.targets import Table, Targets, Values, parse, show
from identifier.doctor import Finding
from models.recordings import Recording, check_against_vehicle, read_recording, runs
from models.vehicle import Vehicle

FIRST = 3000  # seed of the first car: no constant of the doctor was chosen on one from there on
SIZED, OTHER, CLEAN = 1, 2, 12  # cars of each class: with sizes, with gross faults, without a fault
NAMED = 2  # first or second
WORSE, SMALL = 1.2, 5.0  # times the error without the fault; % that is good whatever that was
QUIET = "straight"  # what a half of a drive may be called
RECORDED = {"carmaker": CARMAKER, "dart": DART, "dart_imu": DART}
SIZES = {  # by code, of "factor" with the channel: what it is, limit, and factor to its unit
    "delay": ("delay [ms]", 5.0, 1e3),
    "factor delta_f": ("scale of the steering angle [%]", 2.0, 100.0),
    "velocity_sensor_x": ("velocity sensor ahead of the c.g. [m]", 0.1, 1.0),
    "acceleration_sensor_x": ("accelerometer ahead of the c.g. [m]", 0.1, 1.0),
    "velocity_sensor_angle": ("velocity sensor turned [deg]", 0.1, 180.0 / math.pi),
}
FORCES = ("clean", "faulty", "repaired")
Job = tuple[str, int]  # class of the car, and its seed


class Outcome(NamedTuple):
    """What was said of a log with a planted fault.

    fault : its kind.   named : first or second.   error : of its size, over the size where it is a
    factor.   forces : errors of models of the log without the fault, with it, and repaired [%].
    """

    fault: str
    named: bool
    size: str
    error: float = math.nan
    forces: tuple[float, ...] = ()


def rank_of(findings: Iterable[Finding], right: Right) -> int:
    """Return at which place a planted fault is named, from 1 on; 0 where it is not.

    Parameters
    ----------
    findings : of the doctor.
    right : how the fault may be called: code and channel, "" for any.
    """
    for rank, one in enumerate(findings, start=1):
        channels = ("", *one.channel.split("+"))
        if any(one.code == code and channel in channels for code, channel in right):
            return rank
    return 0


def model_error(log: Recording, car: Vehicle, exact: Recording) -> float:
    """Return the error of the worse axle of the model of a log [% of the rms force].

    Parameters
    ----------
    log : that is identified.
    car : as it is declared.
    exact : the drive without noise or fault, with true forces.
    """
    try:
        check_against_vehicle(log, car)
        return max(force_error(ti.identify(blind(log), car, check=False).freeze(), exact))
    except (ArithmeticError, ValueError):
        return math.inf


def with_sizes(job: Job, names: Sequence[str] = tuple(KINDS)) -> list[Outcome]:
    """Return what is said of one car's drive with faults of a size, and what a repair is worth.

    Parameters
    ----------
    job : class of the car, and its seed.
    names : of the faults.
    """
    kind, seed = job
    log, car, exact = everyday_log(kind, seed)
    clean, found = model_error(log, car, exact), []
    for name in names:
        k = list(KINDS).index(name)
        fault = planted(name, car, np.random.default_rng([seed, k, 7, *kind.encode()]))
        bad, declared = fault.case.log(log), fault.case.car(car)
        said, error = ti.diagnose(bad, declared), math.nan
        rank = rank_of(said.findings[:NAMED], fault.right)
        if rank:
            share = fault.size if fault.code == "factor" else 1.0
            error = (said.findings[rank - 1].size - fault.size) / share
        faulty = repaired = model_error(bad, declared, exact)
        if said.repair:
            try:
                repaired = model_error(*said.repair.apply(bad, declared), exact)
            except ValueError:
                repaired = math.inf
        size = f"{fault.code} {fault.channel}" if fault.code == "factor" else fault.code
        found.append(Outcome(name, rank > 0, size, error, (clean, faulty, repaired)))
    return found


def gross(job: Job) -> list[Outcome]:
    """Return what is said of one car's drive with each gross fault.

    Parameters
    ----------
    job : class of the car, and its seed.
    """
    kind, seed = job
    log, car, _ = everyday_log(kind, seed)
    found = []
    for k, (name, draw) in enumerate(GROSS.items()):
        if "a_y" in name and log.a_y is None:
            continue
        fault = draw(car, np.random.default_rng([seed, k, 8, *kind.encode()]))
        listed = ti.diagnose(fault.case.log(log), fault.case.car(car)).findings
        found.append(Outcome(name, rank_of(listed[:NAMED], fault.right) > 0, ""))
    return found


def alarms(job: Job) -> list[bool]:
    """Return whether there is an alarm without a fault: on a drive, on its halves.

    Parameters
    ----------
    job : class of the car, and its seed.
    """
    log, car, _ = everyday_log(*job)
    half = len(log) // 2
    parts = [log, log.taken(slice(0, half)), log.taken(slice(half, len(log)))]
    return [
        any(one.matters and (part is log or one.code != QUIET)
            for one in ti.diagnose(part, car).findings)
        for part in parts
    ]  # fmt: skip


def recorded_alarm(file: str, run: str) -> bool:
    """Return whether the doctor finds something in a recording that matters.

    Parameters
    ----------
    file, run : of `RECORDED`.
    """
    log = blind(read_recording(DATA / f"{file}.csv.gz", run=run, check=False))
    return any(one.matters for one in ti.diagnose(log, RECORDED[file]).findings)


def percent(flags: Iterable[bool]) -> float:
    """Return the share that is true [%]."""
    return 100.0 * float(np.mean(list(flags)))


def judge_named(key: str, outcomes: list[Outcome], targets: Targets) -> None:
    """Judge how many faults are named, of each kind and of all.

    Parameters
    ----------
    key : sized or gross.
    outcomes : of all cars and faults.
    targets : collects what is missed.
    """
    groups = defaultdict(list)
    for one in outcomes:
        groups[one.fault].append(one.named)
    for fault, flags in groups.items():
        targets.record(f"{key}/named/{fault}", percent(flags))
        show(f"{key}, {fault}: named", f"{percent(flags):.0f} % of {len(flags)}")
    targets.record(f"{key}/faults", len(outcomes))
    share = percent(one.named for one in outcomes)
    targets.at_least(f"{key} faults named first or second", share, 95.0, key=f"{key}/named")


def judge_sizes(outcomes: list[Outcome], targets: Targets) -> None:
    """Judge the sizes of faults that were named, and what repairs are worth.

    Parameters
    ----------
    outcomes : of all cars and faults with sizes.
    targets : collects what is missed.
    """
    for code, (label, limit, times) in SIZES.items():
        errors = [times * abs(one.error) for one in outcomes if one.named and one.size == code]
        if errors:
            high = float(np.percentile(errors, 95.0))
            targets.at_most(f"{label}: 95 % of errors within", high, limit, "", f"size/{code}")
    forces = np.array([one.forces for one in outcomes])
    for name, middle in zip(FORCES, np.median(forces, axis=0).tolist(), strict=True):
        targets.record(f"force/{name}", middle)
        show(f"force error, {name}, median", f"{middle:.1f} %")
    clean, faulty, repaired = forces.T
    limit = np.maximum(WORSE * clean, SMALL)
    targets.record("as_good/faulty", percent(faulty <= limit))
    share = percent(repaired <= limit)
    targets.at_least("repaired logs as good as clean ones", share, 95.0, key="as_good/repaired")
    harmed = int(np.sum(repaired > np.maximum(faulty, limit)))
    targets.at_most("logs that a sure repair made worse", harmed, 0, "", "harmed")


def canary() -> Values:
    """Return what is said of one fault of one car, and what its repair is worth."""
    (found,) = with_sizes(("sedan", FIRST), ("velocity sensor",))
    return {
        "named": found.named,
        "error": found.error,
        **dict(zip(FORCES, found.forces, strict=True)),
    }


def tables(v: Values) -> dict[str, Table]:
    """Return the tables of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    rows = [
        [f"{v['sized/faults']} faults with a size: named", f"{v['sized/named']:.1f} %", "95 %"],
        [f"{v['gross/faults']} gross faults: named", f"{v['gross/named']:.1f} %", "95 %"],
        [f"{v['drives']} drives without a fault: alarms", f"{v['alarms']:.1f} %", "1 %"],
        ["halves of them: alarms", f"{v['alarms/halves']:.1f} %", "1 %"],
    ]
    if "recordings" in v:
        rows.append([f"{v['recordings']} recordings: alarms", f"{v['alarms/recordings']}", "0"])
    errors = {"as logged": "faulty", "repaired": "repaired", "without the fault": "clean"}
    rows += [[f"force error {what}, median", f"{v[f'force/{of}']:.1f} %", ""]
             for what, of in errors.items()]  # fmt: skip
    rows += [
        ["logs as good as without the fault: as logged", f"{v['as_good/faulty']:.0f} %", ""],
        ["the same, repaired", f"{v['as_good/repaired']:.0f} %", "95 %"],
        ["logs that a repair made worse", f"{v['harmed']}", "0"],
    ]
    sizes = [[label, f"{v[f'size/{code}']:.3g}", f"{limit:g}"]
             for code, (label, limit, _) in SIZES.items() if f"size/{code}" in v]  # fmt: skip
    weak = sorted(
        (float(v[f"{key}/named/{fault}"]), fault)
        for key, kinds in (("sized", KINDS), ("gross", GROSS))
        for fault in kinds
        if float(v[f"{key}/named/{fault}"]) < 100.0
    )
    return {
        "doctor": Table(("question", "answer", "target"), rows),
        "doctor/sizes": Table(("size of faults that are named", "95 % of errors within", "target"),
                              sizes),
        "doctor/weak": Table(("fault that is not always named", "named [%]"),
                             [[fault, f"{share:.0f}"] for share, fault in weak]),
    }  # fmt: skip


def main() -> int:
    """Run everything; return the exit code."""
    targets, options = Targets("doctor"), parse("doctor", __doc__)
    classes = list(CLASSES)[:1] if options.quick else list(CLASSES)
    sized, other, clean = (1, 1, 1) if options.quick else (SIZED, OTHER, CLEAN)
    jobs = [(kind, FIRST + 2 * (i + k)) for i, kind in enumerate(classes) for k in range(sized)]
    with ProcessPoolExecutor() as pool:
        found = [one for some in pool.map(with_sizes, jobs) for one in some]
        jobs = [(kind, FIRST + 1 + k) for kind in classes for k in range(other)]
        rough = [one for some in pool.map(gross, jobs) for one in some]
        jobs = [(kind, FIRST + 500 + k) for kind in classes for k in range(clean)]
        loud = list(pool.map(alarms, jobs))
        named = [(file, run) for file in RECORDED for run in recorded_runs(file)]
        recorded = (
            [] if options.quick else list(pool.map(recorded_alarm, *zip(*named, strict=True)))
        )
    judge_named("sized", found, targets)
    judge_named("gross", rough, targets)
    judge_sizes(found, targets)
    targets.record("drives", len(loud))
    targets.at_most("clean drives: alarms", percent(one[0] for one in loud), 1.0, key="alarms")
    halves = percent(flag for one in loud for flag in one[1:])
    targets.at_most("halves of clean drives: alarms", halves, 1.0, key="alarms/halves")
    if recorded:
        targets.record("recordings", len(recorded))
        targets.at_most("recordings: alarms", sum(recorded), 0, "", "alarms/recordings")
    return targets.finish(canary, keep=options.record and DATA.is_dir())


def recorded_runs(file: str) -> tuple[str, ...]:
    """Return the runs of a recording; none where it is not there."""
    path = DATA / f"{file}.csv.gz"
    return tuple(runs(path)) if path.is_file() else ()


if __name__ == "__main__":
    sys.exit(main())
