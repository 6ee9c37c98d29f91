"""Curves and their files: the same force as other code says, and honest errors."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

from identifier.baselines import CurveModel, LinearBaseline, LinearModel
from identifier.frozen import FrozenModelError
from identifier.run import identify
from identifier.tire_model import load_model

PARAMETERS = np.array([[9.0, 1.3, 6.5e3], [11.0, 1.5, 5.5e3]])


@pytest.fixture(name="plain")
def a_curve_without_lag(car):
    return CurveModel(vehicle=car, parameters=PARAMETERS, min_speed=1.0)


def magic(alpha, u):
    B, C, D = PARAMETERS.T
    return D * np.sin(C * np.arctan(B * alpha)) * np.cos(u)


def test_linear_tire_is_stiffness_times_slip_online_and_frozen(car, drive):
    recording = drive(n=300)
    method = LinearBaseline.for_vehicle(car)
    history = identify(recording, car, method)
    v_y, r, v_x = recording.v_y, recording.r, recording.v_x
    alpha = recording.u - np.column_stack([v_y + car.l_f * r, v_y - car.l_r * r]) / v_x[:, None]
    expected = alpha * [car.cornering_stiffness_front, car.cornering_stiffness_rear]
    np.testing.assert_allclose(history.axle_force, expected, rtol=1e-12, atol=1e-9)
    frozen = history.freeze(1.0)
    np.testing.assert_array_equal(frozen.predict(recording), history.axle_force)
    dynamics = frozen.casadi_function().dynamics(recording.x[150], recording.u[150, 0], v_x[150])
    np.testing.assert_allclose(np.array(dynamics[1]).ravel(), expected[150], rtol=1e-12)
    np.testing.assert_allclose(frozen.stiffness, car.bicycle[4:], rtol=1e-12)
    with pytest.raises(ValueError, match="what learns no tire"):
        identify(recording, car, method, start=frozen)


def test_magic_formula_is_the_printed_formula(plain, car, drive):
    recording = drive(n=400, amplitude=0.15)
    expected = magic(recording.alpha(car.l_f, car.l_r), recording.u)
    np.testing.assert_allclose(plain.predict(recording), expected, rtol=1e-9, atol=1e-9)


def test_slip_lags_as_scipy_solves_it_and_offsets_are_taken_off(plain, car, drive):
    """σ dα'/dt = v_x (α - α'), α linear between samples, begun in a steady slide."""
    recording, sigma, offset = drive(n=150, dt=0.02), np.array([0.6, 1.3]), np.array([0.01, -0.2])
    lagged = replace(plain, relaxation_length=sigma, offset=offset)
    read = replace(recording, delta_f=recording.delta_f - offset[0], v_y=recording.v_y + offset[1])
    rates = recording.v_x[0] / sigma
    slip = [
        lsim(([rate], [1.0, rate]), a, recording.t, X0=a[0] / rate)[1]
        for a, rate in zip(recording.alpha(car.l_f, car.l_r).T, rates, strict=True)
    ]
    expected = magic(np.array(slip).T, read.u)
    np.testing.assert_allclose(lagged.predict(read), expected, rtol=1e-9, atol=1e-6)
    assert np.abs(plain.predict(recording) - expected).max() > 100.0, "the lag is seen"


def test_its_equations_of_motion_lag_as_its_replay_does(plain, car, drive):
    sigma, offset = np.array([0.6, 1.3]), np.array([0.01, -0.2])
    recording = drive(n=50)
    dynamics = replace(plain, relaxation_length=sigma, offset=offset).casadi_function().dynamics
    behind = np.array([0.02, -0.01])
    x_dot, force = dynamics(np.append(recording.x[30], behind), recording.u[30, 0], 20.0)
    np.testing.assert_allclose(np.array(force).ravel(), magic(behind, recording.u[30]), rtol=1e-9)
    true = replace(recording, v_y=recording.v_y - offset[1], delta_f=recording.delta_f + offset[0])
    rate = (true.alpha(car.l_f, car.l_r)[30] - behind) * 20.0 / sigma
    np.testing.assert_allclose(np.array(x_dot).ravel()[2:], rate, rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"relaxation_length": np.array([0.5, -0.1])}, "relaxation_length"),
        ({"relaxation_length": np.array([0.5, np.nan])}, "relaxation_length"),
        ({"relaxation_length": np.array([0.5, 100.0])}, "relaxation_length"),
        ({"relaxation_length": np.array([0.5])}, "relaxation_length"),
        ({"offset": np.array([0.6, 0.0])}, "offset"),
        ({"offset": np.array([0.0, -11.0])}, "offset"),
    ],
)
def test_a_lag_or_an_offset_that_no_car_has_is_refused(change, said, plain):
    with pytest.raises(ValueError, match=rf"{said} .* must be two numbers within"):
        replace(plain, **change)


@pytest.mark.parametrize("kind", ["linear", "curve"])
def test_a_curve_is_silent_at_rest_and_finite_in_any_slide(kind, plain, car, drive):
    recording = drive(n=50)
    v_x, v_y = recording.v_x.copy(), recording.v_y.copy()
    v_x[:5], v_y[10:20] = 0.0, [-1e4, -50, -1, -1e-12, 0, 1e-12, 1, 50, 1e3, 1e4]
    model = plain if kind == "curve" else LinearModel(vehicle=car, min_speed=1.0)
    force = model.predict(replace(recording, v_x=v_x, v_y=v_y))
    assert (force[:5] == 0.0).all()
    assert np.isfinite(force).all()


def test_a_model_comes_back_from_its_file(plain, car, drive, tmp_path):
    own = {"relaxation_length": np.array([0.5, 0.9]), "offset": np.array([0.003, -0.1])}
    recording, path = drive(n=50), tmp_path / "weights.json"
    for model in (plain, replace(plain, **own), LinearModel(vehicle=car, min_speed=1.0)):
        model.save(path)
        again = load_model(path)
        assert again.vehicle == model.vehicle
        np.testing.assert_array_equal(again.predict(recording), model.predict(recording))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.pop("rear"), "rear is missing"),
        (lambda d: d["front"].pop("C"), "C is missing"),
        (lambda d: d["front"].update(C=-1.0), "positive numbers"),
        (lambda d: d["front"].update(C=float("nan")), "positive numbers"),
        (lambda d: d.update(curve="dugoff"), "'dugoff' are of an earlier version: identify again"),
        (lambda d: d["vehicle"].update(mass=0.0), "mass"),
        (lambda d: d.update(relaxation_length_m=[0.5, -0.5]), "relaxation_length"),
        (lambda d: d.update(offset_rad_m_s=[0.0]), "offset"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(change, said, plain, refused_in_one_line):
    data = plain.to_dict()
    change(data)
    refused_in_one_line(data, said)


def test_a_model_whose_axle_does_not_push_is_not_read(plain, tmp_path):
    path = tmp_path / "weights.json"
    for share, good in ((0.05, True), (0.01, False)):
        parameters = plain.parameters.copy()
        parameters[1, 2] *= share
        replace(plain, parameters=parameters).save(path)
        if good:
            load_model(path)
        else:
            with pytest.raises(FrozenModelError, match="the rear axle does not push"):
                load_model(path)
