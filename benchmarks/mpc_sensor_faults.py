"""A sensor fails in closed loop: do learning and caution keep the path that frozen tires keep?

    python -m benchmarks.mpc_sensor_faults OUT [--record]

drives, as `tireid drive --fault` does with its defaults, 0.4 laps of the handling course and ISO
3888-1 at 90 % of the limit of grip with each of 34 faults, which begin at three times, on frozen
tires, on those that go on learning, and on frozen tires with `--caution 1`. Each time has a seed of
its own, of noise and of the drive to learn on. The tolerances of the sensors' agreement were chosen
on ISO 3888-2 and the slalom, those of caution on some of these drives. Drives without a fault, at
90 % and 97 % and on half the friction too, count alarms that are false.

A fault is noticed where learning says that there is a sensor fault. One that shows nothing wrong
meanwhile (a steering that is scaled on a straight) cannot be: it is noticed where it shows.
Prints a table, writes OUT/mpc_sensor_faults.json.
"""

import json
import math
import sys
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.mpc_cases import drive_with, options_of
from benchmarks.targets import Targets, keeps
from identifier.compare.work import spread
from mpc.handover.rules import Verdict
from tireid.commands.drive_case import conditions_of, parse_fault
from tireid.driving.runs import FROZEN, LEARNING

CAUTIOUS = "cautious"
DRIVERS = {  # words of the command
    FROZEN: ("--tires", FROZEN),
    LEARNING: ("--tires", LEARNING),
    CAUTIOUS: ("--tires", FROZEN, "--caution", "1"),
}
WITHIN = 0.5  # m that caution may not pass, where frozen tires alone do not
FAULTS = (  # channel, kind, how long [s], size: `tireid drive --fault` with a time
    ("v_y", "biased", math.inf, 0.5),
    ("v_y", "biased", math.inf, -0.5),
    ("v_y", "stuck", math.inf, 0.0),
    ("v_y", "stuck", 2.0, 0.0),
    ("v_y", "zero", 2.0, 0.0),
    ("v_y", "flipped", 2.0, 0.0),
    ("v_y", "lost", 2.0, 0.0),
    ("v_y", "noisy", math.inf, 0.5),
    ("v_y", "drifting", 4.0, 0.3),
    ("v_y", "spiking", math.inf, 2.0),
    ("r", "biased", math.inf, 0.05),
    ("r", "stuck", 2.0, 0.0),
    ("r", "zero", 1.0, 0.0),
    ("r", "flipped", 2.0, 0.0),
    ("r", "lost", 1.0, 0.0),
    ("r", "scaled", math.inf, 0.8),
    ("r", "noisy", 2.0, 0.2),
    ("r", "spiking", math.inf, 0.5),
    ("delta", "biased", math.inf, math.radians(2.0)),
    ("delta", "biased", math.inf, -math.radians(2.0)),
    ("delta", "stuck", math.inf, 0.0),
    ("delta", "zero", 2.0, 0.0),
    ("delta", "flipped", math.inf, 0.0),
    ("delta", "lost", 2.0, 0.0),
    ("delta", "scaled", math.inf, 1.5),
    ("v_x", "scaled", math.inf, 0.8),
    ("v_x", "scaled", math.inf, 1.2),
    ("v_x", "stuck", math.inf, 0.0),
    ("v_x", "zero", 1.0, 0.0),
    ("v_x", "lost", 1.0, 0.0),
    ("X", "lost", 0.5, 0.0),
    ("Y", "biased", 2.0, 0.5),
    ("psi", "biased", math.inf, 0.02),
    ("a_y", "stuck", math.inf, 0.0),
)
ROADS = {  # words of the command, and when faults begin [s]
    "course": (("--path", "course", "--laps", "0.4"), (3.0, 9.0, 15.0)),
    "iso-3888-1": (("--path", "iso-3888-1"), (1.0, 2.5, 4.0)),
}
SPEED = ("--speed", "90%")
QUIET = tuple(  # words of drives without a fault
    (*words, "--speed", share, "--mu", mu)
    for (words, _), share in product(ROADS.values(), ("90%", "97%"))
    for mu in ("1", "0.5")
)
QUIET_SEEDS = 3
WORKERS = 2


