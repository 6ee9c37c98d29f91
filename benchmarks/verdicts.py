"""Is the verdict right? Answers to clean and faulty logs: no bad model may be accepted.

    python -m benchmarks.verdicts [--quick] [--record]

With v_y: sixty answers to logs of random cars of each of four classes, and sixty to parts of the
recordings, where they are there: a third with nothing wrong, a third with a beginning of any
kind, a third with faults of the log or of what is declared. Without v_y: drives on banked roads
with what inertial sensors add; the first part of each is identified, the rest evaluated, with the
same sensors; beside each clean log stands one with a fault. A model is bad above `WRONG` in an
axle's force on the evaluated drive, and good below `RIGHT` in both.

Beside these, other logs: every log of `benchmarks.estimate` identifies tires, every other of that
car asks for the verdict on them, as they are and with something planted: another friction, another
stiffness of one axle, swapped axles, a center of gravity or a steering ratio that is wrong.
Constants of the verdict were chosen on seeds below `FIRST_SEED`, without recordings.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from itertools import product
from operator import methodcaller
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.answers import RIGHT, WRONG, Answer, answer, blind, force_error
from benchmarks.estimate import PLACES, of_random_cars
from benchmarks.fault_cases import Case, random_case
from benchmarks.faults import Late, SwappedAxles, WrongNumber
from benchmarks.random_cars import (
    BEGINNINGS,
    CLASSES,
    FIRST_SEED,
    drawn,
    inertial_drive,
    random_beginning,
)
from benchmarks.recorded_cars import CARMAKER, DART, DATA, OWN
from benchmarks.targets import Table, Targets, Values, parse, show
from identifier.estimate.model import FittedModel
from identifier.estimate.priors import Priors
from identifier.motion.parameters import INDEX, curve_index
from identifier.tire_model import TireModel
from models.faults import SensorFault
from models.recordings import Recording, Repair, read_recording
from models.vehicle import Vehicle

EACH, PER_CAR = 60, 5  # answers of each class and of recordings; of one plant car
FREE = ("free_10_02_28", "free_10_12_05")
BY_CAMERA = (
    "free_10_01_01", "rubber_12_37_59", "ramp_steerneg025", "tape_tiles_steer_neg03", *FREE,
)  # fmt: skip
RUNS: tuple[tuple[str, Vehicle, tuple[str, ...], Mapping[str, str]], ...] = (
    ("carmaker.csv.gz", CARMAKER, ("slalom1_14_5ms", "experiment2_40kmh"), {}),
    ("dart.csv.gz", DART, ("ramp_steer02", *FREE), {}),
    ("dart_imu.csv.gz", DART, BY_CAMERA, {}),
    ("dart_imu.csv.gz", DART, BY_CAMERA, OWN),
)
LASTS, DRIVING = (20.0, 40.0), 0.6  # s; share of a part in which the car drives

# Without v_y.
DRIVES, FIRST = 10, 7000  # of each class; first seed
SHARE = 0.7  # of a drive, that is identified
SCALES = (0.8, 1.25)  # of a channel
LATE = (0.05, 0.1)  # s
INERTIA = (0.4, 2.5)  # times the declared yaw inertia
SCALED, DELAYED = ("v_x", "r", "delta_f", "a_y"), ("r", "delta_f", "a_y")
FAULTS = (*(f"{name} scaled" for name in SCALED), *(f"{name} late" for name in DELAYED),
          "yaw inertia", "l_f and l_r swapped")  # fmt: skip


class Judged(NamedTuple):
    """An answer: group of drives, seed, what was wrong, and what came out."""

    group: str
    seed: int
    what: str
    found: Answer


def plant_answer(kind: str, seed: int, k: int) -> Judged:
    """Return the answer to one drive of a random car: each has a fate of its own.

    Parameters
    ----------
    kind : class of the car.
    seed : of the car.
    k : of the drive.
    """
    rng = np.random.default_rng([seed, k, *kind.encode()])
    fate = (PER_CAR * seed + k) % 3
    make = None
    if fate == 1:
        make = partial(random_beginning, str(rng.choice(BEGINNINGS)))
    drive = drawn(kind, seed, make, k)
    declared_one = drive.car.declared
    case = random_case(declared_one, rng) if fate == 2 else Case()
    log = drive.log(rng)
    judged = drive.cornering(log) if fate == 1 else drive.exact
    what = str(case) if fate != 1 else f"beginning: {drive.beginning.kind}"
    result = answer(case.log(log), case.car(declared_one), case.judged(judged))
    return Judged(kind, seed, what, result)


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
    return Judged("recordings", seed, f"{recording.name}: {case}", result)


def blind_fault(fault: str, rng: np.random.Generator) -> Case:
    """Return a fault of a size that is drawn.

    Parameters
    ----------
    fault : one of `FAULTS`, or empty.
    rng : source of the size.
    """
    channel, _, what = fault.partition(" ")
    if what == "scaled":
        return Case(SensorFault(channel=channel, kind="scaled", size=rng.choice(SCALES)))
    if what == "late":
        return Case(Late(channels=(channel,), delay=rng.choice(LATE)))
    if fault == "yaw inertia":
        return Case(told=WrongNumber(field="yaw_inertia", factor=rng.choice(INERTIA)))
    return Case(told=SwappedAxles()) if fault else Case()


def blind_answers(job: tuple[str, int]) -> list[Judged]:
    """Return what is answered to a drive without v_y, clean and with a fault.

    Parameters
    ----------
    job : class of the car, and seed.
    """
    kind, seed = job
    drive, rng = inertial_drive(kind, seed), np.random.default_rng(seed)
    own = replace(drive.shown, v_y=None, axle_force=drive.exact.axle_force)
    own, car = Repair(acceleration_sensor_x=drive.position[0]).apply(own, drive.declared)
    found = []
    for fault in ("", str(rng.choice(FAULTS))):
        case = blind_fault(fault, rng)
        log, known = case.log(own), case.car(car)
        end = float(log.t[0]) + SHARE * log.duration
        result = answer(log.between(log.t[0], end), known, log.between(end, log.t[-1]))
        group = "without v_y, faulty" if fault else "without v_y, clean"
        found.append(Judged(group, seed, f"{kind} {fault}", result))
    return found


class Pair(NamedTuple):
    """A log that identified tires of a car, and one that asks about them."""

    place: str
    car: Vehicle
    log: Recording
    other: Recording
    since: float


def pairs(*, quick: bool) -> list[Pair]:
    """Return all pairs; of random cars those of a full drive.

    Parameters
    ----------
    quick : one of each place.
    """
    found = []
    for part, drives in PLACES.items():
        if part != "random" and not DATA.is_dir():
            continue
        of_place = of_random_cars(1) if quick and part == "random" else drives()
        for place, tasks in of_place.items():
            if place in ("gentle", "step"):
                continue
            some = [
                Pair(place, one.car, one.log, other, one.since)
                for one in tasks
                for others in one.asked
                for other in others
            ]
            found += some[:1] if quick else some
    return found


def _as_stiff(tire: TireModel, axle: str, times: float) -> TireModel:
    """Return tires so many times as stiff at an axle, within their bounds."""
    assert isinstance(tire, FittedModel)
    p, beliefs = tire.p.copy(), Priors.of(tire.vehicle)
    p[INDEX[f"ln_stiffness_{axle}"]] += np.log(times)
    return replace(tire, p=np.clip(p, beliefs.low, beliefs.high))


def _swapped(tire: TireModel) -> TireModel:
    assert isinstance(tire, FittedModel)
    p = tire.p.copy()
    p[[*curve_index("f")[:-1], *curve_index("r")[:-1]]] = tire.p[
        [*curve_index("r")[:-1], *curve_index("f")[:-1]]
    ]
    return replace(tire, p=p)


PLANTED: Mapping[str, Callable[[TireModel], TireModel]] = {
    **{f"friction x {ratio:g}": methodcaller("at_friction", ratio) for ratio in (0.5, 0.7, 1.3)},
    **{
        f"stiffness {axle} x {times:g}": partial(_as_stiff, axle=axle, times=times)
        for axle in "fr"
        for times in (0.7, 1.42)
    },
    "swapped axles": _swapped,
}
GROUPS = ("nothing", "friction", "stiffness", "swapped axles", "center of gravity", "ratio")
CENTER, RATIOS = (-0.1, 0.1), (0.8, 1.25)  # wheelbases; of the steering


def pair_answers(job: tuple[Pair, bool]) -> list[Judged]:
    """Return the verdicts of a log on tires of another, as they are and with something planted.

    Parameters
    ----------
    job : the pair, and whether something is planted.
    """
    (place, car, log, other, since), planted = job
    asked = other.between(since, float(other.t[-1])) if since > other.t[0] else other

    def judged(what: str, tire: TireModel, asked: Recording = asked) -> Judged:
        verdict = ti.replay(blind(asked), tire).verdict
        codes = tuple(one.code for one in verdict.findings if one.refuses)
        found = Answer(force_error(tire, asked), verdict.valid, codes)
        return Judged(f"planted: {what}", 0, f"{place} {log.name} -> {other.name}", found)

    def taught(log: Recording, car: Vehicle) -> TireModel:
        return ti.identify(blind(log), car, check=False).freeze()

    tire = taught(log, car)
    found = [judged("nothing", tire)]
    if not planted:
        return found
    for what, change in PLANTED.items():
        found.append(judged(next(one for one in GROUPS if what.startswith(one)), change(tire)))
    for share in CENTER:
        moved = share * car.wheelbase
        declared_one = replace(car, l_f=car.l_f + moved, l_r=car.l_r - moved)
        found.append(judged("center of gravity", taught(log, declared_one)))
    for ratio in RATIOS:
        tire = taught(replace(log, delta_f=ratio * log.delta_f), car)
        alike = replace(asked, delta_f=ratio * asked.delta_f)
        found += [judged("ratio", tire), judged("ratio", tire, alike)]
    return found


def report(found: Sequence[Judged], targets: Targets) -> None:
    """Print the counts of each group of answers, and record them.

    Parameters
    ----------
    found : all answers.
    targets : records.
    """
    for name in dict.fromkeys(one.group for one in found):
        some = [one for one in found if one.group == name]
        bad, good = (
            [one for one in some if getattr(one.found, what)] for what in ("wrong", "right")
        )
        accepted = [one for one in bad if one.found.valid]
        rejected = [one for one in good if not one.found.valid]
        silent = [one for one in accepted if not one.found.doctor]
        counts = {"answers": some, "bad": bad, "accepted": accepted, "silent": silent,
                  "good": good, "rejected": rejected}  # fmt: skip
        show(name, ", ".join(f"{len(which)} {what}" for what, which in counts.items()))
        for what, which in counts.items():
            targets.record(f"{name}/{what}", len(which))
        for what, which in (("bad, accepted", accepted), ("good, rejected", rejected)):
            for one in which:
                error = f"{one.found.error[0]:.1f} / {one.found.error[1]:.1f} %"
                said = ", ".join((*one.found.codes, *one.found.doctor))
                show(f"  {what}: {name} {one.seed}", f"{error}, {one.what}  {said}")


def judge(targets: Targets) -> None:
    """Judge the counts of all groups with v_y, and without.

    Parameters
    ----------
    targets : of `report`.
    """
    for way, some in WAYS.items():
        total = {
            what: sum(int(targets.values.get(f"{name}/{what}", 0)) for name in some)
            for what in COUNTS
        }
        targets.at_most(f"{way}: bad models accepted", total["accepted"], 0, "")
        share = 100.0 * total["rejected"] / max(total["good"], 1)
        targets.at_most(f"{way}: good models rejected", share, 3.0)
        for what, count in total.items():
            targets.record(f"{way}/{what}", count)
    wrong = sum(int(targets.values.get(f"planted: {one}/accepted", 0)) for one in GROUPS)
    targets.at_most("other logs: bad models accepted, planted or not", wrong, 0, "")
    right = [int(targets.values[f"planted: nothing/{what}"]) for what in ("rejected", "good")]
    targets.at_most("other logs: good rejected", 100.0 * right[0] / max(right[1], 1), 1.0)
    silent = int(targets.values["with v_y/silent"])
    targets.at_most("with v_y: bad models accepted, and no finding of the doctor", silent, 0, "")


COUNTS = ("answers", "bad", "accepted", "silent", "good", "rejected")
BLIND = ("without v_y, clean", "without v_y, faulty")
WAYS = {"with v_y": (*CLASSES, "recordings"), "without v_y": BLIND}


def canary() -> Values:
    """Return answers to a clean and to a faulty log of one random car."""
    found = {k: plant_answer("sedan", FIRST_SEED + 2, k).found for k in (0, 2)}
    errors = {f"{k}/error": one.worse for k, one in found.items()}
    return {**errors, **{f"{k}/valid": one.valid for k, one in found.items()}}


def tables(v: Values) -> dict[str, Table]:
    """Return the table of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    rows = [
        [name, *(f"{v[f'{name}/{what}']}" for what in COUNTS)]
        for name in (*CLASSES, "recordings", "with v_y", *BLIND)
    ]
    header = (
        "logs", "answers", f"bad models (error above {WRONG:g} %)", "of these accepted",
        "and no finding of the doctor", f"good models (below {RIGHT:g} %)", "of these rejected",
    )  # fmt: skip
    planted = [
        [name, *(f"{v[f'planted: {name}/{what}']}" for what in COUNTS if what != "silent")]
        for name in GROUPS
    ]
    return {
        "verdicts": Table(header, rows),
        "verdicts/planted": Table(
            ("what was planted; verdict of another log", *header[1:4], *header[5:]), planted
        ),
    }


