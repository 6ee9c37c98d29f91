"""Sensors do what their numbers say, and nothing else."""

import math

import numpy as np
import pytest

from models.recordings.samples import white_noise
from models.sensors import Sensor, SensorError, Sensors
from tests.made import made

N = 20001
T = 0.01 * np.arange(N)


def exact(rear=0.0):
    wave = np.sin(2.0 * math.pi * 0.3 * T)
    return made(
        T,
        v_x=20.0 + wave,
        v_y=0.5 * wave,
        r=0.3 * wave,
        delta_f=0.05 * wave,
        delta_r=rear * wave,
        a_y=6.0 * wave,
        axle_force=np.column_stack((5000.0 * wave, 4000.0 * wave)),
    )


EXACT = exact()


def test_noise_and_bias_have_their_size_and_the_truth_stays_exact(rng):
    sensors = Sensors(
        v_y=Sensor(noise=0.05, bias=0.2), r=Sensor(noise=0.004), delta=Sensor(bias=-0.01)
    )
    measured = sensors.apply(EXACT, rng)
    error = measured.v_y - EXACT.v_y
    assert np.mean(error) == pytest.approx(0.2, abs=5 * 0.05 / math.sqrt(N))
    assert np.std(error) == pytest.approx(0.05, rel=0.03)
    assert np.std(measured.r - EXACT.r) == pytest.approx(0.004, rel=0.03)
    assert np.corrcoef(error, measured.r - EXACT.r)[0, 1] == pytest.approx(0.0, abs=0.04)
    np.testing.assert_allclose(measured.delta_f, EXACT.delta_f - 0.01, rtol=1e-14)
    np.testing.assert_array_equal(measured.v_x, EXACT.v_x)
    np.testing.assert_array_equal(measured.axle_force, EXACT.axle_force)


def test_a_delayed_signal_is_the_signal_some_time_ago(rng):
    delay = 0.0137
    measured = Sensor(delay=delay).measure(T, np.sin(T), rng)
    np.testing.assert_allclose(measured[2:], np.sin(T - delay)[2:], atol=0.01**2 / 8.0)
    assert measured[0] == 0.0


def test_resolution_rounds_to_its_grid(rng):
    measured = Sensors(r=Sensor(resolution=0.01)).apply(EXACT, rng).r
    np.testing.assert_allclose(measured / 0.01, np.round(measured / 0.01), atol=1e-9)
    assert np.abs(measured - EXACT.r).max() == pytest.approx(0.005, rel=0.05)


def test_the_same_generator_state_is_the_same_noise():
    sensors = Sensors(v_x=Sensor(noise=0.1))
    one = sensors.apply(EXACT, np.random.default_rng(1))
    two = sensors.apply(EXACT, np.random.default_rng(1))
    three = sensors.apply(EXACT, np.random.default_rng(2))
    np.testing.assert_array_equal(one.v_x, two.v_x)
    assert np.abs(one.v_x - three.v_x).max() > 0.01


def test_an_axle_that_does_not_steer_has_no_steering_sensor(rng):
    sensors = Sensors(delta=Sensor(noise=0.01))
    assert np.all(sensors.apply(EXACT, rng).delta_r == 0.0)
    assert np.any(sensors.apply(exact(rear=0.02), rng).delta_r != exact(rear=0.02).delta_r)


@pytest.mark.parametrize("value", [-1e-3, math.nan])
@pytest.mark.parametrize("key", ["noise", "delay", "resolution", "bias"])
def test_negative_numbers_and_nan_are_refused_by_name(key, value):
    if key == "bias" and value < 0.0:
        assert Sensor(bias=value).bias == value
        return
    with pytest.raises(SensorError, match=key):
        Sensor(**{key: value})


def test_white_noise_is_seen_beside_a_maneuver_and_not_in_straight_lines():
    t = 0.01 * np.arange(4000)
    noise = 0.02 * np.random.default_rng(0).normal(size=t.size)
    signal = 0.1 * np.sin(math.pi * t) * (t > 10.0) + noise
    assert white_noise(signal) == pytest.approx(0.02, rel=0.05)
    assert white_noise(np.interp(t, t[::2], signal[::2])) < 1e-3
