"""Cases of the driving benchmarks: what `tireid drive` does with the words that a user would type.

Every case is parsed by the parser of the command and run by the functions behind it, with its
defaults: its identification drive, its methods, its tracker, its noise and 20 ms of delay. The seed
changes the noise and the identification drive.
"""

import argparse
from collections.abc import Hashable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from typing import NamedTuple, cast

import numpy as np

from identifier.tire_model import TireModel
from models.friction import Friction
from models.maneuvers import StepSteer
from models.plant import Plant
from models.tires import Tire
from models.vehicle import GRAVITY, Vehicle, sedan
from tireid.cli import build_parser
from tireid.commands.drive import conditions_of, frozen_tires
from tireid.driving.runs import FROZEN, LEARNING, LINEAR, ORACLE, run_drive

_RAMP_TIME = 20.0  # s
_RAMP_SPEED = 20.0  # m/s
_LARGEST_ANGLE = 0.3  # rad at friction 1: beyond the peak of any tire for the road
TIRES = {"linear": LINEAR, "paper": FROZEN, "axle": FROZEN, "learning": LEARNING, "oracle": ORACLE}


class Case(NamedTuple):
    """One drive: path by name, speed, friction, tires of `TIRES`, seed, and more words."""

    path: str
    speed: str
    mu: float
    tires: str
    seed: int
    more: tuple[str, ...] = ()


class Score(NamedTuple):
    """Rms and peak deviation from the path [m], whether completed, periods without a new plan."""

    rms: float
    peak: float
    completed: bool
    failures: int


def cornering_limit(
    vehicle: Vehicle, tire: Tire | None = None, mu: float = 1.0, rear_tire: Tire | None = None
) -> float:
    """Return the largest steady lateral acceleration [m/s^2]; no speed of a drive may see it.

    The car is steered more and more at constant speed. The driven axle also holds the speed against
    the drag of cornering, so that this lies a few per cent below what tires give sideways alone.

    Parameters
    ----------
    vehicle : with a chassis.
    tire : of the wheels; None reads the file named by the chassis.
    mu : friction of the road over that of the tire's measurement [-].
    rear_tire : of the two rear wheels, where they have another.
    """
    return _steady_limit(vehicle, cast(Hashable, tire), mu, cast(Hashable, rear_tire))


@cache
def _steady_limit(vehicle: Vehicle, tire: Hashable, mu: float, rear_tire: Hashable) -> float:
    """Drive the ramp once for each car and road: setting up a drive asks a dozen times."""
    rate = _LARGEST_ANGLE * mu / _RAMP_TIME
    ramp = StepSteer(amplitude=_LARGEST_ANGLE * mu, rate_limit=rate, onset=0.1, duration=_RAMP_TIME)
    plant = Plant(vehicle, cast(Tire | None, tire), rear_tire=cast(Tire | None, rear_tire))
    run = plant.simulate(ramp, speed=_RAMP_SPEED, friction=Friction(scale=mu))
    return float(np.abs(run.a_y).max())


def share_of_limit(percent: float, mu: float) -> str:
    """Return `--speed` for a share of the sedan's largest lateral acceleration in steady turning.

    Parameters
    ----------
    percent : of it.
    mu : friction.
    """
    return f"{0.01 * percent * cornering_limit(sedan(), None, mu) / GRAVITY:.4g}g"


def options_of(case: Case) -> argparse.Namespace:
    """Return what the command makes of the words of a case, which writes no folder here."""
    words = ["--path", case.path, "--speed", case.speed, "--mu", f"{case.mu:g}"]
    words += ["--tires", TIRES[case.tires], "--seed", str(case.seed), *case.more]
    words += ["--paper"] * (case.tires == "paper")
    line = ["drive", *words, "--out", "nowhere"]
    return build_parser(line).parse_args(line)


def driven(case: Case) -> Score:
    """Return what became of a drive."""
    label, learnt = TIRES[case.tires], None
    if label in (FROZEN, LEARNING):
        learnt = identified(case.mu, case.seed, case.tires == "paper", "--caution" in case.more)
    found = run_drive(label, conditions_of(options_of(case)), learnt).scores
    bad = sum(found.failures.values())
    return Score(found.rms_e_y_m, found.peak_e_y_m, found.completed, bad)


@cache
def identified(mu: float, seed: int, paper: bool, caution: bool) -> TireModel:
    """Return what the command identifies before it drives: the same on every path.

    Parameters
    ----------
    mu : friction.
    seed : of noise and steering.
    paper : by the network and the law of the paper.
    caution : with it the band of the forces is calibrated.
    """
    more = ("--caution", "1") if caution else ()
    options = options_of(Case("slalom", "0.4g", mu, "paper" if paper else "axle", seed, more))
    _, model = frozen_tires(options, [FROZEN], conditions_of(options))
    assert model is not None
    return model


def all_driven(cases: Sequence[Case]) -> Iterator[tuple[Case, Score]]:
    """Yield what became of each drive, on all cores; those of one seed and friction together.

    Parameters
    ----------
    cases : to drive.
    """
    ordered = sorted(cases, key=lambda case: (case.mu, case.seed))
    same = sum((one.mu, one.seed) == (ordered[0].mu, ordered[0].seed) for one in ordered)
    with ProcessPoolExecutor() as pool:
        yield from zip(ordered, pool.map(driven, ordered, chunksize=same), strict=True)


def median_cm(scores: Sequence[Score]) -> float:
    """Return the median rms deviation [cm]."""
    return 100.0 * float(np.median([one.rms for one in scores]))
