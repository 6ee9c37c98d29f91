"""The true tire as axle curves, against the double-track plant that it is the truth of."""

from dataclasses import replace

import numpy as np
import pytest

from models.friction import Friction
from models.maneuvers import StepSteer
from models.plant import Plant
from models.tires import DugoffTire, FialaTire, LinearTire, MagicFormula
from models.vehicle import VehicleError
from mpc.tires import CurveFitError, oracle_tire, prediction_tire
from mpc.tires.ladder import cornering_force, fitted_ladder, slip_grid
from mpc.tires.tire import Car, Point


def at_slip(forces, model, alpha):
    none = np.zeros(np.size(alpha))
    return forces(model, 20.0, none, none, none, lagged=np.column_stack([alpha, alpha]))[0]


@pytest.mark.sweep("1.0-M*", "0.3-D*", "1.0-F*")
@pytest.mark.parametrize("kind", [MagicFormula, DugoffTire, FialaTire])
@pytest.mark.parametrize("mu", [1.0, 0.3])
def test_curves_follow_the_true_forces_those_with_a_kink_too(car, forces, kind, mu):
    alpha, worst = np.linspace(0.001, 0.5 * mu, 77), 0.013
    if kind is MagicFormula:
        tire, worst = kind.from_tir(car.chassis.tire), 0.002
    else:
        tire = kind(C_alpha=6.0e4, C_kappa=8.0e4, friction=1.0)
    true = np.column_stack([cornering_force(car, tire, axle, alpha, mu) for axle in (0, 1)])
    fitted = at_slip(forces, oracle_tire(car, tire, mu), alpha)
    assert (np.abs(fitted - true).max(axis=0) < worst * true.max(axis=0)).all()


@pytest.mark.sweep("0.5")
@pytest.mark.parametrize("mu", [1.0, 0.5])
def test_the_plant_in_steady_cornering_makes_these_forces(car, forces, mu):
    largest, duration = 0.2 * mu + 0.03, 30.0
    steer = StepSteer(
        amplitude=largest, onset=0.0, rate_limit=largest / duration, duration=duration
    )
    run = Plant(car).simulate(steer, speed=20.0, friction=Friction(scale=mu))
    late = (run.t > 0.1 * duration) & (run.v_x > 0.95 * 20.0)  # as long as it holds its speed
    motion = [signal[late] for signal in (run.v_x, run.v_y, run.r, run.delta_f)]
    slip = forces(oracle_tire(car, mu=mu), *motion)[1]
    force = forces(oracle_tire(car, mu=mu), *motion, lagged=slip)[0]
    true = run.axle_force[late]
    assert np.abs(run.a_y[late]).max() > 0.85 * mu * 9.81  # the drive reaches the limit
    error = np.abs(force - true).max(axis=0) / true.max(axis=0)
    assert (error < 0.02).all()
    blind = forces(prediction_tire(MagicFormula.from_tir(car.chassis.tire), car), *motion)[0]
    assert np.abs(blind - true).max() / true.max() > 0.05  # without load transfer, nor friction


def test_friction_is_other_weights_only(car):
    one, other = oracle_tire(car), oracle_tire(car, mu=0.3)
    assert one.structure == other.structure
    assert one.structure.lagged


def test_the_relaxation_lengths_are_those_of_the_chassis(car):
    model = oracle_tire(car)
    at = Point(0.0, 0.0, 0.0, 20.0, Car(*model.car), model.weights)
    lengths = model.structure.lag_length((0.05, 0.05), at)
    np.testing.assert_allclose([float(length) for length in lengths], [0.60, 0.50])


def test_load_transfer_costs_side_force(car):
    tire, alpha = MagicFormula.from_tir(car.chassis.tire), np.array([0.01, 0.15])
    upright = replace(car.chassis, roll_camber_front=0.0)
    flat = replace(upright, cg_height=0.1, roll_center_height_rear=0.05)
    high, low, leaning = (
        cornering_force(replace(car, chassis=chassis), tire, 0, alpha, 1.0)
        for chassis in (upright, flat, car.chassis)
    )
    assert high[0] == pytest.approx(low[0], rel=0.01)
    assert high[1] < 0.98 * low[1]
    assert (leaning < high).all()  # wheels that lean out with the body make less


def test_what_is_no_force_curve_is_refused(car):
    alpha = slip_grid(0.5)
    curve = 1.0e5 * alpha
    with pytest.raises(CurveFitError, match="rise with slip"):
        fitted_ladder(alpha, np.stack([curve, -curve]))
    wave = np.sin(100.0 * alpha)
    with pytest.raises(CurveFitError, match=r"rear force curve is fitted to .* % of its peak only"):
        fitted_ladder(alpha, np.stack([np.tanh(10.0 * alpha), wave]))
    with pytest.raises(VehicleError, match=r"add \[chassis\]"):
        oracle_tire(replace(car, chassis=None))
    with pytest.raises(
        VehicleError, match=r'names no tire file .* declare it by tire = "my_tire.tir"'
    ):
        oracle_tire(replace(car, chassis=replace(car.chassis, tire=None)))
    with pytest.raises(CurveFitError):
        oracle_tire(car, LinearTire(C_alpha=6e4, C_kappa=8e4), mu=-1.0)
