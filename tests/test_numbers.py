"""Every number of README and docs carries the script and key that prints it, and is that number."""

import ast
import json
import re
from functools import cache
from pathlib import Path

import pytest

from benchmarks import documents
from benchmarks.documents import (
    complaints,
    expand,
    listed,
    marks,
    numbers,
    older,
    printed,
    quoted,
    recorded,
    rewritten,
)
from benchmarks.fingerprint import fingerprint, modules
from benchmarks.run_all import APART, BENCHMARKS
from benchmarks.targets import RESULTS, Targets

ROOT = Path(__file__).resolve().parents[1]
BENCHMARK_FILES = {path.stem: path for path in (ROOT / "benchmarks").glob("*.py")}
DOCUMENTS = documents.documents()


# Quoted in README.md though their script changed since. Empty it: one leaves when it is recorded.
TO_RECORD: set[str] = set()
VALUES = {"speed": {"step": 0.0123, "count": 60789, "tiny": 6.6e-15, "name": "axle"}}
GOOD = """# Title

A step takes 12.3 ms with Python 3.11, 60 800 instructions and an error of 7e-15.
<!-- numbers speed: step*1e3 version=3.11 count~3 tiny -->

| a | b |
|---|---|
| 0.01 | `0.5` |
<!-- numbers speed: step -->
"""


def told(text: str) -> list[str]:
    return [what for _, what in complaints(text, VALUES)]


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_every_number_is_the_recorded_one_or_says_why_it_is_given(path):
    text, name = path.read_text(encoding="utf-8"), path.relative_to(ROOT).as_posix()
    wrong = [
        f"{name}:{text.count(chr(10), 0, at) + 1}: {what}"
        for at, what in complaints(text, recorded())
    ]
    assert not wrong, "\n".join([*wrong, "`make numbers` writes what was recorded"])


def test_a_true_document_has_no_complaint():
    assert told(GOOD) == []
    assert [number.text for number in numbers(GOOD)] == ["12.3", "3.11", "60 800", "7e-15", "0.01"]


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("12.3", "12.4", "12.4 should be 12.3 (speed: step)"),
        ("12.3", "12.30", None),  # one more digit is printed, and it is the right one
        ("12.3", "12.31", "12.31 should be 12.30 (speed: step)"),
        ("60 800", "60 789", "60 789 should be 60 800 (speed: count)"),
        ("7e-15", "6e-15", "6e-15 should be 7e-15 (speed: tiny)"),
        ("0.01", "0.02", "0.02 should be 0.01 (speed: step)"),
        ("3.11", "3.12", "3.12 should be 3.11 (version=3.11)"),
        ("step*1e3", "stop*1e3", "speed records no stop"),
        ("numbers speed: step ", "numbers sped: step ", "no benchmarks/results/sped.json is"),
        ("tiny", "name", "speed: name is no number but 'axle'"),
        ("version=", "because=", "because=3.11: a reason is one of input, target"),
        ("numbers speed: step*", "numbers step*", "step*1e3: no script is named before it"),
        ("count~3", "count~x", "count~x: neither key"),
        (" tiny", "", "3 items for 4 numbers: 12.3, 3.11, 60 800, 7e-15"),
        ("# Title", "# Title 7", "7 has no source"),
        ("| `0.5`", "| 0.5", "1 items for 2 numbers: 0.01, 0.5"),
        ("<!-- numbers speed: step -->", "<!-- step -->", "0.01 has no source"),
    ],
)
def test_what_drifted_is_caught(old, new, complaint):
    assert old in GOOD
    found = told(GOOD.replace(old, new, 1))
    if complaint is None:
        assert found == []
    else:
        assert any(complaint in line for line in found), found


