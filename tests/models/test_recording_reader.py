"""Files: what is read, how it is resampled, and what is refused with which line."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from models.recordings import (
    LogMap,
    RecordingError,
    Repair,
    read_recording,
    runs,
    split_log_argument,
    write_recording,
)
from tests.made import made
from tests.refused import line_about

HEADER = "t,vx,vy,r,delta_f"


def rows(n=60, dt=0.01, start=0.0):
    return [f"{start + k * dt:.6f},20,0,0,0" for k in range(n)]


def write(path, header, lines):
    text = "\n".join([header, *lines]) + "\n"
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


def refusal(path, run=None):
    return line_about(path, RecordingError, read_recording, run)


def test_other_columns_order_spaces_quotes_and_byte_order_marks_do_not_matter(tmp_path):
    path = tmp_path / "log.csv"
    lines = [f'note;"x",{0.001 * k}, 1 ,"2",20,{k * 0.01:.2f}' for k in range(60)]
    path.write_text("﻿junk,delta_f, r,vy,vx,t\n\n" + "\r\n".join(lines), encoding="utf-8")
    got = read_recording(path, check=False)
    assert got.name == "log"
    assert got.delta_f[3] == 0.003
    assert np.all(got.r == 1.0)
    assert np.all(got.v_y == 2.0)
    assert np.all(got.delta_r == 0.0)
    assert got.a_y is None
    assert got.axle_force is None


def test_runs_are_listed_chosen_and_named(tmp_path):
    lines = [line + ",b" for line in rows()] + [line + ",a" for line in rows(start=7.0)]
    path = write(tmp_path / "two.laps.csv.gz", HEADER + ",run", lines)
    assert runs(path) == ["b", "a"]
    assert read_recording(path, "a").name == "two.laps:a"
    assert read_recording(path, "a").t[0] == 7.0
    assert refusal(path).endswith("name one of its runs: b, a")
    assert "no run 'c', the runs are: b, a" in refusal(path, "c")
    spoiled = [line + ",b" for line in rows()] + [
        "nan" + line[line.index(",") :] + ",a" for line in rows()
    ]
    assert refusal(write(tmp_path / "bad.csv", HEADER + ",run", spoiled), "a").startswith(":a: ")
    single = write(tmp_path / "one.csv", HEADER + ",run", [line + ",only" for line in rows()])
    assert read_recording(single).name == "one:only"
    plain = write(tmp_path / "plain.csv", HEADER, rows())
    assert runs(plain) == []
    assert "holds one run without a name, so no run 'a'; leave it out" in refusal(plain, "a")


@pytest.mark.parametrize(
    ("name", "content", "rule"),
    [
        ("a.csv.gz", gzip.compress(b"t,vx\n" * 9, mtime=0)[:-9], "damaged or cut off"),
        (
            "a.csv.gz",
            gzip.compress(b"t,vx\n" * 9, mtime=0)[:12] + b"junkjunk",
            "damaged or cut off",
        ),
        ("a.parquet", b"t,vx,vy,r,delta_f\n", "not a Parquet file"),
        ("a.parquet", b"", "not a Parquet file"),
        ("a.csv", b"t;vx;vy;r;delta_f\n0;1;2;3;4\n", "there are 1 rows, at least 10 needed"),
        ("a.csv", b"hello world\nhow are you\n", "column vx, vy, r, delta_f is missing"),
        ("a.csv", b"t\n0\n1\n2\n", "there is none but the time"),
    ],
)
def test_a_file_that_is_no_log_is_refused(tmp_path, name, content, rule):
    (tmp_path / name).write_bytes(content)
    assert rule in refusal(tmp_path / name)


def test_what_is_packed_is_told_by_its_bytes_not_by_its_name(tmp_path):
    packed = write(tmp_path / "a.csv.gz", HEADER, rows()).rename(tmp_path / "a.csv")
    plain = write(tmp_path / "b.csv", HEADER, rows()).rename(tmp_path / "b.csv.gz")
    assert np.array_equal(read_recording(packed).t, read_recording(plain).t)


@pytest.mark.parametrize(
    ("header", "rule"),
    [
        ("t,Vx,vy,r,delta_f", "column vx is missing; did you mean 'Vx' for vx"),
        (
            "t,vx,vy,yaw_rate,delta",
            "'yaw_rate' for r (it never changes; no unit in the file), 'delta'",
        ),
        ("t,V_x,vy,r,delta_f", "'V_x' for vx"),
        ("t,vx,vy,vx,delta_f", "column vx appears more than once"),
        ("t,vx,vy,r,steer_cmd", "column delta_f is missing"),
    ],
)
def test_a_missing_or_doubled_column_is_named_with_what_was_meant(tmp_path, header, rule):
    assert rule in refusal(write(tmp_path / "a.csv", header, rows()))


@pytest.mark.parametrize(
    ("cell", "rule"),
    [
        ("fast", "vx must be numeric, line 12 has 'fast'"),
        ("1;5", "vx must be numeric, line 12 has '1;5'"),
        ("", "vx must be finite, 1 of 60 values are empty, NaN or infinite, the first in line 12"),
        ("nan", "the first in line 12"),
        ("inf", "the first in line 12"),
        ("1,5", "line 12 has 6 cells, the header has 5"),
    ],
)
def test_a_bad_cell_is_named_with_its_line(tmp_path, cell, rule):
    lines = rows()
    lines[10] = f"0.10,{cell},0,0,0"
    assert rule in refusal(write(tmp_path / "a.csv", HEADER, lines))


def test_time_must_rise_in_seconds(tmp_path):
    path, lines = tmp_path / "a.csv", rows(400)
    assert "t must increase, line 52 has 0.49 after 0.49" in refusal(
        write(path, HEADER, [*lines[:50], lines[49], *lines[50:]])
    )
    assert "several runs in one file need a column run" in refusal(
        write(path, HEADER, lines[:50] + lines[:50])
    )
    assert (
        read_recording(write(path, HEADER, lines[:50] + lines[58:])).t.size == 400
    )  # eight lost samples are bridged
    in_ms = read_recording(write(path, HEADER, rows(dt=10.0)))
    assert in_ms.t[-1] == pytest.approx(0.59) and any("in ms" in one for one in in_ms.notes)
    assert "at least 10 samples per second" in refusal(
        write(path, HEADER.replace("t,", "t [s],"), rows(dt=0.2))
    )
    assert 'its typical step is 10; --columns "t=t [ms]"?' in refusal(
        write(path, HEADER.replace("t,", "t [s],"), rows(dt=10.0))
    )
    assert "there are 8 rows" in refusal(write(path, HEADER, rows(8)))
    assert "lasts 0.05 s" in refusal(write(path, HEADER, rows(60, dt=0.001)))


def test_a_gap_cuts_a_log_into_segments_and_it_is_said(tmp_path):
    path, lines = tmp_path / "a.csv", rows(400)
    got = read_recording(write(path, HEADER, lines[:150] + lines[161:]))
    assert got.breaks == (150,) and len(got) == 389
    assert got.t[149] == 1.49 and got.t[150] == 1.61 and got.dt == 0.01
    assert got.duration == pytest.approx(3.87)
    note = got.notes[-1]
    assert "2 segments" in note and "lasts 0.12 s, after 1.49 s" in note
    short = read_recording(write(path, HEADER, lines[:50] + lines[61:]))
    assert short.t[0] == 0.61 and not short.breaks
    assert short.notes[-1:] == ("left out: 1 segment of less than 1 s",)


@pytest.mark.parametrize("source", [0.001, 0.0025, 0.004, 0.02, 0.05])
def test_resampling_keeps_a_maneuver_without_lag(tmp_path, source):
    t = source * np.arange(round(4.0 / source) + 1)
    lines = [f"{a:.6f},20,{np.sin(2 * np.pi * a):.9f},0,0" for a in t]
    got = read_recording(write(tmp_path / "a.csv", HEADER, lines), check=False)
    assert got.dt == 0.01
    assert got.t[-1] == pytest.approx(4.0)
    error = got.v_y - np.sin(2 * np.pi * got.t)
    assert np.abs(error).max() < (2 * np.pi * max(source, 0.01)) ** 2 / 8 * 1.01
    assert abs(error @ np.cos(2 * np.pi * got.t)) / got.t.size < 1e-4  # in phase


def test_uneven_time_stamps_are_brought_to_the_grid(tmp_path, rng):
    t = np.cumsum(rng.uniform(0.005, 0.015, 500))
    lines = [f"{a:.9f},{20 + 3 * a:.9f},0,0,0" for a in t]
    got = read_recording(write(tmp_path / "a.csv", HEADER, lines), check=False)
    assert np.allclose(np.diff(got.t), 0.01)
    assert np.allclose(got.v_x, 20 + 3 * got.t, atol=1e-7)  # a straight line stays one


def test_a_log_argument_is_split_at_the_right_colon(tmp_path, monkeypatch):
    assert split_log_argument("a/log.csv.gz:lap:2") == (Path("a/log.csv.gz"), "lap:2")
    for ending in ("tsv", "vbo", "asc", "dat", "txt", "log"):
        path = write(tmp_path / f"packed.{ending}.gz", HEADER, rows())
        assert split_log_argument(f"{path}:lap") == (path, "lap")
        assert read_recording(path).name == "packed"
    assert split_log_argument("log.csv") == (Path("log.csv"), None)
    assert split_log_argument("C:\\logs\\log.csv") == (Path("C:\\logs\\log.csv"), None)
    assert split_log_argument("C:/log.parquet:a") == (Path("C:/log.parquet"), "a")
    assert split_log_argument("da:y/log.csv:a") == (Path("da:y/log.csv"), "a")
    monkeypatch.chdir(tmp_path)
    Path("log.csv:a").touch()
    assert split_log_argument("log.csv:a") == (Path("log.csv:a"), None)


def test_inverse_forces_stand_in_where_none_were_measured(tmp_path):
    log = tmp_path / "log.csv"
    rows = [f"{0.01 * k:.2f},10,0,0.01,0.002,3,4" for k in range(100)]
    log.write_text("\n".join(["t,vx,vy,r,delta_f,Fyf_inv,Fyr_inv", *rows]))
    np.testing.assert_array_equal(read_recording(log).axle_force[0], [3.0, 4.0])
    both = [row + ",5,6" for row in rows]
    log.write_text("\n".join(["t,vx,vy,r,delta_f,Fyf_inv,Fyr_inv,Fyf,Fyr", *both]))
    np.testing.assert_array_equal(read_recording(log).axle_force[0], [5.0, 6.0])


@pytest.fixture(scope="module")
def mirrored(tmp_path_factory):
    """A log whose accelerometer shows the other sign."""
    t = 0.01 * np.arange(1000)
    r = 0.3 * np.sin(2.0 * t)
    drive = made(t, name="mirrored", r=r, delta_f=2.7 / 20.0 * r, a_y=-20.0 * r)
    return write_recording(drive, tmp_path_factory.mktemp("logs") / "mirrored.csv")


@pytest.mark.parametrize(
    ("wrong", "right"), [("[rad] /-2", "[rad] /2"), ("*-2 - 0.01", "*2 - -0.01")]
)
def test_a_wrong_sign_is_refused_with_the_word_that_turns_it(mirrored, wrong, right):
    given = {"ay": "ay *-1", "delta_f": f"delta_f {wrong}"}
    with pytest.raises(RecordingError) as refused:
        read_recording(mirrored, columns=given)
    assert f'(--columns "delta_f=delta_f {right}")' in str(refused.value)
    read_recording(mirrored, columns=given | {"delta_f": f"delta_f {right}"})


RIGHT = LogMap(repair=Repair(factor={"a_y": -1.0}, vehicle={"mass": 1400.0}))
STILL_WRONG = LogMap(repair=Repair(offset={"r": 0.001}))


def test_a_map_with_a_repair_is_judged_by_what_the_repair_leaves(mirrored):
    with pytest.raises(RecordingError, match="ay "):
        read_recording(mirrored)
    with pytest.raises(RecordingError, match=f"^{mirrored}: "):
        read_recording(mirrored, log_map=STILL_WRONG)
    recording = read_recording(mirrored, log_map=RIGHT)
    assert recording.a_y is not None
    np.testing.assert_array_equal(recording.a_y, -20.0 * recording.r)  # as it was logged


def test_at_a_coarse_interval_a_segment_of_too_few_samples_is_left_out(tmp_path):
    lines = rows(40, dt=0.05) + rows(200, dt=0.05, start=10.0)  # 2 s and 10 s
    path = write(tmp_path / "coarse.csv", "t,vx,vy,r,delta_f", lines)
    fine = read_recording(path, dt=0.05)
    assert len(fine.segments) == 2 and not any("left out" in note for note in fine.notes)
    coarse = read_recording(path, dt=0.25)
    assert coarse.breaks == () and len(coarse) >= 40
    assert coarse.notes[-1:] == ("left out: 1 segment of less than 2.5 s",)


def test_a_car_that_stands_is_read_with_its_accelerometer():
    still = dict.fromkeys(("vx", "vy", "r", "delta_f", "ay"), np.zeros(1000))
    assert not read_recording({"t": np.arange(1000) * 0.01, **still}).notes
