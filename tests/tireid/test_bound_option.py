"""`tireid identify --bound`: the forces that are guaranteed are written, drawn and told."""

import json

import numpy as np
import pytest

from identifier.tire_model import load_model
from tests.conftest import without_ink
from tests.tireid.conftest import refusal
from tireid.cli import main


@pytest.fixture(scope="module")
def words(logs):
    log, car = str(logs / "slalom.csv"), str(logs / "car.toml")
    return ["identify", log, "--vehicle", car, "--accept", "--method"]


@pytest.fixture(scope="module")
def result(words, tmp_path_factory):
    out = tmp_path_factory.mktemp("bound") / "out"
    with pytest.MonkeyPatch.context() as patch:
        without_ink(patch)
        assert main([*words, "axle", "--bound", "--out", str(out)]) == 0
    return out


def test_the_files_hold_what_is_guaranteed(result):
    model = load_model(result / "weights.json")
    assert model.calibration is not None and not model.guarantee.possible.given
    head, *rows = (result / "curve.csv").read_text(encoding="utf-8").splitlines()
    names = head.split(",")
    table = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    ends = ["Fyf_least_N", "Fyr_least_N", "Fyf_most_N", "Fyr_most_N"]
    assert names[-4:] == ends
    limits = np.hstack(model.guarantee.at(table[:, 0]))
    np.testing.assert_allclose(table[:, -4:], limits, rtol=1e-6, atol=1e-3)
    page = (result / "report.html").read_text(encoding="utf-8")
    assert "Guaranteed at the end of the known slip" in page and "estimated from the drive" in page


def test_another_drive_is_set_against_the_guarantee(result, logs, tmp_path, capsys):
    def predicted(model, name):
        out = tmp_path / name
        main(["predict", str(model), str(logs / "quick.csv"), "--out", str(out), "--accept"])
        summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
        return summary["moments_against_guarantee"], capsys.readouterr().out

    share, said = predicted(result / "weights.json", "right")
    assert share == [0.0, 0.0] and "no moment of the drive contradicts" in said
    data = json.loads((result / "weights.json").read_text(encoding="utf-8"))
    corners = data["guarantee"]["corners"]
    data["guarantee"]["corners"] = [(1.6 * np.array(one)).tolist() for one in corners]
    wrong = tmp_path / "wrong.json"
    wrong.write_text(json.dumps(data), encoding="utf-8")
    share, said = predicted(wrong, "wrong")
    assert min(share) > 0.1 and "the bound of the guaranteed forces is violated" in said


def test_a_bound_that_is_told_is_taken_or_refused_in_one_line(words, tmp_path, capsys, undrawn):
    out = tmp_path / "out"
    assert main([*words, "axle", "--bound", "0.3", "0.02", "--out", str(out)]) == 0
    bound = load_model(out / "weights.json").guarantee.possible.bound
    assert bound.error == (0.3, 0.3) and bound.lateness == (0.02, 0.02)
    for numbers, said in (
        (["0.0005"], "is violated at the"),
        (["-1"], "must be above 0"),
        (["0.1", "5"], "lateness must be"),
        (["0.1", "0.1", "0.1"], "it was given 3 numbers"),
    ):
        no = [*words, "axle", "--bound", *numbers, "--out", tmp_path / "no"]
        assert said in refusal(capsys, no)
        assert not (tmp_path / "no").exists()


@pytest.mark.sweep("fit")
@pytest.mark.parametrize("method", ["fit", "integral"])
def test_a_method_without_such_curves_says_so(words, tmp_path, capsys, undrawn, method):
    assert main([*words, method, "--bound", "--out", str(tmp_path / "out")]) == 0
    assert "no guaranteed band: it takes --method axle" in capsys.readouterr().out
