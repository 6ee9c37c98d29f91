"""Frozen models: the same force as online at the freeze, a file that comes back, honest errors."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.evidence import MotionError
from identifier.frozen import FrozenModelError
from identifier.paper.design import PaperIdentifier
from identifier.prediction import predict
from identifier.reproducibility import (
    AxleRmse,
    axle_rms,
    counted_samples,
    force_rms,
    freeze_key,
    online_error,
    replay,
    reproduce,
)
from identifier.run import identify
from identifier.tire_model import load_model


@pytest.fixture(name="history")
def a_history(car, drive):
    return identify(drive(n=600), car, PaperIdentifier.for_vehicle(car))


def test_frozen_and_online_force_agree_at_the_instant_of_freezing(history):
    for t in (1.0, 3.21):
        k = round(t / 0.01)
        frozen = history.freeze(t).predict(history.recording)
        np.testing.assert_allclose(frozen[k], history.axle_force[k], rtol=1e-12)
        assert np.abs(frozen[k - 50] - history.axle_force[k - 50]).max() > 1.0


def test_frozen_force_is_the_network_by_hand(history, car):
    model, recording, p = history.freeze(6.0), history.recording, car.bicycle
    x_bar = np.column_stack([recording.x, recording.u]) / np.array(model.network.scale)
    f_hat = np.tanh(x_bar @ model.weights.V.T) @ model.weights.W.T
    v_y, r, v_x = recording.v_y, recording.r, recording.v_x
    alpha = recording.u - np.column_stack([v_y + p.l_f * r, v_y - p.l_r * r]) / v_x[:, None]
    expected = alpha * [p.C_f, p.C_r] + 1000.0 * f_hat
    np.testing.assert_allclose(model.predict(recording), expected, rtol=1e-9, atol=1e-7)


def test_freezing_at_the_end_takes_the_weights_after_the_last_sample(history):
    np.testing.assert_array_equal(history.freeze(5.99).weights.W, history.state["W"][-1])
    np.testing.assert_array_equal(history.freeze(99.0).weights.W, history.state["W"][-1])
    with pytest.raises(ValueError, match="begins at 0 s"):
        history.freeze(-1.0)


def test_replay_compares_with_truth_and_with_what_was_said_online(history):
    result = replay(history.freeze(6.0), history)
    truth = history.recording.axle_force
    by_hand = np.sqrt(np.mean((result.axle_force - truth) ** 2, axis=0))
    assert (result.against_truth.front, result.against_truth.rear) == pytest.approx(by_hand)
    online = np.sqrt(np.mean((result.axle_force - history.axle_force) ** 2, axis=0))
    assert (result.against_online.front, result.against_online.rear) == pytest.approx(online)


@pytest.mark.parametrize(("rests", "since"), [(True, None), (False, 4.0)])
def test_samples_at_rest_and_before_the_asked_time_do_not_count(history, rests, since):
    truth, n = history.recording.axle_force, len(history.recording)
    asked = {} if since is None else {"since": since}
    counted = np.arange(n) < 300 if rests else history.recording.t >= since
    shown = replace(history.recording, v_x=np.where(counted | (not rests), 20.0, 0.0))
    run = replace(history, recording=shown)
    assert online_error(run, **asked) == axle_rms((run.axle_force - truth)[counted])
    assert asked or force_rms(run) == axle_rms(truth[counted])
    result = replay(history.freeze(6.0), run, **asked)
    assert result.against_truth == axle_rms((result.axle_force - truth)[counted])
    assert result.against_online == axle_rms((result.axle_force - run.axle_force)[counted])
    assert result.against_truth != replay(history.freeze(6.0), history).against_truth


def by_hand(force, reference, start, stop):
    missed = (force - reference)[start:stop]
    return pytest.approx([np.sqrt(np.mean(missed[:, axle] ** 2)) for axle in (0, 1)])


def axles(error):
    return [error.front, error.rear]


def test_a_freeze_parts_the_past_from_what_comes_after(history):
    """The paper's measure counts t < T_freeze and compares with what was said online."""
    result, truth = reproduce(history, 4.0), history.recording.axle_force
    frozen = history.freeze(4.0).predict(history.recording)
    sides = result.reproduction
    assert axles(sides.past_against_online) == by_hand(frozen, history.axle_force, 0, 400)
    assert axles(sides.past_against_truth) == by_hand(frozen, truth, 0, 400)
    assert axles(sides.after_against_truth) == by_hand(frozen, truth, 401, 600)
    whole = replay(history.freeze(4.0), history)
    assert whole.reproduction is None and whole.recording is result.recording
    assert whole.against_truth == result.against_truth
    assert whole.against_online == result.against_online
    np.testing.assert_array_equal(whole.axle_force, result.axle_force)


def test_the_paper_s_measure_does_not_see_the_future_nor_the_truth(history):
    recording, n = history.recording, history.recording.t.size
    late = (np.arange(n) > 400)[:, None] * 500.0
    spoiled = replace(
        history,
        axle_force=history.axle_force + late,
        recording=replace(recording, axle_force=recording.axle_force + 300.0),
    )
    sides, as_was = (reproduce(h, 4.0).reproduction for h in (spoiled, history))
    assert sides.past_against_online == as_was.past_against_online
    assert sides.past_against_truth != as_was.past_against_truth
    early = replace(history, axle_force=history.axle_force + 500.0 - late)
    assert reproduce(early, 4.0).reproduction.past_against_online != as_was.past_against_online


