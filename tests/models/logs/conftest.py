import subprocess
import sys

import numpy as np
import pytest

from models.logs.door import open_log
from models.logs.log import RecordingError


@pytest.fixture
def drive():
    """Time at 100 Hz and columns of doubles that no rounding leaves as they are."""
    t = np.arange(300) / 100
    rng = np.random.default_rng(14)
    return t, {name: rng.standard_normal(300) for name in ("v_x", "v_y", "r", "delta_f", "a_y")}


def assert_equal(channels, t, columns):
    """Values and clock are the same doubles."""
    assert len(channels) == len(columns)
    for channel, values in zip(channels, columns.values(), strict=True):
        assert np.array_equal(channel.t, t)
        assert np.array_equal(channel.values, values, equal_nan=True), channel.name
        assert channel.t.dtype == channel.values.dtype == np.float64
        assert np.all(np.diff(channel.rows) == 1) and channel.rows[0] in (1, 2)


def ran(script, *words):
    """Python ended, after a script in a process of its own."""
    told = [sys.executable, "-c", script, *map(str, words)]
    return subprocess.run(told, capture_output=True, text=True, check=False)


def channel_of(log, name):
    (channel,) = log.read([name])
    return channel


def refusal(path, dbc=None):
    """The one line with which a log is refused, on opening or on reading."""
    with pytest.raises(RecordingError) as caught:
        log = open_log(path, dbc)
        log.read([one.name for one in log.listed()])
    text = str(caught.value)
    assert "\n" not in text and len(text) < 700
    assert text.startswith((str(path), str(dbc)))
    return text
