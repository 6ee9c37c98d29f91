"""What the README promises: its example learns the tire, its table is the committed one."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from tireid.paper_values import PAPER

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()
EXPECTED = json.loads((ROOT / "tests" / "tireid" / "expected_tables.json").read_text())


def printed_tables(text: str) -> dict[str, dict[str, list[str]]]:
    """By maneuver, by row ("online" or the freeze time): the five cells of the README's table."""
    tables: dict[str, dict[str, list[str]]] = {}
    for line in text.splitlines():
        label, *cells = [cell.strip() for cell in line.strip("|").split("|")]
        if "step steer, RMSE [kN]" in label:
            tables["step_steer"] = rows = {}
        elif label == "**slalom**":
            tables["slalom"] = rows = {}
        elif tables and re.fullmatch(r"online|frozen at \d+ s", label) and len(cells) == 5:
            rows["".join(re.findall(r"\d+", label)) or label] = cells
    return tables


def check_tables(text: str) -> None:
    tables = printed_tables(text)
    assert tables.keys() == EXPECTED.keys()
    for maneuver, rows in tables.items():
        ours, paper = EXPECTED[maneuver], PAPER[maneuver]
        assert rows.keys() == ours["integral"].keys()
        for name, cells in rows.items():
            numbers = []
            for law in ("instantaneous", "integral"):
                numbers += [ours[law][name]["median"], paper[law][name]]
            numbers.append(ours["instantaneous_scaled"][name]["median"])
            assert cells == [f"{number:.2f}" for number in numbers], (maneuver, name)


def test_the_table_is_the_committed_one():
    check_tables(README)


def test_a_number_that_drifted_would_be_seen():
    online = next(line for line in README.splitlines() if line.startswith("| online | 0."))
    cells = online.split("|")
    cells[4] = " 0.99 "
    with pytest.raises(AssertionError):
        check_tables(README.replace(online, "|".join(cells)))
    with pytest.raises(AssertionError):
        check_tables(README.replace(online, ""))


def test_the_example_learns_the_tire(tmp_path, monkeypatch, capsys):
    """The frozen model misses less than 15 % of the rms force of either axle."""
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", README, re.S)
    assert blocks, "the README has no Python example"
    assert len(blocks[0].splitlines()) <= 14
    names: dict[str, object] = {"__name__": "__main__"}
    exec(compile(blocks[0], "README.md", "exec"), names)
    printed = re.search(r"\[(\S+) +(\S+)\]", capsys.readouterr().out)
    assert printed
    truth = names["recording"].axle_force
    for missed, force in zip(map(float, printed.groups()), truth.T, strict=True):
        assert 0.0 < missed < 0.15 * np.sqrt(np.mean(force**2))
