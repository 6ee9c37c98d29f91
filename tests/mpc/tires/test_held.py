"""How far slip is of use, and tires whose curves do not fall beyond."""

import casadi as ca
import numpy as np
import pytest
from mpc.tires.held import RISE, HeldAxles, held

from models.vehicle import sedan
from mpc.tires import oracle_tire, tire_model
from mpc.tires.reach import useful_slip
from mpc.tires.structure import Car, Point

SLIPS = np.linspace(-0.4, 0.4, 161)


def curves(tire, delta=0.0):
    """Axle forces [N] over slip, (2, k)."""
    x = ca.SX.sym("x")
    at = Point(0.0, 0.0, delta, 20.0, Car(*map(float, tire.car)), ca.SX(tire.weights))
    force = ca.Function("force", [x], [ca.vertcat(*tire.structure.force((x, x), at))])
    return np.array(force(SLIPS[None]))


@pytest.fixture(scope="module", params=[1.0, 0.5])
def oracle(request):
    return oracle_tire(sedan(), mu=request.param)


def test_slip_is_of_use_up_to_nearly_the_peak(oracle):
    force, useful = curves(oracle), useful_slip(oracle)
    for axle in (0, 1):
        there = np.interp(useful[axle], SLIPS, force[axle])
        assert 0.97 < there / force[axle].max() <= 1.0
        assert useful[axle] <= SLIPS[force[axle].argmax()] + 0.005


def test_half_the_friction_halves_the_useful_slip():
    dry, wet = (useful_slip(oracle_tire(sedan(), mu=mu)) for mu in (1.0, 0.5))
    assert wet == pytest.approx(0.5 * dry, rel=0.1)


def test_a_tire_that_never_flattens_has_no_end_of_use():
    assert np.isinf(useful_slip(tire_model(sedan()))).all()
    linear = tire_model(sedan())
    assert held(linear) is linear


def test_a_held_tire_is_the_tire_up_to_there_and_rises_beyond(oracle):
    tire, useful = held(oracle), useful_slip(oracle)
    free, kept = curves(oracle, delta=0.1), curves(tire, delta=0.1)
    slope = np.gradient(curves(oracle), SLIPS, axis=1)[:, SLIPS.size // 2]
    for axle in (0, 1):
        inside = np.abs(SLIPS) <= useful[axle]
        assert kept[axle, inside] == pytest.approx(free[axle, inside], abs=1e-6)
        beyond = SLIPS[1:] > useful[axle] + 0.01
        rise = np.diff(kept[axle])[beyond] / np.diff(SLIPS)[beyond]
        assert rise == pytest.approx(RISE * slope[axle], rel=0.02)
        assert np.diff(free[axle])[beyond].min() < 0.0 < np.diff(kept[axle]).min()


def test_slip_and_lag_of_a_held_tire_are_those_of_the_tire(oracle):
    tire = held(oracle)
    names = ca.SX.sym("m", 4)
    for model, other in ((oracle, tire), (tire, oracle)):
        found = []
        for one in (model, other):
            at = Point(*ca.vertsplit(names), Car(*map(float, one.car)), ca.SX(one.weights))
            values = [*one.structure.slip(at), *one.structure.lag_length((0.02, 0.03), at)]
            ask = ca.Function("ask", [names], [ca.vertcat(*values)])
            found.append(np.array(ask([0.4, 0.3, 0.05, 18.0])).ravel())
        assert found[0] == pytest.approx(found[1], rel=1e-12)
    assert tire.structure.lagged == oracle.structure.lagged
    assert tire.structure.n_weights == tire.weights.size


def test_a_held_tire_is_not_held_twice_and_ends_its_use_at_the_same_slip(oracle):
    tire = held(oracle)
    assert held(tire) is tire
    assert tire.structure == HeldAxles(inner=oracle.structure)
    assert useful_slip(tire) == pytest.approx(useful_slip(oracle))
