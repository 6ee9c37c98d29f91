"""What documents promise: the example learns the tire, the table is the committed one."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import tireid as ti
from tireid.commands.paper import _printed_values, _row_labels

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAPER = (ROOT / "docs" / "methods" / "paper.md").read_text(encoding="utf-8")
EXPECTED = json.loads((ROOT / "tests" / "tireid" / "expected_tables.json").read_text())


def printed_tables(text: str) -> dict[str, dict[str, list[str]]]:
    """By maneuver, by the label of a row: the five cells of the document's table."""
    tables: dict[str, dict[str, list[str]]] = {}
    for line in text.splitlines():
        label, *cells = [cell.strip() for cell in line.strip("|").split("|")]
        if "step steer, RMSE [kN]" in label:
            tables["step_steer"] = rows = {}
        elif label == "**slalom**":
            tables["slalom"] = rows = {}
        elif tables and re.match(r"online, |frozen at \d+ s: ", label) and len(cells) == 5:
            rows[label] = cells
    return tables


def check_tables(text: str) -> None:
    tables = printed_tables(text)
    assert tables.keys() == EXPECTED.keys()
    for maneuver, rows in tables.items():
        ours, paper, labels = EXPECTED[maneuver], _printed_values(maneuver), _row_labels(maneuver)
        assert list(rows) == list(labels.values())
        for name, label in labels.items():
            numbers = []
            for law in ("instantaneous", "integral"):
                numbers += [ours[law][name]["median"], paper[law].get(name)]
            numbers.append(ours["instantaneous_scaled"][name]["median"])
            expected = ["" if number is None else f"{number:.2f}" for number in numbers]
            assert rows[label] == expected, (maneuver, name)


def test_the_table_is_the_committed_one():
    check_tables(PAPER)


def test_a_number_that_drifted_or_stands_beside_the_wrong_measure_would_be_seen():
    lines = PAPER.splitlines()
    own = next(k for k, line in enumerate(lines) if "(the paper's measure)" in line)
    cells, below = lines[own].split("|"), lines[own + 1].split("|")
    drifted = "|".join([*cells[:4], " 0.99 ", *cells[5:]])
    cells[3], below[3] = below[3], cells[3]
    swapped = ["|".join(cells), "|".join(below)]
    for planted in ([drifted, lines[own + 1]], [lines[own + 1]], swapped):
        with pytest.raises(AssertionError):
            check_tables("\n".join([*lines[:own], *planted, *lines[own + 2 :]]))


def test_the_example_identifies_the_tire(tmp_path, monkeypatch, capsys):
    """On another drive the model error is below 8 % of either force."""
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", README, re.S)
    assert blocks, "the README has no Python example"
    assert len(blocks[0].splitlines()) <= 12
    assert set(re.findall(r"^(?:import|from) (.*)", blocks[0], re.M)) == {"tireid as ti"}
    names: dict[str, object] = {"__name__": "__main__"}
    exec(compile(blocks[0], "README.md", "exec"), names)
    text = capsys.readouterr().out
    printed = re.search(r"<Prediction .*?([\d.]+) / ([\d.]+) %", text)
    assert printed
    assert all(0.0 < float(share) < 8.0 for share in printed.groups())
    tire, log = names["run"].tire, names["log"]
    assert np.array_equal(ti.TireModel.load("tire.json").predict(log), tire.predict(log))
    force = re.search(r"(\S+) N at a slip", text)
    assert force and float(force[1]) == tire.force(0.05, "front")
    assert 0.5 < float(force[1]) / (0.05 * names["car"].cornering_stiffness_front) < 1.0
