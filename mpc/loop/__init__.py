"""Driving a car along a path with a tracker, and what came of it."""

from mpc.loop.drive import COMPLETED, Learner, drive
from mpc.loop.limit import cornering_limit
from mpc.loop.profile import Preview, SpeedProfile
from mpc.loop.record import Drive, Plan
from mpc.loop.scores import Scores, scores
from mpc.loop.sensing import CarSensors, FaultySensors, Measured, Measures, inertial_unit
from mpc.loop.tracking import PathTracker

__all__ = [
    "COMPLETED",
    "CarSensors",
    "Drive",
    "FaultySensors",
    "Learner",
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