class Case(NamedTuple):
    """One drive: words of the command but for driver and seed, when its fault begins [s]."""

    words: tuple[str, ...]
    driver: str
    seed: int
    begins: float = math.inf


class Outcome(NamedTuple):
    """Whether the path was kept, peak deviation [m], when the alarm began [s], and how long."""

    kept: bool
    peak: float
    faults: tuple[float, ...]
    lasted: float


class Row(NamedTuple):
    """One fault on all roads and at all times: outcomes by driver, in the same order."""

    channel: str
    name: str
    begins: Sequence[float]
    outcomes: dict[str, list[Outcome]]

    def left(self, driver: str) -> int:
        """Return how many drives left the path.

        Parameters
        ----------
        driver : of `DRIVERS`.
        """
        return sum(not one.kept for one in self.outcomes[driver])

    def peak(self, driver: str) -> float:
        """Return the largest deviation [m].

        Parameters
        ----------
        driver : of `DRIVERS`.
        """
        return max(one.peak for one in self.outcomes[driver])

    def worse(self, driver: str, within: float = math.inf) -> int:
        """Return how many drives left the path, or were farther off, where frozen tires did not.

        Parameters
        ----------
        driver : of `DRIVERS`.
        within : deviation that counts as far off [m].
        """
        pairs = zip(self.outcomes[FROZEN], self.outcomes[driver], strict=True)
        return sum(
            (frozen.kept and not other.kept) or frozen.peak <= within < other.peak
            for frozen, other in pairs
        )

    @property
    def times(self) -> list[float]:
        """From the beginning of the fault to that of the alarm, where there was one [s]."""
        found = []
        for begins, one in zip(self.begins, self.outcomes[LEARNING], strict=True):
            found += [t - begins for t in one.faults if t >= begins][:1]
        return found


def fault_word(fault: tuple[str, str, float, float], begins: float) -> str:
    """Return what `--fault` is given.

    Parameters
    ----------
    fault : of `FAULTS`.
    begins : when [s].
    """
    channel, kind, duration, size = fault
    return f"{channel}:{kind}:{begins:g}:{duration:g}:{size!r}"


def score(case: Case) -> Outcome:
    """Return what became of a drive.

    Parameters
    ----------
    case : to drive.
    """
    words = [*case.words, *DRIVERS[case.driver], "--seed", str(case.seed)]
    options = options_of(words)
    driven = drive_with(conditions_of(options), options.tires[0]).drive
    faults = tuple(t for t, note in driven.notes if note.startswith(Verdict.FAULT.value))
    peak = float(np.abs(driven.e_y).max())
    return Outcome(driven.completed, peak, faults, float(driven.t[-1]))


def cases_of(fault: tuple[str, str, float, float], driver: str) -> list[Case]:
    """Return the drives of one fault.

    Parameters
    ----------
    fault : of `FAULTS`.
    driver : of `DRIVERS`.
    """
    return [
        Case((*words, *SPEED, "--fault", fault_word(fault, begins)), driver, seed, begins)
        for words, times in ROADS.values()
        for seed, begins in enumerate(times)
    ]


def drive_all() -> tuple[list[Row], list[Outcome]]:
    """Drive everything, on both cores; return a row for each fault, and the drives without one."""
    quiet = [Case(words, LEARNING, seed) for words, seed in product(QUIET, range(QUIET_SEEDS))]
    cases = [*quiet, *(c for f, d in product(FAULTS, DRIVERS) for c in cases_of(f, d))]
    with spread(WORKERS, chunk=6) as over:
        found = dict(zip(cases, over(score, cases), strict=True))
    rows = []
    for fault in FAULTS:
        begins = [case.begins for case in cases_of(fault, FROZEN)]
        told = parse_fault(fault_word(fault, 0.0))
        name = str(told).replace(" from 0 s on", "")
        outcomes = {of: [found[case] for case in cases_of(fault, of)] for of in DRIVERS}
        rows.append(Row(fault[0], name, begins, outcomes))
    return rows, [found[case] for case in quiet]


