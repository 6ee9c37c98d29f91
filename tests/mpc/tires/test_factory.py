"""One door for every tire, and what it does not let in."""

from dataclasses import replace

import numpy as np
import pytest

from models.tires import DugoffTire, FialaTire, LinearTire, MagicFormula
from mpc.prediction import build_stage
from mpc.tires import prediction_tire
from mpc.tires.ladder import mounted_tire
from mpc.tires.tire import ALL
from tests.mpc.tires.test_oracle import at_slip


def test_a_vehicle_stands_for_the_linear_tire_that_it_states(car):
    model = prediction_tire(car)
    np.testing.assert_array_equal(model.weights, [127700.0, 106000.0])
    np.testing.assert_array_equal(model.car, [1500.0, 2500.0, 1.15, 1.55])


def test_every_tire_of_models_comes_in(car):
    wheel = {"C_alpha": 6e4, "C_kappa": 8e4}
    tires = (
        LinearTire(**wheel),
        DugoffTire(**wheel, friction=1.0),
        FialaTire(**wheel, friction=1.0),
        MagicFormula.from_tir(car.chassis.tire),
    )
    for tire in tires:
        model = prediction_tire(tire, car)
        x = np.array([0.1, 0.02, 0.3, 0.2, 0.05])
        result = build_stage(model.structure)(
            x, 0.1, 0.0, 20.0, 0.05, model.car, model.weights, *ALL, np.ones(7)
        )
        assert all(np.isfinite(np.array(value)).all() for value in result)
        assert model.weights.shape == (model.structure.n_weights,)


def test_a_model_may_be_driven_in_another_car(car):
    heavy = replace(car, mass=1800.0)
    model = prediction_tire(prediction_tire(car), heavy)
    assert model.car[0] == 1800.0
    np.testing.assert_array_equal(model.weights, prediction_tire(car).weights)
    np.testing.assert_array_equal(prediction_tire(car, heavy).car, model.car)


def test_a_mounted_tire_is_that_of_the_static_load(car, forces):
    tire, alpha = MagicFormula.from_tir(car.chassis.tire), np.linspace(0.01, 0.4, 20)
    force = at_slip(forces, prediction_tire(tire, car), alpha)
    require_forces(force, car, tire, tire, alpha, 0.005)


def require_forces(force, car, front, rear, alpha, worst):
    """Those of two tires an axle at its static load."""
    for found, tire, load in zip(force.T, (front, rear), car.axle_loads, strict=True):
        expected = [2.0 * float(tire.forces(a, 0.0, 0.0, 0.5 * load).F_y) for a in alpha]
        np.testing.assert_allclose(found, expected, atol=worst * max(expected))


@pytest.mark.parametrize("kind", [DugoffTire, FialaTire])
@pytest.mark.parametrize("stiffness", [1e4, 4e5, 2e6])
@pytest.mark.parametrize("friction", [0.05, 0.2, 1.0])
@pytest.mark.parametrize("rear_share", [0.1, 1.0])
def test_tires_of_any_friction_and_stiffness_are_mounted(
    car, forces, kind, stiffness, friction, rear_share
):
    given = {"C_alpha": 0.5 * stiffness, "C_kappa": 0.5 * stiffness}
    tires = [kind(**given, friction=share * friction) for share in (1.0, rear_share)]
    alpha = np.geomspace(1e-5, 0.5, 40)
    require_forces(at_slip(forces, mounted_tire(car, *tires), alpha), car, *tires, alpha, 0.02)


def test_the_door_says_what_it_cannot_use(car):
    with pytest.raises(ValueError, match="DugoffTire needs the vehicle"):
        prediction_tire(DugoffTire(C_alpha=6e4, C_kappa=8e4, friction=1.0))
    with pytest.raises(TypeError, match="can be made of str"):
        prediction_tire("weights.json", car)
