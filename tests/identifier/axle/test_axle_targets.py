"""What the axle identifier must reach: on recorded drives of others' cars and on the plant."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.recorded_cars import CARMAKER, DART
from identifier.axle import AxleIdentifier
from identifier.run import identify
from models.friction import Friction, FrictionChange
from models.maneuvers import DoubleLaneChange, Slalom, StepSteer
from models.plant import Plant
from models.recordings import read_recording
from models.sensors import Sensor, Sensors
from models.vehicle import sedan
from tests.identifier.conftest import learnt, missed, outside_known

NOISE = Sensors(v_y=Sensor(noise=0.02), r=Sensor(noise=0.002))
RUNS = {"hard": "slalom1_14_5ms", "mild": "experiment2_40kmh"}
LIMITS = {"hard": (0.09, 0.055), "mild": (0.15, 0.15)}  # front, rear
INSIDE = (0.16, 0.15)  # of the hard drive within the slip that the mild one identifies
STIFFNESS = ((110e3, 130e3), (80e3, 100e3), (150e3, 200e3))  # N/rad, as declared
REAL_RUNS = ("ramp_steer02", "free_10_02_28", "free_10_12_05")
WEAVE = Slalom(amplitude=np.radians(4.0), frequency=0.5, onset=1.0, rate_limit=1.0, duration=30.0)


def rms(force):
    return np.sqrt(np.mean(force**2, axis=0))


@pytest.fixture(name="car", params=STIFFNESS, ids=str)
def carmaker_car(request):
    """The same car, declared with different cornering stiffnesses."""
    front, rear = request.param
    return replace(CARMAKER, cornering_stiffness_front=front, cornering_stiffness_rear=rear)


@pytest.fixture(name="drives")
def carmaker_drives(shared_data):
    return [read_recording(shared_data / "carmaker.csv.gz", run) for run in RUNS.values()]


def test_learnt_on_a_hard_slalom_it_knows_the_gentle_drive(car, drives):
    model = learnt(drives[0], car)
    for name, drive in zip(RUNS, drives, strict=True):
        assert (missed(model, drive) <= LIMITS[name]).all()


def test_learnt_on_a_gentle_drive_it_knows_its_range_and_says_where_it_ends(car, drives):
    hard, gentle = drives
    model = learnt(gentle, car)
    outside = outside_known(model, hard)
    slip = np.abs(hard.alpha(car.l_f, car.l_r))
    reached = np.abs(gentle.alpha(car.l_f, car.l_r)).max(axis=0)
    stiffness = np.array([car.cornering_stiffness_front, car.cornering_stiffness_rear])
    told = hard.alpha(car.l_f, car.l_r) * stiffness
    for axle in range(2):
        assert missed(model, hard, ~outside[:, axle])[axle] <= INSIDE[axle]
        assert missed(model, hard, slip[:, axle] <= reached[axle])[axle] <= 0.15
        beyond = outside[:, axle]
        linear = rms((told - hard.axle_force)[beyond]) / rms(hard.axle_force[beyond])
        assert missed(model, hard, beyond)[axle] < linear[axle]
        assert beyond[slip[:, axle] > 1.1 * reached[axle]].all()
    assert outside_known(model, gentle).mean() < 0.1


def test_on_a_real_small_car_it_transfers_better_than_a_linear_tire(shared_data):
    """Cross replays of three drives; the best linear tire in hindsight misses 32 %."""
    drives = [read_recording(shared_data / "dart.csv.gz", run) for run in REAL_RUNS]
    misses = []
    for trained in drives:
        model = learnt(trained, DART)
        for other in drives:
            if other is not trained:
                moving = other.v_x > 0.8
                error = (model.predict(other) - other.axle_force)[moving]
                misses.append(np.sqrt(np.sum(error**2) / np.sum(other.axle_force[moving] ** 2)))
    assert np.mean(misses) < 0.21
    assert max(misses) < 0.30


@pytest.mark.parametrize(("sensors", "limit"), [(None, 100.0), (NOISE, 150.0)])
def test_on_the_plant_it_repeats_the_slalom_and_knows_other_maneuvers(sensors, limit):
    plant, rng = Plant(sedan()), np.random.default_rng(11)
    slalom = plant.simulate(WEAVE, speed=20.0).recording(sensors, rng)
    model = learnt(slalom, sedan())
    assert (rms(model.predict(slalom) - slalom.axle_force) < limit).all()
    begin = {"onset": 1.0, "rate_limit": 1.0}
    lanes = {"amplitude": np.radians(4.5), "frequency": 0.5, "pause": 0.5, "duration": 10.0}
    for maneuver, speed in (
        (StepSteer(amplitude=np.radians(4.0), duration=8.0, **begin), 20.0),
        (DoubleLaneChange(**lanes, **begin), 20.0),
        (replace(WEAVE, amplitude=np.radians(2.5), duration=15.0), 25.0),
    ):
        other = plant.simulate(maneuver, speed=speed).recording(sensors, rng)
        assert (rms(model.predict(other) - other.axle_force) < 150.0).all()


def test_a_change_of_friction_is_followed_within_two_seconds_both_ways():
    """And the shape is not forgotten: back on the dry road the old model still fits."""
    road = Friction(
        changes=(FrictionChange(scale=0.5, at_time=14.0), FrictionChange(scale=1.0, at_time=28.0))
    )
    run = Plant(sedan()).simulate(replace(WEAVE, duration=42.0), speed=20.0, friction=road)
    recording = run.recording(NOISE, np.random.default_rng(5))
    history = identify(recording, sedan(), AxleIdentifier.for_vehicle(sedan()))
    t, error, size = recording.t, history.axle_force - recording.axle_force, recording.axle_force
    for start, share in ((14.0, 0.15), (28.0, 0.2)):  # a rise shows less, as nothing slides
        just, later = (t >= start) & (t < start + 1), (t >= start + 2) & (t < start + 14)
        assert (rms(error[just]) > 0.15 * rms(size)).any()
        for begin in np.arange(start + 2.0, start + 13.0, 0.1):
            second = (t >= begin) & (t < begin + 1.0)
            assert (rms(error[second]) < share * rms(size)).all(), begin
        assert (rms(error[later]) < 0.07 * rms(size[later])).all()
    before, after = history.freeze(13.9), history.freeze(41.9)
    slips = np.array([0.01, 0.03, 0.06])
    ratio = after.force(slips) / before.force(slips)
    np.testing.assert_allclose(ratio, 1.0, atol=0.12)
    slid = history.freeze(27.9).force(slips) / before.force(slips)
    tire, loads = Plant(sedan()).tire, np.array(sedan().axle_loads) / 2
    icy, dry = (
        np.array([[float(tire.forces(a, 0.0, 0.0, F, mu=mu).F_y) for F in loads] for a in slips])
        for mu in (0.5, 1.0)
    )
    np.testing.assert_allclose(slid, icy / dry, atol=0.1)  # 0.98 at small slip, 0.64 at large
