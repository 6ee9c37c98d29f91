"""Does a car without a sensor of lateral velocity drive as one that has it?

    python -m benchmarks.mpc_without_v_y OUT [SEEDS] [--record]

What `tireid drive --sensors imu` does beside `--sensors full`, both with the defaults of the
command: ISO 3888-2 and the handling course at 90 % of the grip on friction 1.0 and 0.5, on tires
that go on learning, ten seeds of noise, bias and learning drive; each kind of sensors learns its
own tires first, on the same field. Then the friction that halves on the way, in
the slalom of 36 m and the lane change of `mpc_friction_drop`, learning. Truth only scores.
Prints a table, writes OUT/mpc_without_v_y.json.
"""

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks import mpc_friction_drop as drops
from benchmarks.mpc_cases import options_of
from benchmarks.targets import Targets, keeps
from identifier.compare.work import spread
from identifier.tire_model import TireModel
from mpc.handover.learner import Learner
from mpc.handover.rules import Verdict
from mpc.loop.record import EstimateScores, estimate_scores
from tireid.commands.drive_case import conditions_of, frozen_tires
from tireid.driving.runs import FROZEN, FULL, IMU, LEARNING, SENSORS, Conditions, run_drive

PATHS = ("iso-3888-2", "course")
FRICTIONS = (1.0, 0.5)
TIRES = (LEARNING,)
DROPS = drops.SAVED
SEEDS = 10
WORKERS = 2
MOST = 1.3  # rms deviation without v_y over that with it
LATEST = 0.5  # s


class Case(NamedTuple):
    """One drive: path or course with a drop, friction, tires, sensors, seed."""

    path: str
    mu: float
    tires: str
    sensors: str
    seed: int


class Result(NamedTuple):
    """What became of a drive: deviation [m]; time from a drop to the friction that was believed.

    told : how right v_y was, None where it was measured.   alarms : times at which a sensor was
    said to be at fault [s].
    """

    completed: bool
    rms: float
    peak: float
    noticed: float | None
    told: EstimateScores | None
    alarms: list[float]


def conditions(case: Case) -> Conditions:
    """Return what `tireid drive` would drive.

    Parameters
    ----------
    case : what to drive.
    """
    if case.path in DROPS:
        found = drops.conditions(drops.Case(case.path, case.tires, case.seed))
        return replace(found, kind=case.sensors)
    words = ["--path", case.path, "--speed", "90%", "--mu", f"{case.mu:g}"]
    words += ["--sensors", case.sensors, "--seed", str(case.seed)]
    return conditions_of(options_of(words))


@cache
def learnt_before(mu: float, sensors: str, seed: int) -> TireModel:
    """Return what the command learns before it drives: the same on every path.

    Parameters
    ----------
    mu : friction.
    sensors : of `SENSORS`.
    seed : of noise, bias and steering.
    """
    words = ["--mu", f"{mu:g}", "--sensors", sensors, "--seed", str(seed)]
    options = options_of(words)
    _, learnt = frozen_tires(options, [FROZEN], conditions_of(options))
    assert learnt is not None
    return learnt


def score(case: Case) -> Result:
    """Return what became of a drive.

    Parameters
    ----------
    case : to drive.
    """
    learnt = learnt_before(case.mu, case.sensors, case.seed)
    run = run_drive(case.tires, conditions(case), learnt)
    driven, noticed = run.drive, None
    if case.path in DROPS:
        path, _ = drops.course(case.path)
        place = drops.Case(case.path, case.tires, case.seed).place
        dropped_at = float(driven.t[path.pose(place)[0] <= driven.X][0])
        assert isinstance(run.learner, Learner)
        decisions = run.learner.supervisor.decisions
        times = [one.t - dropped_at for one in decisions if one.friction != 1.0]
        noticed = times[0] if times else None
    return Result(
        completed=driven.completed,
        rms=run.scores.rms_e_y_m,
        peak=run.scores.peak_e_y_m,
        noticed=noticed,
        told=estimate_scores(driven),
        alarms=[t for t, note in driven.notes if note.startswith(Verdict.FAULT.value)],
    )


def cases_of(seeds: int) -> list[Case]:
    """Return all drives; those of one seed follow each other, so that a worker learns once.

    Parameters
    ----------
    seeds : of each.
    """
    cases = [Case(*one) for one in product(PATHS, FRICTIONS, TIRES, SENSORS, range(seeds))]
    cases += [
        Case(*one) for one in product(DROPS, (drops.DRY,), (LEARNING,), SENSORS, range(seeds))
    ]
    return sorted(cases, key=lambda case: (case.seed, case.sensors, case.mu))


