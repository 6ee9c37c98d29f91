"""Text files as loggers write them are read as they were meant, or refused in one clear line."""

import csv
import gzip
from dataclasses import replace

import numpy as np
import pytest

from models.logs import preamble
from models.logs.door import open_log
from models.logs.log import RecordingError
from models.recordings import read_recording
from tests.models.logs.conftest import channel_of, refusal
from tests.models.logs.loggers import DIALECTS, DT, SPEEDS, drive, plain, stamped, table, units_row


def written(tmp_path, data, name="log.csv"):
    path = tmp_path / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


def opened(tmp_path, data, rows=(), **how):
    """The log of a text, or of a header and rows."""
    return open_log(written(tmp_path, "\n".join([data, *rows]) if rows else data, **how))


def refused(tmp_path, data):
    """The one line that a text is refused with, without its path."""
    path = written(tmp_path, data)
    message = refusal(path).removeprefix(f"{path}: ")
    assert len(message) < 400
    return message


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_drive_is_the_same_in_every_dialect(tmp_path, dialect, packed):
    data = DIALECTS[dialect]
    log = opened(tmp_path, gzip.compress(data) if packed else data)
    listed = log.listed()
    assert len(listed) == 4
    assert [one.samples for one in listed] == [drive().t.size] * 4
    assert [one.rate for one in listed] == pytest.approx([100.0] * 4, rel=1e-6)
    channels = log.read([one.name for one in listed])
    for channel, told in zip(channels, drive()[1:], strict=True):
        np.testing.assert_array_equal(channel.values, told)
        assert channel.t is channels[0].t
    t = channels[0].t - channels[0].t[0]
    assert np.abs(t - drive().t).max() < (5e-7 if "epoch" in dialect else 1e-9)
    units = [one.unit.replace("°", "deg") for one in listed]
    assert units[1:] == ["m/s", "deg/s", "deg"]
    assert units[0] in ("km/h", "kmh")


def test_what_was_detected_is_said(tmp_path):
    said = opened(tmp_path, DIALECTS["MoTeC"]).dialect
    assert "MoTeC i2 export" in said
    assert "names in line 15" in said
    assert "text in CP1252" in said
    assert "cells apart by commas (sure)" in said
    assert said[-1].startswith("time is 'Time' in s, by its name (sure)")
    said = opened(tmp_path, DIALECTS["2D"]).dialect
    assert {"cells apart by tabs (sure)", "decimal comma", "2D export"} <= set(said)
    said = opened(tmp_path, DIALECTS["milliseconds by their steps"]).dialect
    assert said[-1].endswith(
        "'Time' in ms, by its name (sure), a unit that fits its steps (likely)"
    )


@pytest.mark.parametrize(("name", "unit"), SPEEDS.items())
def test_units_stand_in_names(tmp_path, name, unit):
    log = opened(tmp_path, plain().replace("Speed [km/h]", name))
    assert (log.listed()[0].name, log.listed()[0].unit) == (name, unit)


def test_names_of_signals_are_no_units(tmp_path):
    names = ("t", "v_x", "r", "delta_f", "a_y")
    log = opened(tmp_path, ",".join(names), [f"{DT * k:.2f},1,2,3,4" for k in range(20)])
    assert [(one.name, one.unit) for one in log.listed()] == [(name, "") for name in names[1:]]


def test_channels_are_told_apart_that_bear_one_name(tmp_path):
    log = opened(tmp_path, plain().replace("vy [m/s]", "Speed [km/h]"))
    names = [one.name for one in log.listed()]
    assert names[:2] == ["Speed [km/h]", "Speed [km/h] (2)"]
    np.testing.assert_array_equal(channel_of(log, names[1]).values, drive().lateral)


def test_words_among_numbers_are_no_channel_and_do_not_disturb(tmp_path):
    lines = plain().splitlines()
    rows = [f'"a, b",{one},lap 1' for one in lines[1:]]
    log = opened(tmp_path, f"Note,{lines[0]},run", rows)
    assert next(one.name for one in log.listed()) == "Speed [km/h]"
    assert "Note" not in [one.name for one in log.listed()]
    assert log.runs() == ("lap 1",)
    with pytest.raises(RecordingError, match="Note must be numeric, line 2 has 'a, b'"):
        log.read(["Note"])


