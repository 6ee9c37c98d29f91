"""Curves in closed form: the frozen models' and the tires' own forces."""

import casadi as ca
import numpy as np
import pytest

from identifier.baselines.curves import CurveModel
from models.tires import DugoffTire, LinearTire
from mpc.tires import prediction_tire
from mpc.tires.tire import Point

CURVES = {
    "linear": np.array([[1.2e5], [1.0e5]]),
    "magic_formula": np.array([[11.0, 1.4, 7600.0], [12.0, 1.35, 6000.0]]),
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


def test_a_frozen_dugoff_curve_is_fitted_by_a_ladder(car, forces):
    alpha, none = np.linspace(-0.3, 0.3, 61), np.zeros(61)
    parameters = np.array([[1.2e5, 0.9], [1.0e5, 1.1]])
    model = CurveModel(vehicle=car, curve="dugoff", parameters=parameters, min_speed=1.0)
    slips = np.column_stack([alpha, alpha])
    predicted = forces(prediction_tire(model), 20.0, none, none, none, lagged=slips)[0]
    limit = parameters[:, 1] * np.array(car.axle_loads)
    assert (np.abs(predicted - model.force(alpha)) < 0.013 * limit).all()


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
