from pathlib import Path

import pytest

from mpc.realtime import instance as source_cache
from mpc.realtime.instance import tracker_source
from mpc.tires.network import NetworkAxles


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("TIREID_CACHE", str(tmp_path))
    return tmp_path


def test_a_second_start_generates_nothing_and_has_the_same_text(own_cache, linear, monkeypatch):
    first = tracker_source(linear.structure, 10, single=False)
    monkeypatch.setattr(source_cache, "_generated", lambda *_: pytest.fail("generated again"))
    assert tracker_source(linear.structure, 10, single=False) == first
    assert [path.suffix for path in own_cache.iterdir()] == [".c"]


@pytest.mark.heavy
def test_whatever_the_text_depends_on_is_in_its_key(own_cache, monkeypatch):
    inputs = ("v_y", "r", "delta_f")
    small, large = (NetworkAxles(hidden=n, inputs=inputs) for n in (2, 3))
    texts = {
        tracker_source(small, 10, single=False),
        tracker_source(large, 10, single=False),
        tracker_source(small, 11, single=False),
        tracker_source(small, 10, single=True),
    }
    assert len(texts) == 4
    monkeypatch.setattr(source_cache, "source_digest", lambda: "another version")
    tracker_source(small, 10, single=False)
    assert len(list(own_cache.iterdir())) == 5


def test_the_key_does_not_depend_on_the_order_in_which_a_folder_lists_its_files(monkeypatch):
    generator = source_cache.source_digest.__wrapped__
    first, listed = generator(), Path.rglob
    monkeypatch.setattr(Path, "rglob", lambda *words: sorted(listed(*words), reverse=True))
    assert generator() == first
