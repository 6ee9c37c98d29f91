"""A verdict with every answer: is it good, what speaks against it, and why."""

from identifier.verdict.judging import judge, judge_prediction
from identifier.verdict.verdict import Finding, Number, Verdict

__all__ = ["Finding", "Number", "Verdict", "judge", "judge_prediction"]
