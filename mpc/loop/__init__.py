"""Driving a car along a path with a tracker, and what came of it."""

from mpc.loop.dither import Dither
from mpc.loop.drive import COMPLETED, LearningTires, PathTracker, drive
from mpc.loop.lateral import LateralVelocity, Localization, TellsLateral, Told
from mpc.loop.record import Drive, Plan, Scores, ToldScores, scores, told_scores
from mpc.loop.sensing import (
    CarSensors,
    FaultySensors,
    Measured,
    Measures,
    Preview,
    SpeedProfile,
    cornering_limit,
    imu_and_localization,
    inertial_unit,
)

__all__ = [
    "COMPLETED",
    "CarSensors",
    "Dither",
    "Drive",
    "FaultySensors",
    "LateralVelocity",
    "LearningTires",
    "Localization",
    "Measured",
    "Measures",
    "PathTracker",
    "Plan",
    "Preview",
    "Scores",
    "SpeedProfile",
    "TellsLateral",
    "Told",
    "ToldScores",
    "cornering_limit",
    "drive",
    "imu_and_localization",
    "inertial_unit",
    "scores",
    "told_scores",
]
