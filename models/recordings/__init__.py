"""Recordings of driven cars: read, judged, resampled, sliced and written."""

from models.logs.log import RecordingError
from models.recordings.checks import check_against_vehicle, check_physics
from models.recordings.reader import read_recording, runs, split_log_argument
from models.recordings.record import Recording, write_recording
from models.recordings.repair import Repair

__all__ = [
    "Recording",
    "RecordingError",
    "Repair",
    "check_against_vehicle",
    "check_physics",
    "read_recording",
    "runs",
    "split_log_argument",
    "write_recording",
]
