"""A car steered along a path by a tracker that is told of some tires; a drive to learn them on."""

from tireid.driving.learn import learning_drive, sample_recording
from tireid.driving.runs import Conditions, Run, drive, run_drive
from tireid.driving.setup import Setup, SpeedWish

__all__ = [
    "Conditions",
    "Run",
    "Setup",
    "SpeedWish",
    "drive",
    "learning_drive",
    "run_drive",
    "sample_recording",
]
