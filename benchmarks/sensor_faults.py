"""A sensor fails for up to 4 s while the default method learns: are the forces right afterwards?

    python -m benchmarks.sensor_faults [--quick] [--record]

Random faults of every kind, in one channel at a time, on noisy drives of random cars of four
classes, those of `random_cars`; sizes are those of a sedan, for others by Froude's similarity.
Forces are right where over 5 s, from 3 s after the sensor is good again, they differ from those
told without the fault by at most 5 % of the rms force. The same faults are told to a method that
never doubts: those that it does not get over are harmful, and of these the time is told until the
first sample is not believed or counts half; a drift is small at first and is told apart. No number
of the method was chosen on these drives.
"""

import math
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from benchmarks.answers import blind
from benchmarks.fault_cases import Scale
from benchmarks.random_cars import CLASSES, FIRST_SEED, LEAD, drawn
from benchmarks.targets import Table, Targets, Values, parse, show
from codegen.arrays import Array
from identifier.axle import AxleIdentifier
from identifier.axle.gate import GateState
from identifier.methods import LIVE, make_method
from identifier.refused import SampleLimits
from identifier.run import History, identify
from models.faults import KINDS, SIZED, SensorFault
from models.recordings import Recording
from models.vehicle import Vehicle

FAULTS, DRIVES = 700, 12  # all; drives of each class
SIZES = {"v_x": (1.0, 15.0), "v_y": (0.2, 4.0), "r": (0.03, 0.6), "delta_f": (0.01, 0.15)}  # SI
FACTORS = (0.2, 3.0)  # of a channel that is scaled
LASTS, BEGINS = (0.2, 4.0), (LEAD + 8.0, LEAD + 18.0)  # s
AFTER, LOOK, RIGHT = 3.0, 5.0, 5.0  # s, s, % of the rms force
ON, BAD = (GateState._fields.index(name) for name in ("on", "bad"))
SOON, NEVER = 0.5, 1e9  # s; a time in which no mean of errors moves
HALF = 2.0**0.5  # fast mean of errors over its trend, where a sample counts half
NOBODY = 1e4  # m/s: the largest speed that a recording holds, of no car


class Drive(NamedTuple):
    """A car as it is told, its noisy recording without a_y, as the exported step has none, and the
    forces (n, 2) [N] that are told where nothing fails.
    """

    car: Vehicle
    recording: Recording
    forces: Array


class Result(NamedTuple):
    """A fault; error [% of the rms force] after it and without doubt; time to notice it [s]."""

    fault: SensorFault
    error: float
    trusting: float
    noticed: float


def random_fault(car: Vehicle, rng: np.random.Generator) -> SensorFault:
    """Return a fault of any kind in any channel.

    Parameters
    ----------
    car : to whose size it scales.
    rng : source of randomness.
    """
    channel, kind = str(rng.choice(list(SIZES))), str(rng.choice(KINDS))
    by = Scale.of(car)
    unit = {"v_x": by.speed, "v_y": by.speed, "r": 1.0 / by.time, "delta_f": 1.0}[channel]
    least, most = FACTORS if kind == "scaled" else SIZES[channel]
    size = math.exp(rng.uniform(math.log(least), math.log(most)))
    if kind not in ("scaled", "noisy"):
        size *= rng.choice([-1.0, 1.0])
    return SensorFault(
        channel=channel,
        kind=kind,
        start=float(rng.uniform(*BEGINS)),
        duration=float(math.exp(rng.uniform(*np.log(LASTS)))),
        size=(size if kind == "scaled" else size * unit) if kind in SIZED else 0.0,
        seed=int(rng.integers(1 << 30)),
    )


def shown(recording: Recording, fault: SensorFault, car: Vehicle) -> Recording:
    """Return what the method is shown: samples that are refused read the speed of no car.

    Parameters
    ----------
    recording : what good sensors see.
    fault : what fails.
    car : whose limits refuse samples.
    """
    if fault.kind == "lost":
        return _refused(recording, fault.active(recording.t))
    seen = fault.apply(recording)
    accept = np.vectorize(SampleLimits.of(car).accept, otypes=[bool])
    return _refused(seen, ~accept(seen.v_x, seen.v_y, seen.r, seen.delta_f, seen.delta_r))


def _refused(recording: Recording, where: Any) -> Recording:
    """The recording with samples in whose place a car stands that nobody has seen."""
    nothing = {
        name: np.where(where, 0.0, getattr(recording, name))
        for name in ("v_y", "r", "delta_f", "delta_r")
    }
    signals: dict[str, Any] = {"v_x": np.where(where, NOBODY, recording.v_x), **nothing}
    return replace(recording, **signals)


def doubted(history: History) -> Any:
    """Return where samples of an axle count half or less (n,)."""
    errors = history.state["errors"].reshape(len(history.recording) + 1, 2, -1)[1:]
    return (errors[:, :, 0] > HALF * errors[:, :, 1]).any(axis=1)


def noticed_after(history: History, fault: SensorFault) -> float:
    """Return how long after its start a fault was noticed [s]: a sample is not believed, or half.

    Parameters
    ----------
    history : of the broken drive.
    fault : what failed.
    """
    recording = history.recording
    gate = history.state["gate"].reshape(len(recording) + 1, -1)[1:]
    doubt = doubted(history) | (gate[:, BAD] > 0.0) | (gate[:, ON] == 0.0)
    when = recording.t[doubt & fault.active(recording.t)]
    return float(when[0] - fault.start) if when.size else math.inf