def test_one_run_of_several_is_read_alone(tmp_path):
    lines = plain().splitlines()
    rows = [f"{one},{'a' if k < 50 else 'b'}" for k, one in enumerate(lines[1:])]
    log = opened(tmp_path, lines[0] + ",run", rows)
    assert log.runs() == ("a", "b")
    assert [one.samples for one in log.listed()] == [120] * 4
    assert [one.rate for one in log.listed()] == pytest.approx([100.0] * 4)
    (channel,) = log.read(["Speed [km/h]"], run="b")
    np.testing.assert_array_equal(channel.values, drive().speed[50:])
    assert channel.rows[0] == 52
    assert channel.place == "line"


def test_a_slow_channel_in_a_fast_table_has_its_own_rate(tmp_path):
    rows = [f"{DT * k:.2f},{k},{k if k % 10 == 0 else ''}" for k in range(200)]
    log = opened(tmp_path, "t,fast,slow", rows)
    assert [one.rate for one in log.listed()] == pytest.approx([100.0, 10.0])
    slow = channel_of(log, "slow").values
    assert np.count_nonzero(np.isfinite(slow)) == 20


@pytest.mark.parametrize("word", ["", "NaN", "nan", "N/A", "null", "-", "--", " ", "1.#QNAN"])
def test_a_missing_value_is_a_missing_value_however_it_is_written(tmp_path, word):
    lines = plain().splitlines()
    lines[60] = lines[60].replace(lines[60].split(",")[1], word)
    values = channel_of(opened(tmp_path, "\n".join(lines)), "Speed [km/h]").values
    assert np.flatnonzero(np.isnan(values)).tolist() == [59]


def test_the_header_once_more_and_comments_in_between_are_no_rows(tmp_path):
    lines = units_row().splitlines()
    text = "\n".join([*lines[:50], "", "# paused; here", *lines[:2], *lines[50:]])
    (channel,) = opened(tmp_path, text).read(["Speed"])
    np.testing.assert_array_equal(channel.values, drive().speed)
    assert channel.rows[48] == 55


@pytest.mark.parametrize(
    ("rows", "delimiter"),
    [
        (["1.234,5", "12.345,25", "-1.234.567"], ";"),
        (['"1,234.5"', '"12,345.25"', '"-1,234,567"'], ","),
    ],
)
def test_thousands_are_understood(tmp_path, rows, delimiter):
    lines = [delimiter.join(["t", "F"])]
    lines += [delimiter.join([f"{k}", rows[k % 3]]) for k in range(30)]
    values = channel_of(opened(tmp_path, "\n".join(lines)), "F").values
    np.testing.assert_array_equal(values[:3], [1234.5, 12345.25, -1234567.0])


def test_the_clock_is_found_by_what_it_does_where_no_name_tells(tmp_path):
    rows = [f"{k % 7},{DT * k:.2f},{k}" for k in range(60)]
    log = opened(tmp_path, "a,b,c", rows)
    assert [one.name for one in log.listed()] == ["a", "c"]
    assert log.dialect[-1] == (
        "time is 'b' in s, as it rises evenly (likely), a unit that fits its steps (likely)"
    )


def test_a_clock_that_is_told_is_taken(tmp_path):
    rows = [f"{k % 7},{10 * k},{DT * k:.2f}" for k in range(60)]
    log = opened(tmp_path, "a,Time,mine", rows)
    told = replace(log, clock_name="mine")
    np.testing.assert_array_equal(channel_of(told, "a").t, channel_of(log, "a").t)
    assert [one.name for one in told.listed()] == ["a", "Time"]
    with pytest.raises(RecordingError, match="there is no channel 'b'"):
        replace(log, clock_name="b").listed()
    words = opened(tmp_path, "word,t\n" + "x,1\n" * 9)
    with pytest.raises(RecordingError, match="word must be a time, its first cells are 'x, x, x'"):
        replace(words, clock_name="word").listed()


