"""One drive through every format: the same doubles, the same clock; what is wrong is one line."""

import gzip
import importlib
import random
import shutil

import numpy as np
import pytest

from models.logs import can
from models.logs.door import open_log
from models.logs.log import RecordingError
from models.logs.memory import open_arrays
from tests.models.logs.conftest import assert_equal, ran, refusal
from tests.models.logs.drive_in_every_format import FORMATS, UNITS, write

BINARY = [name for name in FORMATS if name != "CSV"]
EXTRAS = {
    "Parquet": "parquet", "MATLAB 7.3": "mat", "MDF4": "mdf", "MDF3": "mdf", "ROS 2 bag": "ros",
    "db3": "ros", "MCAP": "ros", **{name: "can" for name in FORMATS if name.startswith("CAN")},
}  # fmt: skip
INSTALLED = {
    "parquet": ["pyarrow"], "mat": ["h5py"], "mdf": ["asammdf"], "ros": ["rosbags"],
    "can": ["cantools", "python-can"],
}  # fmt: skip
LIBRARIES = ("pyarrow", "h5py", "asammdf", "rosbags", "can", "cantools")


@pytest.fixture
def written(format, tmp_path, drive):
    return write(format, tmp_path, *drive)


@pytest.mark.parametrize("format", FORMATS)
def test_every_format_gives_the_doubles_and_the_clock_that_were_written(format, drive, written):
    t, columns = drive
    log = open_log(written.path, written.dbc)
    listed = {one.name: one for one in log.listed()}
    names = written.channels
    assert set(names) <= set(listed)
    assert_equal(log.read(names), t, columns)
    back = log.read(names[::-1])
    assert [one.name for one in back] == names[::-1]
    assert np.array_equal(back[0].values, columns["a_y"])
    for column, name in written.names.items():
        assert listed[name].unit in ("", UNITS[column])
        assert listed[name].samples == t.size
        assert listed[name].rate == pytest.approx(100.0, rel=0.01)


# Columns that are sampled together: of a bus, signals of one frame.
ONE_CLOCK = {"ROS 2 bag": ("v_x", "v_y", "r"), "db3": ("v_x", "r"), "MCAP": ("v_x", "r")}


@pytest.mark.parametrize("format", [name for name in FORMATS if not name.startswith("CAN")])
def test_channels_of_one_clock_share_its_times(format, written):
    names = [written.names[one] for one in ONE_CLOCK.get(format, tuple(written.names))]
    first, *others = open_log(written.path).read(names)
    assert others and all(one.t is first.t and one.rows is first.rows for one in others)


@pytest.mark.parametrize("format", [name for name in BINARY if name not in ("MATLAB", "db3")])
def test_a_binary_format_tells_the_units(format, written):
    units = {one.name: one.unit for one in open_log(written.path, written.dbc).listed()}
    told = {column: units[name] for column, name in written.names.items()}
    if format in ("ROS 2 bag", "MCAP"):
        assert told.pop("delta_f") == ""  # a Float64 has no unit
    assert told == {name: UNITS[name] for name in told}


@pytest.mark.parametrize("format", BINARY)
def test_the_name_of_a_file_does_not_tell_its_format(format, tmp_path, drive, written):
    t, columns = drive
    other = tmp_path / "x" / "drive.csv"
    other.parent.mkdir()
    (shutil.copytree if written.path.is_dir() else shutil.copy)(written.path, other)
    log = open_log(other, written.dbc)
    assert_equal(log.read(written.channels), t, columns)


@pytest.mark.parametrize("format", EXTRAS)
def test_a_missing_library_is_named_with_the_pip_line(format, monkeypatch, written):
    real = importlib.import_module

    def without(name):
        if name.partition(".")[0] in LIBRARIES:
            raise ImportError(name)
        return real(name)

    monkeypatch.setattr(importlib, "import_module", without)
    monkeypatch.setattr("models.apart.resource", None)  # no process apart: it is not patched
    text = refusal(written.path, written.dbc)
    extra = EXTRAS[format]
    assert f": pip install {' '.join(INSTALLED[extra])} (" in text
    assert text.endswith(f" pip install '.[{extra}]')")


def test_one_run_of_arrays_is_read_alone():
    t = np.arange(20) / 100
    log = open_arrays("drive", {"t": t, "vx": t, "run": np.repeat(["a", "b"], 10)})
    assert np.array_equal(log.read(["vx"], "b")[0].values, t[10:])


def test_a_text_is_told_without_importing_the_readers_of_other_formats(tmp_path, drive):
    written = write("CSV", tmp_path, *drive)
    script = "import sys; from models.logs.door import open_log; open_log(sys.argv[1]).listed();"
    script += "print(*sorted(name for name in sys.modules if name.startswith('models.logs.')))"
    told = ran(script, written.path)
    imported = {name.rpartition(".")[2] for name in told.stdout.split()}
    assert {"text", "magic"} <= imported, told.stderr
    assert not imported & {"parquet", "mdf", "matlab", "bag", "can", "frames", "grouped"}


