"""What runs lose when they are killed is seen: in files that are gone, changed, or not whole."""

import os
import random
import shutil
import time

import pytest

from benchmarks import kill_and_fill
from benchmarks.kill_and_fill import Bench, partial, warm
from codegen import find_compiler
from tireid import output
from tireid.output import MARKER, output_folder

pytestmark = [
    pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork"),
    pytest.mark.skipif(find_compiler() is None, reason="needs a C compiler"),
]


RUNS = 18  # of which one in three is killed behind the last file that it writes


def spoil_nothing(folder):
    pass


def delete(folder):
    (folder / "deep" / "b.txt").unlink()


def cut(folder):
    (folder / "a.txt").write_text("")


def change(folder):
    (folder / "a.txt").write_text("2")


def add(folder):
    (folder / "deep" / "c.txt").write_text("")


def unmark(folder):
    (folder / MARKER).write_text("{")


@pytest.mark.parametrize("spoil", [spoil_nothing, delete, cut, change, add, unmark])
def test_a_folder_that_is_not_whole_is_seen(tmp_path, spoil):
    with output_folder(tmp_path / "out", force=False) as folder:
        (folder / "a.txt").write_text("1")
        (folder / "deep").mkdir()
        (folder / "deep" / "b.txt").write_text("1")
    spoil(tmp_path / "out")
    assert bool(partial(tmp_path / "out")) is (spoil is not spoil_nothing)


@pytest.fixture(scope="module")
def warmed(tmp_path_factory):
    warm(tmp_path_factory.mktemp("warm"))


@pytest.mark.heavy
@pytest.mark.usefixtures("warmed")
def test_a_folder_that_is_written_in_place_is_lost_when_its_run_is_killed(tmp_path, monkeypatch):
    def copied(new, target, final, **_):
        shutil.rmtree(final, ignore_errors=True)
        final.mkdir()
        time.sleep(0.2)
        shutil.copytree(new, final, dirs_exist_ok=True)

    monkeypatch.setattr(output, "_put_in_place", copied)
    seen = kill_and_fill.kill(Bench(tmp_path / "bench"), RUNS, random.Random(0))
    assert seen["lost"] > 0


@pytest.mark.heavy
@pytest.mark.usefixtures("warmed")
def test_runs_that_are_killed_lose_nothing(tmp_path):
    seen = kill_and_fill.kill(Bench(tmp_path / "bench"), RUNS, random.Random(0))
    assert seen["lost"] == seen["unsaid"] == 0
    assert seen["written"] + seen["renamed"] > 0