def test_a_number_that_drifts_in_a_document_is_caught():
    values, tried = recorded(), 0
    for path in DOCUMENTS:
        text = path.read_text(encoding="utf-8")
        before, found = complaints(text, values), numbers(text)
        inside = ([n for n in found if mark.start <= n.start < mark.end] for mark in marks(text))
        wrong = {at for at, _ in before}
        for number in (some[0] for some in inside if some and some[0].start not in wrong):
            other = text[: number.start] + "77.77" + text[number.start + len(number.text) :]
            assert len(complaints(other, values)) > len(before), (path, number)
            tried += 1
    assert tried >= 40


def test_names_code_and_links_hold_no_numbers():
    text = (
        "C99, x86-64, Cortex-M4F, PAC2002, F_1, ISO 3888-2, `--mu 0.5`, [words](a/2.png), K⁻¹ "
        '<img width="3">\n\n```sh\nrun 4\n```\n\n<!-- 5 -->\n'
    )
    assert numbers(text) == []


def test_signs_ranges_scales_and_versions_are_read():
    text = "a 1:10 car, 0.75-0.86, −2.1 to -3, (6), 1.2.3, 10 000 drives, 2 s."
    found = [number.text for number in numbers(text)]
    assert found == ["1:10", "0.75", "0.86", "−2.1", "-3", "6", "1.2.3", "10 000", "2"]


def test_braces_stand_for_what_a_shell_makes_of_them():
    assert list(expand("a/{b,c}/{d,e}*2")) == ["a/b/d*2", "a/b/e*2", "a/c/d*2", "a/c/e*2"]


@pytest.mark.parametrize(
    ("value", "like", "digits", "text"),
    [
        (3.14159, "9.99", None, "3.14"),
        (1839.6, "1", None, "1840"),
        (1839.6, "1", 2, "1800"),
        (60789.0, "1", 3, "60 800"),
        (0.034567, "1", 2, "0.035"),
        (9.96, "1", 2, "10"),
        (4.44e-10, "1e-9", None, "4e-10"),
        (-2.06, "−9.9", None, "−2.1"),
    ],
)
def test_numbers_are_printed_like_those_that_they_replace(value, like, digits, text):
    assert printed(value, like, digits) == text


def test_recorded_values_are_written_into_a_document():
    stale = GOOD.replace("12.3", "99.9").replace("60 800", "1").replace("| 0.01", "| 0.09")
    assert told(stale) and rewritten(stale, VALUES) == GOOD


def test_writing_leaves_alone_what_it_cannot_serve():
    broken = GOOD.replace("step*1e3", "stop").replace("| 0.01", "| 0.09").replace("7e", "9e")
    served = broken.replace("| 0.09", "| 0.01").replace("9e", "7e")
    assert rewritten(broken, VALUES) == served
    uneven = broken.replace("| `0.5`", "| 0.5")
    assert rewritten(uneven, VALUES) == uneven.replace("9e", "7e")


def test_the_command_writes_what_was_recorded_and_says_what_it_cannot(
    tmp_path, monkeypatch, capsys
):
    page = tmp_path / "README.md"
    monkeypatch.setattr(documents, "ROOT", tmp_path)
    monkeypatch.setattr(documents, "documents", lambda: [page])
    monkeypatch.setattr(documents, "recorded", lambda: VALUES)
    monkeypatch.setattr(documents, "older", lambda: {"speed": ("models",)})
    stale = GOOD.replace("12.3", "99.9")
    page.write_text(stale)
    assert documents.main(["--check"]) == 1 and page.read_text() == stale
    told = capsys.readouterr().out
    assert "README.md:3: 99.9 should be 12.3 (speed: step)" in told
    assert "speed: recorded before models changed" in told
    assert documents.main([]) == 0 and page.read_text() == GOOD
    assert "+A step takes 12.3 ms" in capsys.readouterr().out
    page.write_text(GOOD + "\nAnd 4 more.\n")
    assert documents.main([]) == 1
    assert "README.md:11: 4 has no source" in capsys.readouterr().out


