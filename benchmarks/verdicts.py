"""Is the verdict right? 500 answers, clean and faulty: none that is far off may be called valid.

    python -m benchmarks.verdicts [--each N] [--first SEED] [--record]

A hundred answers to logs of random cars of each of four classes, and a hundred to parts of the
recordings, where they are there: a third with nothing wrong, a third with a beginning of any kind,
a third with faults of the log or of what is told. An answer is wrong above `WRONG` in an axle's
force on a drive with the same sensors, and right below `RIGHT` in both. Constants of the verdict
are chosen with `--first` below `FIRST_SEED`, where there are no recordings.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from benchmarks.answers import REFUSED, RIGHT, WRONG, Answer, answer, drawn
from benchmarks.fault_cases import Case, random_case
from benchmarks.random_cars import BEGINNINGS, CLASSES, FIRST_SEED, random_beginning
from benchmarks.recorded_cars import CARMAKER, DART, DATA
from benchmarks.targets import Targets, keeps, show
from models.recordings import Recording, read_recording
from models.vehicle import Vehicle

EACH, PER_CAR = 100, 5  # answers of each class and of recordings; of one plant car
OWN_SENSORS = {"r": "r_imu", "ay": "ay_imu", "vx": "vx_encoder"}  # 90 ms late, as they come
FREE = ("free_10_02_28", "free_10_12_05")
BY_CAMERA = (
    "free_10_01_01",
    "rubber_12_37_59",
    "ramp_steerneg025",
    "tape_tiles_steer_neg03",
    *FREE,
)
RUNS: tuple[tuple[str, Vehicle, tuple[str, ...], Mapping[str, str]], ...] = (
    ("carmaker.csv.gz", CARMAKER, ("slalom1_14_5ms", "experiment2_40kmh"), {}),
    ("dart.csv.gz", DART, ("ramp_steer02", *FREE), {}),
    ("dart_imu.csv.gz", DART, BY_CAMERA, {}),
    ("dart_imu.csv.gz", DART, BY_CAMERA, OWN_SENSORS),
)
LASTS, DRIVING = (20.0, 40.0), 0.6  # s; share of a part in which the car drives
PROCESSES = 2


class Judged(NamedTuple):
    """An answer: group of drives, seed, what was wrong, what came out, and if nothing was wrong."""

    group: str
    seed: int
    what: str
    found: Answer
    clean: bool = False


def plant_answers(job: tuple[str, int]) -> list[Judged]:
    """Return the answers of one random car: each drive with a fate of its own.

    Parameters
    ----------
    job : class of the car, and seed.
    """
    kind, seed = job
    found = []
    for k in range(PER_CAR):
        rng = np.random.default_rng([seed, k, *kind.encode()])
        fate = (PER_CAR * seed + k) % 3
        make = None
        if fate == 1:
            make = partial(random_beginning, str(rng.choice(BEGINNINGS)))
        drive = drawn(kind, seed, make, k)
        told = drive.car.told
        case = random_case(told, rng) if fate == 2 else Case()
        log = drive.log(rng)
        judged = drive.cornering(log) if fate == 1 else drive.exact
        what = str(case) if fate != 1 else f"beginning: {drive.beginning.kind}"
        result = answer(case.log(log), case.car(told), case.judged(judged))
        found.append(Judged(kind, seed, what, result, fate == 0))
    return found


@cache
def recordings() -> tuple[tuple[Recording, Vehicle], ...]:
    """Return every recording with its car, the 1:10 one by a camera and by its own sensors too.

    None where they are not there.
    """
    if not DATA.is_dir():
        return ()
    return tuple(
        (read_recording(DATA / file, run=run, check=False, columns=columns), car)
        for file, car, names, columns in RUNS
        for run in names
    )


def part_of(recording: Recording, car: Vehicle, rng: np.random.Generator) -> Recording:
    """Return a part of a recording in which the car drives most of the time; all of a short one.

    Parameters
    ----------
    recording : all of it.
    car : that drove.
    rng : source of randomness.
    """
    while True:
        lasts = rng.uniform(*LASTS)
        start = recording.t[0] + rng.uniform(0.0, max(recording.duration - lasts, 1e-9))
        part = recording.between(start, start + lasts)
        if np.mean(part.v_x > car.lowest_speed) >= DRIVING:
            return replace(part, t=part.t - part.t[0])


def recorded_answer(seed: int) -> Judged:
    """Return the answer to a part of a recording.

    Parameters
    ----------
    seed : of part and fault.
    """
    rng = np.random.default_rng([seed, 2])
    recording, car = recordings()[seed % len(recordings())]
    part = part_of(recording, car, rng)
    case = random_case(car, rng) if rng.integers(2) else Case()
    result = answer(case.log(part), case.car(car), case.judged(part))
    return Judged("recordings", seed, f"{recording.name}: {case}", result, case == Case())


def report(found: Sequence[Judged], targets: Targets) -> None:
    """Print tables, record their numbers and judge them.

    Parameters
    ----------
    found : all answers.
    targets : collects what is missed.
    """
    head = "answers  wrong  called valid  right  refused  at the door  valid in between"
    print(f"  {'group':14} {head}")
    everything = Counts(found)
    groups = {name: Counts([one for one in found if one.group == name]) for name in CLASSES}
    groups["plants"] = Counts([one for one in found if one.group in CLASSES])
    groups["recordings"] = Counts([one for one in found if one.group == "recordings"])
    for name, some in groups.items():
        if some.all:
            print(f"  {name:14} {some}")
            for key, value in some.numbers().items():
                targets.record(f"{name}/{key}", value)
    print(f"  {'all':14} {everything}")
    for key, value in everything.numbers().items():
        if key not in ("wrong_valid", "wrong_unsaid"):
            targets.record(key, value)
    for one in everything.wrong_valid:
        _show(one, "wrong and called valid")
    for one in everything.right_refused:
        _show(one, "right and refused")
    codes = Counter(code for one in everything.right_refused for code in one.found.codes)
    for code, number in codes.most_common():
        show(f"refused right answers: {code}", str(number))
        targets.record(f"right_refused_by/{code}", number)
    print("Targets")
    label = f"answers more than {WRONG:g} % wrong and called valid"
    targets.at_most(label, len(everything.wrong_valid), 0, "", "wrong_valid")
    label = "of these, answers of which the doctor says nothing"
    targets.at_most(label, len(everything.wrong_unsaid), 0, "", "wrong_unsaid")
    share = 100.0 * len(everything.right_refused) / max(len(everything.right), 1)
    targets.at_most(f"answers within {RIGHT:g} % and refused", share, 3.0, key="refused_share")
    for name in ("plants", "recordings"):
        if groups[name].right:
            share = 100.0 * len(groups[name].right_refused) / len(groups[name].right)
            targets.record(f"{name}/refused_share", share, "%")
    if not everything.right or not everything.wrong:
        targets.at_least("answers right, and wrong", 0.0, 1.0, "")  # nothing was judged


class Counts:
    """How many answers are right and wrong, and what the verdict said.

    Parameters
    ----------
    found : the answers; attributes all, wrong, wrong_valid, wrong_unsaid (of these, where the
        doctor says nothing), right, right_refused, clean_refused (of these, where nothing was
        wrong), right_alarmed (valid, but the doctor says something where nothing was wrong), door
        (logs not let in), between, between_valid.
    """

    def __init__(self, found: Sequence[Judged]) -> None:
        self.all = list(found)
        self.wrong = [one for one in found if one.found.wrong]
        self.wrong_valid = [one for one in self.wrong if one.found.valid]
        self.wrong_unsaid = [one for one in self.wrong_valid if not one.found.doctor]
        self.right = [one for one in found if one.found.right]
        self.right_refused = [one for one in self.right if not one.found.valid]
        self.clean_refused = [one for one in self.right_refused if one.clean]
        clean = [one for one in self.right if one.clean]
        self.right_alarmed = [one for one in clean if one.found.doctor]
        self.door = [one for one in found if REFUSED in one.found.codes]
        self.between = [one for one in found if not (one.found.wrong or one.found.right)]
        self.between_valid = [one for one in self.between if one.found.valid]

    def numbers(self) -> dict[str, int]:
        """Return how many there are of each, by name; all of them as `answers`."""
        named = {"answers" if key == "all" else key: some for key, some in vars(self).items()}
        return {key: len(some) for key, some in named.items()}

    def __str__(self) -> str:
        """Return them as a row."""
        between = f"{len(self.between_valid)} of {len(self.between)}"
        return (
            f"{len(self.all):7}{len(self.wrong):7}{len(self.wrong_valid):14}{len(self.right):7}"
            f"{len(self.right_refused):9}{len(self.door):13}{between:>18}"
        )


def _show(one: Judged, what: str) -> None:
    error = f"{one.found.error[0]:.1f} / {one.found.error[1]:.1f} %"
    said = [*one.found.codes, *(f"doctor: {finding}" for finding in one.found.doctor)]
    show(f"{what}: {one.group} {one.seed}", f"{error}, {one.what}  {', '.join(said)}")


def main() -> int:
    """Run everything; return the exit code."""
    keep = keeps()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=EACH, help="answers of each group")
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="seed")
    options, targets = parser.parse_args(), Targets("verdicts")
    seeds = range(options.first, options.first + max(options.each // PER_CAR, 1))
    jobs = [(kind, seed) for seed in seeds for kind in CLASSES]
    held_out = options.first >= FIRST_SEED
    parts = range(options.first, options.first + options.each) if held_out else range(0)
    if held_out and not recordings():
        print(f"  without recordings: they are not there: {DATA} (set TIREID_DATA)")
        parts = range(0)
    with ProcessPoolExecutor(PROCESSES) as pool:
        found = [one for some in pool.map(plant_answers, jobs) for one in some]
        found += pool.map(recorded_answer, parts)
    report(found, targets)
    everything = options.each == EACH and options.first == FIRST_SEED and len(parts) > 0
    return targets.finish(keep=keep and everything)


if __name__ == "__main__":
    sys.exit(main())
