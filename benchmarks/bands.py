"""Do bands hold? Coverage of true forces by bands of 90 % on drives that were not identified.

    python -m benchmarks.bands [--quick] [--record]

The default on one log and on two, the axle identifier on one, as `run.tire` gives them; then
another drive: a sample is covered where the true force lies in the band around the force of the
frozen model, whether its slip was identified or not. Random cars are those of `estimate`; where the
recordings are there, CarMaker, five parts of a race car's drive, a hatchback on two days, and a
real 1:10 car on two floors.
The width is half the band over the rms error, the median of drives; a normal error would have 1.64.
"""

import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import combinations, pairwise, permutations, product
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.estimate import CORNER, FLOORS, SLOW, drives_of, random_cars, read
from benchmarks.random_cars import FIRST_SEED
from benchmarks.recorded_cars import CARMAKER, CARMAKER_RUNS, DART, DATA, FERRARI, GTI, GTI_RUNS
from benchmarks.targets import Table, Targets, Values, parse, show
from identifier.estimate.fit import fit
from identifier.methods import DEFAULT, LIVE, make_method
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle

LEVEL = 0.9
LEAST = {DEFAULT: 87.0, LIVE: 80.0}  # % that a band must cover
MOST = 93.0  # % that it shall not exceed
PLACES = ("random", "carmaker", "ferrari", "gti", "dart", "rubber")
CASES = {f"{DEFAULT}/1": "default, one log", f"{DEFAULT}/2": "default, two logs",
         f"{LIVE}/1": "axle identifier, one log"}  # fmt: skip


class Case(NamedTuple):
    """What is identified and what is evaluated, from a time [s] and from a speed [m/s] on."""

    place: str
    car: Vehicle
    logs: Sequence[Recording]
    others: Sequence[Recording]
    since: float = 0.0
    slow: float = 0.0


def cases(*, quick: bool) -> Iterator[Case]:
    """Yield what is identified and evaluated.

    Parameters
    ----------
    quick : random cars alone, one of each class.
    """
    for one in random_cars(count=1) if quick else random_cars():
        first, second = one.others
        full = one.teach["full"]
        yield Case("random", one.declared, [full], [first], CORNER)
        yield Case("random", one.declared, [full, first], [second], CORNER)
    if quick or not DATA.is_dir():
        return
    runs = read("carmaker.csv.gz", CARMAKER_RUNS)
    halves = []
    for run in runs:
        middle = 0.5 * float(run.t[0] + run.t[-1])
        halves.append((run.between(run.t[0], middle), run.between(middle, run.t[-1])))
    for a, b in ((0, 1), (1, 0)):
        yield Case("carmaker", CARMAKER, [one[a] for one in halves], [one[b] for one in halves])
    days = read("gti.csv.gz", GTI_RUNS)
    for place, car, pair in (("carmaker", CARMAKER, runs), ("gti", GTI, days)):
        for log, other in permutations(pair):
            yield Case(place, car, [log], [other])
    whole = read_recording(DATA / "ferrari.csv.gz")
    edges = np.linspace(float(whole.t[0]), float(whole.t[-1]), 6)
    laps: Sequence[Recording] = [whole.between(a, b) for a, b in pairwise(edges)]
    groups = {"ferrari": (FERRARI, laps, 0.0)}
    groups |= {place: (DART, read(*FLOORS[place]), SLOW) for place in FLOORS}
    for place, (car, drives, slow) in groups.items():
        for count in (1, 2):
            for logs in combinations(drives, count):
                others = [one for one in drives if not any(one is log for log in logs)]
                yield Case(place, car, logs, others, 0.0, slow)


def held(case: Case) -> list[tuple[str, float, float]]:
    """Return method, share of samples in the band [%], and half its width over the error.

    Parameters
    ----------
    case : what is identified and evaluated.
    """
    tires: dict[str, ti.TireModel] = {DEFAULT: fit(case.logs, case.car).model}
    if len(case.logs) == 1:
        method = make_method(LIVE, case.car)
        tires[LIVE] = ti.identify(case.logs[0], case.car, method, check=False).tire
    found = []
    for (name, tire), other in product(tires.items(), case.others):
        if tire.band is None or other.axle_force is None:
            continue
        counts = (other.t >= case.since) & (other.v_x >= max(case.slow, tire.min_speed))
        away = np.abs(tire.predict(other) - other.axle_force)[counts]
        half = tire.band.over(other, LEVEL)[counts]
        width = half.mean(axis=0) / np.sqrt(np.mean(away**2, axis=0))
        share = 100.0 * float(np.mean(away <= half))
        found.append((f"{name}/{len(case.logs)}", share, float(width.mean())))
    return found


def canary() -> Values:
    """Return share and width of the bands of one random car."""
    one = drives_of("sedan", FIRST_SEED)
    found = held(Case("random", one.declared, [one.teach["full"]], one.others[:1], CORNER))
    return {f"{key}/{i}": value for key, *some in found for i, value in enumerate(some)}


def tables(v: Values) -> dict[str, Table]:
    """Return the table of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    heads = ("random cars", "CarMaker", "race car", "hatchback", "1:10 car", "1:10 car on rubber")
    rows = []
    for case, words in CASES.items():
        for key, what, decimals in (
            ("held", "coverage [%]", 0),
            ("width", "half width / error", 1),
        ):
            places = [f"{place}/{case}/{key}" for place in PLACES]
            cells = [f"{v[one]:.{decimals}f}" if one in v else "" for one in places]
            rows.append([f"{words}: {what}", *cells])
    return {"bands": Table(("band of 90 %", *heads), rows)}


def main() -> int:
    """Run everything; return the exit code."""
    targets, options = Targets("bands"), parse("bands", __doc__)
    every = list(cases(quick=options.quick))
    found: dict[str, list[tuple[float, float]]] = defaultdict(list)
    with ProcessPoolExecutor() as pool:
        for case, answers in zip(every, pool.map(held, every), strict=True):
            for name, share, width in answers:
                found[f"{case.place}/{name}"].append((share, width))
    for key, some in found.items():
        share, (place, way) = float(np.mean([one for one, _ in some])), key.split("/", 1)
        label, method = f"{place}, {CASES[way]}: coverage", way.split("/")[0]
        targets.at_least(label, share, LEAST[method], key=f"{key}/held")
        if method == DEFAULT:
            targets.at_most(label, share, MOST)
        width = float(np.median([one for _, one in some]))
        targets.record(f"{key}/width", width)
        show(f"{key}: half width over rms error, median", f"{width:.2f}")
    return targets.finish(canary, keep=options.record and DATA.is_dir())


if __name__ == "__main__":
    sys.exit(main())
