"""The drive to learn on: as hard as the sensors show that the car can, ended by a spin."""

from types import SimpleNamespace

import numpy as np
import pytest

import tireid as ti
from models.friction import Friction
from models.vehicle import sedan
from mpc.cars import DoubleTrackCar
from mpc.loop.sensing import Measured, inertial_unit
from tireid.driving.learn import learning_drive

CAR, PERIOD, G = sedan(), 0.01, 9.81


class Recorder:
    """A car that turns as it is steered up to a grip, and spins when told to; notes its angles."""

    vehicle, period = CAR, PERIOD

    def __init__(self, grip=np.inf, spins_at=np.inf):
        self.angles, self.grip, self.spins_at = [], grip, spins_at

    def start(self, v_x):
        return self.state(v_x, 0.0)

    def step(self, state, angle, v_x):
        self.angles.append(angle)
        turned = np.clip(angle * v_x**2 / CAR.wheelbase, -self.grip, self.grip)
        return self.state(v_x, turned)

    def state(self, v_x, a_y):
        t = len(self.angles) * PERIOD
        v_y = 0.3 * v_x if t >= self.spins_at else 0.0
        return SimpleNamespace(t=t, v_x=v_x, v_y=v_y, a_y=a_y, axle_force=np.zeros(2))


def measure(state, rng):
    values = {name: getattr(state, name) for name in ("t", "v_x", "v_y", "a_y")}
    return Measured(*(values.get(name, 0.0) for name in Measured._fields))


def learnt_on(car):
    sensors = SimpleNamespace(measure=measure)
    return learning_drive(car, sensors, np.random.default_rng(1), seed=4)


@pytest.mark.parametrize("grip", [3.0, 9.0])
def test_steering_grows_until_more_of_it_turns_the_car_no_more_and_is_held_there(grip):
    car = Recorder(grip)
    recording = learnt_on(car)
    angles, t = np.array(car.angles), PERIOD * np.arange(len(car.angles))
    assert len(recording) == angles.size == 4000
    at_grip = CAR.wheelbase * grip / 20.0**2
    assert 1.2 * at_grip < np.abs(angles).max() < 1.2**4 * at_grip
    assert not angles[t <= 1.0].any()
    assert np.abs(angles[t < 3.0]).max() < CAR.wheelbase * 2.0 / 20.0**2
    late = np.abs(angles[t > 25.0])
    assert 0.8 * np.abs(angles).max() < late.max() <= np.abs(angles).max()
    swings = np.diff(t[1:-1][np.diff(np.sign(np.diff(angles))) != 0.0])
    assert swings[swings > 2.0 * PERIOD].min() > 0.8
    assert np.abs(np.diff(angles)).max() / PERIOD < 1.0


def test_half_a_second_before_a_spin_is_not_learnt_from():
    recording = learnt_on(Recorder(9.0, spins_at=12.0))
    assert recording.t[-1] == pytest.approx(11.5, abs=0.03)


@pytest.mark.parametrize("mu", [0.3, 1.0])
def test_a_drive_is_whole_and_far_from_a_spin(mu):
    car = DoubleTrackCar(CAR, friction=Friction(scale=mu))
    rng = np.random.default_rng(1)
    recording = learning_drive(car, inertial_unit(), rng, seed=0)
    assert recording.duration == pytest.approx(40.0, abs=0.02)
    a_y = np.abs(recording.axle_force.sum(axis=1)).max() / CAR.mass
    assert (0.25 if mu == 0.3 else 0.8) * G < a_y < 0.95 * G
    assert np.abs(recording.v_y / recording.v_x).max() < np.radians(8.0)


def test_no_drive_asks_for_the_true_tire(monkeypatch):
    """Planted: a car whose tire must not be looked at."""

    def looked(*_, **__):
        raise AssertionError("the driver asks for the true grip")

    class Hidden(DoubleTrackCar):
        tire = property(looked, lambda *_: None)

    usual = ti.sample_recording()
    monkeypatch.setattr("tireid.driving.learn.DoubleTrackCar", Hidden)
    assert np.array_equal(ti.sample_recording().delta_f, usual.delta_f)
