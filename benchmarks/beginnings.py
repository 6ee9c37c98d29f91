"""However a drive begins, are the tires learnt those of the same drive begun in a corner?

    python -m benchmarks.beginnings [--cars N] [--record]

Each random car of four classes drives after four beginnings of the kinds of `BEGINNINGS`: with 30
cars 120 a class. The log from the first corner on teaches the tires to compare with; both are
asked about the forces of that part. The error of the worse axle is compared, and errors below
`FLOOR` count as equal. Of every answer the verdict is asked, too.
"""

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.answers import REFUSED, RIGHT, Answer, answer, drawn, is_dead
from benchmarks.answers import WRONG as NOT_VALID
from benchmarks.random_cars import BEGINNINGS, CLASSES, FIRST_SEED, random_beginning
from benchmarks.targets import Targets, keeps, show

CARS, EACH = 30, 4  # a class; beginnings of each car
FLOOR, WITHIN, WRONG = 1.0, 1.3, 15.0  # %, -, %
REFUSED_AT_MOST = 3.0  # % of the right answers
PROCESSES = 2


class Begun(NamedTuple):
    """A car, how it began, what was learnt, and what begun in the corner."""

    kind: str
    beginning: str
    seed: int
    learnt: Answer
    corner: Answer
    dead: bool

    @property
    def ratio(self) -> float:
        """Error over that of the same drive begun in a corner."""
        return max(self.learnt.worse, FLOOR) / max(self.corner.worse, FLOOR)


class Verdicts(NamedTuple):
    """What the verdict said of drives.

    far_off, wrong_valid : more than `NOT_VALID` wrong, and of these called valid.   right,
    right_refused : within `RIGHT`, and of these not valid.   at_the_door : of the refused, those
    of which the log was not let in.
    """

    far_off: int
    wrong_valid: int
    right: int
    right_refused: int
    at_the_door: int

    @classmethod
    def of(cls, found: Sequence[Begun]) -> "Verdicts":
        """Count them.

        Parameters
        ----------
        found : the drives.
        """
        answers = [one.learnt for one in found]
        refused = [one for one in answers if one.right and not one.valid]
        return cls(
            sum(one.wrong for one in answers),
            sum(one.wrong and one.valid for one in answers),
            sum(one.right for one in answers),
            len(refused),
            sum(REFUSED in one.codes for one in refused),
        )


def begun(job: tuple[str, int]) -> list[Begun]:
    """Return what becomes of the beginnings of one car.

    Parameters
    ----------
    job : class of the car, and its number.
    """
    kind, number = job
    seed, found = FIRST_SEED + number, []
    for k in range(EACH):
        name = BEGINNINGS[(EACH * number + k) % len(BEGINNINGS)]
        drive = drawn(kind, seed, partial(random_beginning, name), k)
        log = drive.log(np.random.default_rng([seed, k, *kind.encode()]))
        corner, car = drive.cornering(log), drive.car
        of_log = partial(answer, told=car.told, judged=corner)
        learnt = of_log(log)
        vehicle = car.vehicle
        right = vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear
        dead = is_dead(learnt, right)
        found.append(Begun(kind, name, seed, learnt, of_log(corner), dead))
    return found


def report(found: Sequence[Begun], targets: Targets) -> None:
    """Print tables, record their numbers and judge them.

    Parameters
    ----------
    found : of all cars.
    targets : collects what is missed.
    """
    targets.record("drives", len(found))
    head = "drives  median  corner  largest  corner  >1.3  >15 %  wrong, valid  right, refused"
    print(f"  {'worse axle [% of rms force]':29} {head}")
    groups = {name: [one for one in found if one.kind == name] for name in CLASSES}
    groups |= {name: [one for one in found if one.beginning == name] for name in BEGINNINGS}
    for name, some in groups.items():
        if some:
            print(f"  {name:28}" + _row(some, name, targets))
    for one in sorted(found, key=lambda one: -one.ratio)[:10]:
        label = f"{one.kind} {one.seed}, {one.beginning}"
        show(label, f"{one.learnt.worse:.1f} %, {one.corner.worse:.1f} % begun in a corner")
    print("Targets")
    beyond = sum(one.ratio > WITHIN for one in found)
    targets.at_most(f"drives beyond {WITHIN:g} of the corner", beyond, 0, "", "beyond")
    ratio = float(np.median([one.ratio for one in found]))
    targets.at_most("median of error over that of the corner", ratio, 1.1, "", "ratio/median")
    wrong = sum(one.learnt.worse > WRONG for one in found)
    targets.at_most(f"drives with an axle more than {WRONG:g} % wrong", wrong, 0, "", "wrong")
    targets.at_most("drives after which an axle is dead", sum(o.dead for o in found), 0, "", "dead")
    stopped = sum(one.learnt.stopped for one in found)
    targets.at_most("drives that stopped the program", stopped, 0, "", "stopped")
    counts = Verdicts.of(found)
    for key in ("far_off", "right", "right_refused", "at_the_door"):
        targets.record(key, getattr(counts, key))
    label = f"drives more than {NOT_VALID:g} % wrong and called valid"
    targets.at_most(label, counts.wrong_valid, 0, "", "wrong_valid")
    share = 100.0 * counts.right_refused / max(counts.right, 1)
    label = f"drives within {RIGHT:g} % and refused"
    targets.at_most(label, share, REFUSED_AT_MOST, key="right_refused_share")
    for one in found:
        if one.learnt.right and not one.learnt.valid:
            codes = ", ".join(one.learnt.codes)
            show(f"right and refused: {one.kind} {one.seed}, {one.beginning}", codes)


def _row(some: Sequence[Begun], name: str, targets: Targets) -> str:
    """A line of the table; its numbers are recorded."""
    learnt, corner = ([getattr(one, side).worse for one in some] for side in ("learnt", "corner"))
    numbers = {
        "median": float(np.median(learnt)),
        "median_corner": float(np.median(corner)),
        "largest": max(learnt),
        "largest_corner": max(corner),
    }
    for key, value in numbers.items():
        targets.record(f"{name}/{key}", value if np.isfinite(value) else "no model", "%")
    verdicts = Verdicts.of(some)
    counts = {
        "beyond": sum(one.ratio > WITHIN for one in some),
        "wrong": sum(one.learnt.worse > WRONG for one in some),
        "wrong_valid": verdicts.wrong_valid,
        "right_refused": verdicts.right_refused,
    }
    for key, count in counts.items():
        targets.record(f"{name}/{key}", count)
    cells = "".join(f"{value:8.1f}" for value in numbers.values())
    return f"{len(some):8}{cells}" + "".join(
        f"{count:{width}}" for count, width in zip(counts.values(), (6, 7, 14, 15), strict=True)
    )


def main() -> int:
    """Run everything; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cars", type=int, default=CARS, help="of each class")
    cars, targets = parser.parse_args().cars, Targets("beginnings")
    jobs = [(kind, number) for number in range(cars) for kind in CLASSES]
    with ProcessPoolExecutor(PROCESSES) as pool:
        found = [one for some in pool.map(begun, jobs) for one in some]
    report(found, targets)
    return targets.finish(keep=keep and cars == CARS)


if __name__ == "__main__":
    sys.exit(main())
