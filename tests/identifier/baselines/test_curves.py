"""Curves and their files: the same force as other code says, and honest errors."""

import json
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.signal import lsim

from identifier.baselines import CurveModel, LinearBaseline
from identifier.baselines.curves import CURVES
from identifier.frozen import FrozenModelError
from identifier.run import identify
from identifier.tire_model import load_model
from models.tires import DugoffTire

PARAMETERS = {
    "linear": [[9e4], [1.1e5]],
    "magic_formula": [[9.0, 1.3, 6.5e3], [11.0, 1.5, 5.5e3]],
    "dugoff": [[9e4, 0.8], [1.1e5, 0.7]],
}


def model_of(curve, car):
    parameters = np.array(PARAMETERS[curve])
    return CurveModel(vehicle=car, curve=curve, parameters=parameters, min_speed=1.0)


def test_linear_tire_is_stiffness_times_slip_online_and_frozen(car, drive):
    recording = drive(n=300)
    method = LinearBaseline.for_vehicle(car)
    history = identify(recording, car, method)
    v_y, r, v_x = recording.v_y, recording.r, recording.v_x
    alpha = recording.u - np.column_stack([v_y + car.l_f * r, v_y - car.l_r * r]) / v_x[:, None]
    expected = alpha * [car.cornering_stiffness_front, car.cornering_stiffness_rear]
    np.testing.assert_allclose(history.axle_force, expected, rtol=1e-12, atol=1e-9)
    frozen = history.freeze(1.0).predict(recording)
    np.testing.assert_array_equal(frozen, history.axle_force)
    with pytest.raises(ValueError, match="what learns no tire"):
        identify(recording, car, method, start=history.freeze(1.0))


def test_dugoff_is_the_tire_of_the_plant_at_the_static_load(car, drive):
    recording = drive(n=400, amplitude=0.15)
    force = model_of("dugoff", car).predict(recording)
    alpha = recording.alpha(car.l_f, car.l_r)
    for i, (C, mu) in enumerate(PARAMETERS["dugoff"]):
        tire = DugoffTire(C_alpha=C, C_kappa=C, friction=mu)
        wheel = [float(tire.forces(a, 0.0, 0.0, car.axle_loads[i]).F_y) for a in alpha[:, i]]
        np.testing.assert_allclose(force[:, i], wheel * np.cos(recording.u[:, i]), rtol=1e-9)
    assert np.abs(np.diff(force, axis=0)).max() > 1.0


