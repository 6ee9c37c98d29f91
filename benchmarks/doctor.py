"""Whether the doctor finds what is wrong with a log, sizes it well, and what its repair is worth.

    python -m benchmarks.doctor [--cars N] [--clean N] [--first SEED] [--record]

Faults of every kind of `doctor_cases`, in sizes that matter, on minutes of everyday driving with
one lane change or slalom of cars of four classes; the same drives without a fault; and the inertial
unit of a real 1:10 car, whose log is about 90 ms late against the cameras (where it is there).

What a repair is worth is measured as its user would, on every log, whatever was found in it: the
repair of the diagnosis is applied, as --repair does, which is what is sure and may be nothing; the
log is learnt on with the checks of `ti.identify`, frozen, and the force on the drive without the
fault is set beside the truth. A log that is refused has no model, and an error without bound.
Beside it, as at most can be had of the finding, the repair of the right one, sure or not.
"""

import argparse
import csv
import gzip
import math
import sys
from collections import defaultdict
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.answers import blind, force_error
from benchmarks.doctor_answers import (
    FIRST,
    NAMED,
    PROCESSES,
    RECORDED,
    Clean,
    judge_clean,
    rank_of,
    recorded_runs,
    said_of_clean,
)
from benchmarks.doctor_cases import KINDS, planted
from benchmarks.everyday_drives import KINDS as MANEUVERS
from benchmarks.everyday_drives import drawn_everyday
from benchmarks.random_cars import CLASSES
from benchmarks.recorded_cars import DATA
from benchmarks.targets import Targets, keeps, show
from codegen.arrays import Array
from identifier.doctor import Finding
from models.recordings import Recording, Repair, check_against_vehicle
from models.vehicle import Vehicle

CARS = 1  # of each class; every other of all drives a slalom, the rest a lane change
CLEAN = 12  # drives of each class without a fault
WORSE, SMALL = 1.2, 5.0  # times the error without the fault; % that is good whatever that was
LATE = (0.07, 0.12)  # s, of the inertial unit
SIZES = {  # by code, of "factor" with the channel: what it is, limit, and factor to its unit
    "delay": ("delay [ms]", 5.0, 1e3),
    "factor delta_f": ("scale of the steering angle [%]", 2.0, 100.0),
    "velocity_sensor_x": ("lever arm [m]", 0.1, 1.0),
    "acceleration_sensor_x": ("lever arm of the accelerometer [m]", 0.1, 1.0),
    "velocity_sensor_angle": ("misalignment [deg]", 0.1, 180.0 / np.pi),
}


class Outcome(NamedTuple):
    """What was said of a log with one planted fault.

    kind : class of the car.   fault : its kind.   code, channel : how it is called.   rank : of the
    right finding from 1 on, 0 where it was not named.   error : of its size, over the size where it
    is a factor.   sigmas : the same over its deviation.   force : errors of the frozen model.
    text : of the fault.
    """

    kind: str
    fault: str
    code: str
    channel: str
    rank: int
    error: float
    sigmas: float
    force: "Force"
    text: str

    @property
    def named(self) -> bool:
        """Whether it was named first or second."""
        return 0 < self.rank <= NAMED


class Force(NamedTuple):
    """Errors of frozen models [% of the rms force]; inf where there is none.

    clean : of the log without the fault.   faulty : with it.   repaired : with what is sure taken
    out.   right : with the right finding's repair, where it was named and has one.
    """

    clean: float
    faulty: float
    repaired: float
    right: float


def learnt_error(log: Recording, told: Vehicle, exact: Recording) -> float:
    """Return the error of the worse axle of what a log teaches [% of the rms force].

    Parameters
    ----------
    log : that is learnt from.
    told : the car.
    exact : the drive without noise or fault, with true forces.
    """
    try:
        check_against_vehicle(log, told)
        model = ti.identify(blind(log), told, check=False).freeze()  # the doctor was asked
        return max(force_error(model, exact))
    except (ArithmeticError, ValueError):
        return math.inf


def repaired_error(repair: Repair, log: Recording, told: Vehicle, exact: Recording) -> float:
    """Return the same of a log that is repaired first.

    Parameters
    ----------
    repair : of the log and the car.
    log : that is learnt from.
    told : the car.
    exact : the drive without noise or fault, with true forces.
    """
    try:
        mended, car = repair.apply(log, told)
    except ValueError:
        return math.inf
    return learnt_error(mended, car, exact)


def drawn(kind: str, seed: int) -> tuple[Recording, Vehicle, Recording]:
    """Return the log of a seed, the car as it is told, and the drive without noise.

    Parameters
    ----------
    kind : class of the car.
    seed : of car, drive and noise.
    """
    drive = drawn_everyday(kind, MANEUVERS[seed % len(MANEUVERS)], seed)
    return blind(drive.log(np.random.default_rng([seed, 1]))), drive.car.told, drive.exact


