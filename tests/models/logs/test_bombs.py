"""Files of a few kilobytes that say to hold gigabytes: refused by what they tell of themselves."""

import contextlib
import os
import re
import struct
import time
import zlib
from pathlib import Path

import numpy as np
import pytest

from models import apart
from models.logs.door import open_log
from models.logs.log import RecordingError
from models.schema import _SWELLS
from tests.models.logs.conftest import ran, refusal

MANY = 100_000_000  # samples of a channel that the limits allow
ROOM = 700_000_000  # bytes beyond what the readers themselves take
# Opens a log and reads what it lists in little memory, and tells the refusal, or "read".
READER = f"""
import resource, sys
import h5py, pyarrow.parquet, numpy
from models.logs.door import open_log
taken = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (taken + {ROOM}, resource.RLIM_INFINITY))
for path in sys.argv[1:]:
    try:
        log = open_log(path)
        log.read([one.name for one in log.listed()])
        print("read")
    except ValueError as error:
        print(error)
"""


def hdf5(path, **shapes):
    h5py = pytest.importorskip("h5py", reason="needs the package h5py")
    with h5py.File(path, "w") as file:
        for name, (shape, kind) in shapes.items():
            kind = h5py.string_dtype() if kind == "text" else kind
            chunks = tuple(min(one, 1000) for one in shape)
            one = file.create_dataset(name, shape, kind, chunks=chunks)
            if name == "zipped":
                del file[name]
                one = file.create_dataset(name, shape, kind, chunks=(shape[0],), compression="gzip")
                one[:] = np.zeros(shape, kind)
    return path


def parquet(path, **columns):
    pyarrow = pytest.importorskip("pyarrow", reason="needs the package pyarrow")
    from pyarrow import parquet

    t = np.arange(2000) / 100
    word = pyarrow.array(np.zeros(t.size, np.int32))
    table = {"t": t, "v": t}
    for name, words in columns.items():
        codes = pyarrow.array(np.arange(t.size, dtype=np.int32) % len(words))
        table[name] = pyarrow.DictionaryArray.from_arrays(codes if len(words) > 1 else word, words)
    parquet.write_table(
        pyarrow.table(table),
        path,
        compression="zstd",
        store_schema=False,  # texts, which only the file keeps as a dictionary
        dictionary_pagesize_limit=1 << 30,
    )
    return path


def element(kind, data, order="<"):
    return struct.pack(order + "II", kind, len(data)) + data + bytes(-len(data) % 8)


def head_of(kind, rows, order="<"):
    """Flags and dimensions of a variable of MATLAB of one column."""
    flags, shape = struct.pack(order + "II", kind, 0), struct.pack(order + "ii", rows, 1)
    return element(6, flags, order) + element(5, shape, order)


def numbers(name, count):
    """A variable of MATLAB: zeros of one byte."""
    return element(14, head_of(8, count) + element(1, name) + element(1, bytes(count)))


def struct_of(name, count):
    """A struct of MATLAB with one field, t."""
    return element(
        14,
        head_of(2, 1)
        + element(1, name)
        + element(5, struct.pack("<i", 8))
        + element(1, b"t".ljust(8, b"\0"))
        + numbers(b"", count),
    )


HEADER = b"MATLAB 5.0 MAT-file".ljust(124)


def matlab(path, *variables):
    packed = [zlib.compress(one, 9) for one in variables]
    body = b"".join(struct.pack("<II", 15, len(one)) + one for one in packed)
    path.write_bytes(HEADER + b"\0\1IM" + body)
    return path