@pytest.mark.sweep("rint*")
@pytest.mark.parametrize(
    ("tick", "dt"), [(0.1, 0.01), (0.01, 0.0025), (0.001, 0.0025), (0.001, 1 / 60), (1.0, 0.02)]
)
@pytest.mark.parametrize("how", [np.floor, np.rint])
def test_rounded_stamps_are_put_on_the_even_clock_and_it_is_said(tmp_path, tick, dt, how):
    true = dt * np.arange(4000)
    rows = [f"{tick * stamp:.3f},1" for stamp in how(np.round(true / tick, 6))]
    log = opened(tmp_path, "t,v", rows)
    t = channel_of(log, "v").t
    assert np.ptp(t - true) < 1e-3 * dt
    assert np.diff(t) == pytest.approx(np.full(3999, dt), rel=1e-4)
    (note,) = log.notes
    assert note.startswith(f"t is rounded to {tick:g} s, its samples were put on the even clock of")
    assert f"{dt:.9g} s that explains every stamp" in note


def test_samples_that_are_lost_among_rounded_stamps_stay_lost(tmp_path):
    true = 0.01 * np.delete(np.arange(4000), slice(1200, 1277))
    rows = [f"{stamp:.1f},1" for stamp in np.floor(np.round(true * 10, 6)) / 10]
    t = channel_of(opened(tmp_path, "t,v", rows), "v").t
    assert np.abs(t - true).max() < 0.1
    assert np.count_nonzero(np.diff(t) > 0.011) == 1
    np.testing.assert_allclose(np.diff(t)[:1000], 0.01, rtol=1e-6)


@pytest.mark.parametrize("dt", [0.01, 0.02, 0.005])
def test_a_lost_sample_of_an_even_clock_moves_no_stamp(tmp_path, dt):
    require_kept(tmp_path, dt * np.delete(np.arange(400), [37, 200, 201]))


def require_kept(tmp_path, stamps):
    t = np.round(stamps, 3)
    log = opened(tmp_path, "t,v", [f"{one:.3f},1" for one in t])
    np.testing.assert_array_equal(channel_of(log, "v").t, t)
    assert log.notes == ()


def test_stamps_that_jitter_but_rise_stay_as_they_are(tmp_path, rng):
    require_kept(tmp_path, np.cumsum(rng.uniform(0.006, 0.014, 500)))


WRONG = {
    "no header": (plain().split("\n", 1)[1], "there is no header, line 1 is data already"),
    "a wrong cell": (
        plain().replace("60.040", "fast", 1),
        "Speed [km/h] must be numeric, line 3 has 'fast'",
    ),
    "a wrong cell far down": (
        "\n".join([*plain().splitlines()[:90], "0.89,slow,0,0,0"]),
        "Speed [km/h] must be numeric, line 91 has 'slow'",
    ),
    "a decimal comma among points": (
        plain(";").replace("60.04", "60,04", 1),
        "Speed [km/h] must be numeric, line 3 has '60,040'",
    ),
    "a decimal point among commas": (
        plain(";", ",").replace("60,04", "60.04", 1),
        "Speed [km/h] must be numeric, line 3 has '60.040' where others have decimal commas",
    ),
    "decimal commas between commas": (
        plain(",", ","),
        "line 2 has 10 cells, the header has 5: decimal commas cannot be distinguished from commas "
        "between cells; export with semicolons",
    ),
    "a cut row": (plain()[:-12], "line 121 has 4 cells, the header has 5; was the file cut off?"),
    "a header alone": ("t,v\n", "there is a header but no row of data"),
    "a header with units alone": ("t,v\ns,m/s\n", "there is a header but no row of data"),
    "times of no clock": (
        "t,v\n-1e308,1\n1e308,2\n" + "inf,1\n" * 20,
        "t must be a time in every row, line 4 has none",
    ),
    "nothing": ("", "is empty"),
    "blank lines": ("\n \n\n", "is empty"),
    "a picture": (b"\x89PNG\r\n\x1a\n" + bytes(40), "is a binary file (it has NUL bytes)"),
    "controls": (b"t,v\n0,1\x02\n", "is not a text file (line 2 has the character 0x02)"),
    "NUL bytes far down": (
        plain().encode() * 3000 + b"1,2,\0,4,5\n",
        "is a binary file or damaged (it has NUL bytes in line 363001); a log is text",
    ),
    "no time": ("a,b\n" + "1,2\n" * 20, "no column is a time that rises; --rate HZ gives"),
    "an empty time": (
        plain().replace("\n0.030,", "\n,", 1),
        "Time [s] must be a time in every row, line 5 has none",
    ),
    "a clock that starts again": (
        plain() + plain().split("\n", 1)[1],
        "Time [s] must increase, line 122 has 0 after 1.19; the clock starts again: several runs "
        "in one file need a column run",
    ),
    "a sample twice": (
        plain().replace("\n0.510,", "\n0.500,"),
        "Time [s] must increase, line 53 has 0.5 after 0.5; a sample is there twice: --mend",
    ),
    "samples out of order": (
        plain().replace("\n0.510,", "\n0.485,"),
        "Time [s] must increase, line 53 has 0.485 after 0.5; samples are out of order",
    ),
    "rounded stamps of no clock": (
        "t,v\n" + "".join(f"{0.1 * k:.1f},1\n" * (1 + k * k % 19) for k in range(40)),
        "samples share one, and no even clock explains them: export time with more digits",
    ),
    "a wrong date": (
        stamped(lambda t: f"2023-05-20T10:00:{'xx' if 0.495 < t < 0.505 else f'{t:06.3f}'}"),
        "Time must be a time, line 52 has '2023-05-20T10:00:xx'",
    ),
    "a quote that never ends": (
        plain() + '"' + table() * 3,
        "has 1 cells, the header has 5",
    ),
    "channels in blocks of their own": (
        "PiToolboxVersionedASCIIDataSet\nVersion\t2\n"
        + "".join(
            f"\n{{ChannelBlock}}\nTime\t{name}\n" + "".join(f"{0.1 * k}\t{k}\n" for k in range(9))
            for name in ("vCar[km/h]", "gLat[g]")
        ),
        "line 16 begins a {ChannelBlock} of one channel: each has its own; export all",
    ),
    "VBOX without names": ("[column names]\n\n[data]\n1 2\n", "[column names], line 1, must be"),
}  # fmt: skip