def test_a_target_that_is_met_at_last_or_missed_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.targets.RESULTS", tmp_path)
    for value, word in ((2.2, "missed"), (1.9, "target")):
        targets = Targets("lap")
        targets.at_most("ratio", value, 2.0, "-", key="ratio")
        targets.finish(keep=True)
        values = recorded(tmp_path)
        text = f"{value} times (target 2{', missed' * (word == 'missed')}).\n"
        assert complaints(f"{text}<!-- numbers lap: ratio ratio@{word} -->\n", values) == []
        other = {"missed": "target", "target": "missed"}[word]
        stale = complaints(f"{text}<!-- numbers lap: ratio ratio@{other} -->\n", values)
        assert [what for _, what in stale] == [f"lap records no ratio@{other}"]


# A record and the code that it measured.


@cache
def older_records() -> dict[str, tuple[str, ...]]:
    return older()


def plant(folder: Path) -> None:
    """Write a checkout with two benchmarks and what they run."""
    for name, text in {
        "benchmarks/lap.py": "from benchmarks.course import bends\nfrom models.car import drive\n",
        "benchmarks/course.py": "bends = 7\n",
        "benchmarks/pit.py": "stops = 1\n",
        "models/__init__.py": "",
        "models/car.py": "def drive():\n    from models.tire import grip\n    return grip\n",
        "models/tire.py": "grip = 1\n",
        "models/wind.py": "speed = 3\n",
        "models/c/road.c": "int bumps = 0;\n",
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


@pytest.mark.parametrize(
    ("name", "text", "packages"),
    [
        ("benchmarks/lap.py", "from models.car import drive\n", ("benchmarks", "script")),
        ("benchmarks/course.py", "bends = 8\n", ("benchmarks",)),
        ("models/tire.py", "grip = 2\n", ("models",)),  # imported in a function
        ("models/c/road.c", "int bumps = 1;\n", ("models",)),
        ("models/c/road.c", "int  bumps = 0; /* flat */\n", None),
        ("models/tire.py", '"""Words."""\n\ngrip = (1)  # of the road\n', None),
        ("models/wind.py", "speed = 4\n", None),
        ("benchmarks/pit.py", "stops = 2\n", None),
    ],
)
def test_a_record_older_than_the_code_that_it_measures_is_found(tmp_path, name, text, packages):
    then, today, record = tmp_path / "then", tmp_path / "today", tmp_path / "lap.json"
    plant(then)
    plant(today)
    (today / name).write_text(text)
    record.write_text(json.dumps({"values": {}, "code": fingerprint("lap", then)}))
    assert older(tmp_path, then) == {}
    assert older(tmp_path, today) == ({} if packages is None else {"lap": packages})
    record.write_text(json.dumps({"values": {}}))
    assert {"models", "script"} <= {*older(tmp_path, today)["lap"]}


def test_a_benchmark_of_a_command_measures_all_commands():
    assert {"tireid.commands.identify", "identifier.axle.step"} <= modules("benchmarks.long_logs")


def test_every_record_says_which_code_it_measured():
    for path in RESULTS.glob("*.json"):
        code = json.loads(path.read_text(encoding="utf-8")).get("code", {})
        assert "script" in code, f"{path.name}: only `--record` of its benchmark writes it"


def test_no_number_of_the_readme_is_of_a_benchmark_that_measures_another_thing_today():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    stale = {name for name, packages in older_records().items() if "script" in packages}
    todo = "record with benchmarks.run_all --record --only, or strike from TO_RECORD"
    assert quoted(text) & stale == TO_RECORD, todo
    assert quoted(GOOD) == {"speed"}


def test_records_older_than_their_code_are_listed():
    """`python -m benchmarks.documents` (make numbers) writes the list."""
    text = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    assert listed(text, older_records()) == text, "make numbers"
    before, stale = "<!-- older -->\n- old;\n- list.\n\nMore.\n", {"pit": ("models",)}
    assert listed(before, stale) == (
        "<!-- older -->\n- by another script than that of today: none;\n"
        "- by the script of today, on earlier packages: `pit`.\n\nMore.\n"
    )
    assert "of today: `lap`;" in listed(before, {"lap": ("models", "script")})


def keys_of(script: str, sources: dict[str, Path]) -> list[str]:
    """Patterns of the keys that a benchmark, with the benchmarks it imports, can record."""
    patterns, seen, waiting = [], set(), [script]
    while waiting:
        name = waiting.pop()
        if name in seen or name not in sources:
            continue
        seen.add(name)
        for node in ast.walk(ast.parse(sources[name].read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("benchmarks"):
                waiting += [node.module.rpartition(".")[2], *(alias.name for alias in node.names)]
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                key = next((word.value for word in node.keywords if word.arg == "key"), None)
                place = {"record": 0, "at_most": 4, "at_least": 4}.get(node.func.attr, 99)
                if len(node.args) > place:
                    key = node.args[place]
                if key is not None:
                    patterns.append(pattern_of(key))
    return patterns


def pattern_of(key: ast.expr) -> str:
    if isinstance(key, ast.Constant):
        return re.escape(str(key.value))
    if isinstance(key, ast.JoinedStr):
        parts = (
            re.escape(str(part.value)) if isinstance(part, ast.Constant) else ".+"
            for part in key.values
        )
        return "".join(parts)
    return ".+"


def vanished(results: Path, sources: dict[str, Path], scripts: set[str]) -> list[str]:
    """What is recorded though no benchmark of `make bench` prints it any longer."""
    wrong = []
    for path in sorted(results.glob("*.json")):
        text = json.loads(path.read_text(encoding="utf-8"))
        if path.stem not in sources or path.stem not in scripts:
            wrong.append(f"{path.name}: make bench has no such script")
            continue
        if text["script"] != f"benchmarks/{path.stem}.py":
            wrong.append(f"{path.name}: is of {text['script']}")
        patterns = keys_of(path.stem, sources)
        wrong += [
            f"{path.stem} records no {key}"
            for key in text["values"]
            if not any(re.fullmatch(pattern, key) for pattern in patterns)
        ]
    return wrong


def test_what_is_recorded_is_what_the_benchmarks_print():
    assert list(RESULTS.glob("*.json"))
    files = BENCHMARK_FILES | {"fuzz": ROOT / "benchmarks" / "fuzz" / "__main__.py"}
    wrong = vanished(RESULTS, files, {*BENCHMARKS, *APART})
    assert not wrong, "\n".join(wrong)


def test_a_script_or_key_that_vanished_is_caught(tmp_path, monkeypatch):
    source = tmp_path / "lap.py"
    source.write_text(
        "from benchmarks.helper import more\n"
        "targets.record('laps', 3)\n"
        "targets.at_most('time', 1.0, 2.0, key=f'time/{car}')\n"
    )
    (tmp_path / "helper.py").write_text("targets.record('cost', 1.0)\n")
    sources = {path.stem: path for path in tmp_path.glob("*.py")}
    monkeypatch.setattr("benchmarks.targets.RESULTS", tmp_path)
    targets = Targets("lap")
    for key in ("laps", "time/sedan", "cost"):
        targets.record(key, 1.0)
    targets.finish(keep=True)
    assert vanished(tmp_path, sources, {"lap"}) == []
    assert vanished(tmp_path, sources, set()) == ["lap.json: make bench has no such script"]
    source.write_text(source.read_text().replace("'laps'", "'rounds'"))
    (tmp_path / "helper.py").write_text("")
    assert vanished(tmp_path, sources, {"lap"}) == [
        "lap records no laps",
        "lap records no cost",
    ]
    source.unlink()
    gone = {name: path for name, path in sources.items() if name != "lap"}
    assert vanished(tmp_path, gone, {"lap"}) == ["lap.json: make bench has no such script"]
