"""Tables whose channels stand behind times of their own; a second time that is none of theirs."""

from itertools import zip_longest

import numpy as np
import pytest

from models.logs.door import open_log
from tests.models.logs.conftest import channel_of


def at(rate, begin=0.0, lasts=4.0):
    t = np.round(begin + np.arange(round(lasts * rate)) / rate, 6)
    return t, np.sin(3.0 * t)


def written(path, **columns):
    """A table whose shorter columns end in empty cells."""
    cells = (map(repr, one.tolist()) for one in columns.values())
    rows = map(",".join, zip_longest(*cells, fillvalue=""))
    path.write_text("\n".join([",".join(columns).replace("__", " "), *rows, ""]))
    return path


@pytest.mark.parametrize("names", [("time_1", "time_2", "time_3"), ("t", "t__", "t___")])
@pytest.mark.parametrize("order", [(100, 50, 20), (20, 50, 100)])
def test_each_channel_has_the_time_that_stands_before_it(tmp_path, names, order):
    columns, expected = {}, {}
    for name, rate in zip(names, order, strict=True):
        columns[name], columns[f"v{rate}"] = expected[f"v{rate}"] = at(rate)
    log = open_log(written(tmp_path / "log.csv", **columns))
    assert [one.name for one in log.listed()] == list(expected)
    assert [one.rate for one in log.listed()] == pytest.approx(order)
    assert [one.samples for one in log.listed()] == [4 * rate for rate in order]
    for channel in log.read(list(expected)):
        t, values = expected[channel.name]
        np.testing.assert_array_equal(channel.t, t)
        np.testing.assert_array_equal(channel.values, values)
        assert channel.rows[0] == 2 and channel.rows.size == t.size
    (note,) = log.notes
    assert note.startswith("channels have times of their own, each the one before it: ")


def test_behind_a_time_that_repeats_the_first_stands_what_has_the_first(tmp_path):
    (t, v), (t_2, v_2) = at(100), at(50)
    columns = {"time_1": t, "v": v, "time_2": t_2, "w": v_2, "time_3": t, "u": v}
    log = open_log(written(tmp_path / "log.csv", **columns))
    v, w, u = log.read(["v", "w", "u"])
    np.testing.assert_array_equal(u.t, v.t)
    np.testing.assert_array_equal(w.t, t_2)


def test_channels_that_began_apart_stay_apart(tmp_path):
    (t_1, v_1), (t_2, v_2) = at(100), at(100, begin=2.0)
    log = open_log(written(tmp_path / "log.csv", time_1=t_1, v=v_1, time_2=t_2, w=v_2))
    assert channel_of(log, "w").t[0] == 2.0


@pytest.mark.parametrize("other", ["gps_time", "time_2"])
def test_another_time_of_the_same_rows_is_no_clock_of_its_own(tmp_path, other):
    (t, v), late = at(100), 3.2 if other == "gps_time" else 0.0
    log = open_log(written(tmp_path / "log.csv", **{"time": t, "v": v, other: t + late, "w": v}))
    assert [one.name for one in log.listed()] == ["v", other, "w"]
    np.testing.assert_array_equal(channel_of(log, "w").t, t)
    assert not log.notes


def test_a_time_that_rests_is_that_of_a_slower_sensor_of_the_same_rows(tmp_path):
    t, v = at(100)
    rests = np.round(np.floor(10.0 * t) / 10.0, 6)
    log = open_log(written(tmp_path / "log.csv", time=t, v=v, gps_time=rests, w=v))
    np.testing.assert_array_equal(channel_of(log, "w").t, t)
