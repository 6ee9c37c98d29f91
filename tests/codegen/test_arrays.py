"""Blocks of long recordings, arrays that lie on disk, and threads of BLAS."""

import gc
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController, threadpool_limits

from codegen import arrays
from codegen.arrays import LONG, blocks, filled, large, one_thread, thinning
from identifier.doctor import diagnose
from identifier.estimate.fit import fit
from identifier.estimate.latent import estimate_v_y
from models.vehicle import sedan


@pytest.mark.parametrize("n", [1, 59_999, LONG, LONG + 1, 1_000_000])
def test_blocks_cover_all_samples_once(n):
    parts = list(blocks(n))
    assert [part.start for part in parts] == [0, *(part.stop for part in parts[:-1])]
    assert parts[-1].stop == n
    assert (len(parts) == 1) == (n <= LONG)


def test_blocks_from_a_sample_on_cover_what_follows_once(monkeypatch):
    monkeypatch.setattr(arrays, "LONG", 30)
    monkeypatch.setattr(arrays, "BLOCK", 10)
    assert list(blocks(47, 33)) == [slice(33, 43), slice(43, 47)]
    assert list(blocks(25, 20)) == [slice(20, 25)]
    assert list(blocks(20, 20)) == []


@pytest.mark.parametrize("long", [1000, 20])
def test_values_are_filled_part_by_part_and_nobody_may_write_them(monkeypatch, long):
    monkeypatch.setattr(arrays, "LONG", long)
    monkeypatch.setattr(arrays, "BLOCK", 7)
    parts = []
    values = filled(45, lambda part: parts.append(part) or np.arange(45.0)[part] ** 2)
    np.testing.assert_array_equal(values, np.arange(45.0) ** 2)
    assert len(parts) == (1 if long > 45 else 7)
    with pytest.raises(ValueError, match="read-only"):
        values[0] = 1.0


def test_blocks_overlap_as_far_as_there_are_samples():
    parts = list(blocks(LONG + 1, overlap=3))
    assert all(one.stop - other.start == 3 for one, other in pairwise(parts))
    assert parts[-1].stop == LONG + 1


@pytest.mark.parametrize("n", [1, LONG, LONG + 1, 10 * LONG])
def test_thinned_samples_are_at_most_those_of_a_short_recording(n):
    assert LONG / 2 < len(range(0, n, thinning(n))) <= LONG or n <= LONG
    assert (thinning(n) == 1) == (n <= LONG)


def test_a_large_array_lies_on_disk_and_a_small_one_in_memory(monkeypatch):
    monkeypatch.setattr(arrays, "IN_MEMORY", 800)
    small, big = large((100,)), large((101, 3))
    assert small.base is None
    assert isinstance(big.base, np.memmap)
    big[:] = np.arange(303.0).reshape(101, 3)
    np.testing.assert_array_equal(big.ravel(), np.arange(303.0))


def test_a_large_array_is_in_memory_where_the_disk_is_full(monkeypatch):
    def full(*_):
        raise OSError("no space left on device")

    monkeypatch.setattr(arrays, "IN_MEMORY", 800)
    monkeypatch.setattr(arrays.os, "posix_fallocate", full, raising=False)
    assert large((101,)).base is None


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="Linux tells what memory holds")
def test_pages_on_disk_are_let_go_after_a_block_and_hold_what_was_written():
    def held():
        lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
        return next(float(line.split()[1]) / 1024 for line in lines if line.startswith("RssFile"))

    n = 4_000_000
    array = large((n,))
    array[:] = np.arange(n)
    full = held()
    for _ in blocks(LONG + 1):
        pass
    assert held() < full - 25.0  # of 32 MB
    np.testing.assert_array_equal(array, np.arange(n))
    kept = len(arrays._mapped)
    del array
    gc.collect()
    assert len(arrays._mapped) < kept


def blas_threads():
    return {
        one["num_threads"] for one in ThreadpoolController().info() if one["user_api"] == "blas"
    }


@pytest.fixture
def before():
    with threadpool_limits(3, "blas"):
        yield blas_threads()


def test_blas_has_one_thread_until_the_last_of_several_calls_ends(before):
    one = {1} if before else before  # else it is a BLAS that nobody can ask
    with suppress(KeyError), one_thread:
        first = Thread(target=one_thread.__enter__)
        first.start(), first.join()
        assert blas_threads() == one
        raise KeyError
    assert blas_threads() == one
    one_thread.__exit__()
    assert blas_threads() == before


@pytest.mark.parametrize(
    "call",
    [
        lambda log: fit([log], sedan()),
        lambda log: estimate_v_y(log, sedan(), None, None),
        lambda log: diagnose(log, sedan()),
    ],
)
def test_the_estimate_takes_one_thread_and_leaves_as_many_as_before(before, call):
    class Log:
        def __getattr__(self, name):
            raise KeyError(blas_threads())

    with pytest.raises(KeyError) as told:
        call(Log())
    assert told.value.args == ({1} if before else before,)
    assert blas_threads() == before
