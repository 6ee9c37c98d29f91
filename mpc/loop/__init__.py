"""Driving a car along a path with a tracker, and what came of it."""

from mpc.loop.drive import COMPLETED, LearningTires, PathTracker, drive
from mpc.loop.record import Drive, Plan, Scores, scores
from mpc.loop.sensing import (
    CarSensors,
    FaultySensors,
    Measured,
    Measures,
    Preview,
    SpeedProfile,
    cornering_limit,
    inertial_unit,
)

__all__ = [
    "COMPLETED",
    "CarSensors",
    "Drive",
    "FaultySensors",
    "LearningTires",
    "Measured",
    "Measures",
    "PathTracker",
    "Plan",
    "Preview",
    "Scores",
    "SpeedProfile",
    "cornering_limit",
    "drive",
    "inertial_unit",
    "scores",
]
