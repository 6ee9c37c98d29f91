"""Times that decrease or repeat, mended where declared: the samples of the right log, said."""

from itertools import pairwise

import numpy as np
import pytest

from models.logs.door import open_log
from models.logs.log import RecordingError
from models.logs.memory import open_arrays
from models.logs.stamps import PAUSE
from tests.models.logs.conftest import channel_of
from tests.models.logs.drive_in_every_format import write

N = 300
EVERY = np.arange(N)
SWAPPED = EVERY.copy()
SWAPPED[50:250:40] += 1
SWAPPED[51:251:40] -= 1
# Rows as a logger wrote them, by rows of the right log; what is said of the mending.
WRITTEN = {
    "the other way round": (EVERY[::-1], f"samples out of order are sorted: {N - 1}"),
    "neighbors swapped": (SWAPPED, "samples out of order are sorted: 5"),
    "one twice": (
        np.insert(EVERY, 100, 100),
        "samples that share their stamp with one before are left out: 1",
    ),
    "a block twice": (
        np.concatenate([EVERY[:260], EVERY[230:]]),
        "samples that share their stamp with one before are left out: 30",
    ),
}


def as_arrays(t, columns, rows):
    data = {"t": t[rows], **{name: values[rows] for name, values in columns.items()}}
    return open_arrays("log", data, mend=True)


@pytest.mark.parametrize("kind", WRITTEN)
@pytest.mark.parametrize("format", ["CSV", "MDF4", "arrays"])
def test_the_samples_are_those_of_the_right_log(format, kind, tmp_path, drive):
    t, columns = drive
    rows, said = WRITTEN[kind]
    if format == "arrays":
        log, names = as_arrays(t, columns, rows), list(columns)
    else:
        written = write(format, tmp_path, t[rows], {k: v[rows] for k, v in columns.items()})
        log, names = open_log(written.path, written.dbc, mend=True), written.channels
        with pytest.raises(RecordingError, match=r"must increase.*--mend-clock"):
            open_log(written.path, written.dbc).read(names)
    channels = log.read(names)
    for channel, values in zip(channels, columns.values(), strict=True):
        np.testing.assert_array_equal(channel.t, t)
        np.testing.assert_array_equal(channel.values, values)
        assert channel.rows.size == N
    assert any(said in note for note in log.notes), log.notes


def test_what_follows_where_the_clock_starts_again_is_put_after_a_gap(drive):
    t, columns = drive
    pieces = [EVERY, EVERY[:200], EVERY[:250]]
    log = as_arrays(t, columns, np.concatenate(pieces))
    channel = channel_of(log, "r")
    np.testing.assert_array_equal(channel.values, columns["r"][np.concatenate(pieces)])
    ends = np.cumsum([len(piece) for piece in pieces])
    for before, after in pairwise(np.split(channel.t, ends[:-1])):
        assert after[0] - before[-1] == pytest.approx(PAUSE)
        np.testing.assert_allclose(np.diff(after), 0.01)
    assert any("and on 10 s later: 2" in note for note in log.notes)


def test_runs_are_not_mixed_and_a_sample_astray_goes_to_its_place(drive):
    t, columns = drive
    late = np.concatenate([EVERY[:200], EVERY[90:]])  # as late as that no clock begins
    log = as_arrays(t, columns, late)
    np.testing.assert_array_equal(channel_of(log, "r").values, columns["r"][late])
    log = as_arrays(t, columns, np.concatenate([EVERY[:20], EVERY[21:], [20]]))
    np.testing.assert_array_equal(channel_of(log, "r").values, columns["r"])
    mixed = np.random.default_rng(7).permutation(N)
    np.testing.assert_array_equal(channel_of(as_arrays(t, columns, mixed), "r").t, t)


def test_a_clock_of_several_that_starts_again_is_refused_all_the_same(tmp_path, drive):
    t, columns = drive
    rows = np.concatenate([EVERY, EVERY[:200]])
    written = write("MDF4", tmp_path, t[rows], {k: v[rows] for k, v in columns.items()})
    log = open_log(written.path, mend=True)
    with pytest.raises(RecordingError, match="the clock starts again beside others: cut"):
        log.read(written.channels)


@pytest.mark.parametrize(
    ("power", "each", "said"),
    [(0.5, 2, "stamps are rounded, 2 samples share one"), (0.0, 1, "it never moves: declare")],
)
def test_stamps_that_rest_throughout_are_refused_all_the_same(drive, power, each, said):
    t, columns = drive
    log = as_arrays(t**power, columns, np.repeat(EVERY, each))
    with pytest.raises(RecordingError, match=said):
        log.read(["r"])


def test_a_log_that_is_right_is_left_alone(drive):
    t, columns = drive
    log = as_arrays(t, columns, EVERY)
    np.testing.assert_array_equal(channel_of(log, "r").t, t)
    assert not log.notes
