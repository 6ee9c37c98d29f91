"""Maneuvers that teach most: what the axle identifier does not know yet, within an area."""

from identifier.plan.motion import hold_of
from identifier.plan.plan import Plan, Rehearsal, Rival, make_plan
from identifier.plan.rehearsal import rehearse
from identifier.plan.search import Pass, PlanError, Space
from identifier.plan.tires import STEERING_LAG, PlausibleTires

__all__ = [
    "STEERING_LAG", "Pass", "Plan", "PlanError", "PlausibleTires", "Rehearsal", "Rival", "Space",
    "hold_of", "make_plan", "rehearse",
]  # fmt: skip
