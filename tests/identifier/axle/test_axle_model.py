"""The frozen axle model: what it says of the tire, of itself, and of files that are not one."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identifier.axle import AxleIdentifier, AxleModel
from identifier.axle.model import BESIDE
from identifier.frozen import FrozenModelError
from identifier.run import identify
from identifier.tire_model import load_model, stored_verdict
from tests.identifier.conftest import learnt, outside_known, saturating


def test_told_another_stiffness_it_reads_off_the_true_one(car, drive):
    told = replace(car, cornering_stiffness_front=0.7e5, cornering_stiffness_rear=1.8e5)
    model = learnt(drive(amplitude=0.04), told)
    true = np.array([car.cornering_stiffness_front, car.cornering_stiffness_rear])
    np.testing.assert_allclose(model.stiffness, true, rtol=0.08)
    alpha = np.array([-0.04, -0.01, 0.01, 0.04])
    expected = np.column_stack([saturating(alpha, 1.4e5, 5000), saturating(alpha, 1.2e5, 4500)])
    curve = learnt(drive(amplitude=0.06), told).force(alpha)
    np.testing.assert_allclose(curve, expected, atol=200.0)
    assert (model.relaxation_length < 0.15).all()  # the drive's tires have no lag
    early = learnt(drive(n=100, amplitude=0.0), told)
    assert (np.abs(early.stiffness / true - 1) > 0.25).all()


def test_frozen_and_online_forces_are_one_where_nothing_is_learnt(car, drive):
    design = AxleIdentifier.for_vehicle(car)
    never = replace(design, plausibility=replace(design.plausibility, learning_speed=100.0))
    recording = drive(n=400)
    history = identify(recording, car, never)
    np.testing.assert_allclose(
        history.freeze(0.0).predict(recording), history.axle_force, rtol=1e-12, atol=1e-9
    )


def test_it_knows_where_it_has_been(car, drive):
    gentle, hard = drive(amplitude=0.02), drive(amplitude=0.1)
    model, expert = learnt(gentle, car), learnt(hard, car)
    assert outside_known(model, gentle).mean() < 0.05
    assert outside_known(model, hard).mean() > 0.3
    assert outside_known(expert, hard).mean() < 0.05
    slip = np.abs(gentle.alpha(car.l_f, car.l_r)).max(axis=0)
    np.testing.assert_allclose(model.known_slip, slip, rtol=0.2)
    relative_sd = model.band.relative_sd(np.array([0.01, 0.1]))
    assert (relative_sd[0] < 0.15).all()
    assert (relative_sd[1] > 2 * relative_sd[0]).all()
    design = AxleIdentifier.for_vehicle(car)
    new = design.frozen(car, design.setup(car).carry)
    np.testing.assert_allclose(new.band.relative_sd(np.array([0.01, 0.1])), 1.0)
    np.testing.assert_array_equal(new.known_slip, 0.0)
    assert outside_known(new, gentle)[100:].any(axis=1).mean() > 0.9
    assert 10.0 < model.excitation[:, 1].min() <= 14.6


def test_slip_is_known_up_to_where_a_quarter_of_the_doubt_is_left(car):
    """Weights of one unit: doubt is that of the unit at every slip. Of two: where they balance."""
    design = AxleIdentifier.for_vehicle(car)
    n = len(design.ladder)
    state = dict(design.setup(car).carry)
    new = design.frozen(car, state)
    seen = np.array([[0.2], [0.1]]) * np.eye(1, 9)
    for share, known in ((0.24, [0.2, 0.1]), (0.26, [0.0, 0.0]), (0.35, [0.0, 0.0])):
        model = replace(new, excitation=seen, covariance=share**2 * new.prior_covariance)
        np.testing.assert_allclose(model.band.relative_sd(np.array([0.05])), share, rtol=1e-9)
        np.testing.assert_allclose(model.known_slip, known)
    shares = np.array([0.3, 0.2])[:, None, None]
    uneven = replace(new, excitation=seen, covariance=shares**2 * new.prior_covariance)
    np.testing.assert_allclose(uneven.known_slip, [0.0, 0.1])

    # Units of the first scale and of the last alone, the first well known, the last not at all:
    # (0.01 t_1² + t_4²)/(t_1² + t_4²) = 1/16 where (t_4/t_1)² = (1/16 - 0.01)/(1 - 1/16).
    alone = np.full(n + 3, 1e-18)
    alone[[0, n - 1]] = 1.0
    told = alone.copy()
    told[0] = 0.01
    axles = np.stack([np.diag(told)] * 2), np.stack([np.diag(alone)] * 2)
    model = replace(new, excitation=seen, covariance=axles[0], prior_covariance=axles[1])
    wanted = np.sqrt((1 / 16 - 0.01) / (1 - 1 / 16))
    slip = np.linspace(1e-4, 0.3, 300001)
    ratio = np.tanh(slip / design.ladder[-1]) / np.tanh(slip / design.ladder[0])
    edge = slip[np.argmax(ratio > wanted)]
    assert 0.03 < edge < 0.1
    np.testing.assert_allclose(model.known_slip, edge, atol=0.2 / 200)
    recordings = np.array([-1.05, -0.9, 0.9, 1.05]) * edge
    inside = np.abs(recordings) < model.known_slip[0]
    assert inside.tolist() == [False, True, True, False]


def test_far_outside_it_saturates(car, drive):
    model = learnt(drive(amplitude=0.02), car)
    far = np.abs(model.force(np.linspace(-1.5, 1.5, 61)))
    assert (far <= 1.5 * np.array(car.axle_loads) + 1e-6).all()
    np.testing.assert_allclose(far[0], far[1], rtol=0.01)


def test_learning_goes_on_from_stored_weights(car, drive, tmp_path):
    whole = drive(n=1500, amplitude=0.08)
    first, second = whole.between(0.0, 9.995), whole.between(10.0, 15.0)
    model, design = learnt(first, car), AxleIdentifier.for_vehicle(car)
    model.save(tmp_path / "weights.json")
    stored = load_model(tmp_path / "weights.json")
    assert isinstance(stored, AxleModel) and stored.to_dict() == model.to_dict()
    earlier = {key: one for key, one in model.to_dict().items() if key not in BESIDE}
    earlier["own"] = np.column_stack([model.compliance, model.sway_share, model.offset]).tolist()
    assert AxleModel.from_dict(earlier, "earlier").to_dict() == model.to_dict()
    for own in ([[0.1, 0.0], [0.1, 0.0]], [[0.1, 0.0, 0.0, 0.0]] * 2, [0.1, 0.0], []):
        with pytest.raises(FrozenModelError, match=r"earlier: own must have shape \(2, 3\)"):
            AxleModel.from_dict(earlier | {"own": own}, "earlier")
    again, afresh = identify(second, car, design, start=stored), identify(second, car, design)
    np.testing.assert_array_equal(again.state["W"][0], model.W)
    off = [np.abs(one.axle_force - second.axle_force).mean() for one in (again, afresh)]
    assert off[0] < 0.5 * off[1]
    at = np.array([0.05])
    np.testing.assert_allclose(again.freeze().force(at), learnt(whole, car).force(at), rtol=0.03)


def test_weights_of_another_structure_are_refused(car, drive):
    recording = drive(n=100)
    model = learnt(recording, car)
    other = replace(AxleIdentifier.for_vehicle(car), ladder=(0.016, 0.064, 0.256))
    assert np.isfinite(identify(recording, car, other).axle_force).all()
    with pytest.raises(ValueError, match="another structure"):
        identify(recording, car, other, start=model)


def test_a_stored_model_says_whether_it_was_found_valid(car, drive, tmp_path):
    model = learnt(drive(n=600), car)
    for valid in (True, False, None):
        model.save(tmp_path / "weights.json", valid=valid)
        assert stored_verdict(tmp_path / "weights.json") is valid
    (tmp_path / "odd.json").write_text(json.dumps(model.to_dict() | {"valid": "maybe"}))
    for read in (stored_verdict, load_model):
        with pytest.raises(FrozenModelError, match=r"odd.json: valid must be true or false"):
            read(tmp_path / "odd.json")


@pytest.mark.parametrize(
    ("key", "value", "rule"),
    [
        ("W", None, "W is missing"),
        ("W", [[1.0, 2.0]], r"W must have shape \(2, 4\)"),
        ("compliance", [float("nan"), 0], "compliance holds a number that is not finite"),
        ("compliance", [-0.1, 0], r"compliance \[m\] must be within 0 and"),
        ("sway_share", [0, 1.5], "sway share must be within 0 and 1"),
        ("offset", [2.5e8, 0], r"steering offset \[rad\] must be within -1.2 and"),
        ("offset", [0, -1e3], r"bias of v_y \[m/s\] must be within"),
        ("ladder", [0.01, 0.03, 0.1, 0.2], "ladder must rise by powers of two"),
        ("sway", {"frequency": -1.0, "damping": 0.3}, "frequency must lie between 0.1 and 100"),
        ("plausibility", {"color": 1}, "plausibility.color is unknown"),
        ("edges", [0.0, 1.0], "edges must be"),
    ],
)
def test_a_file_that_is_no_model_is_refused(key, value, rule, car, drive, refused_in_one_line):
    data = learnt(drive(n=50), car).to_dict() | {key: value}
    refused_in_one_line({name: one for name, one in data.items() if one is not None}, rule)


def test_designs_are_similar_for_a_model_car(car, model_car):
    """By Froude lengths over 10 and speeds over sqrt(10); times of drivers and sensors stay."""
    full, small = AxleIdentifier.for_vehicle(car), AxleIdentifier.for_vehicle(model_car)
    assert full.prior.compliance / small.prior.compliance == pytest.approx(10.0)
    assert full.min_speed / small.min_speed == pytest.approx(np.sqrt(10.0))
    assert small.sway.frequency / full.sway.frequency == pytest.approx(np.sqrt(10.0))
    assert full.regression.noise / small.regression.noise == pytest.approx(np.sqrt(10.0))
    assert full.regression == replace(small.regression, noise=full.regression.noise)
