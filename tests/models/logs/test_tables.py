"""Tables are read the same with and without pyarrow, and long ones do not fill memory."""

import errno
import random
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

from models.logs import text
from models.logs.arrow import columns_of
from models.logs.door import open_log
from models.logs.foreign import one_line
from models.logs.growing import Growing
from models.logs.log import RecordingError
from models.logs.table import Kind, TableLog
from tests.models.logs.conftest import channel_of, ran
from tests.models.logs.drive_in_every_format import write
from tests.models.logs.loggers import DIALECTS, DT, drive, plain

# What is put in the place of a cell, or anywhere.
SPOILS = [
    b"", b" ", b",", b";", b"\t", b"\n", b"\n\n", b"\r", b'"', b'""', b"#", b"%", b"nan", b"inf",
    b"-", b"1e5", b"1e999", b"1_0", b"+1.5", b"1,5", b"1.5", b"0x10", b"\xff", b"\xc3\xa9", b"\0",
    b"1.", b".5", b"1e", b"N/A", b"None", b"10:00:00.5", b"infinity", b"1d5", b" 1 ", b"\xc2\xa0",
    b"True", b"\x0b", b"-0", b"1e-400", b"9" * 400, b"Nan", b"nan(1)", b"[data]",
]  # fmt: skip


def spoilt(rng, data):
    """A text with some cells and bytes changed."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 3, 9))):
        k = end = rng.randrange(len(data))
        while end < len(data) and data[end : end + 1] not in b",;\t|\n ":
            end += 1
        chance = rng.random()
        if chance < 0.7:
            data[k : end if chance < 0.4 else k] = rng.choice(SPOILS)
        elif chance < 0.9:
            del data[k : k + rng.randrange(1, 20)]
        else:
            data[k:k] = data[max(0, k - rng.randrange(200)) : k]
    return bytes(data) or b"x"


def outcome(path, arrow):
    """All that a text gives, or the line that it is refused with."""
    try:
        log = open_log(path)
        log = TableLog(table=replace(log.table, arrow=arrow))
        names, runs = [one.name for one in log.listed()], log.runs()
        channels = log.read(names, run=runs[0] if runs else None)
    except RecordingError as error:
        assert "\n" not in str(error)
        return str(error)
    return [names, runs, log.notes, log.dialect] + [
        (one.t.tobytes(), np.nan_to_num(one.values, nan=0.123).tobytes(), one.rows.tobytes())
        for one in channels
    ]


@pytest.mark.sweep("MoTeC", "UTF-16", "quoted decimal commas between commas")
@pytest.mark.parametrize("dialect", DIALECTS)
def test_pyarrow_changes_neither_bits_nor_messages_however_a_text_is_spoilt(
    tmp_path, monkeypatch, dialect
):
    rng = random.Random(dialect)
    path = tmp_path / "log.csv"
    for k in range(12):
        path.write_bytes(spoilt(rng, DIALECTS[dialect]) if k else DIALECTS[dialect])
        size = rng.choice((200, 1500, 1 << 22))
        monkeypatch.setattr(text, "_BLOCK", size)
        monkeypatch.setattr(text, "_SMALL_BLOCK", size)
        assert outcome(path, True) == outcome(path, False)


def test_pyarrow_reads_what_is_plain_itself(tmp_path, monkeypatch):
    path = tmp_path / "log.csv"
    path.write_text(plain())

    def never(*_):
        raise AssertionError("Python reads what pyarrow can")

    monkeypatch.setattr(text._Python, "read", never)
    assert len(outcome(path, True)) == 8
    with pytest.raises(AssertionError):
        outcome(path, False)


def test_reading_imports_no_pandas(tmp_path):
    (tmp_path / "log.csv").write_text(plain())
    table = pyarrow.table({"t": DT * np.arange(50), "v": [None, *range(49)]})
    pyarrow.parquet.write_table(table, tmp_path / "log.parquet")
    script = """
import sys
from dataclasses import replace
from models.logs.door import open_log
from models.logs.table import TableLog
text, parquet = map(open_log, sys.argv[1:])
for log in (TableLog(table=replace(text.table, arrow=True)), parquet):
    log.read([one.name for one in log.listed()])