@pytest.mark.parametrize("format", [name for name in FORMATS if name not in ("CSV", "ROS 2 bag")])
def test_only_tables_in_text_may_be_packed(format, written):
    packed = written.path.with_name(f"{written.path.name}.gz")
    packed.write_bytes(gzip.compress(written.path.read_bytes()))
    assert refusal(packed, written.dbc) == (
        f"{packed}: is packed by gzip, which only tables in text may be; unpack it first"
    )


@pytest.mark.parametrize("format", BINARY)
def test_a_channel_or_run_that_is_not_there_is_refused(format, written):
    log = open_log(written.path, written.dbc)
    name = written.names["delta_f"]
    with pytest.raises(RecordingError, match=r"there is no channel .*; did you mean") as caught:
        log.read([name[:-1]])
    assert repr(name)[1:-1] in str(caught.value)
    with pytest.raises(RecordingError, match="holds one run without a name, so no run 'lap1'"):
        log.read([name], run="lap1")
    assert log.runs() == ()


@pytest.mark.parametrize("format", BINARY)
def test_damaged_files_are_refused_in_one_line_or_read(format, tmp_path, drive, capfd):
    """Cut off anywhere, and with bits that fell: nothing but a refusal, nothing said aside."""
    t, columns = drive
    written = write(format, tmp_path, t[:40], {k: v[:40] for k, v in columns.items()})
    path = written.path
    if path.is_dir():
        path = path / f"{path.name}.db3"
    whole = path.read_bytes()
    capfd.readouterr()
    refused = 0
    for seed in range(12):
        rng = random.Random(seed)
        damaged = bytearray(whole)
        if seed % 2:
            damaged = damaged[: rng.randrange(1, len(whole))]
        for _ in range(rng.choice((0, 3, 30))):
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        path.write_bytes(damaged)
        try:
            log = open_log(written.path, written.dbc)
            log.read([one.name for one in log.listed()])
        except RecordingError as error:
            refused += 1
            text = str(error)
            assert "\n" not in text and len(text) < 700 and str(tmp_path) in text
    assert refused >= 3
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("format", BINARY)
@pytest.mark.parametrize("content", [b"", b"\0" * 5000, None])
def test_other_content_under_the_ending_of_a_format_is_refused(format, content, tmp_path, written):
    """None: what begins as the format and then is nothing."""
    path = written.path
    if path.is_dir():
        path = path / ("metadata.yaml" if content is not None else f"{path.name}.db3")
    path.write_bytes(path.read_bytes()[:700] + b"\0" * 3000 if content is None else content)
    assert str(tmp_path) in refusal(written.path, written.dbc)


@pytest.mark.parametrize("clock", ["nan", "back", "still"])
@pytest.mark.parametrize("format", ["MATLAB", "MATLAB 7.3", "MDF4", "MDF3"])
def test_a_clock_that_does_not_rise_is_refused(format, clock, tmp_path, drive):
    t, columns = drive
    t = t.copy()
    if clock == "nan":
        t[100] = np.nan
    elif clock == "back":
        t[100:] -= 0.5
    else:
        t[:] = 1.0
    written = write(format, tmp_path, t, columns)
    assert "clock of" in refusal(written.path, written.dbc)


@pytest.mark.parametrize("format", ["CSV", "Parquet", "MATLAB", "MATLAB 7.3"])
def test_a_clock_of_numbers_that_counts_since_1970_keeps_them(format, tmp_path, drive):
    t, columns = drive
    written = write(format, tmp_path, 1.7e9 + t, columns)
    first, *_ = open_log(written.path).read(written.channels)
    assert np.array_equal(first.t, 1.7e9 + t)


@pytest.mark.parametrize(("format", "clock"), [("MCAP", "/odom"), ("CAN candump", "Frame_v_x")])
def test_what_was_stamped_out_of_order_is_refused(format, clock, tmp_path, drive):
    t, columns = drive
    written = write(format, tmp_path, np.concatenate([t[:100], t[:200]]), columns)
    said = refusal(written.path, written.dbc)
    assert f"the clock of {clock} must increase, message" in said


@pytest.mark.parametrize("format", BINARY)
def test_a_log_of_more_samples_than_is_allowed_is_refused(format, monkeypatch, written):
    monkeypatch.setenv("TIREID_LIMITS", "samples=250")
    if format.startswith("CAN") and format != "CAN MDF4":
        monkeypatch.setattr(can, "_FRAMES_AT_ONCE", 16)
    assert "TIREID_LIMITS=samples=NUMBER" in refusal(written.path, written.dbc)
