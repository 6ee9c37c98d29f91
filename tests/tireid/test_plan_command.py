"""`tireid plan`: files, table and refusals."""

import json

import numpy as np
import pytest

from tireid.cli import main
from tireid.commands.plan import _parse_area, _parse_speed


def plan(out, *words):
    return main(["plan", "--speed", "15", "--time", "4", *words, "--out", str(out)])


def test_the_best_steering_is_written_and_all_maneuvers_are_ranked(tmp_path, capsys, undrawn):
    out = tmp_path / "plan"
    assert plan(out, "--steering-ratio", "15", "--area", "100x12") == 0
    assert {"steering.csv", "summary.json"} <= {one.name for one in out.iterdir()}
    rows = np.genfromtxt(out / "steering.csv", delimiter=",", names=True)
    np.testing.assert_allclose(
        rows["hand_wheel_deg"], np.degrees(15.0 * rows["delta_f_rad"]), atol=1e-5
    )
    assert (rows["v_x_m_s"] == 15.0).all() and rows["delta_f_rad"][0] == 0.0
    found = json.loads((out / "summary.json").read_text())["maneuvers"]
    errors = [one["expected_error"] for one in found]
    assert errors == sorted(errors)
    fit = [one for one in found if one["fits"]]
    assert 0 < len(fit) < len(found) and all(one["width_m"] < 12.0 for one in fit)
    said = capsys.readouterr().out
    assert said.startswith(f"{fit[0]['maneuver']} at 15 m/s tells most")
    assert all(one["maneuver"] in said for one in found) and "open loop" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--area", "1.2.3x4"], "--area wants length x width"),
        (["--area", "12x8"], "no maneuver fits"),
        (["--speed", "15kn"], "--speed wants"),
        (["--steering-ratio", "0.1"], "--steering-ratio must be"),
    ],
)
def test_words_that_make_no_plan_are_refused_in_one_line(tmp_path, capsys, words, said):
    assert plan(tmp_path / "out", *words) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert said in lines[-1] and not (tmp_path / "out").exists()


def test_areas_and_speeds_are_read_with_their_units():
    assert _parse_area("60x20.5m") == (60.0, 20.5)
    assert _parse_area(" 40 X 40 ") == (40.0, 40.0)
    assert _parse_speed("54km/h") == pytest.approx(15.0) == _parse_speed("15m/s")
