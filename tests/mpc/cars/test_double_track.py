"""The double-track plant as a car."""

import numpy as np
import pytest

from models.friction import Friction, FrictionChange
from models.vehicle import sedan
from mpc.cars import DoubleTrackCar
from tests.mpc.cars.conftest import column, driven


@pytest.fixture(scope="module")
def slalom():
    car = DoubleTrackCar(sedan())
    return car, driven(car, 300, lambda k: 0.04 * np.sin(0.03 * k))


def test_what_a_state_says_fits_together(slalom):
    car, states = slalom
    v_x, v_y, r, psi = (column(states, name) for name in ("v_x", "v_y", "r", "psi"))
    inside = slice(1, -1)

    def rate(values):
        return (values[2:] - values[:-2]) / (2.0 * car.period)

    X_dot = v_x * np.cos(psi) - v_y * np.sin(psi)
    Y_dot = v_x * np.sin(psi) + v_y * np.cos(psi)
    assert rate(column(states, "X")) == pytest.approx(X_dot[inside], abs=2e-3)
    assert rate(column(states, "Y")) == pytest.approx(Y_dot[inside], abs=2e-2)
    assert rate(psi) == pytest.approx(r[inside], abs=2e-3)
    assert rate(v_y) + (v_x * r)[inside] == pytest.approx(column(states, "a_y")[inside], abs=0.05)
    force = column(states, "axle_force")
    assert force.sum(axis=1) == pytest.approx(car.vehicle.mass * column(states, "a_y"), abs=1e-6)
    assert np.abs(column(states, "a_y")).max() > 4.0
    assert column(states, "t") == pytest.approx(car.period * np.arange(301), abs=1e-12)


def test_the_road_wheels_follow_the_command_with_the_lag_of_the_chassis():
    car = DoubleTrackCar(sedan())
    states = driven(car, 30, lambda k: 0.02)
    t = car.period * np.arange(31)
    lag = car.vehicle.require_chassis().steering_lag
    assert column(states, "delta") == pytest.approx(0.02 * (1.0 - np.exp(-t / lag)), abs=1e-7)


def test_the_road_turns_slippery_where_it_is_said_to():
    road = Friction(changes=(FrictionChange(scale=0.3, at_time=1.0),))
    slippery = DoubleTrackCar(sedan(), friction=road)
    dry = DoubleTrackCar(sedan())
    a, b = (driven(car, 200, lambda k: 0.06) for car in (slippery, dry))
    same = [np.array_equal(x.inner.x, y.inner.x) for x, y in zip(a, b, strict=True)]
    assert all(same[:100])
    assert abs(a[-1].a_y) < 0.6 * abs(b[-1].a_y)


def test_the_driver_follows_a_wanted_speed():
    car = DoubleTrackCar(sedan())
    state = car.start(20.0)
    for _ in range(400):
        state = car.step(state, 0.0, 22.0)
    assert state.v_x == pytest.approx(22.0, abs=0.02)
