"""How far slip is of use, and what the tracker believes beyond: curves that do not fall."""

import casadi as ca
import numpy as np
import pytest

from models.tires import FialaTire
from models.vehicle import sedan
from mpc.prediction import build_dynamics
from mpc.problem import Limits, Problem
from mpc.realtime import Tracker
from mpc.tires import oracle_tire, prediction_tire
from mpc.tires.tire import ALL, LEAST_RISE, Car, Point, believed, valid_slip
from tests.mpc.test_prediction import network

CAR = sedan()
SLIPS = np.linspace(-0.4, 0.4, 161)
MOST, NO_LIMIT = (0.2, 0.2), (np.inf, np.inf)


def curves(tire, valid=ALL, delta=0.0):
    """Axle forces [N] over slip as they are believed, (2, k)."""
    x = ca.SX.sym("x")
    at = Point(0.0, 0.0, delta, 20.0, Car(*map(float, tire.car)), ca.SX(tire.weights))
    force, _ = believed(tire.structure, (x, x), at, *map(ca.DM, valid))
    return np.array(ca.Function("force", [x], [force])(SLIPS[None]))


@pytest.fixture(scope="module", params=[1.0, 0.5])
def oracle(request):
    return oracle_tire(CAR, mu=request.param)


def test_slip_is_of_use_up_to_nearly_the_peak(oracle):
    force, useful = curves(oracle), valid_slip(oracle, NO_LIMIT).slip
    for axle in (0, 1):
        there = np.interp(useful[axle], SLIPS, force[axle])
        assert 0.97 < there / force[axle].max() <= 1.0
        assert useful[axle] <= SLIPS[force[axle].argmax()] + 0.005


def test_a_linear_tire_is_of_use_everywhere_and_goes_on_as_it_is():
    linear = prediction_tire(CAR)
    assert np.isinf(valid_slip(linear, NO_LIMIT).slip).all()
    valid = valid_slip(linear, MOST)
    np.testing.assert_allclose(valid.slip, MOST)
    np.testing.assert_allclose(valid.rise, linear.weights)
    np.testing.assert_allclose(curves(linear, valid), curves(linear), atol=1e-8)


def test_a_curve_is_the_tires_up_to_there_and_rises_beyond(oracle):
    useful, valid = valid_slip(oracle, NO_LIMIT).slip, valid_slip(oracle, MOST)
    free, kept = curves(oracle, delta=0.1), curves(oracle, valid, delta=0.1)
    first = np.gradient(curves(oracle), SLIPS, axis=1)[:, SLIPS.size // 2]
    for axle in (0, 1):
        inside = np.abs(SLIPS) <= useful[axle]
        assert kept[axle, inside] == pytest.approx(free[axle, inside], abs=1e-6)
        beyond = np.abs(SLIPS[1:] - 0.0025) > useful[axle] + 0.01
        rise = np.diff(kept[axle])[beyond] / np.diff(SLIPS)[beyond]
        assert (rise > 0.99 * LEAST_RISE * first[axle]).all()
        assert (rise < 0.055 * first[axle]).all()
        assert np.diff(free[axle])[beyond].min() < 0.0 < np.diff(kept[axle]).min()
        np.testing.assert_allclose(kept[axle], -kept[axle][::-1], atol=1e-6)


def test_a_curve_goes_on_without_a_kink(oracle):
    valid, step = valid_slip(oracle, MOST), 1e-6
    x = ca.SX.sym("x", 2)
    at = Point(0.0, 0.0, 0.0, 20.0, Car(*map(float, oracle.car)), ca.SX(oracle.weights))
    force, _ = believed(oracle.structure, (x[0], x[1]), at, *map(ca.DM, valid))
    slope = ca.Function("slope", [x], [ca.diag(ca.jacobian(force, x))])
    below, above = (np.array(slope(valid.slip + d)).ravel() for d in (-step, step))
    np.testing.assert_allclose(above, below, rtol=1e-3)


def test_a_tire_that_slides_fully_still_rises():
    tire = prediction_tire(FialaTire(C_alpha=6e4, C_kappa=8e4, friction=0.5), CAR)
    kept = curves(tire, valid_slip(tire, MOST))
    assert np.diff(curves(tire)).min() < 0.0
    assert np.diff(kept).min() > 0.0


def test_a_network_of_other_signals_is_left_as_it_is():
    tire = prediction_tire(network(hidden=4))
    valid = valid_slip(tire, MOST)
    x = np.array([0.0, 0.0, 3.0, 0.5, 0.4])
    given = (x, 0.1, 0.0, 12.0, 0.05, tire.car, tire.weights)
    rates = build_dynamics(tire.structure)
    np.testing.assert_array_equal(np.array(rates(*given, *valid)), np.array(rates(*given, *ALL)))


def test_the_tracker_believes_what_is_of_use_of_the_tire_that_it_is_told():
    dry, wet = (oracle_tire(CAR, mu=mu) for mu in (1.0, 0.5))
    tracker = Tracker(dry, Problem(limits=Limits(slip=(0.1, 0.2))))
    for tire in (dry, wet):
        tracker.set_tire(tire)
        slip, rise, _ = valid_slip(tire, (0.1, 0.2))
        np.testing.assert_allclose(tracker.params["max_slip"], slip, rtol=1e-14)
        np.testing.assert_allclose(tracker.params["rise"], rise, rtol=1e-14)
    assert (tracker.params["max_slip"] < 0.1).all()
