"""The same drive through every format is the same recording."""

import numpy as np
import pytest

from models.recordings import read_recording
from tests.models.logs.drive_in_every_format import FORMATS, write
from tests.tireid.conftest import typed

COLUMNS = {"v_x": "vx", "v_y": "vy", "r": "r", "delta_f": "delta_f", "a_y": "ay"}


@pytest.fixture(scope="module")
def driven(logs):
    """Times and columns of the slalom."""
    recording = read_recording(logs / "slalom.csv")
    t = np.arange(recording.t.size) / 100
    return t, {name: getattr(recording, name) for name in COLUMNS}


def words_of(written):
    """How a drive in a file is told to a command."""
    told = [f"{COLUMNS[name]}={channel}" for name, channel in written.names.items()]
    dbc = [] if written.dbc is None else ["--dbc", written.dbc]
    return [written.path, "--columns", *told, *dbc]


@pytest.mark.sweep("ROS 2 bag", "CAN BLF", "CSV", "MATLAB 7.3", "MDF4", "Parquet")
@pytest.mark.parametrize("format", FORMATS)
def test_channels_writes_a_map_that_reads_the_same_recording_from_every_format(
    format, driven, tmp_path
):
    t, columns = driven
    written = write(format, tmp_path, t, columns)
    told = tmp_path / "log.toml"
    assert typed("channels", *words_of(written), "--write", told) == 0
    recording = read_recording(written.path, log_map=told)
    assert recording.name == "drive"
    assert np.array_equal(recording.t, t)
    for name, values in columns.items():
        assert np.array_equal(getattr(recording, name), values), name
