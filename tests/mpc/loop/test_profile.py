"""Wanted speed along a path, and the road ahead."""

import numpy as np
import pytest

from models.vehicle import sedan
from mpc.cars import DoubleTrackCar
from mpc.path import Path, SpeedProfile
from tests.mpc.loop.test_drive import ring as ring

GAIN = 4.0  # of who drives a double-track car


@pytest.fixture(scope="module")
def straight():
    return Path.from_waypoints([0.0, 50.0, 100.0, 150.0, 200.0], np.zeros(5), name="straight")


def wave(path):
    return 15.0 + 3.0 * np.sin(2.0 * np.pi * path.s / path.length)


def integrated(profile, s, v, t):
    """ds/dt = v, dv/dt = a(s) + k (v(s) - v) by small Euler steps."""
    dt = 1e-4
    for _ in range(round(t / dt)):
        slope = (float(profile.at(s + 0.1)) - float(profile.at(s - 0.1))) / 0.2
        s, v = s + dt * v, v + dt * (slope * v + GAIN * (float(profile.at(s)) - v))
    return s, v


@pytest.mark.sweep("20.0*", "180.0*")
@pytest.mark.parametrize(("s", "v"), [(20.0, 15.0), (120.0, 17.0), (180.0, 12.0)])
def test_the_road_ahead_is_where_the_driver_brings_the_car(ring, s, v):
    profile = SpeedProfile(ring, wave(ring))
    ahead = profile.ahead(s, v, np.array([0.0, 0.5, 1.5]), GAIN)
    for k, t in enumerate((0.0, 0.5, 1.5)):
        there, fast = integrated(profile, s, v, t)
        assert ahead.s[k] == pytest.approx(there, abs=0.15)
        assert ahead.v_x[k] == pytest.approx(fast, abs=0.25)
    assert ahead.kappa == pytest.approx(1.0 / 30.0, rel=1e-3)


def test_beyond_the_end_of_an_open_path_the_speed_is_held(straight):
    profile = SpeedProfile(straight, 20.0)
    ahead = profile.ahead(195.0, 20.0, np.array([0.0, 1.0]), GAIN)
    assert ahead.s == pytest.approx([195.0, 215.0])
    assert ahead.v_x == pytest.approx([20.0, 20.0])
    assert profile.ahead(-5.0, 20.0, np.array([1.0]), GAIN).s == pytest.approx([15.0])


def test_the_reference_keeps_a_proportional_driver_from_lagging(straight):
    profile = SpeedProfile(straight, np.interp(straight.s, [0, 50, 150, 200], [20, 20, 14, 14]))
    errors = {}
    for gain in (GAIN, np.inf):  # without end the reference is the profile itself
        car = DoubleTrackCar(sedan())
        state, worst = car.start(20.0), 0.0
        while state.X < 180.0:
            state = car.step(state, 0.0, profile.reference(state.X, gain))
            worst = max(worst, abs(state.v_x - float(profile.at(state.X))))
        errors[gain] = worst
    assert errors[GAIN] < 0.15
    assert errors[np.inf] > 0.25
