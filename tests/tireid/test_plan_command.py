"""`tireid plan`: files, words and refusals."""

import json

import numpy as np
import pytest

import tireid as ti
from identifier.plan import search
from mpc.path import Path
from tireid.cli import main
from tireid.commands.plan import _parse_area, _parse_speed


@pytest.fixture(autouse=True)
def brief(monkeypatch):
    monkeypatch.setattr(search, "CHOSEN", search.CHOSEN._replace(generations=4))


def plan(out, *words):
    return main(["plan", "--area", "40x20", "--speed", "15", *words, "--out", str(out)])


def columns(path):
    return np.genfromtxt(path, delimiter=",", names=True)


def test_a_plan_is_written_with_its_course_and_said_in_words(tmp_path, capsys, undrawn):
    out = tmp_path / "plan"
    assert plan(out, "--time", "4", "--steering-ratio", "15") == 0
    names = {"steering.csv", "path.csv", "path_2.csv", "summary.json", "report.html"}
    assert names <= {one.name for one in out.iterdir()}
    rows = columns(out / "steering.csv")
    assert set(rows["pass"]) == {1.0, 2.0}
    np.testing.assert_allclose(
        rows["hand_wheel_deg"], np.degrees(15.0 * rows["delta_f_rad"]), atol=1e-5
    )
    assert (rows["v_x_m_s"] == 15.0).all()
    first = rows[rows["pass"] == 1.0]
    assert first["delta_f_rad"][0] == 0.0 and first["t_s"][-1] == pytest.approx(2.0)
    path = Path.from_csv(out / "path.csv")  # as tireid drive reads it
    assert path.length == pytest.approx(15.0 * 3.0, rel=0.1)
    at = np.hypot(path.X - first["X_m"][100], path.Y - first["Y_m"][100])
    assert at.min() < 0.3
    found = json.loads((out / "summary.json").read_text())
    assert found["passes"] == 2 and found["least_distance_to_edge_m"] > 0.9
    assert found["steering_lag_s"] == 0.04  # of the sedan's file
    assert found["expected_error"] < found["expected_error_before"]
    assert found["expected_error"] < found["rivals"]["slalom"]["expected_error"]
    said = capsys.readouterr().out
    assert "2 passes of 2.0 s at 15 m/s in 40 x 20 m" in said and "slalom" in said


@pytest.mark.heavy
def test_the_same_seed_plans_the_same(tmp_path, undrawn):
    for name in ("one", "two"):
        assert plan(tmp_path / name, "--time", "2", "--seed", "3") == 0
    texts = [(tmp_path / name / "steering.csv").read_text() for name in ("one", "two")]
    assert texts[0] == texts[1]


@pytest.mark.heavy
def test_a_plan_follows_what_was_learnt(tmp_path, undrawn):
    ti.identify(ti.sample_recording(), ti.sedan()).freeze().save(tmp_path / "tire.json")
    out = tmp_path / "after"
    assert plan(out, "--time", "2", "--after", str(tmp_path / "tire.json")) == 0
    found = json.loads((out / "summary.json").read_text())
    assert found["expected_error_before"] < 0.15


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--area", "40"], "--area wants length x width"),
        (["--area", "40x0"], "--area must have sides of 0.1 to 5000 m"),
        (["--area", "1.2.3x4"], "--area wants"),
        (["--area", "12x8"], "the area must be"),
        (["--speed", "15kn"], "--speed wants"),
        (["--speed", "1e999"], "--speed wants"),
        (["--speed", "2"], "no sample counts below"),
        (["--time", "nan"], "the time must be"),
        (["--mu", "9"], "--mu must lie between 0.05 and 3, it is 9"),
        (["--grip", "nan"], "--grip must lie between 20 and 97, it is nan"),
        (["--grip", "100"], "--grip must lie between 20 and 97, it is 100"),
        (["--margin", "-1"], "--margin must lie between 0 and 1000, it is -1"),
        (["--steering-rate", "0"], "--steering-rate must be positive"),
        (["--steering-angle", "80"], "--steering-angle must lie between 1 and 60, it is 80"),
        (["--steering-ratio", "0.1"], "--steering-ratio must be"),
        (["--steering-lag", "5"], "--steering-lag must lie between"),
        (["--steering-lag", "nan"], "--steering-lag must lie between"),
        (["--area", "60x3"], "is 3 m wide and the car with its margins"),
        (["--seed", "-1"], "--seed must not be negative"),
    ],
)
def test_words_that_make_no_plan_are_refused_in_one_line(tmp_path, capsys, words, said):
    assert plan(tmp_path / "out", *words) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert said in lines[-1] and not (tmp_path / "out").exists()


def test_a_model_that_does_not_know_how_sure_it_is_is_refused(tmp_path, capsys, logs):
    car = ti.sedan()
    log = ti.read_recording(logs / "quick.csv")
    ti.identify(log, car, ti.make_method("linear", car)).freeze().save(tmp_path / "linear.json")
    assert plan(tmp_path / "out", "--after", str(tmp_path / "linear.json")) == 2
    assert "needs a model with a covariance" in capsys.readouterr().err


def test_areas_and_speeds_are_read_with_their_units():
    assert _parse_area("60x20.5m") == (60.0, 20.5)
    assert _parse_area(" 40 X 40 ") == (40.0, 40.0)
    assert _parse_speed("54km/h") == pytest.approx(15.0) == _parse_speed("15m/s")
