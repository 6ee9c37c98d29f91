"""What documents promise: the example learns the tire, the table is the committed one."""

import re
from pathlib import Path

import numpy as np

import tireid as ti

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_example_identifies_the_tire(tmp_path, monkeypatch, capsys):
    """On another drive the model error is below 8 % of either force."""
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", README, re.S)
    assert blocks, "the README has no Python example"
    assert len(blocks[0].splitlines()) <= 12
    assert set(re.findall(r"^(?:import|from) (.*)", blocks[0], re.M)) == {"tireid as ti"}
    names = {"__name__": "__main__"}
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
