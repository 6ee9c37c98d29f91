"""`tireid plan`: files, table and refusals."""

import numpy as np
import pytest

from tests.tireid.conftest import json_of, table_of, typed


def plan(out, *words):
    return typed("plan", "--speed", "15", "--time", "4", *words, "--out", out)


def test_the_best_steering_is_written_and_all_maneuvers_are_ranked(tmp_path, capsys, undrawn):
    out = tmp_path / "plan"
    assert plan(out, "--steering-ratio", "15", "--area", "100", "12") == 0
    assert {"steering.csv", "summary.json"} <= {one.name for one in out.iterdir()}
    rows = table_of(out / "steering.csv")
    np.testing.assert_allclose(
        rows["hand_wheel_deg"], np.degrees(15.0 * rows["delta_f_rad"]), atol=1e-5
    )
    assert (rows["v_x_m_s"] == 15.0).all() and rows["delta_f_rad"][0] == 0.0
    found = json_of(out / "summary.json")["maneuvers"]
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
        (["--area", "12", "8"], "no maneuver fits"),
        (["--steering-ratio", "0.1"], "--steering-ratio must be"),
    ],
)
def test_words_that_make_no_plan_are_refused_in_one_line(out, capsys, words, said):
    assert plan(out, *words) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert said in lines[-1] and not out.exists()
