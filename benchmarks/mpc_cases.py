"""Cases of the driving benchmarks: what `tireid drive` does with the words that a user would type.

Every case is parsed by the parser of the command and run by the functions behind it, with its
defaults: its drive to learn on, its methods, its tracker, its noise and 20 ms of delay. What a
benchmark adds are words only; the seed changes the noise and the drive to learn on.
"""

import argparse
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

from identifier.tire_model import TireModel
from tireid.cli import build_parser
from tireid.commands.drive_case import conditions_of, frozen_tires
from tireid.driving.runs import FROZEN, LINEAR, ORACLE, Conditions, Run, run_drive

LABELS = {"linear": LINEAR, "paper": FROZEN, "axle": FROZEN, "oracle": ORACLE}
TIRES = tuple(LABELS)


class Case(NamedTuple):
    """One drive: path by name, share of the limit of grip, friction, tires, seed."""

    path: str
    share: float
    mu: float
    tires: str
    seed: int

    @property
    def words(self) -> list[str]:
        """What a user types after `tireid drive`."""
        return [
            *("--path", self.path, "--speed", f"{100.0 * self.share:g}%", "--mu", f"{self.mu:g}"),
            *("--tires", LABELS[self.tires], "--seed", str(self.seed)),
            *(["--paper"] if self.tires == "paper" else []),
        ]


def options_of(words: Sequence[str]) -> argparse.Namespace:
    """Return what the command makes of its words.

    Parameters
    ----------
    words : after `tireid drive`, but for the folder, which nobody writes here.
    """
    line = ["drive", *words, "--film", "none", "--out", "nowhere"]
    return build_parser(line).parse_args(line)


def run(case: Case) -> Run:
    """Drive a case.

    Parameters
    ----------
    case : what to drive.
    """
    conditions = conditions_of(options_of(case.words))
    label, learnt = LABELS[case.tires], None
    if label == FROZEN:
        learnt = learnt_before(case.mu, case.seed, paper=case.tires == "paper")
    return run_drive(label, conditions, learnt)


@cache
def learnt_before(mu: float, seed: int, *, paper: bool = False, caution: float = 0.0) -> TireModel:
    """Return what the command learns before it drives: the same on every path.

    Parameters
    ----------
    mu : friction.
    seed : of noise and steering.
    paper : by the network and the law of the paper.
    caution : of the drive; with it the band of the forces is calibrated.
    """
    words = ["--mu", f"{mu:g}", "--seed", str(seed), "--caution", f"{caution:g}"]
    words += ["--paper"] if paper else []
    options = options_of(words)
    _, learnt = frozen_tires(options, [FROZEN], conditions_of(options))
    assert learnt is not None
    return learnt


def drive_with(conditions: Conditions, label: str) -> Run:
    """Drive conditions that have no word of their own on what is learnt on the dry road.

    Parameters
    ----------
    conditions : path, car, road and seed.
    label : of `tireid.driving.runs.TIRES`.
    """
    setup, seed, caution = conditions.setup, conditions.seed, conditions.caution
    known = label in (LINEAR, ORACLE)
    learnt = None if known else learnt_before(setup.mu, seed, caution=caution)
    return run_drive(label, conditions, learnt)
