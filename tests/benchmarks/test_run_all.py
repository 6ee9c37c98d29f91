"""`make bench` fails loudly: it names missed targets and failed scripts, and returns 1."""

import json
import subprocess
import sys

import pytest

from benchmarks import run_all, targets
from benchmarks.fingerprint import fingerprint, modules
from benchmarks.targets import Targets

LAP = """
import sys
from benchmarks.targets import Targets, parse
targets, options = Targets("lap"), parse("lap", __doc__)
targets.at_most("time of a lap", {}, 2.0, "s", key="time")
targets.at_least("laps", 3.0, 2.0, "")
sys.exit(targets.finish(lambda: {{"laps": 3.0}}, keep=options.record))
"""


@pytest.fixture
def scripts(tmp_path, monkeypatch):
    """Give a checkout whose only benchmarks are those that a test writes."""
    folder = tmp_path / "benchmarks"
    (folder / "results").mkdir(parents=True)
    for name in ("targets.py", "fingerprint.py"):
        (folder / name).write_text((run_all.ROOT / "benchmarks" / name).read_text())
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(run_all, "ROOT", tmp_path)
    monkeypatch.setattr(run_all, "BENCHMARKS", ("lap", "pit"))
    (folder / "lap.py").write_text(LAP.format(1.0))
    (folder / "pit.py").write_text("print('no recordings')\n")
    return folder


def bench(tmp_path, *words):
    return run_all.main(["--out", str(tmp_path / "out"), "--only", "lap", "pit", *words])


def test_targets_that_are_met_give_0_and_are_recorded_where_that_is_asked(
    scripts, tmp_path, capsys
):
    assert bench(tmp_path) == 0
    printed = capsys.readouterr().out
    assert "missed or failed: none" in printed
    assert (tmp_path / "out" / "summary.txt").read_text() in printed
    assert not list((scripts / "results").iterdir())
    (scripts / "pit.py").write_text(LAP.format(1.0).replace("lap", "pit"))
    assert bench(tmp_path, "--record") == 0
    record = json.loads((scripts / "results" / "lap.json").read_text())
    assert (record["values"], record["missed"], record["met"]) == ({"time": 1.0}, [], 2)
    assert record["canary"] == {"laps": 3.0}
    assert record["code"] == fingerprint("lap", tmp_path)


def test_a_missed_target_gives_1_and_is_named(scripts, tmp_path, capsys):
    (scripts / "lap.py").write_text(LAP.format(3.0))
    assert bench(tmp_path) == 1
    *_, row, other, _, last = capsys.readouterr().out.splitlines()
    assert row.split()[:3] == ["lap", "1", "1"] and row.endswith("MISSED: time of a lap (<= 2 s)")
    assert other.split()[:3] == ["pit", "0", "0"]
    assert last == "missed or failed: lap"


def test_a_script_that_fails_gives_1_and_is_named(scripts, tmp_path, capsys):
    (scripts / "pit.py").write_text("raise SystemExit(3)\n")
    assert bench(tmp_path) == 1
    printed = capsys.readouterr().out
    assert "FAILED with exit code 3" in printed and "missed or failed: pit" in printed


def test_one_name_is_one_number():
    collected = Targets("lap")
    collected.record("time", 1.0)
    with pytest.raises(ValueError, match="recorded twice"):
        collected.record("time", 2.0)


def test_a_quick_run_is_not_recorded(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["lap", "--quick", "--record"])
    with pytest.raises(SystemExit):
        targets.parse("lap", "A lap.")
    assert "only all of the cases are recorded" in capsys.readouterr().err


CAR = 'drive = 1\nif drive > 3:\n    raise ValueError(f"{drive} is too fast")'


@pytest.mark.parametrize(
    ("file", "text", "other"),
    [
        ("benchmarks/lap.py", "from models.car import drive\n", True),
        ("models/car.py", f'"""Other words."""\n\n{CAR}  # more\n', False),
        ("models/car.py", CAR.replace("too fast", "too slow"), False),
        ("models/car.py", CAR.replace("1", "2"), True),
        ("models/step.c", "/* a comment */\nint   x;\n", False),
        ("models/step.c", "int y;\n", True),
        ("benchmarks/pit.py", "stops = 2\n", False),
    ],
)
def test_a_record_is_older_where_the_code_that_it_measured_changed(tmp_path, file, text, other):
    texts = {
        "benchmarks/lap.py": "from models.car import drive\nprint(drive)\n",
        "benchmarks/pit.py": "stops = 1\n",
        "models/__init__.py": "",
        "models/car.py": f'"""Words."""\n{CAR}\n',
        "models/step.c": "int x;\n",
    }
    hashes = []
    for root, more in ((tmp_path / "a", {}), (tmp_path / "b", {file: text})):
        for name, said in (texts | more).items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(said)
        hashes.append(fingerprint("lap", root))
    assert (hashes[0] != hashes[1]) is other


def test_a_benchmark_that_starts_commands_runs_all_of_them():
    assert {"tireid.commands.identify", "identifier.axle.step"} <= set(modules("benchmarks.speed"))


def test_a_quick_run_ends():
    command = [sys.executable, "-m", "benchmarks.export_cost", "--quick"]
    answer = subprocess.run(command, cwd=run_all.ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode in (0, 1), answer.stderr
    assert "export_cost: " in answer.stdout.splitlines()[-1]
