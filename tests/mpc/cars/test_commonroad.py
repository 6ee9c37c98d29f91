"""The cars of commonroad-vehicle-models behind our interface."""

import importlib.util
import sys

import numpy as np
import pytest

from models.friction import Friction, FrictionChange
from models.plant import Driver
from mpc.cars.bmw import MissingCommonRoadError
from mpc.cars.commonroad import CommonRoadError, drift_car, multi_body_car
from tests.mpc.cars.conftest import column, driven

needs_package = pytest.mark.skipif(
    importlib.util.find_spec("vehiclemodels") is None,
    reason="needs commonroad-vehicle-models",
)
CARS = {"multi-body": multi_body_car, "drift": drift_car}


@pytest.fixture(scope="module", params=list(CARS))
def gentle(request):
    if importlib.util.find_spec("vehiclemodels") is None:
        pytest.skip("needs commonroad-vehicle-models")
    car = CARS[request.param]()
    return car, driven(car, 200, lambda k: 0.01)


def test_a_missing_package_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "vehiclemodels.parameters_vehicle2", None)
    for make in CARS.values():
        with pytest.raises(MissingCommonRoadError, match=r"pip install commonroad-vehicle-models"):
            make()


def test_gentle_cornering_is_that_of_the_linear_bicycle_of_its_vehicle(gentle):
    car, states = gentle
    v = car.vehicle
    weight = v.mass / v.wheelbase
    understeer = weight * (v.l_r / v.cornering_stiffness_front - v.l_f / v.cornering_stiffness_rear)
    v_x = states[-1].v_x
    steady = 0.01 * v_x / (v.wheelbase + understeer * v_x**2)
    assert states[-1].r == pytest.approx(steady, rel=0.04)


def test_what_a_state_says_fits_together(gentle):
    car, states = gentle
    v_x, v_y, r, psi = (column(states, name) for name in ("v_x", "v_y", "r", "psi"))
    inside = slice(6, -1)

    def rate(values):
        return ((values[2:] - values[:-2]) / (2.0 * car.period))[5:]

    Y_dot = v_x * np.sin(psi) + v_y * np.cos(psi)
    assert rate(column(states, "Y")) == pytest.approx(Y_dot[inside], abs=0.02)
    assert rate(psi) == pytest.approx(r[inside], abs=2e-3)
    assert rate(v_y) + (v_x * r)[inside] == pytest.approx(column(states, "a_y")[inside], abs=0.1)
    force = column(states, "axle_force")
    assert force.sum(axis=1) == pytest.approx(car.vehicle.mass * column(states, "a_y"), abs=1e-6)
    assert (force[-1] > 0.0).all()


@needs_package
def test_the_wheels_turn_no_faster_than_their_parameters_allow():
    car = drift_car()
    states = driven(car, 10, lambda k: 0.5)
    assert np.diff(column(states, "delta")) == pytest.approx(0.4 * car.period, abs=1e-12)
    assert car.step(states[0], 0.003, 20.0).delta == pytest.approx(0.003, abs=1e-12)


@needs_package
def test_half_the_friction_carries_half_the_acceleration():
    largest = []
    for scale in (1.0, 0.5):
        states = driven(drift_car(friction=Friction(scale=scale)), 150, lambda k: 0.002 * k)
        largest.append(np.abs(column(states, "a_y")).max())
    assert largest[1] / largest[0] == pytest.approx(0.5, abs=0.06)


@needs_package
def test_friction_changes_where_it_is_said_to():
    road = Friction(changes=(FrictionChange(scale=0.3, at_place=10.0),))
    slippery, dry = drift_car(friction=road), drift_car()
    a, b = (driven(car, 90, lambda k: 0.05) for car in (slippery, dry))
    before = column(b, "X") < 9.8
    assert before.sum() > 40
    assert np.array_equal(column(a, "r")[before], column(b, "r")[before])
    assert abs(a[-1].a_y) < 0.6 * abs(b[-1].a_y)


@needs_package
def test_what_cannot_be_driven_is_refused():
    with pytest.raises(ValueError, match="integral_gain must be zero"):
        drift_car(driver=Driver())
    with pytest.raises(ValueError, match="multiple of dt"):
        drift_car(period=0.0105)
    car = drift_car()
    state = car.start(20.0)
    with pytest.raises(ValueError, match="must be finite"):
        car.step(state, np.nan, 20.0)
    broken = state._replace(inner=state.inner._replace(x=np.full(9, np.nan)))
    with pytest.raises(CommonRoadError, match=r"before t = 0.010 s"):
        car.step(broken, 0.0, 20.0)
