"""Curves and their files: the same force as other code says, and honest errors."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.baselines import CurveModel, LinearBaseline
from identifier.baselines.curves import CURVES
from identifier.method import FrozenModelError
from identifier.methods import load_model
from identifier.run import identify
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
    frozen = history.freeze(1.0).axle_force(recording)
    np.testing.assert_array_equal(frozen, history.axle_force)
    with pytest.raises(ValueError, match="learns nothing"):
        identify(recording, car, method, start=history.freeze(1.0))


def test_dugoff_is_the_tire_of_the_plant_at_the_static_load(car, drive):
    recording = drive(n=400, amplitude=0.15)
    force = model_of("dugoff", car).axle_force(recording)
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
    force = model_of("magic_formula", car).axle_force(recording)
    np.testing.assert_allclose(force, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("curve", list(CURVES))
def test_a_curve_is_silent_at_rest_and_finite_in_any_slide(curve, car, drive):
    recording = drive(n=50)
    v_x, v_y = recording.v_x.copy(), recording.v_y.copy()
    v_x[:5], v_y[10:20] = 0.0, [-1e4, -50, -1, -1e-12, 0, 1e-12, 1, 50, 1e3, 1e4]
    force = model_of(curve, car).axle_force(replace(recording, v_x=v_x, v_y=v_y))
    assert (force[:5] == 0.0).all()
    assert np.isfinite(force).all()


@pytest.mark.parametrize("curve", list(CURVES))
def test_a_model_comes_back_from_its_file(curve, car, drive, tmp_path):
    model, path = model_of(curve, car), tmp_path / "weights.json"
    model.save(path)
    again = load_model(path)
    assert again.vehicle == model.vehicle
    recording = drive(n=50)
    np.testing.assert_array_equal(again.axle_force(recording), model.axle_force(recording))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.pop("rear"), "rear is missing"),
        (lambda d: d["front"].pop("C"), "C is missing"),
        (lambda d: d["front"].update(C=-1.0), "must be positive"),
        (lambda d: d["front"].update(C=float("nan")), "must be positive"),
        (lambda d: d.update(curve="brush"), "curve must be one of"),
        (lambda d: d["vehicle"].update(mass=0.0), "mass"),
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