def test_magic_formula_is_the_printed_formula(car, drive):
    recording = drive(n=400, amplitude=0.15)
    B, C, D = np.array(PARAMETERS["magic_formula"]).T
    alpha = recording.alpha(car.l_f, car.l_r)
    expected = D * np.sin(C * np.arctan(B * alpha)) * np.cos(recording.u)
    force = model_of("magic_formula", car).predict(recording)
    np.testing.assert_allclose(force, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("curve", list(CURVES))
def test_slip_lags_as_scipy_solves_it_and_offsets_are_taken_off(curve, car, drive):
    """σ dα'/dt = v_x (α - α'), α linear between samples, begun in a steady slide."""
    recording, sigma, offset = drive(n=150, dt=0.02), np.array([0.6, 1.3]), np.array([0.01, -0.2])
    plain = model_of(curve, car)
    lagged = replace(plain, relaxation_length=sigma, offset=offset)
    read = replace(recording, delta_f=recording.delta_f - offset[0], v_y=recording.v_y + offset[1])
    if curve == "linear":
        arm = np.array([car.l_f, -car.l_r])
        drift = (recording.v_y[:, None] + arm * recording.r[:, None]) / recording.v_x[:, None]
        alpha = recording.u - drift
    else:
        alpha = recording.alpha(car.l_f, car.l_r)
    rates = recording.v_x[0] / sigma
    slip = [
        lsim(([rate], [1.0, rate]), a, recording.t, X0=a[0] / rate)[1]
        for a, rate in zip(alpha.T, rates, strict=True)
    ]
    q, loads = np.array(PARAMETERS[curve]), np.array(car.axle_loads)
    expected = [
        np.array(ca.DM(CURVES[curve].force(ca.DM(q), ca.DM(loads), ca.DM(a), ca.DM(u)))).ravel()
        for a, u in zip(np.array(slip).T, read.u, strict=True)
    ]
    np.testing.assert_allclose(lagged.predict(read), expected, rtol=1e-9, atol=1e-6)
    assert np.abs(plain.predict(recording) - expected).max() > 100.0, "the lag is seen"


def test_without_lag_and_offsets_nothing_is_added_to_the_slip(car, drive):
    recording, plain = drive(n=100), model_of("magic_formula", car)
    assert not plain.lagged
    short = replace(plain, relaxation_length=np.full(2, 1e-7))
    assert short.lagged
    np.testing.assert_allclose(
        short.predict(recording), plain.predict(recording), rtol=1e-4, atol=0.1
    )


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
def test_a_lag_or_an_offset_that_no_car_has_is_refused(change, said, car):
    with pytest.raises(ValueError, match=rf"{said} .* must be two numbers within"):
        replace(model_of("dugoff", car), **change)


@pytest.mark.parametrize("curve", list(CURVES))
def test_a_curve_is_silent_at_rest_and_finite_in_any_slide(curve, car, drive):
    recording = drive(n=50)
    v_x, v_y = recording.v_x.copy(), recording.v_y.copy()
    v_x[:5], v_y[10:20] = 0.0, [-1e4, -50, -1, -1e-12, 0, 1e-12, 1, 50, 1e3, 1e4]
    force = model_of(curve, car).predict(replace(recording, v_x=v_x, v_y=v_y))
    assert (force[:5] == 0.0).all()
    assert np.isfinite(force).all()


@pytest.mark.parametrize("curve", list(CURVES))
def test_a_model_comes_back_from_its_file(curve, car, drive, tmp_path):
    own = {"relaxation_length": np.array([0.5, 0.9]), "offset": np.array([0.003, -0.1])}
    recording, path = drive(n=50), tmp_path / "weights.json"
    for model in (model_of(curve, car), replace(model_of(curve, car), **own)):
        model.save(path)
        again = load_model(path)
        assert again.vehicle == model.vehicle
        np.testing.assert_array_equal(again.predict(recording), model.predict(recording))


def test_a_file_without_lag_and_offsets_is_a_curve_without_them(car, tmp_path):
    path, data = tmp_path / "weights.json", model_of("dugoff", car).to_dict()
    del data["relaxation_length_m"], data["offset_rad_m_s"]
    path.write_text(json.dumps(data))
    again = load_model(path)
    assert not again.lagged
    assert not again.offset.any()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.pop("rear"), "rear is missing"),
        (lambda d: d["front"].pop("C"), "C is missing"),
        (lambda d: d["front"].update(C=-1.0), "must be positive"),
        (lambda d: d["front"].update(C=float("nan")), "must be positive"),
        (lambda d: d.update(curve="brush"), "curve must be one of"),
        (lambda d: d["vehicle"].update(mass=0.0), "mass"),
        (lambda d: d.update(relaxation_length_m=[0.5, -0.5]), "relaxation_length"),
        (lambda d: d.update(offset_rad_m_s=[0.0]), "offset"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(change, said, car, refused_in_one_line):
    data = model_of("magic_formula", car).to_dict()
    change(data)
    refused_in_one_line(data, said)


def test_a_model_whose_axle_does_not_push_is_not_read(car, tmp_path):
    model, path = model_of("dugoff", car), tmp_path / "weights.json"
    for share, good in ((0.05, True), (0.01, False)):
        parameters = model.parameters.copy()
        parameters[1, 0] *= share
        replace(model, parameters=parameters).save(path)
        if good:
            load_model(path)
        else:
            with pytest.raises(FrozenModelError, match="the rear axle does not push"):
                load_model(path)
