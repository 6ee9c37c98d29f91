"""Which segments of a long drive the doctor looks at, and what it holds to find them."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from codegen import arrays
from identifier.doctor.pieces import driven_pieces, looked_at, segments_of, usual_speed
from models.recordings import Recording, joined
from models.vehicle import sedan
from tests.made import made

N, DT = 40_000, 0.01


@pytest.fixture
def drive(rng) -> Recording:
    swing = np.repeat(rng.uniform(0.0, 0.5, N // 200), 200)
    signals = {name: swing * rng.standard_normal(N) for name in ("v_y", "r", "delta_f", "delta_r")}
    return made(DT * np.arange(N), **signals)


def places(drive: Recording) -> list[float]:
    return [float(one.t[0]) for one in segments_of(drive, sedan(), longest=60.0, pieces=4)]


def test_the_liveliest_segment_of_each_part_is_looked_at(drive):
    length, quarter = round(15.0 / DT), N // 4
    for k, begin in enumerate(places(drive)):
        starts = np.arange(k * quarter, (k + 1) * quarter - length + 1, length // 10)
        energy = [np.sum(drive.r[a : a + length] ** 2) for a in starts]
        assert begin == drive.t[starts[int(np.argmax(energy))]]


def test_they_are_the_same_found_block_by_block_and_little_is_held(drive, monkeypatch):
    whole = places(drive)
    monkeypatch.setattr(arrays, "LONG", 1000)
    monkeypatch.setattr(arrays, "BLOCK", 512)
    monkeypatch.setattr(arrays, "IN_MEMORY", 8000)
    tracemalloc.start()
    try:
        assert places(drive) == whole
        held = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert held < 8 * N


def test_of_a_long_log_pieces_all_over_it_are_looked_at_and_of_a_short_one_all(drive):
    (whole,) = looked_at(drive)
    assert whole is drive
    long = made(DT * np.arange(12 * 6000))
    pieces = looked_at(long)
    assert [len(one) for one in pieces] == [6000] * 10
    assert (pieces[0].t[0], pieces[-1].t[-1]) == (0.0, long.t[-1])
    v_x = np.where(long.t < 400.0, 0.0, -20.0)
    driving = replace(long, v_x=v_x)
    assert [one.t[0] for one in driven_pieces(driving)] == [
        one.t[0] for one in pieces if one.t[-1] > 401.0
    ]
    assert usual_speed((driving,)) == 20.0
    standing = replace(long, v_x=0.0 * v_x)
    assert len(driven_pieces(standing)) == 10


def test_gaps_cut_what_is_looked_at_and_short_segments_are_left_out(drive):
    parts = [drive.between(a, b) for a, b in ((0.0, 10.0), (50.0, 51.0), (60.0, 100.0))]
    broken = joined(parts)
    found = segments_of(broken, sedan(), longest=60.0, pieces=4)
    assert [len(one) for one in found] == [len(parts[0]), len(parts[2])]
    short = joined([drive.between(0.0, 1.0), drive.between(5.0, 6.5)])
    (only,) = segments_of(short, sedan(), longest=60.0, pieces=4)
    assert only.duration == pytest.approx(1.5, abs=0.02)
    slow = replace(drive, v_x=np.where(drive.t < 200.0, 1.0, 20.0))
    brisk = segments_of(slow, sedan(), longest=60.0, pieces=2)
    assert brisk[0].t[0] == 0.0 and brisk[1].t[0] >= 200.0, "nothing is lively where it is slow"