@pytest.mark.sweep("[!N]*")
@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_file_is_refused_in_one_line_that_says_where_and_why(tmp_path, wrong):
    data, said = WRONG[wrong]
    assert said in refused(tmp_path, data)


def test_a_header_of_megabytes_or_of_a_million_columns_is_refused(tmp_path):
    assert "line 1 is longer than" in refused(tmp_path, "a" * 10_000_000)
    assert "line 1 is longer than" in refused(tmp_path, ",".join(map(str, range(1_000_000))))
    many = ",".join(f"c{k}" for k in range(20_000)) + "\n" + ",".join("1" for _ in range(20_000))
    assert "columns must be at most 10000, here are 20000" in refused(tmp_path, many)


def test_a_line_without_end_is_refused_before_it_fills_memory(tmp_path):
    endless = plain() + "1" * 12_000_000
    assert "line 122 is longer than 8388608 bytes" in refused(tmp_path, endless)


def test_folders_pipes_and_nothing_are_refused(tmp_path):
    assert "there is no such file" in refusal(tmp_path / "nowhere.csv")
    assert "it is a folder" in refusal(tmp_path)
    assert "a device, pipe or socket" in refusal("/dev/zero")


@pytest.mark.parametrize("unit", ["sec", "s", "msec", "Milliseconds", "usec", "µs"])
def test_a_clock_that_a_map_names_knows_the_units_that_a_clock_of_the_file_knows(tmp_path, unit):
    per_second = {"m": 1e3, "u": 1e6, "µ": 1e6}.get(unit[0].lower(), 1.0)
    rows = [f"{k / 100:.2f},{k / 100 * per_second!r},20,0,0,0" for k in range(60)]
    text = "\n".join([f"Ta [s],Tb [{unit}],vx,vy,r,delta_f", *rows])
    path = written(tmp_path, text)
    named = read_recording(path, check=False, columns={"t": f"Tb [{unit}]"})
    np.testing.assert_allclose(named.t, np.arange(60) / 100, rtol=0, atol=1e-9)
    lines = [row.partition(",")[2] for row in rows]
    alone = written(tmp_path, "\n".join([f"Time [{unit}],vx,vy,r,delta_f", *lines]), "one.csv")
    np.testing.assert_allclose(read_recording(alone, check=False).t, named.t, rtol=0, atol=1e-9)


