"""Whether the doctor finds what is wrong with a log, sizes it well, and what its repair is worth.

    python -m benchmarks.doctor [--cars N] [--record]

Faults of every kind of `doctor_cases`, in sizes that matter, on minutes of everyday driving with
one lane change or slalom of cars of four classes; the same drives without a fault; and the inertial
unit of a real 1:10 car, whose log is about 90 ms late against the cameras (where it is there). What
the verdict on a repaired log is worth is measured as its user would: learnt on it, frozen, the
force on the drive without the fault beside the truth.
"""

import argparse
import csv
import gzip
import sys
from collections import defaultdict
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.answers import blind, force_error
from benchmarks.doctor_cases import KINDS, Planted, planted
from benchmarks.everyday_drives import KINDS as MANEUVERS
from benchmarks.everyday_drives import drawn_everyday
from benchmarks.random_cars import CLASSES, FIRST_SEED
from benchmarks.recorded_cars import CARMAKER, DART, DATA
from benchmarks.targets import Targets, keeps, show
from codegen.arrays import Array
from identifier.doctor import Finding
from models.recordings import Recording, read_recording, runs
from models.vehicle import Vehicle

CARS = 3  # of each class; on half of their drives a lane change, on half a slalom
CLEAN = 25  # drives of each class without a fault
NAMED = 2  # first or second
SURE = 0.5  # confidence from which a finding on a clean log is an alarm
WORSE, SMALL = 1.2, 5.0  # times the error without the fault; % that is good whatever that was
LATE = (0.07, 0.12)  # s, of the inertial unit
PROCESSES = 2
SIZES = {  # by code and channel, "" for all: what it is, limit, and factor to its unit
    "delay": ("delay [ms]", 5.0, 1e3),
    "factor delta_f": ("steering ratio [%]", 2.0, 100.0),
    "velocity_sensor_x": ("lever arm [m]", 0.1, 1.0),
    "acceleration_sensor_x": ("lever arm of the accelerometer [m]", 0.1, 1.0),
    "velocity_sensor_angle": ("misalignment [deg]", 0.1, 180.0 / np.pi),
}


class Outcome(NamedTuple):
    """What was said of a log with one planted fault.

    kind : class of the car.   fault : kind of the fault.   rank : of the right finding from 1 on, 0
    where it was not named.   error : of its size, over the size where it is a factor.   sigmas :
    the same over its deviation.   force : error of the frozen model, of the log without the fault,
    with it, and repaired [%]; None where it was not asked.   text : of the fault.
    """

    kind: str
    fault: str
    rank: int
    error: float
    sigmas: float
    force: tuple[float, float, float] | None
    text: str


def is_right(finding: Finding, fault: Planted) -> bool:
    """Return whether a finding is of the planted fault.

    Parameters
    ----------
    finding : of the doctor.
    fault : that was planted.
    """
    return finding.code == fault.code and fault.channel in finding.channel.split("+")


def learnt_error(log: Recording, told: Vehicle, exact: Recording) -> float:
    """Return the error of the worse axle of what a log teaches [% of the rms force].

    Parameters
    ----------
    log : that is learnt from.
    told : the car.
    exact : the drive without noise or fault, with true forces.
    """
    try:
        model = ti.identify(blind(log), told, check=False).freeze()
        return max(force_error(model, exact))
    except (ArithmeticError, ValueError):
        return np.inf