def main() -> int:
    """Run everything; return the exit code."""
    targets, options = Targets("verdicts"), parse("verdicts", __doc__)
    each, drives = (PER_CAR, 1) if options.quick else (EACH, DRIVES)
    classes = list(CLASSES)[: 1 if options.quick else None]
    seeds = range(FIRST_SEED, FIRST_SEED + each // PER_CAR)
    jobs = product(classes, seeds, range(PER_CAR))
    first = (FIRST + len(CLASSES) * k for k in range(drives))
    blind_jobs = [(kind, seed + i) for seed in first for i, kind in enumerate(classes)]
    first_of: set[int] = set()
    asked = []
    for one in pairs(quick=options.quick):  # planted is in the first log that asks of each
        asked.append((one, id(one.log) not in first_of))
        first_of.add(id(one.log))
    parts = range(FIRST_SEED, FIRST_SEED + each) if recordings() else range(0)
    if not recordings():
        print(f"  without recordings: they are not there: {DATA} (set TIREID_DATA)")
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(plant_answer, *zip(*jobs, strict=True)))
        found += pool.map(recorded_answer, parts)
        found += [one for some in pool.map(blind_answers, blind_jobs) for one in some]
        found += [one for some in pool.map(pair_answers, asked) for one in some]
    report(found, targets)
    judge(targets)
    return targets.finish(canary, keep=options.record and bool(recordings()))


if __name__ == "__main__":
    sys.exit(main())
