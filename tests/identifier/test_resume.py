"""Work that was stopped goes on where it was, and never takes the result of other work."""

import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import identifier.compare.work
from identifier.compare.course import Course
from identifier.compare.sweep import CHUNK, sweep
from identifier.compare.work import Store, content_digest, run_resumably


class Killed(BaseException):
    """What ends the process."""


def store(folder):
    return Store(
        folder=folder,
        name=lambda item: content_digest("squares", item),
        to_json=lambda result: {"square": result},
        from_json=lambda kept: kept["square"],
    )


def killed_after(count):
    """A map that works on some items, the last first, and then is gone."""

    def some(work, items):
        for done, item in enumerate(reversed(items)):
            if done == count:
                raise Killed
            yield work(item)

    return some


class Square:
    """A work that remembers what it was asked."""

    def __init__(self):
        self.asked = []

    def __call__(self, item):
        self.asked.append(item)
        return item**2


def test_what_was_finished_is_not_worked_out_again(tmp_path):
    work, items = Square(), [3, 1, 4, 5, 9]
    with pytest.raises(Killed):
        run_resumably(work, items, killed_after(3), store=store(tmp_path))
    assert work.asked == [9, 5, 4]
    told = []
    again = run_resumably(
        work, items, map, store=store(tmp_path), done=lambda *counts: told.append(counts)
    )
    assert again == [9, 1, 16, 25, 81]
    assert work.asked == [9, 5, 4, 3, 1]
    assert told == [(3, 3), (3, 4), (3, 5)]


def test_without_a_store_all_is_worked_out(tmp_path):
    work = Square()
    assert run_resumably(work, [2, 3], map) == run_resumably(work, [2, 3], map) == [4, 9]
    assert work.asked == [2, 3, 2, 3]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("damage", ["", '{"squ', "[1, 2]", "{}", "\x00\xff"])
def test_a_damaged_result_is_found_anew(tmp_path, damage):
    work = Square()
    run_resumably(work, [6, 7], map, store=store(tmp_path))
    file = tmp_path / f"{store(tmp_path).name(7)}.json"
    file.write_text(damage)
    assert run_resumably(work, [6, 7], map, store=store(tmp_path)) == [36, 49]
    assert work.asked == [6, 7, 7]
    assert json.loads(file.read_text()) == {"square": 49}


def test_a_digest_tells_apart_what_differs(monkeypatch):
    arrays = np.arange(6.0), np.arange(6.0).reshape(2, 3), np.arange(6), np.nextafter(range(6), 9)
    different = [*arrays, "ab", ("a", "b"), 1, 1.0, 0.1 + 0.2, 0.3]
    digests = {content_digest(part) for part in different} | {content_digest("a", "b")}
    assert len(digests) == len(different) + 1
    assert content_digest(*arrays) == content_digest(*(array.copy() for array in arrays))
    before = content_digest(1)
    monkeypatch.setattr(identifier.compare.work, "source_digest", lambda: "another version")
    assert content_digest(1) != before


def test_another_source_text_has_another_digest(monkeypatch, tmp_path):
    digests = set()
    for text in ("x = 1", "x = 2"):
        for package in identifier.compare.work.PACKAGES:
            (tmp_path / package).mkdir(exist_ok=True)
            (tmp_path / package / "step.py").write_text(text)
        monkeypatch.setattr(identifier.compare.work, "ROOT", tmp_path)
        digests.add(identifier.compare.work.source_digest.__wrapped__())
    assert len(digests) == 2


@pytest.fixture(name="course")
def a_course(car, drive):
    return Course(vehicle=car, recordings=(drive(n=300),), min_speed=1.0)


def refuse(work, items):
    assert not list(items), "nothing was left to do"
    return iter(())


def test_a_sweep_that_was_stopped_goes_on(course, tmp_path):
    options = {"designs": 2 * CHUNK + 3, "seed": 3, "folder": tmp_path}
    with pytest.raises(Killed):
        sweep(["integral"], course, elsewhere=killed_after(2), **options)
    assert len(list(tmp_path.glob("*.json"))) == 2
    said = []
    found = sweep(["integral"], course, workers=1, progress=said.append, **options)
    assert found == sweep(["integral"], course, workers=1, designs=2 * CHUNK + 3, seed=3)
    assert f"{2 * CHUNK} of {2 * CHUNK + 3} designs were judged by an earlier run" in said[0]
    assert sweep(["integral"], course, elsewhere=refuse, **options) == found


def test_a_sweep_of_anything_else_is_another(course, tmp_path):
    options = {"designs": 2, "seed": 3, "folder": tmp_path}
    sweep(["integral"], course, workers=1, **options)
    (recording,) = course.recordings
    scaled = replace(recording, axle_force=recording.axle_force * 1.01)
    heavier = replace(course.vehicle, mass=course.vehicle.mass + 1.0)
    for other, changed in (
        (course, {"seed": 4}),
        (replace(course, recordings=(scaled,)), {}),
        (replace(course, vehicle=heavier), {}),
        (replace(course, min_speed=2.0), {}),
    ):
        with pytest.raises(AssertionError, match="nothing was left to do"):
            sweep(["integral"], other, elsewhere=refuse, **{**options, **changed})


def test_a_digest_sees_every_entry_the_shape_and_the_type_of_an_array():
    long = np.zeros(5000)
    other = long.copy()
    other[2500] = 1e-12  # repr leaves the middle of long arrays out
    parts = [long, other, long.reshape(50, 100), long.astype(np.float32), long[:-1], "x", 1, 1.0]
    assert len({content_digest(part) for part in parts}) == len(parts)
    assert content_digest(long, 2.0) == content_digest(np.zeros(5000), 2.0)
    assert content_digest(long[::2]) == content_digest(np.zeros(2500)), "strides do not matter"
    assert content_digest("a", "b") != content_digest("ab")


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="asks /proc who lives")
def test_processes_end_with_the_one_that_made_them_when_that_is_killed():
    program = (
        "import os, time\n"
        "from identifier.compare.work import fresh_processes\n"
        "if __name__ == '__main__':\n"
        "    pool = fresh_processes(2)\n"
        "    waits = [pool.submit(time.sleep, 0.5) for _ in range(2)]\n"
        "    [one.result() for one in waits]\n"
        "    print(*pool._processes, flush=True)\n"
        "    time.sleep(60)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        workers = [int(one) for one in parent.stdout.readline().split()]
        assert workers and all(_lives(one) for one in workers)
        parent.kill()
    until = time.monotonic() + 10.0
    while any(_lives(one) for one in workers) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(_lives(one) for one in workers)


def _lives(process):
    """Whether a process is there and no zombie that nobody has waited for."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