def test_a_law_that_does_not_learn_reproduces_its_past_exactly(history, car):
    gains = replace(history.method.gains, eta_W=1e-15, eta_V=1e-15, rho_W=1e-15, rho_V=1e-15)
    still = identify(history.recording, car, replace(history.method, gains=gains))
    sides = reproduce(still, 4.0).reproduction
    assert sides.past_against_online.both < 1e-9
    assert sides.past_against_truth.both > 1.0  # and yet it knows nothing


def test_sides_count_from_the_asked_time_on(history):
    sides = reproduce(history, 4.0, since=2.0).reproduction
    frozen = history.freeze(4.0).predict(history.recording)
    assert axles(sides.past_against_online) == by_hand(frozen, history.axle_force, 200, 400)
    nothing_before = reproduce(history, 4.0, since=4.5).reproduction
    assert nothing_before.past_against_online is None
    assert nothing_before.past_against_truth is None


def test_a_side_without_samples_or_truth_has_no_error(history):
    assert reproduce(history, 5.99).reproduction.after_against_truth is None
    assert reproduce(history, 0.0).reproduction.past_against_online is None
    blind = replace(history, recording=replace(history.recording, axle_force=None))
    sides, whole = reproduce(blind, 4.0).reproduction, replay(blind.freeze(6.0), blind)
    assert sides.past_against_online.front > 0.0 and whole.against_online.front > 0.0
    assert (sides.past_against_truth, sides.after_against_truth) == (None, None)
    assert (online_error(blind), whole.against_truth) == (None, None)


def test_a_drive_without_a_sample_that_counts_is_refused(history):
    slow = replace(history.recording, v_x=np.full(history.recording.t.size, 0.5))
    with pytest.raises(ValueError, match=r"drive: v_x never reaches 1 m/s, .* is 0.5 m/s"):
        counted_samples(slow, 1.0)
    with pytest.raises(ValueError, match=r"never reaches 1 m/s from 99 s on"):
        online_error(replace(history, method=replace(history.method, min_speed=1.0)), since=99.0)


def test_freeze_times_of_any_clock_have_keys_of_their_own():
    assert [freeze_key(t) for t in (32.0, 0.1, 1700000004.0, 1700000004.25)] == [
        "32",
        "0.1",
        "1700000004",
        "1700000004.25",
    ]


def test_a_model_comes_back_from_its_file(history, tmp_path):
    model = history.freeze(4.0)
    model.save(tmp_path / "weights.json")
    again = load_model(tmp_path / "weights.json")
    np.testing.assert_array_equal(
        again.predict(history.recording), model.predict(history.recording)
    )
    assert (again.vehicle, again.network) == (model.vehicle, model.network)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.pop("W"), "W is missing"),
        (lambda d: d.update(format="something"), "not a frozen model"),
        (lambda d: d.update(V=[[1.0, 2.0]]), "V must have shape"),
        (lambda d: d["W"][0].__setitem__(0, float("nan")), "not finite"),
        (lambda d: d["vehicle"].update(mass=-1.0), "mass must be"),
        (lambda d: d["network"].update(inputs=["v_y", "speed"]), "inputs must be chosen"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(history, refused_in_one_line, change, said):
    data = history.freeze(4.0).to_dict()
    change(data)
    refused_in_one_line(data, said)


def test_a_file_that_is_not_json_is_refused(tmp_path):
    path = tmp_path / "weights.json"
    path.write_bytes(b"\x80\x81")
    with pytest.raises(FrozenModelError, match="not a text file in UTF-8"):
        load_model(path)
    with pytest.raises(FrozenModelError, match="there is no such file"):
        load_model(tmp_path / "absent.json")


def test_both_axles_together_is_the_rms_of_all_samples():
    force = np.array([[3.0, 0.0], [-3.0, 4.0]])
    assert axle_rms(force).both == pytest.approx(np.sqrt(np.mean(force**2)))
    assert AxleRmse(front=3.0, rear=4.0).both == pytest.approx(np.sqrt(12.5))


def test_no_samples_have_no_size():
    force = np.ones((4, 2))
    for none in (axle_rms(force[:0]), axle_rms(force, np.zeros(4, dtype=bool))):
        assert np.isnan([none.front, none.rear, none.both]).all()
    some = axle_rms(force, np.array([True, False, True, False]), -force)
    assert (some.front, some.rear) == (2.0, 2.0)


def test_what_explains_less_than_nothing_is_said_to_explain_nothing(history):
    motion = MotionError(lateral=0.1, yaw=30.0, lateral_rms=1.0, yaw_rms=1.0)
    prediction = replace(predict(history.freeze(4.0), history.recording), motion=motion)
    said = "explained are 99.0 % of the lateral and nothing of the yaw acceleration"
    assert prediction.motion_text() == said
    still = replace(prediction, motion=replace(motion, yaw_rms=0.0))
    assert still.motion_text() == "explained are 99.0 % of the lateral acceleration"
    slow = replace(prediction, motion=replace(motion, yaw_rms=0.01))
    assert slow.motion_text().endswith("of this car: the yaw acceleration cannot check the model")
