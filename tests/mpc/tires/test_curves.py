"""Curves in closed form: the frozen models' and the tires' own forces."""

import casadi as ca
import numpy as np
import pytest

from identifier.baselines.curves import CurveModel
from models.tires import DugoffTire, FialaTire, LinearTire
from mpc.tires import prediction_tire
from mpc.tires.tire import Point

CURVES = {
    "linear": np.array([[1.2e5], [1.0e5]]),
    "magic_formula": np.array([[11.0, 1.4, 7600.0], [12.0, 1.35, 6000.0]]),
    "dugoff": np.array([[1.2e5, 0.9], [1.0e5, 1.1]]),
}


@pytest.mark.parametrize("curve", CURVES)
def test_forces_are_those_of_the_frozen_curve(car, motions, forces, at, curve):
    model = CurveModel(vehicle=car, curve=curve, parameters=CURVES[curve], min_speed=1.0)
    predicted, _ = forces(prediction_tire(model), *at(motions))
    expected = model.predict(motions)
    np.testing.assert_allclose(predicted, expected, rtol=1e-9, atol=1e-6)
    parameters = np.array(CURVES[curve])
    parameters[1, -1] *= 1.02
    other = CurveModel(vehicle=car, curve=curve, parameters=parameters, min_speed=1.0)
    assert np.abs(forces(prediction_tire(other), *at(motions))[0] - expected)[:, 1].max() > 1.0


@pytest.mark.parametrize("curve", CURVES)
def test_a_lagged_curve_is_the_frozen_models_own_expressions(car, motions, forces, at, curve):
    model = CurveModel(
        vehicle=car,
        curve=curve,
        parameters=CURVES[curve],
        min_speed=1.0,
        relaxation_length=np.array([0.5, 0.8]),
        offset=np.array([0.01, -0.2]),
    )
    tire = prediction_tire(model)
    assert tire.structure.lagged
    behind = np.random.default_rng(1).normal(0.0, 0.1, (len(motions), 2))
    force, kinematic = forces(tire, *at(motions), lagged=behind)
    lengths = tire.structure.lag_length((0.0, 0.0), Point(0.0, 0.0, 0.0, 1.0, None, tire.weights))
    for k in range(0, len(motions), 20):
        v_x = motions.v_x[k]
        expected, rate = model.force_expression(
            ca.DM(behind[k]), ca.DM(motions.x[k]), motions.delta_f[k], v_x
        )
        np.testing.assert_allclose(force[k], np.array(ca.DM(expected)).ravel(), rtol=1e-9)
        slower = (kinematic[k] - behind[k]) * v_x / np.array(lengths)
        np.testing.assert_allclose(slower, np.array(ca.DM(rate)).ravel(), rtol=1e-9)


def test_offsets_without_a_lag_add_no_states(car, motions, forces, at):
    model = CurveModel(
        vehicle=car,
        curve="magic_formula",
        parameters=CURVES["magic_formula"],
        min_speed=1.0,
        offset=np.array([0.01, -0.2]),
    )
    tire = prediction_tire(model)
    assert not tire.structure.lagged
    force, _ = forces(tire, *at(motions))
    np.testing.assert_allclose(force, model.predict(motions), rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("kind", [DugoffTire, FialaTire])
def test_two_tires_an_axle_make_the_force(car, motions, forces, at, kind):
    tire = kind(C_alpha=6.0e4, C_kappa=8.0e4, friction=0.9)
    predicted, slip = forces(prediction_tire(tire, car), *at(motions))
    expected = np.array(
        [
            [2.0 * float(tire.forces(a, 0.0, 0.0, 0.5 * load).F_y) for a, load in pairs]
            for pairs in (zip(row, car.axle_loads, strict=True) for row in slip)
        ]
    )
    expected[:, 0] *= np.cos(motions.delta_f)
    np.testing.assert_allclose(predicted, expected, rtol=1e-6, atol=1e-3)
    limit = 0.9 * np.array(car.axle_loads)
    assert (np.abs(predicted) <= limit * (1.0 + 1e-9)).all()
    assert (np.abs(predicted).max(axis=0) > 0.95 * limit).all()  # the motions reach it


def test_slip_is_the_angle_between_wheel_and_travel(car, motions, forces, at):
    tire = prediction_tire(DugoffTire(C_alpha=6.0e4, C_kappa=8.0e4, friction=0.9), car)
    _, slip = forces(tire, *at(motions))
    v_x, v_y, r, delta = at(motions)
    np.testing.assert_allclose(slip[:, 0], delta - np.arctan2(v_y + car.l_f * r, v_x), atol=1e-12)
    np.testing.assert_allclose(slip[:, 1], -np.arctan2(v_y - car.l_r * r, v_x), atol=1e-12)


def test_the_linear_tire_is_twice_that_of_a_wheel(car, motions, forces, at):
    force, slip = forces(
        prediction_tire(LinearTire(C_alpha=5.0e4, C_kappa=8.0e4), car), *at(motions)
    )
    np.testing.assert_allclose(force, 1.0e5 * slip, rtol=1e-12)