def of_car(job: tuple[str, int]) -> list[Outcome]:
    """Return what is said of one car's drive with each kind of fault.

    Parameters
    ----------
    job : class of the car, and its seed.
    """
    kind, seed = job
    log, told, exact = drawn(kind, seed)
    clean = learnt_error(log, told, exact)
    found = []
    for k, name in enumerate(KINDS):
        fault = planted(name, told, np.random.default_rng([seed, k, 7, *kind.encode()]))
        bad, car = fault.case.log(log), fault.case.car(told)
        said = ti.diagnose(bad, car)
        rank, error, sigmas = rank_of(said.findings, fault.right), math.nan, math.nan
        faulty = learnt_error(bad, car, exact)
        repaired = repaired_error(said.repair, bad, car, exact) if said.repair else faulty
        right = faulty
        if rank:
            one = said.findings[rank - 1]
            share = fault.size if fault.code == "factor" else 1.0
            error = (one.size - fault.size) / share
            sigmas = (one.size - fault.size) / one.deviation
            if one.repair == said.repair:
                right = repaired
            elif one.repair is not None:
                right = repaired_error(one.repair, bad, car, exact)
        force = Force(clean, faulty, repaired, right)
        words = str(fault.case)
        found.append(
            Outcome(kind, name, fault.code, fault.channel, rank, error, sigmas, force, words)
        )
    return found


def clean_car(job: tuple[str, int]) -> Clean:
    """Return what is said against a drive without a fault.

    Parameters
    ----------
    job : class of the car, and its seed.
    """
    log, told, _ = drawn(*job)
    return said_of_clean(*job, log, told)


def of_recordings() -> dict[str, tuple[Finding, ...]]:
    """Return what is said of the recordings, by name; with the inertial unit's channels too."""
    found = {}
    for name, (log, car) in recorded_runs().items():
        found[name] = ti.diagnose(log, car).findings
        file, run = name.split("/")
        if file == "dart_imu":
            found[f"imu/{run}"] = ti.diagnose(with_inertial_unit(log, run), car).findings
    return found


def with_inertial_unit(recording: Recording, run: str) -> Recording:
    """Return the recording with r and a_y of the car's own inertial unit.

    Parameters
    ----------
    recording : of the cameras.
    run : its name in the file.
    """
    with gzip.open(DATA / "dart_imu.csv.gz", "rt", encoding="utf-8") as text:
        rows = [row for row in csv.DictReader(text) if row["run"] == run]
    t = np.array([float(row["t"]) for row in rows])

    def channel(name: str) -> Array:
        values = np.array([float(row[name]) for row in rows])
        return np.asarray(np.interp(recording.t, t, values), dtype=np.float64)

    return replace(recording, r=channel("r_imu"), a_y=channel("ay_imu"))


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
        by_class = [
            f"{kind} {100 * np.mean([one.named for one in some if one.kind == kind]):.0f}"
            for kind in CLASSES
        ]
        key = fault.replace(" ", "_")
        targets.record(f"named/{key}", 100.0 * float(np.mean([one.named for one in some])), "%")
        errors = np.abs([one.error for one in some if one.named])
        told = "never named"
        if errors.size:
            middle, largest = float(np.median(errors)), float(errors.max())
            targets.record(f"error/{key}/median", middle)
            targets.record(f"error/{key}/largest", largest)
            told = f"error {middle:.4f}, at most {largest:.4f}"
        show(f"{fault} named [%]", f"{', '.join(by_class)}; {told}")
    share = 100.0 * float(np.mean([one.named for one in outcomes]))
    targets.at_least("planted faults named first or second", share, 95.0, "%", "named/all")
    _sizes([one for one in outcomes if one.named], targets)
    _repairs(outcomes, targets)


def _sizes(named: list[Outcome], targets: Targets) -> None:
    """Judge the sizes of faults that were named first or second."""
    for code, (label, limit, times) in SIZES.items():
        errors = [
            times * abs(one.error)
            for one in named
            if code in (one.code, f"{one.code} {one.channel}")
        ]
        if errors:
            high = float(np.percentile(errors, 95.0))
            key = "size/" + code.replace(" ", "_")
            targets.at_most(f"{label}: 95 % of errors within", high, limit, "", key)
    sigmas = [abs(one.sigmas) for one in named if one.code == "offset"]
    within = 100.0 * float(np.mean(np.array(sigmas) <= 2.0))
    targets.at_least("offsets within their 2 sigma", within, 95.0, "%", "size/offset")


