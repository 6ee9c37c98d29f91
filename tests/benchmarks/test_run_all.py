"""`make bench` fails loudly: it names missed targets and failed scripts, and returns 1."""

import json

import pytest

from benchmarks import run_all, targets
from benchmarks.fingerprint import fingerprint
from benchmarks.targets import Targets, keeps

MISSES = """
import sys
from benchmarks.targets import Targets, keeps
targets = Targets("lap")
targets.at_most("time of a lap", 3.0, 2.0, "s", key="time")
targets.at_least("laps", 3.0, 2.0, "")
sys.exit(targets.finish(keep=keeps()))
"""


@pytest.fixture
def scripts(tmp_path, monkeypatch):
    """Give a checkout whose only benchmarks are those that a test writes."""
    folder = tmp_path / "benchmarks"
    folder.mkdir()
    for name in ("targets.py", "fingerprint.py"):
        (folder / name).write_text((run_all.ROOT / "benchmarks" / name).read_text())
    monkeypatch.setattr(run_all, "ROOT", tmp_path)
    monkeypatch.setattr(run_all, "BENCHMARKS", {"lap": [], "pit": []})
    (folder / "lap.py").write_text(MISSES.replace('3.0, 2.0, "s"', '1.0, 2.0, "s"'))
    (folder / "pit.py").write_text("print('no targets')\n")
    return folder


def bench(tmp_path, *words):
    return run_all.main(["--out", str(tmp_path / "out"), *words])


def test_targets_that_are_met_give_0(scripts, tmp_path, capsys):
    assert bench(tmp_path) == 0
    printed = capsys.readouterr().out
    assert "missed or failed: none" in printed
    assert (tmp_path / "out" / "summary.txt").read_text() in printed


def test_a_missed_target_gives_1_and_is_named(scripts, tmp_path, capsys):
    (scripts / "lap.py").write_text(MISSES)
    assert bench(tmp_path) == 1
    *_, row, other, last = capsys.readouterr().out.splitlines()
    assert row.split()[:3] == ["lap", "1", "1"] and row.endswith("MISSED: time of a lap")
    assert other.split()[:3] == ["pit", "-", "-"]
    assert last == "missed or failed: lap"


def test_a_script_that_fails_gives_1_and_is_named(scripts, tmp_path, capsys):
    (scripts / "pit.py").write_text("raise SystemExit(3)\n")
    assert bench(tmp_path) == 1
    printed = capsys.readouterr().out
    assert "FAILED with exit code 3" in printed and "missed or failed: pit" in printed


def test_record_is_handed_on_and_kept(scripts, tmp_path):
    bench(tmp_path, "--only", "lap")
    assert not (scripts / "results").exists()
    bench(tmp_path, "--only", "lap", "--record")
    kept = json.loads((scripts / "results" / "lap.json").read_text())
    assert kept["values"] == {"time": 1.0} and kept["units"] == {"time": "s"}
    assert kept["script"] == "benchmarks/lap.py"
    assert kept["code"] == fingerprint("lap", tmp_path) and set(kept["code"]) == {"script"}


def test_two_numbers_of_one_key_are_refused():
    found = Targets("lap")
    found.record("time", 1.0)
    with pytest.raises(ValueError, match="'time' is recorded twice"):
        found.at_most("again", 1.0, 2.0, key="time")


def test_a_value_on_the_limit_is_good_and_one_that_is_no_number_is_missed(capsys):
    found = Targets("lap")
    found.at_most("on it", 2.0, 2.0)
    found.at_least("on it", 2.0, 2.0)
    found.at_most("lost", float("nan"), 2.0)
    found.at_least("lost", float("nan"), 2.0)
    assert found.missed == ["lost", "lost"] and found.met == 2
    assert found.finish(keep=False) == targets.MISSED
    assert capsys.readouterr().out.count("MISSED") == 2


def test_the_word_record_is_taken_out_of_the_command():
    words = ["lap.py", "--record", "out"]
    assert keeps(words) and words == ["lap.py", "out"] and not keeps(words)
