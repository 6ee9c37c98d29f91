"""MATLAB files: structs of any shape, against what SciPy reads; what is hostile is one line."""

import struct
import zlib

import h5py
import numpy as np
import pytest
import scipy.io

from models.logs.door import open_log
from tests.models.logs.conftest import channel_of, refusal
from tests.models.logs.drive_in_every_format import write_mat73
from tests.models.logs.test_bombs import HEADER, element, head_of

T = np.arange(300) / 100
SLOW = T[::10]
A, B = np.random.default_rng(7).standard_normal((2, 300))

TREE = {
    "log": {
        "imu": {"time": T, "ay": A, "r": B, "units": {"ay": "g", "r": "deg/s"}},
        "gps": {"t_ms": SLOW * 1000, "v": {"data": SLOW * 2, "unit": "km/h"}},
        "speed": {"Time": T, "Data": A, "DataInfo": {"Units": "m/s"}, "Name": "velocity"},
    },
    "scope": {
        "time": T,
        "signals": [
            {"values": A, "label": "one"},
            {"values": np.column_stack([A, B]), "label": "two"},
        ],
    },
    "cells": [SLOW, B],
    "t": T,
    "matrix": np.column_stack([SLOW, SLOW * 3]),
    "lonely": np.arange(7.0),
    "comment": "hello",
    "count": np.arange(300, dtype="i2"),
}
LISTED = {
    "log.imu.ay": ("g", 300, 100.0), "log.imu.r": ("deg/s", 300, 100.0),
    "log.gps.v": ("km/h", 30, 10.0), "velocity": ("m/s", 300, 100.0), "one": ("", 300, 100.0),
    "two(:,1)": ("", 300, 100.0), "two(:,2)": ("", 300, 100.0), "cells{2}": ("", 300, 100.0),
    "matrix(:,2)": ("", 30, 10.0), "count": ("", 300, 100.0),
}  # fmt: skip


def cells(value):
    """Lists as SciPy writes them: object arrays, which are cells."""
    if isinstance(value, dict):
        return {name: cells(one) for name, one in value.items()}
    if isinstance(value, list):
        result = np.empty(len(value), dtype=object)
        result[:] = [cells(one) for one in value]
        return result
    return value


def write_5(path, tree, **options):
    scipy.io.savemat(path, cells(tree), oned_as="column", **options)
    return path


WRITERS = {
    "5": write_5,
    "7": lambda path, tree: write_5(path, tree, do_compression=True),
    "7.3": write_mat73,
}


@pytest.mark.parametrize("version", WRITERS)
def test_vectors_of_nested_structs_and_cells_are_channels_with_their_own_clock(version, tmp_path):
    log = open_log(WRITERS[version](tmp_path / "log.mat", TREE))
    listed = {one.name: (one.unit, one.samples, round(one.rate, 6)) for one in log.listed()}
    assert listed == LISTED
    assert log.notes == ("there is no vector t or time of the same length for: cells{1}, lonely",)
    read = {one.name: one for one in log.read(list(LISTED))}
    for name, values in {
        **{"log.imu.ay": A, "log.imu.r": B, "velocity": A, "one": A, "two(:,1)": A},
        **{"two(:,2)": B, "cells{2}": B, "count": np.arange(300.0)},
    }.items():
        assert np.array_equal(read[name].values, values), name
        assert np.array_equal(read[name].t, T), name
    assert np.array_equal(read["log.gps.v"].values, SLOW * 2)
    assert np.allclose(read["log.gps.v"].t, SLOW, rtol=0, atol=1e-12)  # of milliseconds
    assert np.array_equal(read["matrix(:,2)"].values, SLOW * 3)
    assert np.array_equal(read["matrix(:,2)"].t, SLOW)


@pytest.mark.parametrize("kind", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?"])
@pytest.mark.parametrize("compressed", [False, True])
def test_numbers_of_every_type_are_those_that_scipy_reads(kind, compressed, tmp_path):
    values = (np.random.default_rng(3).standard_normal((40, 3)) * 90).astype(kind)
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {"t": T[:40], "m": values}, do_compression=compressed)
    read = open_log(path).read(["m(:,1)", "m(:,2)", "m(:,3)"])
    there = scipy.io.loadmat(path)["m"].astype(float)
    for k, channel in enumerate(read):
        assert np.array_equal(channel.values, there[:, k])


def test_files_of_another_byte_order_are_read(tmp_path):
    path = tmp_path / "log.mat"

    def matrix(name, values):
        data = element(1, name, ">") + element(9, values.astype(">f8").tobytes(), ">")
        return element(14, head_of(6, 40, ">") + data, ">")

    path.write_bytes(HEADER + b"\1\0MI" + matrix(b"t", T[:40]) + matrix(b"v", A[:40]))
    assert np.array_equal(scipy.io.loadmat(path)["v"].ravel(), A[:40])
    assert np.array_equal(channel_of(open_log(path), "v").values, A[:40])


SHAPES = {  # what is written, names and units of its channels, of which the last one is B
    "a matrix with names of its columns": (
        {"log": {"t": T, "data": np.column_stack([A, B]), "names": ["yaw rate", "steer"],
                 "units": ["deg/s", "deg"]}},
        [("yaw rate", "deg/s"), ("steer", "deg")],
    ),
    "dSPACE, with its clock in X": (
        {"rec": {"X": {"Name": "clock", "Data": T}, "Y": [
            {"Name": "v_x", "Data": A, "Unit": "m/s"}, {"Name": "r", "Data": B, "Unit": "1/s"},
        ]}},
        [("v_x", "m/s"), ("r", "1/s")],
    ),
    "rows of a To File block": (
        {"ans": np.vstack([T, A, B])}, [("ans(2,:)", ""), ("ans(3,:)", "")],
    ),
}  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("version", WRITERS)
def test_signals_of_a_matrix_or_of_structs_are_named_and_timed(version, shape, tmp_path):
    tree, names = SHAPES[shape]
    log = open_log(WRITERS[version](tmp_path / "log.mat", tree))
    assert [(one.name, one.unit) for one in log.listed()] == names
    (last,) = log.read([names[-1][0]])
    assert np.array_equal(last.values, B) and np.array_equal(last.t, T)


