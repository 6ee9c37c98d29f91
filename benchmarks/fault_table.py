"""What faults of logs and of what is told do to the answer, and whether its verdict says so.

    python -m benchmarks.fault_table OUT [--cars N] [--record]

Each fault of `fault_cases.cases` on the two CarMaker runs, where they are there, and on plant cars
of four classes: learnt stiffness, error of the force of the frozen model (on the same sensors, on a
drive with corners), the verdict, and the doctor, whose findings `tireid identify` tells beside it.
Where a fault can be seen the error at most doubles, where it can not the answer is called not
valid, or the doctor says something that it does not say of the drive without the fault, be it the
right cause or another; a wrong mass alone nobody can see. Writes OUT/fault_table.md for
docs/benchmarks.md.
"""

import argparse
import math
import sys
import textwrap
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.answers import Answer, answer, drawn, is_dead
from benchmarks.documents import numbers
from benchmarks.fault_cases import cases
from benchmarks.random_cars import CLASSES, FIRST_SEED
from benchmarks.recorded_cars import CARMAKER, DATA
from benchmarks.targets import Targets, keeps, show
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle, sedan

CARS = 2  # of each class
RUNS = {"slalom": "slalom1_14_5ms", "sine": "experiment2_40kmh"}
TWICE, SMALL = 2.0, 5.0  # times the error without the fault; % that is good whatever that was
LABELS = {  # by the first part of the key of a case; its size follows
    "clean": "nothing",
    "v_y_bias": "v_y off by {} m/s",
    "mounting": "velocity sensor turned by {}°",
    "ahead": "velocity sensor {} m ahead",
    "steering": "steering off by {}°",
    "late": "steering {} ms late",
    "bank": "road banked by {}°",
    "mass": "mass told {} times",
    "inertia": "yaw inertia told {} times",
    "center": "c.g. told {} wheelbases too far back",
    "swapped": "l_f and l_r swapped",
    "other_car": "a car of another size told",
    "straight": "no corner driven",
    "v_y_zero": "v_y always zero",
}
UNSEEN = {"mass/1.2": 20.0}  # % that no motion shows: all forces grow with the mass
SHOWN, WIDTH = {"tenth": "1:10"}, 110  # name of a class in documents; characters of their lines
SHOWN_AT_MOST = 20  # answers of which nothing is said
PROCESSES = 2
Answers = Mapping[str, Answer]  # by case


class Silent(NamedTuple):
    """An answer that is wrong by a fault and that the verdict calls valid."""

    group: str
    case: str
    answer: Answer
    by_doctor: bool
    """Whether the doctor says something."""


def of_log(log: Recording, drive: Recording, told: Vehicle) -> dict[str, Answer]:
    """Return the answer to each fault of a drive.

    Parameters
    ----------
    log : of good sensors.
    drive : the same without noise.
    told : the car, told rightly.
    """
    return {
        name: answer(case.log(log), case.car(told), case.judged(drive))
        for name, case in cases(told).items()
    }


def of_car(job: tuple[str, int]) -> dict[str, Answer]:
    """Return the answer to each fault of a drive of a plant car.

    Parameters
    ----------
    job : class of the car, and its number.
    """
    kind, number = job
    drive = drawn(kind, FIRST_SEED + number)
    rng = np.random.default_rng([FIRST_SEED + number, 1])
    return of_log(drive.log(rng), drive.exact, drive.car.told)


def of_carmaker() -> dict[str, list[Answers]]:
    """Return the answers on the recordings of CarMaker; none where they are not there."""
    found: dict[str, list[Answers]] = {}
    if not DATA.is_dir():
        print(f"  without recordings: they are not there: {DATA} (set TIREID_DATA)")
        return found
    for name, run in RUNS.items():
        recording = read_recording(DATA / "carmaker.csv.gz", run=run)
        found[name] = [of_log(recording, recording, CARMAKER)]
    return found


def is_told(found: Answer, clean: Answer, unseen: float = 0.0) -> bool:
    """Return whether the error at most doubles, or the verdict calls the answer not valid.

    Parameters
    ----------
    found : with the fault.
    clean : without.
    unseen : error that is added and that nobody can see [%].
    """
    return not found.valid or found.worse <= max(TWICE * clean.worse, SMALL) + unseen


def is_told_by_doctor(found: Answer, clean: Answer) -> bool:
    """Return whether the doctor says something that it does not say without the fault.

    Parameters
    ----------
    found : with the fault.
    clean : without.
    """
    return not {*found.doctor} <= {*clean.doctor}


def label_of(case: str) -> str:
    """Return a case in words.

    Parameters
    ----------
    case : its key.
    """
    kind, _, size = case.partition("/")
    return LABELS[kind].format(size)


