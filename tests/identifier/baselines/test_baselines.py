"""What the baselines that learn a tire promise: similar cars, and better than the linear tire."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.baselines import LaggedEkf, LinearBaseline, magic_formula_ekf
from identifier.run import identify
from models.maneuvers import Slalom
from models.plant import Plant
from models.recordings import Recording
from models.vehicle import Vehicle, sedan
from tests.identifier.conftest import missed

LEARNING = pytest.mark.parametrize("make", [magic_formula_ekf, LaggedEkf.for_vehicle])


@pytest.fixture(name="slalom", scope="module")
def the_plants_slalom():
    maneuver = Slalom(
        amplitude=np.radians(4.0), frequency=0.5, onset=1.0, rate_limit=0.5, duration=16.0
    )
    return Plant(sedan()).simulate(maneuver, speed=20.0)


@LEARNING
def test_a_similar_model_car_learns_the_same(make, car, drive):
    """Lengths by 1/s, times by sqrt(1/s), masses by 1/s³: forces come out by 1/s³."""
    s, recording = 10.0, drive(n=600)
    small = Vehicle(
        mass=car.mass / s**3, yaw_inertia=car.yaw_inertia / s**5, l_f=car.l_f / s, l_r=car.l_r / s,
        cornering_stiffness_front=car.cornering_stiffness_front / s**3,
        cornering_stiffness_rear=car.cornering_stiffness_rear / s**3,
    )  # fmt: skip
    dt = 0.01 / np.sqrt(s)
    shrunk = Recording(
        name="small",
        t=recording.t / np.sqrt(s),
        v_x=recording.v_x / np.sqrt(s),
        v_y=recording.v_y / np.sqrt(s),
        r=recording.r * np.sqrt(s),
        delta_f=recording.delta_f,
        delta_r=recording.delta_r,
    )
    shrunk = replace(shrunk, t=np.arange(600) * shrunk.dt)
    large_force = identify(recording, car, make(car)).axle_force
    small_force = identify(shrunk, small, make(small, dt=shrunk.dt)).axle_force
    assert dt == pytest.approx(shrunk.dt, rel=1e-6)
    np.testing.assert_allclose(small_force * s**3, large_force, rtol=1e-4, atol=1.0)


@LEARNING
def test_learning_baselines_beat_the_linear_tire_where_it_is_wrong(make, slalom):
    recording, car = slalom.recording(), sedan()
    wrong = replace(car, cornering_stiffness_front=2e5, cornering_stiffness_rear=2.4e5)
    linear = identify(recording, wrong, LinearBaseline.for_vehicle(car)).freeze(99.0)
    model = identify(recording, wrong, make(wrong)).freeze(99.0)
    assert (missed(model, recording) < 0.7 * missed(linear, recording)).all()