def print_table(rows: list[Row]) -> None:
    """Print how many drives left the path, the worst deviation, and when faults were noticed.

    Parameters
    ----------
    rows : what was driven.
    """
    heads = "".join(f"{f'{driver}: left, peak [m]':>26}" for driver in DRIVERS)
    print(f"{'fault':30}{heads}{'noticed':>9}{'median [s]':>12}{'latest [s]':>12}")
    for row in rows:
        n, times = len(row.begins), row.times
        print(f"{row.name:30}", end="")
        print("".join(f"{row.left(d):>12}/{n}{row.peak(d):12.2f}" for d in DRIVERS), end="")
        seen = (f"{np.median(times):12.2f}{max(times):12.2f}") if times else f"{'-':>12}{'-':>12}"
        print(f"{len(times):>7}/{n}{seen}")


def judge(rows: list[Row], quiet: list[Outcome], targets: Targets) -> None:
    """Print and record the numbers beside their targets.

    Parameters
    ----------
    rows : what was driven with faults.
    quiet : and without.
    targets : collects what is missed.
    """
    label = "drives that learning leaves the path in and frozen tires do not"
    targets.at_most(label, sum(row.worse(LEARNING) for row in rows), 0, "", key="worse")
    label = (
        f"drives that caution leaves the path in, or passes {WITHIN:g} m, and frozen tires do not"
    )
    worse = sum(row.worse(CAUTIOUS, WITHIN) for row in rows)
    targets.at_most(label, worse, 0, "", key="worse_cautious")
    for channel in dict.fromkeys(row.channel for row in rows):
        record(channel, [row for row in rows if row.channel == channel], targets)
    record("all", rows, targets)
    early = [
        t < begins
        for row in rows
        for begins, one in zip(row.begins, row.outcomes[LEARNING], strict=True)
        for t in one.faults
    ]
    false = sum(len(one.faults) for one in quiet)
    targets.at_most("alarms without a fault", false + sum(early), 0, "", key="quiet/alarms")
    left = sum(not one.kept for one in quiet)
    targets.at_most("drives without a fault that left the path", left, 0, "", key="quiet/left")
    targets.record("quiet/minutes", sum(one.lasted for one in quiet) / 60.0, "min")
    targets.record("faults", len(FAULTS))


def record(name: str, rows: list[Row], targets: Targets) -> None:
    """Record what some faults did.

    Parameters
    ----------
    name : of them.
    rows : of them.
    targets : keeps it.
    """
    times = [t for row in rows for t in row.times]
    targets.record(f"{name}/faults", len(rows))
    targets.record(f"{name}/drives", sum(len(row.begins) for row in rows))
    for driver in DRIVERS:
        targets.record(f"{name}/{driver}/left", sum(row.left(driver) for row in rows))
        targets.record(f"{name}/{driver}/peak", max(row.peak(driver) for row in rows), "m")
    targets.record(f"{name}/worse_cautious", sum(row.worse(CAUTIOUS, WITHIN) for row in rows))
    targets.record(f"{name}/noticed", len(times))
    if times:
        targets.record(f"{name}/median", float(np.median(times)), "s")
        targets.record(f"{name}/latest", max(times), "s")


def main(out: Path, *, keep: bool = False) -> int:
    """Drive and print; return 1 where a target was missed.

    Parameters
    ----------
    out : folder of the JSON.
    keep : record the numbers for the documents.
    """
    out.mkdir(parents=True, exist_ok=True)
    (rows, quiet), targets = drive_all(), Targets("mpc_sensor_faults")
    print_table(rows)
    judge(rows, quiet, targets)
    content = {"faults": [row._asdict() for row in rows], "quiet": quiet}
    (out / "mpc_sensor_faults.json").write_text(json.dumps(content, indent=1), encoding="utf-8")
    print(f"wrote {out / 'mpc_sensor_faults.json'}")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    records = keeps()
    if len(sys.argv) != 2:
        sys.exit("usage: mpc_sensor_faults OUT [--record]")
    sys.exit(main(Path(sys.argv[1]), keep=records))