def lines_at_random(count):
    """Lines of few characters, so that numbers, quotes, ones and blanks meet often."""
    rng = np.random.default_rng(5)
    parts = ["1", "1", "0.5", "-2,5", "1.234,5", "e3", "m/s", "[s]", "nan", '"', " ", "\t", "#", ""]
    return [
        rng.choice([",", ";", "\t", "|", " "]).join(rng.choice(parts, rng.integers(1, 6)))
        for _ in range(count)
    ]


def test_a_line_without_quotes_is_split_as_a_reader_of_csv_does():
    for line in [*lines_at_random(3000), "", " ", "a\rb,c", "a\0b,c", 200_000 * "x"]:
        for delimiter in ",;\t|":
            try:
                cells = next(csv.reader([line], delimiter=delimiter), [])
            except csv.Error:
                cells = [line]
            assert preamble.cells_of(line, delimiter) == tuple(cell.strip() for cell in cells)


VBO = """[header]
satellites
time
velocity kmh
{titles}

[channel units]
{units}

[column names]
sats time velocity {names}

[data]
012 103000.00 071.2 +1.0E+00 +2.0E+00
012 103000.01 071.3 +1.1E+00 +2.1E+00
"""


@pytest.mark.parametrize(
    ("names", "units", "told"),
    [
        ("slip yaw", "Degrees\n°/s", ("Degrees", "°/s")),
        ("gear yaw_rate", "(null)\n°/s", ("", "°/s")),
        ("brake yaw_rate", "°/s", ("", "°/s")),
        ("accel_g slip", "°\nG", ("", "")),
        ("slip yaw", "%\n°\n°\n°/s\nG\nbar", ("", "")),
    ],
    ids=["each", "none told", "of the last", "against a name", "more than columns"],
)
def test_units_of_a_vbo_belong_to_its_last_columns(tmp_path, names, units, told):
    titles = names.replace(" ", "\n")
    text = VBO.format(names=names, units=units, titles=titles)
    listed = {one.name: one.unit for one in opened(tmp_path, text, name="log.vbo").listed()}
    assert tuple(listed[name] for name in names.split()) == told
    assert listed["velocity"] == "kmh"


def test_a_cell_that_describes_a_channel_is_its_name_and_unit(tmp_path):
    head = '"Interval"|"ms"|0|0|1,"Speed"|"mph"|0.0|150.0|10,"Yaw"|"Deg/Sec"|-120|120|25'
    rows = "".join(f"{40 * k},{40.0 + k if k % 2 else ''},{0.5 * k}\n" for k in range(20))
    log = opened(tmp_path, f"{head}\n{rows}", name="run.log")
    assert [(one.name, one.unit) for one in log.listed()] == [("Speed", "mph"), ("Yaw", "Deg/Sec")]
    speed, yaw = log.read(["Speed", "Yaw"])
    assert np.isfinite(speed.values).sum() == 10
    assert np.diff(yaw.t) == pytest.approx(0.04)


def test_a_duration_with_its_unit_is_a_time(tmp_path):
    """As MATLAB writes a timetable."""
    rows = "".join(f"{0.01 * k:g} sec,{20 + k % 3}\n" for k in range(200))
    log = opened(tmp_path, f"Time,vx\n{rows}")
    (vx,) = log.read(["vx"])
    np.testing.assert_allclose(vx.t - vx.t[0], 0.01 * np.arange(200), atol=1e-9)


def test_a_table_of_labview_has_units_in_a_label_and_a_comment_that_no_row_has(tmp_path):
    head = (
        "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
        "Samples\t99\t99\t\nY_Unit_Label\tkm/h\tdeg/s\t\nX0\t0.0\t0.0\t\nDelta_X\t0.01\t0.01\t\n"
        "***End_of_Header***\t\t\t\nX_Value\tSpeed\tYaw Rate\tComment\n"
    )
    rows = "".join(f"{0.01 * k:.2f}\t{70 + k % 5}.5\t{k % 7}.25\n" for k in range(99))
    log = opened(tmp_path, head + rows, name="run.lvm.txt")
    assert [(one.name, one.unit, one.samples) for one in log.listed()] == [
        ("Speed", "km/h", 99),
        ("Yaw Rate", "deg/s", 99),
    ]
