"""A verdict with every answer: is it good, what speaks against it, and why."""

from identifier.verdict.bands import calibrated, within_band
from identifier.verdict.friction import Road, RoadFriction, road_friction
from identifier.verdict.judging import (
    friction_of,
    judge,
    judge_identification,
    judge_prediction,
)
from identifier.verdict.verdict import Number, Objection, Verdict, WindowForces

__all__ = [
    "Number", "Objection", "Road", "RoadFriction", "Verdict", "WindowForces", "calibrated",
    "friction_of", "judge", "judge_identification", "judge_prediction", "road_friction",
    "within_band",
]  # fmt: skip
