"""What is heavy is left to a run of its own, and nothing is left out of both."""

import re
from pathlib import Path

import pytest

from tests.conftest import HEAVY, pytest_runtest_setup, sort_out

ROOT = Path(__file__).resolve().parents[1]
ENTRIES = [{"test": "t.py::sweep", "keep": ["a", "b-*"]}, {"test": "t.py::long", "beside": "x"}]


class Item:
    def __init__(self, nodeid):
        self.nodeid, self.marks = nodeid, []

    def add_marker(self, mark):
        self.marks.append(mark.name)

    def get_closest_marker(self, name):
        return name if name in self.marks else None


def sorted_out(*names):
    items = [Item(f"t.py::{name}") for name in names]
    unmet = sort_out(items, ENTRIES)
    return [item.nodeid[6:] for item in items if item.marks == ["heavy"]], unmet


def test_cases_that_are_kept_and_other_tests_are_not_heavy():
    names = ["sweep[a]", "sweep[ab]", "sweep[b-1]", "sweep[c-[2]]", "long", "longer", "other[a]"]
    assert sorted_out(*names) == (["sweep[ab]", "sweep[c-[2]]", "long"], [])


def test_an_entry_that_nothing_meets_is_told():
    assert sorted_out("sweep[a]", "sweep[c]")[1] == ["t.py::long", "t.py::sweep: b-*"]
    assert sorted_out("sweep[a]", "sweep[b-1]", "long")[1] == ["t.py::sweep"]  # none is heavy
    assert sort_out([Item("u.py::long")], ENTRIES) == []  # t.py is skipped


def test_what_is_heavy_is_left_out_when_its_time_is_over_and_nothing_else_is(monkeypatch):
    quick, heavy = Item("t.py::other"), Item("t.py::long")
    sort_out([quick, heavy], ENTRIES)
    for until in ("", "1e12"):
        monkeypatch.setenv("TIREID_HEAVY_UNTIL", until)
        pytest_runtest_setup(heavy)
    monkeypatch.setenv("TIREID_HEAVY_UNTIL", "1")
    pytest_runtest_setup(quick)
    with pytest.raises(pytest.skip.Exception, match="make heavy"):
        pytest_runtest_setup(heavy)


@pytest.mark.parametrize("entry", HEAVY, ids=lambda entry: entry["test"].partition("::")[2][:60])
def test_each_entry_says_what_stays(entry):
    assert {"keep"} ^ {"beside"} >= set(entry) - {"test"} and len(entry) == 2
    assert any(entry.get("keep", entry.get("beside")))
    file, _, name = entry["test"].partition("::")
    assert re.search(rf"^def {name}\(", (ROOT / file).read_text(encoding="utf-8"), re.M)


def test_what_make_test_leaves_is_run_by_make_heavy_and_by_continuous_integration():
    make = (ROOT / "Makefile").read_text(encoding="utf-8")
    chosen = re.findall(
        r"^(tests|heavy):.*\n\t\$\(PY\) -m pytest .* -m \"?([\w ]+)\"?$", make, re.M
    )
    assert chosen == [("tests", "not heavy"), ("heavy", "heavy")]
    (asked,) = re.findall(r"^test: (.*)\n\t\$\(MAKE\) .* (types tests)$", make, re.M)
    assert "format" in asked[0].split(), "and both halves of lint"
    text = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    ran = re.findall(r"^ *make (\w+)", text, re.M)
    assert ran.index("test") < ran.index("heavy")
    assert re.search(r"^make heavy .*TIREID_HEAVY_UNTIL=", text, re.M), "what is left out, said"
    assert "fuzzing and newest versions are left out" in text, "where they are, said"


def test_a_run_that_chooses_nothing_runs_what_is_heavy_too():
    """As `make mutants` does, which asks tests by their names."""
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert not re.search(r'addopts.*"-m', project)
    for path in (ROOT / "benchmarks" / "mutation").glob("*.py"):
        assert "heavy" not in path.read_text(encoding="utf-8"), path
