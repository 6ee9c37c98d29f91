"""Logs of an IMU, wheel speed and steering alone: read, identified, judged and predicted."""

from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from identifier.axle import AxleIdentifier
from identifier.estimate.method import FitMethod
from models.maneuvers import SampledSteer
from models.plant import Plant
from models.recordings import RecordingError, read_recording, write_recording
from tests.identifier.conftest import steered
from tests.identifier.estimate.test_latent import blind as as_logged
from tests.tireid.conftest import columns_of, json_of, learn_words, table_of, typed

CAR = ti.sedan()


def driven(seed):
    return steered(seed, 23.99, amplitude=np.radians(4.0)).recording()


@pytest.fixture(scope="module")
def exact():
    return driven(3)


@pytest.fixture(scope="module")
def history(exact):
    return ti.identify(as_logged(exact), CAR)


@pytest.fixture
def log(exact, tmp_path):
    write_recording(as_logged(exact), tmp_path / "imu.csv")
    CAR.to_toml(tmp_path / "car.toml")
    return tmp_path / "imu.csv"


def missed(model, exact):
    away = model.predict(exact) - exact.axle_force
    return np.sqrt((away**2).mean(axis=0) / (exact.axle_force**2).mean(axis=0))


def test_a_log_without_v_y_teaches_the_estimate(history, exact):
    assert isinstance(history.method, FitMethod)
    assert (missed(history.freeze(), exact) < 0.08).all()
    away = np.degrees((history.recording.v_y - exact.v_y)[500:] / 20.0)
    assert np.sqrt(np.mean(away**2)) < 0.1
    sd = history.history.outputs["v_y_sd"].ravel()[500:]
    assert np.mean(np.abs(away) < np.degrees(2.0 * sd / 20.0)) > 0.9
    assert np.degrees(np.median(sd) / 20.0) < 0.15


def test_what_was_estimated_is_said_to_be_and_never_shown_to_a_method(history):
    told = history.recording
    assert told.estimated == ("v_y",)
    assert told.logged_v_y is None
    again = ti.identify(told, CAR)
    np.testing.assert_array_equal(again.recording.v_y, told.v_y)
    with pytest.raises(RecordingError, match="there is no vy, from which AxleIdentifier learns"):
        ti.identify(told, CAR, AxleIdentifier.for_vehicle(CAR))


def test_a_right_answer_is_valid_and_says_what_it_cannot_see(history):
    verdict = history.verdict
    assert verdict.valid
    assert "l_f and l_r swapped" in " ".join(verdict.lines)
    assert any("l_f and l_r swapped" in line for line in verdict.to_dict()["not_observable"])


@pytest.mark.parametrize(("channel", "factor"), [("a_y", 1.6), ("v_x", 1.25), ("r", 1.25)])
def test_a_channel_that_is_scaled_is_not_valid(exact, channel, factor):
    log = as_logged(exact)
    wrong = replace(log, **{channel: factor * getattr(log, channel)})
    verdict = ti.identify(wrong, CAR, check=False).verdict
    assert not verdict.valid
    assert "a_y_disagrees" in [one.code for one in verdict.findings]


@pytest.fixture(scope="module")
def swept():
    """A sine sweep to 2.5 Hz, in which v_y changes as fast as the car turns."""
    t = np.arange(0.0, 40.0, 0.02)
    angle = np.radians(1.5) * np.sin(2.0 * np.pi * (0.1 + 0.03 * t) * t)
    maneuver = SampledSteer(
        times=tuple(t), angles=tuple(angle), rate_limit=1.0, duration=float(t[-1])
    )
    return Plant(CAR).simulate(maneuver, speed=25.0, name="sweep").recording()


@pytest.mark.parametrize(("factor", "right"), [(1.0, True), (1.3, False)])
def test_a_y_is_held_against_the_change_of_v_y_too(swept, factor, right):
    log = as_logged(swept)
    run = ti.identify(replace(log, a_y=factor * log.a_y), CAR, check=False)
    assert ("a_y_disagrees" not in [one.code for one in run.verdict.findings]) == right
    if right:
        assert run.verdict.valid
        assert (missed(run.freeze(), swept) < 0.08).all()


def test_a_model_says_the_forces_of_a_drive_without_v_y(history):
    other = driven(8)
    prediction = ti.replay(replace(as_logged(other), axle_force=other.axle_force), history.freeze())
    assert prediction.recording.estimated == ("v_y",)
    assert prediction.against_truth.both < 0.1 * prediction.true_force.both
    assert prediction.verdict.valid


def test_the_motion_is_judged_by_the_accelerometer_where_no_v_y_was_measured(history):
    wrong = replace(history.recording, a_y=-history.recording.a_y)
    prediction = ti.replay(wrong, history.freeze())
    assert not prediction.verdict.valid
    assert prediction.motion.explained[0] < 0.0


def test_without_v_y_there_are_no_slip_angles(exact):
    with pytest.raises(RecordingError, match=r"there is no vy, so slip angles are not known"):
        as_logged(exact).alpha(CAR.l_f, CAR.l_r)
    with pytest.raises(RecordingError, match="estimated may name v_y"):
        replace(exact, estimated=("r",))


def test_a_frame_without_vy_is_taken_where_ay_is_there(exact):
    columns = columns_of(exact)
    del columns["vy"]
    told = read_recording(columns | {"ay": exact.a_y})
    assert told.v_y is None
    assert "no lateral velocity is read" in " ".join(told.notes)
    with pytest.raises(RecordingError, match=r"column vy \(or ay, from which it is estimated\)"):
        read_recording(columns)


def test_a_log_that_contradicts_itself_without_v_y_is_refused(exact):
    columns = columns_of(exact)
    del columns["vy"]
    with pytest.raises(RecordingError, match="change the sign of ay"):
        read_recording(columns | {"ay": -exact.a_y})
    with pytest.raises(RecordingError, match="delta_f must be in rad"):
        read_recording(columns | {"ay": exact.a_y, "delta_f": 10 * exact.delta_f})


def test_a_written_recording_leaves_out_what_was_estimated(history, tmp_path):
    write_recording(history.recording, tmp_path / "log.csv")
    assert read_recording(tmp_path / "log.csv").v_y is None


@pytest.mark.usefixtures("unmade")
def test_the_command_learns_and_tells_side_slip_with_its_deviation(
    log, exact, tmp_path, out, capsys
):
    words = learn_words(tmp_path, log)
    assert typed(*words, "--out", out) == 0
    said = capsys.readouterr()
    assert "fit learns, and estimates it" in said.err
    assert "side slip was estimated to ±" in said.out
    assert "the log has no lateral velocity" in said.out
    told = table_of(out / "forces.csv")
    away = np.abs(told["v_y_estimated_m_s"] - exact.v_y)
    assert np.mean(away < 2.0 * told["v_y_sd_m_s"]) > 0.8
    summary = json_of(out / "summary.json")
    assert summary["law"] == "fit"


def test_the_doctor_and_channels_say_what_they_cannot_see_of_it(log, tmp_path, capsys):
    assert typed("doctor", log, "--vehicle", tmp_path / "car.toml") == 0
    assert "the log has no lateral velocity" in capsys.readouterr().out
    assert typed("channels", log) == 0
    assert "without vy, identify estimates it" in capsys.readouterr().out


def test_a_method_that_needs_v_y_is_refused_in_one_line(log, tmp_path, out, capsys):
    words = [*learn_words(tmp_path, log), "--method", "axle"]
    assert typed(*words, "--out", out) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert "there is no vy, from which AxleIdentifier learns" in said
    assert not out.exists()
