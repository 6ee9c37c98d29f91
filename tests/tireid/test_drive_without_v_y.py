"""`tireid drive --sensors imu`: nothing measures v_y, the car drives, files say what was told."""

import numpy as np
import pytest

import tireid as ti
from identifier.tire_model import load_model
from models.vehicle import sedan
from tests.pages import outline
from tests.tireid.conftest import page_in, refusal, table_of, typed
from tests.tireid.test_drive_command import bend, learns_shortly, summary_of  # noqa: F401
from tireid.commands.drive import parse_fault

TOLD = ("v_y_estimated_m_s", "v_y_estimated_sd_m_s", "side_slip_observable", "a_y_level_m_s2")


@pytest.fixture(scope="module")
def result(bend, tmp_path_factory):  # noqa: F811
    """Tires that go on learning and linear ones, up to 0.77 g, without v_y."""
    out = tmp_path_factory.mktemp("imu") / "out"
    words = ["drive", "--sensors", "imu", "--path", bend, "--tires", "learning", "linear"]
    words += ["--speed", "0.77g"]
    learns_shortly([*words, "--film", "none", "--out", out], 20.0)
    return out


@pytest.mark.heavy
def test_the_car_drives_as_well_as_with_v_y(result, bend, tmp_path, undrawn):  # noqa: F811
    words = ["drive", "--path", bend, "--weights", result / "weights.json", "--speed", "0.77g"]
    assert typed(*words, "--film", "none", "--out", tmp_path / "full") == 0
    full, drives = summary_of(tmp_path / "full"), summary_of(result)["drives"]
    assert drives["learning"]["completed"]
    assert drives["learning"]["rms_e_y_m"] < 1.5 * full["rms_e_y_m"]
    assert drives["learning"]["rms_e_y_m"] < 0.5 * drives["linear"]["rms_e_y_m"]


def test_the_files_hold_what_was_told_in_place_of_what_was_not_measured(result):
    drive = table_of(result / "drive.csv")
    assert set(TOLD) < set(drive.dtype.names)
    assert "v_y_measured_m_s" not in drive.dtype.names
    error = drive["v_y_estimated_m_s"] - drive["v_y_m_s"]
    told = summary_of(result)["lateral_velocity"]
    assert told["rms_error_m_s"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-5)
    assert told["within_two_sd"] == pytest.approx(
        np.mean(np.abs(error) <= 2.0 * drive["v_y_estimated_sd_m_s"]), abs=0.01
    )
    assert told["within_two_sd"] > 0.9
    assert 0.0 < told["rms_error_m_s"] < 0.05
    assert summary_of(result)["inputs"]["sensors"] == "imu"
    assert (result / "lateral.png").read_bytes().startswith(b"\x89PNG")


def test_the_report_shows_the_side_slip_that_was_told(result):
    told, text = summary_of(result)["lateral_velocity"], outline(page_in(result)).text
    assert f"{told['rms_error_deg']:.2f}°" in text
    assert "Lateral velocity, which no sensor measured" in text


@pytest.mark.heavy
def test_what_has_all_sensors_says_nothing_of_it(bend, result, tmp_path, undrawn):  # noqa: F811
    """And names them or not: the same bits."""
    words = ["drive", "--path", bend, "--weights", result / "weights.json"]
    for name, more in (("named", ["--sensors", "full"]), ("default", [])):
        assert typed(*words, *more, "--film", "none", "--out", tmp_path / name) == 0
    named, default = (table_of(tmp_path / name / "drive.csv") for name in ("named", "default"))
    for name in named.dtype.names:
        assert name == "solve_time_s" or np.array_equal(named[name], default[name])
    assert "v_y_measured_m_s" in named.dtype.names and not set(TOLD) & set(named.dtype.names)
    summaries = [summary_of(tmp_path / name) for name in ("named", "default")]
    assert summaries[0]["hash"] == summaries[1]["hash"]
    assert "lateral_velocity" not in summaries[0] and "sensors" not in summaries[0]["inputs"]
    assert not (tmp_path / "named" / "lateral.png").exists()


def test_the_line_that_is_printed_says_how_right_it_was(result, bend, out, capsys, undrawn):  # noqa: F811
    words = ["drive", "--sensors", "imu", "--path", bend, "--film", "none"]
    words += ["--weights", result / "weights.json", "--no-noise", "--speed", "0.6g"]
    capsys.readouterr()
    assert typed(*words, "--out", out) == 0
    printed = capsys.readouterr().out
    assert "no noise, no v_y" in printed
    assert "frozen: v_y estimated to 0.0" in printed


def test_a_fault_of_what_is_not_measured_is_one_clear_line(bend, tmp_path, capsys):  # noqa: F811
    words = ["drive", "--path", bend, "--sensors", "imu", "--fault", "v_y:zero:1:1"]
    said = refusal(capsys, [*words, "--out", tmp_path / "out"])
    assert "--fault v_y:zero:1:1: channel must be one of X, Y, psi, v_x, r, delta, a_y" in said
    assert list(tmp_path.iterdir()) == []


def test_a_fault_is_of_a_sensor_that_is_there():
    assert parse_fault("a_y:stuck:1:2", "imu").channel == "a_y"
    assert parse_fault("v_y:stuck:1:2", "full").channel == "v_y"


@pytest.mark.heavy
def test_the_public_function_takes_the_same_road(result):
    car, path = sedan(), ti.paths.iso_3888_2()
    tire = load_model(result / "weights.json")
    run = ti.drive(path, car, tire, sensors="imu", learning=True, speeds=14.0)
    assert run.scores.completed
    assert set(run.drive.estimates) >= {"v_y", "v_y_sd", "observable"}
    assert np.std(run.drive.estimates["v_y"] - run.drive.v_y) < 0.05
    with pytest.raises(ValueError, match="sensors must be one of full, imu, not 'gps'"):
        ti.drive(path, car, tire, sensors="gps")
