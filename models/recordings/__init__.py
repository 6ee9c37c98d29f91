"""Recordings of driven cars: read, judged, resampled, sliced and written."""

from models.logs.log import RecordingError
from models.recordings.checks import check_against_vehicle, check_physics
from models.recordings.map import LogMap
from models.recordings.reader import read_recording, read_repaired, runs, split_log_argument
from models.recordings.record import Recording, joined, write_recording
from models.recordings.repair import Repair
from models.recordings.wheels import Wheels

__all__ = [
    "LogMap", "Recording", "RecordingError", "Repair", "Wheels", "check_against_vehicle",
    "check_physics", "joined", "read_recording", "read_repaired", "runs", "split_log_argument",
    "write_recording",
]  # fmt: skip
