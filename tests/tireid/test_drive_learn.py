"""The drive to learn on: as hard as the grip allows, no faster than a driver, ended by a spin."""

from types import SimpleNamespace

import numpy as np
import pytest

from models.vehicle import sedan
from mpc.loop.sensing import Measured
from tireid.driving.learn import learning_drive

CAR, PERIOD, GRIP = sedan(), 0.01, 9.0


class Recorder:
    """A car that goes straight on, notes how it is steered, and spins or tips when told to."""

    vehicle, period = CAR, PERIOD

    def __init__(self, spins_at=None, tips_at=None):
        self.angles, self.spins_at, self.tips_at = [], spins_at, tips_at

    def start(self, v_x):
        return SimpleNamespace(t=0.0, v_x=v_x, v_y=0.0, a_y=0.0, axle_force=np.zeros(2))

    def step(self, state, angle, v_x):
        self.angles.append(angle)
        t = len(self.angles) * PERIOD
        v_y = 0.3 * v_x if self.spins_at is not None and t >= self.spins_at else 0.0
        a_y = -1.3 * GRIP if self.tips_at is not None and t >= self.tips_at else 0.0
        return SimpleNamespace(t=t, v_x=v_x, v_y=v_y, a_y=a_y, axle_force=np.zeros(2))


def measure(state, rng):
    values = {"t": state.t, "v_x": state.v_x, "v_y": state.v_y}
    return Measured(*(values.get(name, 0.0) for name in Measured._fields))


def learnt_on(car):
    sensors = SimpleNamespace(measure=measure)
    rng = np.random.default_rng(1)
    return learning_drive(car, sensors, rng, grip=GRIP, seed=4)


def test_steering_grows_to_the_bend_at_the_limit_plus_slip_and_swings_within_its_frequency():
    car = Recorder()
    recording = learnt_on(car)
    angles, t = np.array(car.angles), PERIOD * np.arange(len(car.angles))
    assert len(recording) == angles.size == 4000
    most = CAR.wheelbase * GRIP / 20.0**2 + np.radians(3.5)
    assert 0.8 * most < np.abs(angles[t > 21.0]).max() <= most
    assert np.abs(angles[t < 3.0]).max() <= 0.4 * most
    assert not angles[t <= 1.0].any()
    turns = t[1:-1][np.diff(np.sign(np.diff(angles))) != 0.0]
    late = turns[turns > 22.0]
    half_period = 0.5 / 0.6
    assert np.diff(late).min() == pytest.approx(half_period, abs=0.03)
    assert np.abs(np.diff(angles)).max() / PERIOD < 1.0


def test_half_a_second_before_a_spin_or_a_tip_is_not_learnt_from():
    for trouble in ({"spins_at": 12.0}, {"tips_at": 12.0}):
        recording = learnt_on(Recorder(**trouble))
        assert recording.t[-1] == pytest.approx(11.5, abs=0.03)
