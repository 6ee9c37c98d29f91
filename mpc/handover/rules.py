"""When learnt weights are handed over: the numbers, and what a decision says."""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from models.rules import require_positive_fields


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """Times and evidence of handing over.

    Evidence is a difference of chi-squares, -2 ln of a ratio of likelihoods: 8 is one in 50.
    every : time between two looks at the friction [s].
    learnt_every : time between two looks at what was learnt [s].
    seconds : that a learnt tire must explain better than the one in use [s].
    evidence : by which it must [-].
    least_seconds : of these seconds there must be at least [s]; after a change of friction too.
    learning_time : with slip at both axles before anything is handed over [s].
    last_moments : what tells that the friction has changed [s].
    wrong : mean chi-square of the last moments, over its baseline, from which on a friction is
        looked for [-].
    friction_evidence : by which a lower friction must explain the last moments better [-].
    recovery_seconds, recovery_evidence : the same for a higher one, which can wait: a car that
        believes in too little grip is only slow to turn.
    follow : time for which a new friction is corrected as more is seen of it [s].
    correction : evidence that is enough for that [-].
    baseline_time : over which the baseline of chi-squares is averaged [s].
    revoke : what was handed over this long before the sensors were found to disagree is taken back
        [s].
    relapse : what was learnt or handed over since they were believed again is taken back too, where
        that was less than this before [s].
    blend, quick_blend : time in which weights move to those handed over [s], for a learnt tire and
        for another friction.
    jump, quick_jump : largest change of the planned steering rate by such a move [rad/s].
    """

    every: float = 0.05
    learnt_every: float = 0.2
    seconds: float = 3.0
    evidence: float = 4.0
    least_seconds: float = 1.0
    learning_time: float = 1.0
    last_moments: float = 0.2
    wrong: float = 1.5
    friction_evidence: float = 8.0
    recovery_seconds: float = 0.6
    recovery_evidence: float = 16.0
    follow: float = 2.0
    correction: float = 2.0
    baseline_time: float = 10.0
    revoke: float = 1.0
    relapse: float = 10.0
    blend: float = 0.4
    quick_blend: float = 0.08
    jump: float = 0.05
    quick_jump: float = 0.2

    def __post_init__(self) -> None:
        require_positive_fields(self)


class Verdict(Enum):
    """What is done with the weights."""

    KEEP = "keep"
    LEARNT = "learnt tire"
    FRICTION = "friction lost"
    CORRECTION = "friction corrected"
    RECOVERY = "friction regained"
    FAULT = "sensor fault"


class Decision(NamedTuple):
    """What was decided at a time [s] and why.

    friction : of the candidate over that of the tire that it was scaled from [-]; 1 for others.
    """

    t: float
    verdict: Verdict
    reason: str
    friction: float = 1.0