def report(found: dict[Case, Result], seeds: int, targets: Targets) -> None:
    """Print both kinds of sensors side by side, and the numbers beside their targets.

    Parameters
    ----------
    found : what was driven.
    seeds : of each.
    targets : collects what is missed.
    """

    def rows(path: str, mu: float, tires: str) -> dict[str, list[Result]]:
        return {
            kind: [found[Case(path, mu, tires, kind, seed)] for seed in range(seeds)]
            for kind in SENSORS
        }

    for path, mu, tires in product(PATHS, FRICTIONS, TIRES):
        compare(f"{path}/{mu:g}/{tires}", rows(path, mu, tires), targets)
    for path in DROPS:
        drop(path, rows(path, drops.DRY, LEARNING), targets)
    told = [result for case, result in found.items() if case.sensors == IMU]
    alarms = sum(len(result.alarms) for result in told)
    targets.at_most("alarms without a fault", alarms, 0, "", key="alarms")
    targets.record("drives", len(told))
    within = [result.told.within_two_sd for result in told if result.told is not None]
    targets.record("within_two_sd/median", 100.0 * float(np.median(within)), "%")
    targets.record("within_two_sd/least", 100.0 * min(within), "%")


def compare(key: str, rows: dict[str, list[Result]], targets: Targets) -> None:
    """Print a path: deviation, completed drives, and how right v_y was.

    Parameters
    ----------
    key : of the path.
    rows : by sensors, one for each seed.
    targets : collects what is missed.
    """
    medians = {kind: float(np.median([one.rms for one in row])) for kind, row in rows.items()}
    for kind, row in rows.items():
        targets.record(f"{key}/{kind}/rms", 100.0 * medians[kind], "cm")
        targets.record(f"{key}/{kind}/completed", sum(one.completed for one in row))
    pairs = list(zip(rows[FULL], rows[IMU], strict=True))
    worse = sum(full.completed and not imu.completed for full, imu in pairs)
    targets.at_most(f"{key}: completed with v_y alone", worse, 0, "", key=f"{key}/lost")
    label = f"{key}: rms deviation without v_y over with it"
    targets.at_most(label, medians[IMU] / medians[FULL], MOST, "", key=f"{key}/ratio")
    targets.record(f"{key}/worst_ratio", max(imu.rms / full.rms for full, imu in pairs))
    tell(key, rows[IMU], targets)


def tell(key: str, row: list[Result], targets: Targets) -> None:
    """Record how right v_y was, the median of the seeds.

    Parameters
    ----------
    key : of the path.
    row : of the car without the sensor.
    targets : keeps it.
    """

    def median(of: Callable[[EstimateScores], float]) -> float:
        return float(np.median([of(one.told) for one in row if one.told is not None]))

    targets.record(f"{key}/side_slip", median(lambda told: told.rms_error_deg), "deg")
    targets.record(f"{key}/side_slip_true", median(lambda told: told.rms_deg), "deg")
    targets.record(f"{key}/v_y", median(lambda told: told.rms_error_m_s), "m/s")
    targets.record(f"{key}/v_y_inertial", median(lambda told: told.inertial_rms_error_m_s), "m/s")


def drop(path: str, rows: dict[str, list[Result]], targets: Targets) -> None:
    """Print when the drop of friction was noticed, and how far off the path it took the car.

    Parameters
    ----------
    path : of `DROPS`.
    rows : by sensors, one for each seed.
    targets : collects what is missed.
    """
    key = path.replace(" ", "_")
    for kind, row in rows.items():
        times = [one.noticed for one in row if one.noticed is not None]
        targets.record(f"{key}/{kind}/noticed", float(np.median(times)), "s")
        targets.record(f"{key}/{kind}/noticed_latest", max(times), "s")
        targets.record(f"{key}/{kind}/peak", max(one.peak for one in row), "m")
        targets.record(f"{key}/{kind}/completed", sum(one.completed for one in row))
    imu = rows[IMU]
    seen = [one.noticed for one in imu if one.noticed is not None]
    targets.at_least(f"{path}: drops that were noticed", len(seen), len(imu), "", key=f"{key}/seen")
    label = f"{path}: time until the drop is noticed, median"
    targets.at_most(label, float(np.median(seen)), LATEST, "s", key=f"{key}/time")
    worse = sum(a.completed and not b.completed for a, b in zip(rows[FULL], rows[IMU], strict=True))
    targets.at_most(f"{path}: completed with v_y alone", worse, 0, "", key=f"{key}/lost")
    tell(key, imu, targets)


def main(out: Path, seeds: int = SEEDS, *, keep: bool = False) -> int:
    """Drive and print; return 1 where a target was missed.

    Parameters
    ----------
    out : folder of the JSON.
    seeds : of each.
    keep : record the numbers for the documents.
    """
    out.mkdir(parents=True, exist_ok=True)
    cases, targets = cases_of(seeds), Targets("mpc_without_v_y")
    with spread(WORKERS, chunk=10) as over:
        found = dict(zip(cases, over(score, cases), strict=True))
    report(found, seeds, targets)
    rows = [
        {**case._asdict(), **one._asdict(), "told": one.told and one.told._asdict()}
        for case, one in found.items()
    ]
    (out / "mpc_without_v_y.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
    print(f"wrote {out / 'mpc_without_v_y.json'}")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    records = keeps()
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: mpc_without_v_y OUT [SEEDS] [--record]")
    sys.exit(main(Path(sys.argv[1]), *(int(word) for word in sys.argv[2:]), keep=records))
