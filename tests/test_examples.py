"""Every example and the README's example run and say what they promise."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs_and_stays_short(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert len(path.read_text().splitlines()) <= 80
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    headline = module.main()
    assert isinstance(headline, float)
    assert 0.0 < headline < module.EXPECTED_BELOW
    assert capsys.readouterr().out


def test_readme_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
    assert blocks, "the README has no Python example"
    assert len(blocks[0].splitlines()) <= 14
    exec(compile(blocks[0], "README.md", "exec"), {"__name__": "__main__"})
    assert re.search(r"\d", capsys.readouterr().out)