print("pyarrow" in sys.modules, "pandas" in sys.modules)
"""
    told = ran(script, tmp_path / "log.csv", tmp_path / "log.parquet")
    assert told.stdout == "True False\n", told.stderr


def test_a_column_of_parquet_that_stands_twice_is_listed_as_in_a_text(tmp_path):
    t = np.arange(50.0) / 100.0
    holed = pyarrow.array([None if k % 2 else float(k) for k in range(50)])
    table = pyarrow.table([t, t, pyarrow.array([[1]] * 50), t, holed], names=["t", *"vawv"])
    pyarrow.parquet.write_table(table, tmp_path / "log.parquet")
    log = open_log(tmp_path / "log.parquet")
    assert [(one.name, round(one.rate)) for one in log.listed()] == [
        ("v", 100),
        ("w", 100),
        ("v (2)", 50),
    ]
    assert np.array_equal(channel_of(log, "w").values, t)


@pytest.mark.parametrize("categories", [False, True])
def test_an_empty_run_cell_is_a_run_without_a_name_in_every_table(tmp_path, categories):
    t = np.tile(np.arange(20.0) / 100.0, 2)
    cells = pyarrow.array(["lap"] * 20 + [None] * 20)
    columns = {"t": t, "vx": t, "run": cells.dictionary_encode() if categories else cells}
    pyarrow.parquet.write_table(pyarrow.table(columns), tmp_path / "log.parquet")
    rows = zip(t.tolist(), t.tolist(), ["lap"] * 20 + [""] * 20, strict=True)
    text = "t,vx,run\n" + "".join(f"{a!r},{b!r},{c}\n" for a, b, c in rows)
    (tmp_path / "log.csv").write_text(text)
    for name in ("log.csv", "log.parquet"):
        log = open_log(tmp_path / name)
        assert log.runs() == ("lap", "")
        assert np.array_equal(log.read(["vx"], "")[0].values, t[20:])


def test_without_pyarrow_a_text_is_read_all_the_same(tmp_path, monkeypatch):
    path = tmp_path / "log.csv"
    path.write_text(plain())
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert len(outcome(path, True)) == 8


@pytest.mark.parametrize("block", [60, 61, 127, 1000])
def test_blocks_may_end_anywhere_but_within_quotes(tmp_path, monkeypatch, block):
    path = tmp_path / "log.csv"
    rows = [f'"a ""word"",\nof {k}",{DT * k:.2f},{k}' for k in range(50)]
    path.write_text("\n".join(["note,t,v", *rows]))
    monkeypatch.setattr(text, "_BLOCK", block)
    monkeypatch.setattr(text, "_SMALL_BLOCK", block)
    for arrow in (True, False):
        log = TableLog(table=replace(open_log(path).table, arrow=arrow))
        (channel,) = log.read(["v"])
        np.testing.assert_array_equal(channel.values, np.arange(50.0))
        np.testing.assert_array_equal(channel.rows, 3 + 2 * np.arange(50))


def test_a_column_that_grows_goes_to_disk_and_comes_back(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    parts = [np.arange(k, dtype=np.float64) for k in (3, 0, 5, 1000, 7)]
    short, long = Growing(), Growing()
    for part in parts:
        short.extend(part)
    monkeypatch.setattr("models.logs.growing.LONGEST_IN_MEMORY", 10)
    for part in parts:
        long.extend(part)
    assert len(long) == 1015
    a, b = short.finished(), long.finished()
    np.testing.assert_array_equal(a, np.concatenate(parts))
    np.testing.assert_array_equal(b, a)
    assert isinstance(b.base, np.memmap) or isinstance(b, np.memmap)
    assert not a.flags.writeable
    assert not b.flags.writeable
    assert list(tmp_path.iterdir()) == [], "its file has no name that could be left behind"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a disk that is always full")
@pytest.mark.parametrize("ending", ["csv", "mcap"])
def test_a_full_disk_is_no_fault_of_the_log(tmp_path, monkeypatch, ending):
    t = DT * np.arange(50)
    written = write(
        {"csv": "CSV", "mcap": "MCAP"}[ending],
        tmp_path,
        t,
        {name: t for name in ("v_x", "v_y", "r", "delta_f", "a_y")},
    )
    log = open_log(written.path)
    monkeypatch.setattr("models.logs.growing.LONGEST_IN_MEMORY", 10)
    monkeypatch.setattr("tempfile.TemporaryFile", partial(Path("/dev/full").open, "w+b", 0))
    with pytest.raises(RecordingError) as caught:
        log.read([written.names["v_x"]])
    said = str(caught.value)
    assert "takes no more of a log that is too long for memory (No space left on device)" in said
    assert "damaged" not in said and str(written.path) not in said


def test_too_little_memory_or_room_to_unpack_is_no_fault_of_the_log(tmp_path):
    with pytest.raises(MemoryError), one_line(tmp_path / "log.parquet", "a Parquet file"):
        raise MemoryError
    full = OSError(errno.ENOSPC, "No space left on device")
    with pytest.raises(RecordingError) as caught, one_line(tmp_path / "log", "a ROS 2 bag"):
        raise full
    assert "there is no room in" in str(caught.value) and "damaged" not in str(caught.value)


@pytest.mark.heavy
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="counts the pages of Linux")
def test_memory_does_not_grow_with_the_log(tmp_path):
    """Anonymous memory after reading; what is mapped from disk the system can drop."""
    script = """
