"""Curves in closed form: the frozen models' and the tires' own forces."""

import numpy as np

from identifier.baselines import LinearModel
from models.tires import DugoffTire, LinearTire
from mpc.tires import prediction_tire


def test_a_frozen_linear_tire_is_that_of_its_vehicle(car, motions, forces, at):
    model = LinearModel(vehicle=car, min_speed=1.0)
    predicted, _ = forces(prediction_tire(model), *at(motions))
    np.testing.assert_allclose(predicted, model.predict(motions), rtol=1e-9, atol=1e-6)


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