def _repairs(outcomes: list[Outcome], targets: Targets) -> None:
    """Judge the errors of what is learnt, over all logs."""

    def good(error: float, clean: float) -> bool:
        return error <= max(WORSE * clean, SMALL)

    forces = [one.force for one in outcomes]
    fine = [good(force.repaired, force.clean) for force in forces]
    for one, is_fine in zip(outcomes, fine, strict=True):
        if not is_fine:
            show(f"repaired, and worse: {one.kind}", f"{one.text}: {one.force}")
    for name in Force._fields:
        middle = float(np.median([getattr(force, name) for force in forces]))
        targets.record(f"force/{name}", middle, "%")
        show(f"force error, {name}, in the median", f"{middle:.1f} %")
    harmed = [force.repaired > max(force.faulty, WORSE * force.clean, SMALL) for force in forces]
    for key, some in (
        ("as_good_unrepaired", [good(force.faulty, force.clean) for force in forces]),
        ("as_good_by_right", [good(force.right, force.clean) for force in forces]),
    ):
        targets.record(f"force/{key}", 100.0 * float(np.mean(some)), "%")
        show(f"logs, {key.replace('_', ' ')}", f"{100.0 * float(np.mean(some)):.1f} %")
    targets.at_most("logs that a sure repair made worse", float(sum(harmed)), 0, "", "force/harmed")
    share = 100.0 * float(np.mean(fine))
    targets.at_least("repaired logs as good as clean ones", share, 95.0, "%", "force/as_good")


def _recordings(targets: Targets) -> None:
    if not DATA.is_dir():
        print(f"  without recordings: they are not there: {DATA} (set TIREID_DATA)")
        return
    found = of_recordings()
    for name, listed in found.items():
        said = ", ".join(f"{one.code} {one.channel} {one.size:.3g}" for one in listed)
        show(name, said or "nothing")
    loud = {name: any(one.matters for one in listed) for name, listed in found.items()}
    for file in RECORDED:
        of_file = [is_loud for name, is_loud in loud.items() if name.split("/")[0] == file]
        targets.record(f"recordings/{file}", len(of_file))
        targets.record(f"alarms/recordings/{file}", sum(of_file))
    as_logged = [is_loud for name, is_loud in loud.items() if not name.startswith("imu/")]
    targets.record("recordings", len(as_logged))
    targets.at_most(
        "recordings as they are with an alarm", sum(as_logged), 0, "", "alarms/recordings"
    )
    _inertial_unit({name: x for name, x in found.items() if name.startswith("imu/")}, targets)


def _inertial_unit(found: dict[str, tuple[Finding, ...]], targets: Targets) -> None:
    """Judge whether the inertial unit is found to be late, and record what is blamed else."""
    right, early = 0, 0
    for name, listed in found.items():
        late = {one.channel: one.size for one in listed if one.code == "delay"}
        own = [size for channel, size in late.items() if "r" in channel.split("+")]
        targets.record(f"late/{name}", 1e3 * own[0] if own else "not found", "ms")
        first = f"{listed[0].code} {listed[0].channel}".strip() if listed else "nothing"
        targets.record(f"first/{name}", first)
        is_right = bool(own) and LATE[0] <= own[0] <= LATE[1]
        right += is_right
        early += not is_right and late.get("v_y", 0.0) < 0.0
    targets.record("late/runs_with_v_y_early", early)
    targets.at_least("runs in which the inertial unit is late", right, len(found), "", "late/runs")


def main() -> int:
    """Run everything; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cars", type=int, default=CARS, help="of each class")
    parser.add_argument("--clean", type=int, default=CLEAN, help="drives of each class")
    parser.add_argument("--first", type=int, default=FIRST, help="seed of the first car")
    parser.add_argument("--no-recordings", action="store_true", help="drives of the plant only")
    options, targets = parser.parse_args(), Targets("doctor")
    first = options.first
    jobs = [(kind, first + i + k) for i, kind in enumerate(CLASSES) for k in range(options.cars)]
    clean = [(kind, first + 500 + k) for kind in CLASSES for k in range(options.clean)]
    with ProcessPoolExecutor(PROCESSES) as pool:
        outcomes = []
        for job, some in zip(jobs, pool.map(of_car, jobs), strict=True):
            missed = [one.text for one in some if not one.named]
            said = f"{len(some) - len(missed)} of {len(some)} named" + "; not: " * bool(missed)
            print(f"  {job[0]} {job[1]}: {said}{'; '.join(missed)}", flush=True)
            outcomes += some
        said_of = list(pool.map(clean_car, clean))
    targets.record("drives", len(jobs))
    targets.record("faults", len(outcomes))
    report(outcomes, targets)
    judge_clean(said_of, targets)
    if not options.no_recordings:
        _recordings(targets)
    whole = (
        not options.no_recordings
        and (options.cars, options.clean, first) == (CARS, CLEAN, FIRST)
        and DATA.is_dir()
    )
    return targets.finish(keep=keep and whole)


if __name__ == "__main__":
    sys.exit(main())
