"""A verdict with every answer: is it good, what speaks against it, and why."""

from identifier.verdict.bands import calibrated, within_band
from identifier.verdict.judging import judge, judge_prediction
from identifier.verdict.verdict import Number, Objection, Verdict

__all__ = [
    "Number",
    "Objection",
    "Verdict",
    "calibrated",
    "judge",
    "judge_prediction",
    "within_band",
]
