"""The lagged filter finds a tire of its own form, with a_y and without."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.baselines import LaggedEkf
from identifier.baselines.lagged_ekf import SHAPE
from identifier.run import identify
from models.vehicle import Vehicle

STIFFNESS, FRICTION = np.array([11.0, 19.0]), np.array([0.8, 0.95])  # static axle loads


@pytest.fixture(name="log")
def a_log(car, curve_drive, rng):
    """A drive on tires of the filter's form and lag; steering and accelerometer are off zero."""

    def curve(axle, alpha):
        B = STIFFNESS[axle] / (SHAPE * FRICTION[axle])
        D = FRICTION[axle] * car.axle_loads[axle]
        return D * np.sin(SHAPE * np.arctan(B * alpha))

    lag = 0.12 * car.wheelbase
    log = curve_drive(car, curve, n=4000, rng=rng, lag=lag)
    a_y = log.axle_force.sum(axis=1) / car.mass + 0.2 + 0.3 * rng.standard_normal(4000)
    return replace(log, delta_f=log.delta_f - 0.005, a_y=a_y)


def learnt(log, car):
    history = identify(log, car, LaggedEkf.for_vehicle(car))
    return history, history.freeze()


def test_stiffness_friction_and_zeros_are_found(log, car):
    history, tire = learnt(log, car)
    B, C, D = tire.parameters.T
    loads = np.array(car.axle_loads)
    np.testing.assert_allclose(B * C * D / loads, STIFFNESS, rtol=0.05)
    np.testing.assert_allclose(D / loads, FRICTION, rtol=0.03)
    np.testing.assert_array_equal(C, SHAPE)
    assert tire.offset[0] == pytest.approx(0.005, abs=5e-4)
    assert history.state["estimate"][-1, 9] == pytest.approx(0.2, abs=0.05)
    another = replace(car, cornering_stiffness_front=3e4, cornering_stiffness_rear=3e5)
    np.testing.assert_array_equal(learnt(log, another)[1].parameters, tire.parameters)


def test_a_log_without_a_y_teaches_too_and_one_with_it_teaches_another_tire(log, car):
    deaf = learnt(replace(log, a_y=None), car)[1].parameters
    B, C, D = deaf.T
    np.testing.assert_allclose(B * C * D / np.array(car.axle_loads), STIFFNESS, rtol=0.1)
    assert np.abs(deaf - learnt(log, car)[1].parameters).max() > 0.0


def test_it_freezes_to_the_force_that_it_told(log, car):
    history, tire = learnt(log, car)
    force = tire.predict(history.recording)[-1]
    np.testing.assert_allclose(force, history.axle_force[-1], atol=0.01 * np.abs(force).max())


def test_it_goes_on_from_no_stored_model(log, car):
    with pytest.raises(ValueError, match="the lagged filter begins afresh"):
        identify(log, car, LaggedEkf.for_vehicle(car), start=learnt(log, car)[1])


def test_a_similar_model_car_learns_the_same(car, drive):
    """Lengths by 1/s, times by sqrt(1/s), masses by 1/s³: forces come out by 1/s³."""
    s, recording = 10.0, drive(n=600)
    small = Vehicle(
        mass=car.mass / s**3, yaw_inertia=car.yaw_inertia / s**5, l_f=car.l_f / s, l_r=car.l_r / s,
        cornering_stiffness_front=car.cornering_stiffness_front / s**3,
        cornering_stiffness_rear=car.cornering_stiffness_rear / s**3,
    )  # fmt: skip
    root = np.sqrt(s)
    shrunk = replace(
        recording, t=recording.t / root, v_x=recording.v_x / root, v_y=recording.v_y / root,
        r=recording.r * root, axle_force=None,
    )  # fmt: skip
    large = identify(recording, car, LaggedEkf.for_vehicle(car)).axle_force
    like = identify(shrunk, small, LaggedEkf.for_vehicle(small, dt=shrunk.dt)).axle_force
    np.testing.assert_allclose(like * s**3, large, rtol=1e-4, atol=1.0)


def test_at_rest_the_force_is_zero_and_learning_rests(car, halted_drive):
    recording, rest = halted_drive
    history = identify(recording, car, LaggedEkf.for_vehicle(car))
    assert (history.axle_force[rest] == 0.0).all()
    theta = history.state["estimate"][:, 4:]
    assert (np.diff(theta, axis=0)[rest] == 0.0).all()
    assert np.abs(np.diff(theta, axis=0)[~rest]).max() > 0.0


def test_covariance_stays_symmetric_and_positive(car, drive):
    P = identify(drive(n=3000), car, LaggedEkf.for_vehicle(car)).state["P"][1:]
    np.testing.assert_array_equal(P, P.swapaxes(1, 2))
    assert np.linalg.eigvalsh(P).min() > 0.0