def after_fault(drive: Drive, fault: SensorFault, forces: Array) -> float:
    """Return by how much forces still differ [% of the rms force], the worse axle.

    Parameters
    ----------
    drive : the drive.
    fault : what failed.
    forces : that were told (n, 2) [N].
    """
    t, end = drive.recording.t, fault.start + fault.duration + AFTER
    window = (t >= end) & (t < end + LOOK)
    off = forces[window] - drive.forces[window]
    size = np.sqrt(np.mean(drive.forces**2, axis=0))
    return float(100.0 * (np.sqrt(np.mean(off**2, axis=0)) / size).max())


def drive_of(kind: str, number: int) -> tuple[Drive, float]:
    """Return a drive, and the share of time in doubt although nothing fails.

    Parameters
    ----------
    kind : class of the car.
    number : of the drive.
    """
    drawn_drive = drawn(kind, FIRST_SEED + number)
    rng = np.random.default_rng([20, number, *kind.encode()])
    car, recording = drawn_drive.car.declared, replace(blind(drawn_drive.log(rng)), a_y=None)
    history = identify(recording, car, _design(car))
    return Drive(car, recording, history.axle_force), float(doubted(history).mean())


def of_class(job: tuple[str, int]) -> tuple[list[Result], float]:
    """Return the results for a class of cars, and the share of time in doubt.

    Parameters
    ----------
    job : the class, and the number of faults.
    """
    kind, count = job
    made = [drive_of(kind, number) for number in range(min(DRIVES, count))]
    drives = [drive for drive, _ in made]
    results = [
        _result(drives[k % len(drives)], np.random.default_rng([21, k, *kind.encode()]))
        for k in range(count)
    ]
    return results, float(np.mean([alarm for _, alarm in made]))


def run(count: int) -> tuple[dict[str, list[Result]], float]:
    """Return the results by class of cars, and the share of time in doubt.

    Parameters
    ----------
    count : number of faults, as many on each.
    """
    jobs = [(kind, count // len(CLASSES)) for kind in CLASSES]
    with ProcessPoolExecutor() as pool:
        found = dict(zip(CLASSES, pool.map(of_class, jobs), strict=True))
    alarm = float(np.mean([alarm for _, alarm in found.values()]))
    return {kind: results for kind, (results, _) in found.items()}, alarm


def _design(car: Vehicle) -> AxleIdentifier:
    design = make_method(LIVE, car)
    assert isinstance(design, AxleIdentifier)
    return design


def _result(drive: Drive, rng: np.random.Generator) -> Result:
    """Return what becomes of a random fault on a drive."""
    fault, design = random_fault(drive.car, rng), _design(drive.car)
    seen = shown(drive.recording, fault, drive.car)
    never = replace(design, change=replace(design.change, fast=NEVER))
    doubting, trusting = (identify(seen, drive.car, one) for one in (design, never))
    return Result(
        fault,
        after_fault(drive, fault, doubting.axle_force),
        after_fault(drive, fault, trusting.axle_force),
        noticed_after(doubting, fault),
    )


def report(results: dict[str, list[Result]], alarm: float, targets: Targets) -> None:
    """Print shares of faults after which forces are right, and judge them.

    Parameters
    ----------
    results : by class of cars.
    alarm : share of time in doubt where nothing fails.
    targets : collects what is missed.
    """
    everything = [one for some in results.values() for one in some]
    groups = dict(results)
    groups |= {kind: [one for one in everything if one.fault.kind == kind] for kind in KINDS}
    for name, some in groups.items():
        if some:
            right, trusting = shares(some)
            targets.record(f"{name}/faults", len(some))
            targets.record(f"{name}/right", right)
            targets.record(f"{name}/unwatched", trusting)
            show(name, f"{len(some)} faults, right {right:.1f} %, without doubt {trusting:.1f} %")
    right, trusting = shares(everything)
    targets.record("faults", len(everything))
    targets.at_least("forces right 3 s after the fault", right, 99.0, key="right")
    targets.record("unwatched", trusting)
    harmful = [one for one in everything if one.trusting > RIGHT and one.fault.kind != "drifting"]
    if harmful:
        soon = 100.0 * float(np.mean([one.noticed <= SOON for one in harmful]))
        label = f"harmful faults that do not grow, noticed within {SOON:g} s"
        targets.at_least(label, soon, 90.0, key="soon")
    targets.at_most("time in doubt although nothing fails", 100.0 * alarm, 1.0, key="doubt")


def shares(some: Sequence[Result]) -> tuple[float, float]:
    """Return the share of faults after which forces are right [%], and without doubt."""
    columns = [one.error for one in some], [one.trusting for one in some]
    right, trusting = (100.0 * float(np.mean(np.array(one) <= RIGHT)) for one in columns)
    return right, trusting


def canary() -> Values:
    """Return errors after one fault [%], and the time to notice it [s]."""
    found = _result(drive_of("sedan", 0)[0], np.random.default_rng([21, 9, *b"sedan"]))
    return {"error": found.error, "trusting": found.trusting, "noticed": found.noticed}


def tables(v: Values) -> dict[str, Table]:
    """Return the table of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    rows = [
        [name, f"{v[f'{name}/faults']}", f"{v[f'{name}/right']:.0f}",
         f"{v[f'{name}/unwatched']:.0f}"]
        for name in KINDS if f"{name}/faults" in v
    ]  # fmt: skip
    rows.append(["all", f"{v['faults']}", f"{v['right']:.1f}", f"{v['unwatched']:.1f}"])
    header = ("sensor fault", "faults", "forces right 3 s later [%]", "without detection [%]")
    return {"sensor_faults": Table(header, rows)}


def main() -> int:
    """Run everything; return the exit code."""
    targets, options = Targets("sensor_faults"), parse("sensor_faults", __doc__)
    results, alarm = run(8 if options.quick else FAULTS)
    report(results, alarm, targets)
    return targets.finish(canary, keep=options.record)


if __name__ == "__main__":
    sys.exit(main())
