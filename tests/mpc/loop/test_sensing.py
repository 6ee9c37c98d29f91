"""What the tracker is told: the truth, moved, shaken and rounded as its sensors say."""

from types import SimpleNamespace

import numpy as np
import pytest

from models.sensors import Sensor
from mpc.loop.sensing import CarSensors, Measured

NAMES = list(Measured._fields[1:])
STATE = SimpleNamespace(t=1.5, **{name: 0.37 * (k + 1) for k, name in enumerate(NAMES)})


def told(rng, **sensors):
    return CarSensors(**sensors).measure(STATE, rng)


def test_perfect_sensors_tell_the_truth(rng):
    measured = told(rng)
    assert measured.t == STATE.t
    for name in NAMES:
        assert getattr(measured, name) == getattr(STATE, name)


@pytest.mark.parametrize("step", [0.5, 0.01])
def test_a_resolution_rounds_to_the_nearest_of_its_grid(rng, step):
    value = told(rng, r=Sensor(resolution=step)).r
    assert value / step == pytest.approx(round(value / step), abs=1e-9)
    assert abs(value - STATE.r) <= 0.5 * step + 1e-12


def test_bias_and_noise_belong_to_their_own_channel_and_stay_in_step():
    plain = told(np.random.default_rng(3), r=Sensor(noise=0.1))
    both = told(np.random.default_rng(3), r=Sensor(noise=0.1), v_y=Sensor(bias=0.2, noise=0.05))
    assert both.r == plain.r
    assert plain.v_y == STATE.v_y and both.v_y != STATE.v_y
    values = [
        told(np.random.default_rng(k), v_y=Sensor(bias=0.2, noise=0.05)).v_y for k in range(900)
    ]
    assert np.mean(values) == pytest.approx(STATE.v_y + 0.2, abs=0.01)
    assert np.std(values) == pytest.approx(0.05, rel=0.1)
