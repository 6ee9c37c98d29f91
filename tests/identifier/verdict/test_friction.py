"""Another friction is told where tires slide, with its size, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.prediction import predict
from identifier.run import identify
from identifier.verdict import calibrated, judge_prediction, road_friction
from models.friction import Friction, FrictionChange
from models.maneuvers import RandomSteer
from models.plant import Plant
from models.sensors import Sensor, Sensors
from models.vehicle import sedan

SENSORS = Sensors(
    v_x=Sensor(noise=0.03), v_y=Sensor(noise=0.03), r=Sensor(noise=0.003), delta=Sensor(noise=5e-4)
)
DROP = 10.0  # s


def driven(seed, friction=None, amplitude=0.06):
    steering = RandomSteer(
        amplitude=amplitude, frequency=0.6, seed=seed, onset=1.0, rate_limit=0.8, duration=24.0
    )
    run = Plant(sedan()).simulate(steering, speed=20.0, friction=friction)
    return SENSORS.apply(run.recording(), np.random.default_rng(seed))


def taught(log):
    blind = replace(log, axle_force=None)
    return calibrated(identify(blind, sedan(), AxleIdentifier.for_vehicle(sedan(), dt=log.dt)))


@pytest.fixture(scope="module")
def tires():
    """Learnt on the friction that the tires were measured on, with a band."""
    return taught(driven(3))


@pytest.fixture(scope="module")
def same():
    return driven(5)


@pytest.fixture(scope="module")
def wetter():
    """Half the friction from a time on."""
    return driven(5, Friction(changes=(FrictionChange(scale=0.5, at_time=DROP),)), 0.05)


def test_half_the_friction_is_told_within_a_second_with_its_size(tires, wetter):
    (road,) = predict(tires, wetter).friction().roads
    wrong = np.abs(tires.predict(wetter) - wetter.axle_force) / tires.vehicle.axle_loads
    slides = wetter.t[np.argmax((wrong.max(axis=1) > 0.15) & (wetter.t >= DROP))]
    assert DROP < road.first < slides + 1.0
    assert road.last == pytest.approx(wetter.t[-1], abs=0.3)
    assert abs(road.ratio - 0.5) < 2.0 * road.sd < 0.2


def test_the_road_that_taught_is_told_as_such(tires, same):
    found = road_friction(tires, same)
    assert found.roads == () and found.unchanged
    assert found.unexplained.max() < 0.5


def test_what_came_later_changes_nothing_that_was_told(tires, wetter):
    whole = road_friction(tires, wetter)
    part = road_friction(tires, wetter.between(0.0, DROP + 4.0))
    n = part.t.size - 2
    np.testing.assert_allclose(whole.ratio[:n], part.ratio[:n], rtol=0.1)
    np.testing.assert_array_equal(whole.another[:n] > 0.5, part.another[:n] > 0.5)


@pytest.mark.parametrize("off", [-0.01, 0.01])
def test_another_zero_of_the_steering_is_no_other_road(tires, same, off):
    assert road_friction(tires, replace(same, delta_f=same.delta_f + off)).roads == ()


def test_a_banked_road_is_taken_off_and_the_verdict_tells_the_same(tires):
    steering = RandomSteer(
        amplitude=0.05, frequency=0.6, seed=5, onset=1.0, rate_limit=0.8, duration=24.0
    )
    wet = Friction(changes=(FrictionChange(scale=0.5, at_time=DROP),))
    run = Plant(sedan()).simulate(
        steering, speed=20.0, friction=wet, bank=lambda t: np.full(t.size, 0.03)
    )
    prediction = predict(tires, SENSORS.apply(run.recording(), np.random.default_rng(5)))
    (road,) = prediction.friction().roads
    assert DROP < road.first < DROP + 5.0 and abs(road.ratio - 0.5) < 2.0 * road.sd
    assert road.text in [one.text for one in prediction.verdict.findings]


def test_more_friction_is_told_where_the_grip_was_learnt_alone(same):
    wet = taught(driven(5, Friction(scale=0.5), 0.05))
    (road,) = road_friction(wet, same).roads
    assert 1.4 < road.ratio < 2.2  # beyond what was learnt the curve is a guess
    assert road_friction(taught(driven(3, amplitude=0.012)), same).roads == ()


def test_the_verdict_of_a_prediction_names_the_road(tires, wetter, same):
    verdict = judge_prediction(tires, wetter)
    assert "another_road" in [one.code for one in verdict.findings if not one.refuses]
    assert any("of the friction of the identification drive" in line for line in verdict.lines)
    slippery = judge_prediction(tires, driven(5, Friction(scale=0.5), 0.05))
    assert {one.code for one in slippery.findings if one.refuses} == {"force_missed"}
    assert "another_road" in [one.code for one in slippery.findings]
    assert "another_road" not in [one.code for one in judge_prediction(tires, same).findings]
