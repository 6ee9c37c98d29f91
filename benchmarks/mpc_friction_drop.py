"""Friction halves in mid course: do learning while driving and caution keep the car on its path?

    python -m benchmarks.mpc_friction_drop [--quick] [--record]

`tireid drive --mu-drop` on a slalom of cones 36 m apart (a file, `--path`) and on ISO 3888-1, at a
speed that takes half of the grip before the drop and nearly all of it behind. Seeds change the
place of the drop, the noise and the identification drive on the dry road. A car has left its path
where it is more than 0.5 m off, spins, or gives up.
"""

import sys
from collections import defaultdict
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.mpc_cases import Case, Score, all_driven, driven, median_cm, share_of_limit
from benchmarks.targets import Table, Targets, Values, parse
from mpc.path import slalom

COURSES = {"slalom": (51.7, 190.0, 6.0), "iso-3888-1": (52.8, 45.0, 2.0)}
"""Per cent of the dry limit; place of the drop [m], and how much farther with each seed [m]."""
WET = 0.5
CAUTION = ("--caution", "1")
WAYS = {
    "linear tire": ("linear", ()),
    "frozen": ("axle", ()),
    "frozen, `--caution 1`": ("axle", CAUTION),
    "learning": ("learning", ()),
    "learning, `--caution 1`": ("learning", CAUTION),
    "true tire": ("oracle", ()),
}
WITHIN = 0.5  # m
SEEDS = 10


def left(score: Score) -> bool:
    """Return whether a car has left its path."""
    return not score.completed or score.peak > WITHIN


def canary() -> Values:
    """Return the deviation of one drive that learns as friction drops [m]."""
    percent, place, _ = COURSES["iso-3888-1"]
    words = ("--mu-drop", f"{place:g}:{WET}")
    found = driven(Case("iso-3888-1", share_of_limit(percent, 1.0), 1.0, "learning", 0, words))
    return {"rms": found.rms, "peak": found.peak}


def tables(v: Values) -> dict[str, Table]:
    """Return the table of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    rows = []
    for way in WAYS:
        cells = [f"{v[f'{course}/{way}/{what}']:.{n}f}"
                 for course in COURSES for what, n in (("left", 0), ("peak", 0))]  # fmt: skip
        rows.append([way, *cells])
    header = [f"friction {WET} of the dry one"]
    for course in COURSES:
        header += [f"{course}: left the path, of {SEEDS}", "largest deviation [cm]"]
    return {"mpc_friction_drop": Table(header, rows)}


def main() -> int:
    """Drive and print; return 1 where a target was missed."""
    targets, options = Targets("mpc_friction_drop"), parse("mpc_friction_drop", __doc__)
    names = {case: way for way, case in WAYS.items()}
    seeds = range(1 if options.quick else SEEDS)
    found: dict[tuple[str, str], list[Score]] = defaultdict(list)
    with TemporaryDirectory() as folder:
        cones = slalom(gap=36.0, cones=12)
        file = Path(folder) / "slalom.csv"
        points = np.column_stack([cones.X, cones.Y])
        np.savetxt(file, points, delimiter=",", header="X_m,Y_m", comments="")
        paths = {"slalom": str(file), "iso-3888-1": "iso-3888-1"}
        cases = []
        for seed, course, (tires, more) in product(seeds, COURSES, WAYS.values()):
            percent, place, farther = COURSES[course]
            words = (*more, "--mu-drop", f"{place + farther * seed:g}:{WET}")
            cases.append(Case(paths[course], share_of_limit(percent, 1.0), 1.0, tires, seed, words))
        for case, score in all_driven(cases):
            course = "slalom" if case.path == str(file) else case.path
            found[course, names[case.tires, case.more[:-2]]].append(score)
    for course, way in product(COURSES, WAYS):
        scores, key = found[course, way], f"{course}/{way}"
        lost, peak = sum(map(left, scores)), 100.0 * max(one.peak for one in scores)
        print(f"{key:34} {lost} of {len(scores)} left, rms {median_cm(scores):.1f} cm")
        targets.record(f"{key}/peak", peak)
        if "learning" in way or "caution" in way:
            targets.at_most(f"{key}: cars that left", lost, 0, "", key=f"{key}/left")
        else:
            targets.record(f"{key}/left", lost)
    return targets.finish(canary, keep=options.record)


if __name__ == "__main__":
    sys.exit(main())
