"""Every example runs and says what it promises."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.mark.sweep("learn_and_freeze", "derivations")
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs_and_stays_short(path, tmp_path, monkeypatch, capsys):
    if path.stem == "own_network":
        pytest.importorskip("onnx", reason="needs the package onnx")
    monkeypatch.chdir(tmp_path)
    assert len(path.read_text().splitlines()) <= 80
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    headline = module.main()
    assert isinstance(headline, float)
    assert 0.0 < headline < module.EXPECTED_BELOW
    assert capsys.readouterr().out