def of_car(job: tuple[str, int]) -> list[Outcome]:
    """Return what is said of one car's drive with each kind of fault.

    Parameters
    ----------
    job : class of the car, and its number.
    """
    kind, number = job
    seed = FIRST_SEED + number
    drive = drawn_everyday(kind, MANEUVERS[number % len(MANEUVERS)], seed)
    log, told = drive.log(np.random.default_rng([seed, 1])), drive.car.told
    clean = learnt_error(log, told, drive.exact)
    found = []
    for k, name in enumerate(KINDS):
        fault = planted(name, told, np.random.default_rng([seed, k, 7]))
        bad, car = blind(fault.case.log(log)), fault.case.car(told)
        listed = ti.diagnose(bad, car).findings
        ranks = [i for i, one in enumerate(listed, start=1) if is_right(one, fault)]
        rank, error, sigmas, force = ranks[0] if ranks else 0, np.nan, np.nan, None
        if rank:
            one = listed[rank - 1]
            share = fault.size if fault.code == "factor" else 1.0
            error = (one.size - fault.size) / share
            sigmas = (one.size - fault.size) / one.deviation
            if one.repair is not None:
                repaired, mended = one.repair.apply(bad, car)
                asked = learnt_error(repaired, mended, drive.exact)
                force = (clean, learnt_error(bad, car, drive.exact), asked)
        found.append(Outcome(kind, name, rank, error, sigmas, force, str(fault.case)))
    return found


def clean_car(job: tuple[str, int]) -> tuple[str, ...]:
    """Return the alarms on a drive without a fault.

    Parameters
    ----------
    job : class of the car, and its number.
    """
    kind, number = job
    seed = FIRST_SEED + 500 + number
    drive = drawn_everyday(kind, MANEUVERS[number % len(MANEUVERS)], seed)
    log = blind(drive.log(np.random.default_rng([seed, 1])))
    return tuple(
        one.text for one in ti.diagnose(log, drive.car.told).findings if one.confidence >= SURE
    )


def of_recordings() -> dict[str, tuple[Finding, ...]]:
    """Return what is said of the recordings, by name; with the inertial unit's channels too."""
    found = {}
    for file, car in (("carmaker", CARMAKER), ("dart", DART), ("dart_imu", DART)):
        path = DATA / f"{file}.csv.gz"
        for run in runs(path):
            recording = read_recording(path, run=run, check=False)
            found[f"{file}/{run}"] = ti.diagnose(blind(recording), car).findings
            if file == "dart_imu":
                unit = with_inertial_unit(recording, run)
                found[f"imu/{run}"] = ti.diagnose(blind(unit), car).findings
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
        named = [0 < one.rank <= NAMED for one in some]
        by_class = [
            f"{kind} {100 * np.mean([0 < o.rank <= NAMED for o in some if o.kind == kind]):.0f}"
            for kind in CLASSES
        ]
        errors = np.abs([one.error for one in some if one.rank])
        middle = float(np.median(errors)) if errors.size else np.nan
        largest = float(errors.max()) if errors.size else np.nan
        targets.record(f"named/{fault}", 100.0 * float(np.mean(named)), "%")
        if errors.size:
            targets.record(f"error/{fault}/median", middle)
            targets.record(f"error/{fault}/largest", largest)
        show(
            f"{fault} named [%]",
            f"{', '.join(by_class)}; error {middle:.4f}, at most {largest:.4f}",
        )
    share = 100.0 * float(np.mean([0 < one.rank <= NAMED for one in outcomes]))
    targets.at_least("planted faults named first or second", share, 95.0, "%", "named/all")
    _sizes(outcomes, targets)
    _repairs(outcomes, targets)


def _sizes(outcomes: list[Outcome], targets: Targets) -> None:
    codes = {name: planted_code(name) for name in KINDS}
    for code, (label, limit, times) in SIZES.items():
        errors = [
            times * abs(one.error) for one in outcomes if one.rank and codes[one.fault] == code
        ]
        if code == "delay":
            errors = [
                times * abs(one.error)
                for one in outcomes
                if one.rank and one.fault.startswith("delay")
            ]
        if errors:
            high = float(np.percentile(errors, 95.0))
            key = "size/" + code.replace(" ", "_")
            targets.at_most(f"{label}: 95 % of errors within", high, limit, "", key)
    sigmas = [abs(one.sigmas) for one in outcomes if one.rank and one.fault.startswith("offset")]
    within = 100.0 * float(np.mean(np.array(sigmas) <= 2.0))
    targets.at_least("offsets within their 2 sigma", within, 95.0, "%", "size/offset")