def report(found: Mapping[str, list[Answers]], targets: Targets) -> str:
    """Record and judge the numbers; return the table as Markdown with its sources.

    Parameters
    ----------
    found : by recording or class, for each of its drives.
    targets : collects what is missed.
    """
    labels = {name: label_of(name) for name in cases(sedan())}
    plants = [name for name in found if name in CLASSES]
    logs = [name for name in found if name not in CLASSES]
    head = [f"CarMaker {name}{what}" for name in logs for what in (" [kN/rad]", " [%]")]
    asked = sum(map(len, found.values()))
    targets.record("drives", asked)
    head += [f"{SHOWN.get(name, name)} [%]" for name in plants]
    told = ["of these, wrong", "and the doctor silent"]
    head = ["what is wrong", *head, f"valid, of {asked}", *told]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    sources = ["name=1:10"] * ("tenth" in plants) + ["fault_table:", "drives"]
    silent: list[Silent] = []
    dead: list[Answer] = []
    for name, label in labels.items():
        row, silent_before = [label], len(silent)
        sources += [f"input={number.text}" for number in numbers(label)]
        sources.append(f"{name}/{{{','.join(logs)}}}/{{stiffness,error}}/{{front,rear}}")
        sources.append(f"{name}/{{{','.join(plants)}}}/error/{{front,rear}}")
        for group, drives in found.items():
            some = [answers[name] for answers in drives]
            if group in logs:
                row.append(_pair(targets, f"{name}/{group}/stiffness", some))
            row.append(_pair(targets, f"{name}/{group}/error", some))
            clean = [answers["clean"] for answers in drives]
            pairs = list(zip(some, clean, strict=True))
            silent += [
                Silent(group, name, one, is_told_by_doctor(one, good))
                for one, good in pairs
                if not is_told(one, good, UNSEEN.get(name, 0.0))
            ]
            dead += [one for one, good in pairs if is_dead(one, good.stiffness)]
        every = [answers[name] for drives in found.values() for answers in drives]
        valid = sum(one.valid for one in every)
        mine = silent[silent_before:]
        counts = {
            "valid": valid,
            "silent": len(mine),
            "silent_with_doctor": sum(not one.by_doctor for one in mine),
        }
        for key, count in counts.items():
            targets.record(f"{name}/{key}", count)
        sources.append(f"{name}/{{{','.join(counts)}}}")
        lines.append(f"| {' | '.join([*row, *map(str, counts.values())])} |")
        codes = sorted({code for one in every for code in one.codes})
        show(label, f"{valid} of {len(every)} valid  {', '.join(codes)}")
    unheard = [one for one in silent if not one.by_doctor]
    for one in unheard[:SHOWN_AT_MOST]:
        error = f"{one.answer.error[0]:.1f} / {one.answer.error[1]:.1f} %"
        show(f"says nothing: {one.group}, {labels[one.case]}", error)
    right = [answers["clean"] for drives in found.values() for answers in drives]
    targets.record("clean/doctor", sum(bool(one.doctor) for one in right))
    everything = [
        one for drives in found.values() for answers in drives for one in answers.values()
    ]
    targets.record("answers", len(everything))
    label = "answers whose error doubles and that the verdict calls valid"
    targets.at_most(label, len(silent), 0, "", "silent")
    label = "of these, answers of which the doctor says nothing"
    targets.at_most(label, len(unheard), 0, "", "silent_with_doctor")
    targets.at_most("answers that leave an axle dead", len(dead), 0, "", "dead")
    untold = sum(one.valid for one in dead)
    targets.at_most("answers with a dead axle called valid", untold, 0, "", "dead_valid")
    stopped = sum(one.stopped for one in everything)
    targets.at_most("answers that stopped the program", stopped, 0, "", "stopped")
    comment = f"<!-- numbers {' '.join(sources)} -->"
    lines += textwrap.wrap(comment, WIDTH, break_long_words=False, break_on_hyphens=False)
    return "\n".join(lines) + "\n"


def _pair(targets: Targets, key: str, some: list[Answer]) -> str:
    """A cell, front / rear: the medians over drives, recorded; the infinite error of no model."""
    if key.endswith("/stiffness"):
        values, unit, digits = [1e-3 * np.array(one.stiffness) for one in some], "kN/rad", 0
    else:
        values, unit, digits = [np.array(one.error) for one in some], "%", 1
    cells = []
    for axle, value in zip(("front", "rear"), np.median(values, axis=0).tolist(), strict=True):
        sound = math.isfinite(value)
        targets.record(f"{key}/{axle}", value if sound else "no model", unit)
        cells.append(f"{value:.{digits}f}" if sound else "no model")
    return " / ".join(cells)


def main() -> int:
    """Run everything; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="OUT")
    parser.add_argument("--cars", type=int, default=CARS, help="of each class")
    options, targets = parser.parse_args(), Targets("fault_table")
    jobs = [(kind, number) for kind in CLASSES for number in range(options.cars)]
    found = of_carmaker()
    with ProcessPoolExecutor(PROCESSES) as pool:
        for (kind, _), answers in zip(jobs, pool.map(of_car, jobs), strict=True):
            found.setdefault(kind, []).append(answers)
    table = report(found, targets)
    print(table)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "fault_table.md").write_text(table, encoding="utf-8")
    return targets.finish(keep=keep and options.cars == CARS and len(found) > len(CLASSES))


if __name__ == "__main__":
    sys.exit(main())
