"""What all baselines promise: similar cars, honest tunables, and forces on the plant's drives."""

from dataclasses import fields, replace

import numpy as np
import pytest

from identifier.baselines import (
    ExtendedStateObserver,
    ForceEkf,
    LinearBaseline,
    StiffnessRls,
    dugoff_ekf,
    magic_formula_ekf,
    share_of_force,
)
from identifier.run import identify
from models.maneuvers import Slalom
from models.plant import Plant
from models.recordings import Recording
from models.sensors import Sensor, Sensors
from models.vehicle import Vehicle, sedan

LEARNING = {
    "stiffness": StiffnessRls.for_vehicle,
    "magic": magic_formula_ekf,
    "dugoff": dugoff_ekf,
}
FOLLOWING = {"eso": ExtendedStateObserver.for_vehicle, "ekf": ForceEkf.for_vehicle}


@pytest.fixture(name="slalom", scope="module")
def the_plants_slalom():
    maneuver = Slalom(
        amplitude=np.radians(4.0), frequency=0.5, onset=1.0, rate_limit=0.5, duration=16.0
    )
    return Plant(sedan()).simulate(maneuver, speed=20.0)


def online_share(history):
    truth = history.recording.axle_force
    return np.sqrt(np.mean((history.axle_force - truth) ** 2, axis=0) / np.mean(truth**2, axis=0))


@pytest.mark.parametrize("name", list(FOLLOWING))
@pytest.mark.parametrize("noisy", [False, True])
def test_signal_estimators_follow_the_plant(name, noisy, slalom, rng):
    sensors = Sensors(v_y=Sensor(noise=0.02), r=Sensor(noise=0.002)) if noisy else None
    recording = slalom.recording(sensors, rng)
    history = identify(recording, sedan(), FOLLOWING[name](sedan()))
    assert online_share(history).max() < (0.25 if noisy else 0.12)


def test_learning_baselines_beat_the_linear_tire_where_it_is_wrong(slalom):
    recording, car = slalom.recording(), sedan()
    wrong = replace(car, cornering_stiffness_front=2e5, cornering_stiffness_rear=2.4e5)
    linear = identify(recording, wrong, LinearBaseline.for_vehicle(car)).freeze(99.0)
    for make in LEARNING.values():
        model = identify(recording, wrong, make(wrong)).freeze(99.0)
        assert (share_of_force(model, recording) < 0.7 * share_of_force(linear, recording)).all()


@pytest.mark.parametrize("make", [*LEARNING.values(), *FOLLOWING.values()])
def test_a_similar_model_car_learns_the_same(make, car, drive):
    """Lengths by 1/s, times by sqrt(1/s), masses by 1/s³: forces come out by 1/s³."""
    s, recording = 10.0, drive(n=600)
    small = Vehicle(
        mass=car.mass / s**3,
        yaw_inertia=car.yaw_inertia / s**5,
        l_f=car.l_f / s,
        l_r=car.l_r / s,
        cornering_stiffness_front=car.cornering_stiffness_front / s**3,
        cornering_stiffness_rear=car.cornering_stiffness_rear / s**3,
    )
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


@pytest.mark.parametrize("make", [*LEARNING.values(), *FOLLOWING.values()])
def test_every_tunable_is_a_number_of_the_method_and_its_range_runs(make, car, drive, rng):
    method, recording = make(car), drive(n=300)
    names = {field.name for field in fields(method)}
    assert set(method.tunables) <= names
    for name, span in method.tunables.items():
        assert span.low < getattr(method, name) < span.high
    for _ in range(5):
        drawn = {name: span.at(rng.uniform()) for name, span in method.tunables.items()}
        history = identify(recording, car, replace(method, **drawn))
        assert np.isfinite(history.axle_force).all()
        assert history.diverged_at is None


@pytest.mark.parametrize("make", list(LEARNING.values()))
def test_a_number_that_is_not_positive_is_refused(make, car):
    method = make(car)
    for name in method.tunables:
        rule = f"{name} must (be positive and finite|lie between 0 and 1000), it is -1"
        with pytest.raises(ValueError, match=rule):
            replace(method, **{name: -1.0})
