"""How what the doctor says is judged, alike for the sizes that it estimates and for gross faults.

A planted fault is named where a finding of its code and channel is the first or the second. On a
drive without a fault any finding that matters is an alarm, by `ti.diagnose`, as a user gets it: on
the whole minute, and on its halves, of which one may well hold no brisk corner. That a half has too
few corners to be judged is said of it rightly.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.answers import blind
from benchmarks.recorded_cars import CARMAKER, DART, DATA
from benchmarks.targets import Targets, show
from identifier.doctor import Finding
from models.recordings import Recording, read_recording, runs
from models.vehicle import Vehicle

FIRST = 3000  # seed of the first car: no constant of the doctor was chosen on one from there on
NAMED = 2  # first or second
PROCESSES = 2
QUIET = "straight"  # what a half of a drive may be called
RECORDED = {"carmaker": CARMAKER, "dart": DART, "dart_imu": DART}
WHOLE, PARTS = "whole", ("first half", "second half")
Right = tuple[tuple[str, str], ...]  # codes and channels of findings that are right, "" for any


class Clean(NamedTuple):
    """What was said against a drive without a fault: alarms by part of it."""

    kind: str
    seed: int
    alarms: Mapping[str, tuple[str, ...]]


def is_right(finding: Finding, right: Right) -> bool:
    """Return whether a finding is of the planted fault.

    Parameters
    ----------
    finding : of the doctor.
    right : how the fault may be called.
    """
    channels = finding.channel.split("+")
    return any(finding.code == code and channel in ("", *channels) for code, channel in right)


def rank_of(findings: Iterable[Finding], right: Right) -> int:
    """Return at which place a planted fault is named, from 1 on; 0 where it is not.

    Parameters
    ----------
    findings : of the doctor.
    right : how the fault may be called.
    """
    ranks = (k for k, one in enumerate(findings, start=1) if is_right(one, right))
    return next(ranks, 0)


def parts_of(log: Recording) -> dict[str, Recording]:
    """Return a drive and its parts by name.

    Parameters
    ----------
    log : a minute of driving.
    """
    n = len(log)
    places = {
        WHOLE: slice(0, n),
        **dict(zip(PARTS, (slice(0, n // 2), slice(n // 2, n)), strict=True)),
    }
    return {name: log.taken(place) for name, place in places.items()}


def said_of_clean(kind: str, seed: int, log: Recording, told: Vehicle) -> Clean:
    """Return the alarms on a drive without a fault, and on its parts.

    Parameters
    ----------
    kind : class of the car.
    seed : of the car.
    log : without a fault.
    told : the car, told rightly.
    """
    alarms = {
        name: tuple(
            one.text
            for one in ti.diagnose(part, told).findings
            if one.matters and (name == WHOLE or one.code != QUIET)
        )
        for name, part in parts_of(log).items()
    }
    return Clean(kind, seed, alarms)


def judge_clean(clean: Iterable[Clean], targets: Targets) -> None:
    """Record and judge the alarms on drives without a fault.

    Parameters
    ----------
    clean : what was said of each.
    targets : collects what is missed.
    """
    said = list(clean)
    for one in said:
        for part, texts in one.alarms.items():
            for text in texts:
                show(f"false alarm: {one.kind} {one.seed}, {part}", text)
    targets.record("clean_drives", len(said))
    whole = [bool(one.alarms[WHOLE]) for one in said]
    halves = [bool(one.alarms[part]) for one in said for part in PARTS]
    share = 100.0 * float(np.mean(whole))
    targets.at_most("clean drives with an alarm", share, 1.0, "%", "alarms")
    targets.record("clean_halves", len(halves))
    share = 100.0 * float(np.mean(halves))
    targets.at_most("halves of clean drives with an alarm", share, 1.0, "%", "alarms/halves")


def recorded_runs() -> dict[str, tuple[Recording, Vehicle]]:
    """Return the recordings and their cars, by file and run."""
    found = {}
    for file, car in RECORDED.items():
        path = DATA / f"{file}.csv.gz"
        for run in runs(path):
            found[f"{file}/{run}"] = blind(read_recording(path, run=run, check=False)), car
    return found
