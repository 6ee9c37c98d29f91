"""Notebooks run from the first cell to the last, keep no outputs, and hold what they promise."""

import ast
import json
import re
import shlex
from pathlib import Path

import pytest

from tireid.cli import build_parser

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def cells(path, kind):
    """The sources of the cells of a kind, markdown or code."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    return ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == kind]


def run(sources):
    """Run cells one after the other as Jupyter does; return the names that they leave."""
    names = {"__name__": "__main__"}
    for k, source in enumerate(sources):
        exec(compile(source, f"cell {k}", "exec"), names)
    return names


@pytest.fixture
def executed(request, tmp_path, monkeypatch):
    import matplotlib
    import matplotlib.pyplot as plt

    matplotlib.use("Agg")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    path = ROOT / "docs" / "notebooks" / f"{request.param}.ipynb"
    monkeypatch.chdir(path.parent)  # where Jupyter runs it
    yield run(cells(path, "code"))
    plt.close("all")


@pytest.mark.parametrize("executed", ["learn_from_a_log"], indirect=True)
def test_what_was_learnt_from_a_log_predicts_another_drive(executed):
    prediction, before = executed["prediction"], executed["before"]
    assert prediction.against_truth.both < 0.06 * prediction.true_force.both
    assert prediction.against_truth.both < 0.1 * before.against_truth.both
    assert executed["again"].to_dict() == executed["tire"].to_dict()


@pytest.mark.parametrize("executed", ["a_real_car"], indirect=True)
def test_tires_of_a_real_car_predict_its_next_drive_and_reach_a_tire_file(executed):
    assert executed["run"].verdict.valid and executed["prediction"].verdict.valid
    steering = {one.code for one in executed["found"].findings if one.channel == "delta_f"}
    assert "factor" in steering and not executed["found"].repair
    assert executed["off"] < 0.02 * executed["axle"].max()  # [N], of the .tir to the model


def test_every_notebook_is_run_and_leads_through_one_import():
    run_above = {"learn_from_a_log", "from_a_tire_to_a_controller", "a_real_car"}
    assert {path.stem for path in NOTEBOOKS} == run_above
    own = {"codegen", "models", "identifier", "mpc"}
    for path in NOTEBOOKS:
        nodes = [n for source in cells(path, "code") for n in ast.walk(ast.parse(source))]
        modules = {a.name for n in nodes if isinstance(n, ast.Import) for a in n.names}
        modules |= {n.module for n in nodes if isinstance(n, ast.ImportFrom)}
        assert "tireid" in modules and not {m.split(".")[0] for m in modules} & own, path


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_keeps_no_output_and_has_the_form_that_jupyter_reads(path):
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    ids = [cell["id"] for cell in notebook["cells"]]
    assert len(set(ids)) == len(ids) and all(re.fullmatch(r"[\w-]{1,64}", name) for name in ids)
    for cell in notebook["cells"]:
        code = {"outputs", "execution_count"} if cell["cell_type"] == "code" else set()
        assert set(cell) == {"id", "cell_type", "metadata", "source"} | code
        assert not cell.get("outputs") and cell.get("execution_count") is None


def strangers(gallery):
    """Commands of the gallery that there are none, and figures from folders that none writes."""
    wrong, written = [], set()
    shell = "\n".join(re.findall(r"^%%sh\n(.*?)^```$", gallery, re.M | re.S))
    for line in shell.splitlines():
        words = shlex.split(line)[1:]
        try:
            options = build_parser(words).parse_args(words)
        except SystemExit:
            wrong.append(line)
        else:
            written.add(str(getattr(options, "out", "")))
    figures = re.findall(r'^Image\("(.*)"\)$', gallery, re.M)
    assert shell and figures
    return wrong + [name for name in figures if name.partition("/")[0] not in written]


def test_the_gallery_shows_figures_of_commands_that_there_are(capsys):
    gallery = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    assert strangers(gallery) == []
    planted = gallery.replace("tireid plan --vehicle", "tireid plan --wagon")
    found = strangers(planted)
    assert len(found) == 2 and found[0].startswith("tireid plan --wagon")
    assert found[1:] == ["plan/maneuver.png"]