def test_what_swells_in_memory_is_refused_before_it_does(tmp_path):
    cases = [
        # What a file never stored is its fill value.
        (
            hdf5(tmp_path / "channels.h5", t=((MANY,), "f8"), v=((MANY,), "i1")),
            r"not read: t \(100000000 numbers in 0 bytes\), v \(100000000 numbers in 0 bytes\)",
        ),
        (hdf5(tmp_path / "matrix.h5", m=((MANY // 4, 4), "f4")), r"m \(100000000 numbers in 0 "),
        (
            hdf5(tmp_path / "sum.h5", **{name: ((MANY // 3,), "f4") for name in "abc"}),
            r"not read: b \(33333333 numbers in 0 bytes\), c \(33333333 numbers",
        ),
        (hdf5(tmp_path / "wide.h5", units=((5000,), "S1000000")), r"units \(a long text\)"),
        (hdf5(tmp_path / "many.h5", units=((90_000,), "text")), r"units \(a long text\)"),
        (matlab(tmp_path / "v.mat", numbers(b"t", MANY)), r"t \(100000000 numbers in \d+ bytes\)"),
        (matlab(tmp_path / "s.mat", struct_of(b"s", MANY)), r"holds no signal"),
        (
            matlab(tmp_path / "several.mat", *(struct_of(b"s%d" % k, MANY) for k in range(3))),
            "structs and cells must be a log, they swell to "
            rf"\d+ times their size, above {_SWELLS}",
        ),
        (parquet(tmp_path / "text.parquet", note=["x" * 3_000_000]), "read"),
        (parquet(tmp_path / "time.parquet", time=["1" * 3_000_000]), "read"),
        (parquet(tmp_path / "run.parquet", run=["x" * 3_000_000]), "run must be at most 200"),
    ]
    assert max(path.stat().st_size for path, _ in cases) < 500_000
    reader = ran(READER, *(path for path, _ in cases))
    assert reader.returncode == 0, reader.stderr
    for (path, words), line in zip(cases, reader.stdout.splitlines(), strict=True):
        assert re.search(words, line), (path.name, line)


def mdf(path):
    asammdf = pytest.importorskip("asammdf", reason="needs the package asammdf")
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(SAME, SAME, name="v")])
        return file.save(path, compression=2)


def bag(path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="needs the package rosbags")
    typesys = pytest.importorskip("rosbags.typesys", reason="needs the package rosbags")
    store = typesys.get_typestore(typesys.Stores.LATEST)
    writer = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
    writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
    with writer:
        kind, of = "geometry_msgs/msg/PointStamped", store.types
        topic = writer.add_connection("/point", kind, typestore=store)
        stamp = of["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
        header = of["std_msgs/msg/Header"](stamp=stamp, frame_id="x" * 500_000)
        point = of[kind](header=header, point=of["geometry_msgs/msg/Point"](x=1.0, y=2.0, z=3.0))
        text = store.serialize_cdr(point, kind)
        writer.write(topic, 0, text)
    return path


SAME = np.zeros(60_000)


@pytest.mark.parametrize(
    ("written", "words"),
    [
        (lambda path: hdf5(path, zipped=((60_000,), "f8")), r"not read: zipped \(60000 numbers in"),
        (
            lambda path: parquet(path, note=[f"{'x' * 5000}{k}" for k in range(100)]),
            "the cells of 'note' must be a log",
        ),
        (mdf, "groups of channels must be a log"),
        (bag, "chunks must be a log"),
    ],
)
def test_what_a_file_unpacks_to_is_told_by_it_and_judged_first(
    written, words, tmp_path, monkeypatch
):
    path = written(tmp_path / "log")
    monkeypatch.setattr("models.apart.resource", None)  # no process apart: it is not patched
    monkeypatch.setattr("models.schema._SWOLLEN_FROM", 10_000_000)
    with contextlib.suppress(RecordingError):  # such as that nothing rises
        open_log(path).listed()
    monkeypatch.setattr("models.schema._SWOLLEN_FROM", 100_000)
    with pytest.raises(RecordingError, match=words):
        open_log(path)


# What a library in C does with a damaged file, in a process apart.


def test_a_list_of_an_hdf5_file_that_leads_to_itself_is_refused(tmp_path):
    path = hdf5(tmp_path / "log.h5", t=((300,), "f8"), v=((300,), "f8"))
    raw = bytearray(path.read_bytes())
    free, place = struct.unpack_from("<QQ", raw, raw.index(b"HEAP") + 16)
    assert raw[place + free] == 1  # no free block follows the first one
    raw[place + free] = free
    path.write_bytes(raw)
    assert "is damaged or cut off (Link iteration failed (memory alloc" in refusal(path)


def test_an_hdf5_file_with_a_changed_byte_is_read_or_refused_in_one_line(tmp_path):
    path = hdf5(tmp_path / "log.h5", t=((300,), "f8"), zipped=((300,), "f8"))
    raw = path.read_bytes()
    for place in range(0, len(raw), 61):
        path.write_bytes(raw[:place] + bytes([raw[place] ^ 0xFF]) + raw[place + 1 :])
        with contextlib.suppress(RecordingError):
            open_log(path).listed()
    assert apart.apart(RecordingError, path, 0.0, len, "again") == 5


@pytest.mark.parametrize(
    ("call", "words"),
    [
        ((bytes, 10**10), "takes more than .* GB of memory"),
        ((os.abort,), "crashes"),
        ((pow, 7, 10**9), "takes more than 0 s"),
    ],
)
def test_a_library_that_takes_too_much_or_crashes_is_stopped(call, words, tmp_path, monkeypatch):
    monkeypatch.setattr(apart, "_LEAST_SECONDS", 0.0)
    path = tmp_path / "log"
    path.write_bytes(b"x")
    with pytest.raises(RecordingError, match=f"log: is damaged, reading it {words}.*; save it"):
        apart.apart(RecordingError, path, 0.0, *call)
    assert apart.apart(RecordingError, path, 0.0, len, "again") == 5


KILLED = """
import os, threading
from pathlib import Path
from models import apart
def stop():
    print(worker.pid, flush=True)
    os.kill(os.getpid(), 9)
worker = apart._started()
apart._started = lambda: worker
threading.Timer(0.7, stop).start()
apart.apart(ValueError, Path("."), 0.0, pow, 7, 10**9)
"""


def test_a_process_apart_ends_with_the_one_that_started_it():
    about, waited = Path(f"/proc/{int(ran(KILLED).stdout)}/stat"), 0.0
    with contextlib.suppress(FileNotFoundError):
        while about.read_text().split()[2] != "Z":
            assert waited < 3.0
            waited += 0.05
            time.sleep(0.05)