@pytest.mark.parametrize("version", WRITERS)
def test_a_file_without_a_time_says_what_it_needs(version, tmp_path):
    path = WRITERS[version](tmp_path / "log.mat", {"v": A, "w": B})
    assert "there is no vector t or time of the same length for: v, w; save vectors" in refusal(
        path
    )


def table():
    """A variable that is an object of MATLAB, as `save` writes a table."""
    inner = element(14, head_of(13, 1))
    words = b"".join(element(1, word) for word in (b"tab", b"MCOS", b"table"))
    return element(14, element(6, struct.pack("<II", 17, 0)) + words + inner)


def test_tables_and_other_objects_are_named_with_what_to_do(tmp_path):
    path = tmp_path / "log.mat"
    write_5(path, {"t": T, "v": A})
    path.write_bytes(path.read_bytes() + table())
    log = open_log(path)
    assert [one.name for one in log.listed()] == ["v"]
    assert log.notes == ("not read: tab (a table, timeseries or other object)",)

    write_5(path, {"n": np.ones((1, 1))})
    path.write_bytes(path.read_bytes() + table())
    text = refusal(path)
    assert (
        "not read: tab (a table, timeseries or other object); save vectors and their time" in text
    )

    path = write_mat73(tmp_path / "log73.mat", {"n": np.ones(1), "tab": np.ones((1, 6))})
    with h5py.File(path, "r+") as file:
        file["tab"].attrs["MATLAB_class"] = np.bytes_("timetable")
        file["tab"].attrs["MATLAB_object_decode"] = 3
    assert "not read: tab (timetable); save vectors and their time" in refusal(path)


def nested(depth):
    """Cells in one another, so deep that a reader that follows them runs out of stack."""
    begin = head_of(1, 1) + struct.pack("<IBBBB", 0x00010001, 97, 0, 0, 0)
    number = head_of(6, 1) + element(1, b"") + element(9, struct.pack("<d", 1.0))
    size, heads = len(number) + 8, []
    for _ in range(depth):
        size += len(begin)
        heads.append(struct.pack("<II", 14, size) + begin)
        size += 8
    return b"".join(reversed(heads)) + element(14, number)


def test_cells_so_deep_that_they_break_a_stack_are_refused(tmp_path):
    path = tmp_path / "log.mat"
    path.write_bytes(HEADER + b"\x00\x01IM" + nested(100_000))
    assert "levels of structs and cells must be at most 32" in refusal(path)


def test_a_variable_that_inflates_beyond_the_limit_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("TIREID_LIMITS", "block=2")
    path = write_5(tmp_path / "log.mat", {"t": T, "c": [np.zeros(500_000)]}, do_compression=True)
    assert path.stat().st_size < 20_000
    assert "megabytes of a variable must be at most 2, here are 2.0" in refusal(path)


def test_a_compressed_variable_that_is_no_variable_is_refused(tmp_path):
    data = zlib.compress(b"no variable, but some words")
    path = tmp_path / "log.mat"
    path.write_bytes(HEADER + b"\x00\x01IM" + struct.pack("<II", 15, len(data)) + data)
    assert "is cut off" in refusal(path)


def test_links_and_arrays_in_other_files_are_not_followed(tmp_path):
    secret = tmp_path / "secret.h5"
    with h5py.File(secret, "w") as file:
        file["v"] = A
    raw = tmp_path / "secret.bin"
    raw.write_bytes(A.tobytes())
    path = write_mat73(tmp_path / "log.mat", {"t": T, "own": B})
    with h5py.File(path, "r+") as file:
        file["there"] = h5py.ExternalLink(str(secret), "v")
        file["soft"] = h5py.SoftLink("/own")
        file.create_dataset("raw", (300,), "f8", external=[(str(raw), 0, 2400)])
        layout = h5py.VirtualLayout((300,), "f8")
        layout[:] = h5py.VirtualSource(str(secret), "v", (300,))
        file.create_virtual_dataset("virtual", layout)
    log = open_log(path)
    assert [one.name for one in log.listed()] == ["own"]
    assert log.notes == ("not read: raw (in another file), virtual (in another file)",)


def test_a_group_that_holds_itself_is_refused(tmp_path):
    path = write_mat73(tmp_path / "log.mat", {"t": T, "a": {"v": A}})
    with h5py.File(path, "r+") as file:
        file["a"]["again"] = file["a"]
    assert "levels of groups must be at most 32" in refusal(path)


def test_other_hdf5_files_are_read_as_they_are(tmp_path):
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["drive/t"], file["drive/v"] = T, A
        file["drive/m"] = np.column_stack([A, B])
        file["drive/v"].attrs["note"] = "x"
        file["blob"] = np.void(b"cos\nsystem\n(S'touch x'\ntR.")  # a pickle stays what it is
    log = open_log(path)
    assert log.format == "HDF5"
    assert np.array_equal(channel_of(log, "drive.v").values, A)
    assert np.array_equal(log.read(["drive.m(:,2)"])[0].values, B)