import re, sys
from dataclasses import replace
from models.logs import growing
from models.logs.door import open_log
from models.logs.table import TableLog
growing.LONGEST_IN_MEMORY = int(sys.argv[1])
def anonymous():
    return int(re.search(r"RssAnon:\\s+(\\d+)", open("/proc/self/status").read())[1]) / 1e3
sizes = []
for path in sys.argv[2:]:
    log = TableLog(table=replace(open_log(path).table, arrow=False))
    channels = log.read(["vx", "vy", "r", "delta_f"])
    sizes.append(anonymous())
    del channels
print(sizes[1] - sizes[0])
"""
    paths = []
    for name, n in (("short.csv", 50_000), ("long.csv", 600_000)):
        path = tmp_path / name
        with path.open("w") as file:
            file.write("t,vx,vy,r,delta_f\n")
            for k in range(0, n, 1000):
                file.writelines(
                    f"{0.001 * (k + j):.3f},20.125,0.001,0.002,0.003\n" for j in range(1000)
                )
        paths.append(path)
    little, all_ = (
        float(ran(script, in_memory, *paths).stdout) for in_memory in (1 << 16, 1 << 30)
    )
    assert little < 12.0  # [MB]; six columns of 600 000 numbers are 29
    assert all_ > 20.0, "the alarm rings where all is held in memory"


def test_parquet_bears_units_and_times_of_the_calendar(tmp_path):
    path = tmp_path / "log.parquet"
    one = drive()
    start = np.datetime64("2023-05-20T10:00:00", "ns")
    times = start + np.round(one.t * 1e9).astype("timedelta64[ns]")
    fields = [
        pyarrow.field("stamp", pyarrow.timestamp("ns")),
        pyarrow.field("speed", pyarrow.float32(), metadata={"unit": "km/h"}),
        pyarrow.field("steer [deg]", pyarrow.float64()),
        pyarrow.field("gear", pyarrow.string()),
    ]
    columns = [times, one.speed.astype(np.float32), one.steer, ["3"] * one.t.size]
    pyarrow.parquet.write_table(pyarrow.table(columns, schema=pyarrow.schema(fields)), path)
    log = open_log(path)
    assert [(c.name, c.unit, c.samples) for c in log.listed()] == [
        ("speed", "km/h", 120),
        ("steer [deg]", "deg", 120),
    ]
    speed, steer = log.read(["speed", "steer [deg]"])
    np.testing.assert_array_equal(steer.values, one.steer)
    np.testing.assert_array_equal(steer.t, one.t)
    np.testing.assert_array_equal(speed.values, one.speed.astype(np.float32))
    assert (log.format, speed.place, speed.rows[0]) == ("Parquet", "row", 1)
    with pytest.raises(RecordingError, match="gear must be numeric, its type is string"):
        log.read(["gear"])


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_parquet_knows_durations(tmp_path, unit):
    path = tmp_path / "log.parquet"
    per_second = {"s": 1, "ms": 1000, "us": 10**6, "ns": 10**9}[unit]
    whole = np.arange(60) if unit == "s" else np.arange(60) * per_second // 100
    t = pyarrow.array(whole, pyarrow.duration(unit))
    pyarrow.parquet.write_table(pyarrow.table({"time": t, "v": np.arange(60.0)}), path)
    expected = np.arange(60.0) * (1.0 if unit == "s" else 0.01)
    np.testing.assert_allclose(channel_of(open_log(path), "v").t, expected, atol=1e-12)


def test_no_thread_of_pyarrow_is_left_with_bytes_of_pythons(tmp_path):
    # One that drops them while Python ends aborts the program, after all was done.
    path = tmp_path / "log.csv"
    path.write_text("t,vx\n" + "".join(f"{0.01 * k:.2f},10.0\n" for k in range(300)))
    layout = open_log(path).table.layout
    block = path.read_bytes().partition(b"\n")[2]
    before = sys.getrefcount(block)
    for _ in range(200):
        assert columns_of(block, 300, layout, dict.fromkeys((0, 1), Kind.NUMBER)) is not None
        assert sys.getrefcount(block) == before