def planted_code(fault: str) -> str:
    """Return code and channel of a kind of fault, the channel only where it is steering's factor.

    Parameters
    ----------
    fault : one of `KINDS`.
    """
    codes = {"velocity sensor": "velocity_sensor_x", "accelerometer": "acceleration_sensor_x"}
    return {"misaligned": "velocity_sensor_angle", **codes}.get(fault, fault)


def _repairs(outcomes: list[Outcome], targets: Targets) -> None:
    asked = [(one, one.force) for one in outcomes if one.force is not None]
    good = [force[2] <= max(WORSE * force[0], SMALL) for _, force in asked]
    for (one, force), fine in zip(asked, good, strict=True):
        if not fine:
            show(f"repaired, and worse: {one.kind}", f"{one.text}: {force}")
    clean, bad, mended = np.median([force for _, force in asked], axis=0).tolist()
    for key, value in (("clean", clean), ("faulty", bad), ("repaired", mended)):
        targets.record(f"force/{key}", value, "%")
    show("force error clean, faulty, repaired [%]", f"{clean:.1f}, {bad:.1f}, {mended:.1f}")
    share = 100.0 * float(np.mean(good))
    targets.at_least("repaired logs as good as clean ones", share, 95.0, "%", "force/as_good")


def _recordings(targets: Targets) -> None:
    if not DATA.is_dir():
        print(f"  without recordings: they are not there: {DATA} (set TIREID_DATA)")
        return
    found = of_recordings()
    imu = {name: listed for name, listed in found.items() if name.startswith("imu/")}
    for name, listed in found.items():
        said = ", ".join(f"{one.code} {one.channel} {one.size:.3g}" for one in listed)
        show(name, said or "nothing")
    as_logged = {name: listed for name, listed in found.items() if name not in imu}
    loud = sum(any(one.confidence >= SURE for one in listed) for listed in as_logged.values())
    targets.record("recordings", len(as_logged))
    targets.at_most("recordings as they are with an alarm", loud, 0, "", "alarms/recordings")
    late = {
        name: [one.size for one in listed if one.code == "delay" and "r" in one.channel.split("+")]
        for name, listed in imu.items()
    }
    for name, sizes in late.items():
        targets.record(f"late/{name}", 1e3 * sizes[0] if sizes else "not found", "ms")
    right = sum(bool(sizes) and LATE[0] <= sizes[0] <= LATE[1] for sizes in late.values())
    targets.at_least("runs in which the inertial unit is late", right, len(late), "", "late/runs")


def main() -> int:
    """Run everything; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cars", type=int, default=CARS, help="of each class")
    parser.add_argument("--clean", type=int, default=CLEAN, help="drives of each class")
    parser.add_argument("--no-recordings", action="store_true", help="drives of the plant only")
    options, targets = parser.parse_args(), Targets("doctor")
    jobs = [(kind, number) for kind in CLASSES for number in range(options.cars)]
    clean = [(kind, number) for kind in CLASSES for number in range(options.clean)]
    with ProcessPoolExecutor(PROCESSES) as pool:
        outcomes = []
        for job, some in zip(jobs, pool.map(of_car, jobs), strict=True):
            missed = [one.text for one in some if not 0 < one.rank <= NAMED]
            said = f"{len(some) - len(missed)} of {len(some)} named" + "; not: " * bool(missed)
            print(f"  {job[0]} {job[1]}: {said}{'; '.join(missed)}", flush=True)
            outcomes += some
        alarms = list(pool.map(clean_car, clean))
    targets.record("drives", len(jobs))
    targets.record("faults", len(outcomes))
    targets.record("clean_drives", len(clean))
    report(outcomes, targets)
    for (kind, _), texts in zip(clean, alarms, strict=True):
        for text in texts:
            show(f"false alarm: {kind}", text)
    share = 100.0 * float(np.mean([bool(texts) for texts in alarms]))
    targets.at_most("clean drives with an alarm", share, 1.0, "%", "alarms")
    if not options.no_recordings:
        _recordings(targets)
    whole = (
        not options.no_recordings
        and options.cars == CARS
        and options.clean == CLEAN
        and DATA.is_dir()
    )
    return targets.finish(keep=keep and whole)


if __name__ == "__main__":
    sys.exit(main())
