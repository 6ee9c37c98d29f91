"""Which segments of a long drive the doctor looks at, and what it holds to find them."""

import tracemalloc

import numpy as np
import pytest

from codegen import arrays
from identifier.doctor.pieces import segments_of
from models.recordings import Recording
from models.vehicle import sedan

N, DT = 40_000, 0.01


@pytest.fixture
def drive(rng) -> Recording:
    swing = np.repeat(rng.uniform(0.0, 0.5, N // 200), 200)
    signals = {name: swing * rng.standard_normal(N) for name in ("v_y", "r", "delta_f", "delta_r")}
    return Recording(name="long", t=DT * np.arange(N), v_x=np.full(N, 20.0), **signals)


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
