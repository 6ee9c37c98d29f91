"""Maneuvers: resolved at the sample time, with the shape their name promises."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from models.maneuvers import (
    DoubleLaneChange,
    ManeuverError,
    RandomSteer,
    SampledSteer,
    Slalom,
    StepSteer,
)

COMMON = {"amplitude": 0.1, "onset": 1.003, "rate_limit": 0.7, "duration": 12.0}
ALL = [
    StepSteer(**COMMON), Slalom(**COMMON, frequency=0.6),
    DoubleLaneChange(**COMMON, frequency=0.5, pause=1.2),
    RandomSteer(**COMMON, frequency=1.0, seed=3),
]  # fmt: skip
NAMES = [type(m).__name__ for m in ALL]
every_maneuver = pytest.mark.parametrize("maneuver", ALL, ids=NAMES)


@every_maneuver
@pytest.mark.parametrize("dt", [0.001, 0.01, 0.05])
def test_steering_never_jumps(maneuver, dt):
    t = np.arange(0.0, maneuver.duration, dt)
    change = np.abs(np.diff(maneuver.steering(t)[:, 0]))
    assert change.max() <= maneuver.rate_limit * dt * (1.0 + 1e-9)
    assert change.max() > 0.0


@every_maneuver
def test_nothing_happens_before_the_onset_and_the_amplitude_is_kept(maneuver):
    t = np.arange(0.0, maneuver.duration, 0.001)
    angle = maneuver.steering(t)
    assert np.all(angle[t <= maneuver.onset] == 0.0)
    assert np.abs(angle).max() <= maneuver.amplitude * (1.0 + 1e-12)
    assert np.abs(angle).max() > 0.8 * maneuver.amplitude
    assert np.all(angle[:, 1] == 0.0)


@every_maneuver
def test_the_rear_axle_follows_its_ratio_and_the_limit_holds_for_it_too(maneuver):
    t = np.linspace(0.0, maneuver.duration, 12001)
    both = replace(maneuver, rear_ratio=-1.1).steering(t)
    np.testing.assert_allclose(both[:, 1], -1.1 * both[:, 0], rtol=1e-15)
    assert np.abs(np.diff(both[:, 1])).max() <= maneuver.rate_limit * 0.001 * (1.0 + 1e-9)


@every_maneuver
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_numbers_that_are_not_finite_are_refused_by_name(maneuver, value):
    for field in fields(maneuver):
        if field.name != "seed":
            with pytest.raises(ManeuverError, match=field.name):
                replace(maneuver, **{field.name: value})


@every_maneuver
def test_numbers_that_must_be_positive_are(maneuver):
    names = {field.name for field in fields(maneuver)}
    least = dict.fromkeys(("frequency", "rate_limit", "duration"), 0.0) | {
        "onset": -0.1,
        "pause": -0.1,
    }
    for key in names & least.keys():
        with pytest.raises(ManeuverError, match=key):
            replace(maneuver, **{key: least[key]})


def test_a_step_ends_at_its_angle_after_amplitude_over_rate():
    step = StepSteer(**COMMON)
    arrival = 1.003 + 0.1 / 0.7
    assert step.steering(np.array([arrival + 1e-9]))[0, 0] == 0.1
    assert step.steering(np.array([arrival - 0.01]))[0, 0] == pytest.approx(0.1 - 0.007)


def test_a_double_lane_change_brings_the_steering_integral_back_twice():
    change = DoubleLaneChange(**COMMON, frequency=0.5, pause=1.2)
    t = np.arange(0.0, 12.0, 0.001)
    angle = change.steering(t)[:, 0]
    heading = np.cumsum(angle) * 0.001
    lane = np.cumsum(heading) * 0.001
    assert abs(heading[-1]) < 1e-6
    assert abs(lane[-1]) < 1e-3 * lane.max()  # back in the first lane
    assert np.all(angle[(t > 3.01) & (t < 4.19)] == 0.0)


def test_random_steer_is_its_seed():
    t = np.arange(0.0, 12.0, 0.01)
    first = RandomSteer(**COMMON, frequency=1.0, seed=3)
    np.testing.assert_array_equal(first.steering(t), replace(first).steering(t))
    other = replace(first, seed=4).steering(t)
    assert np.corrcoef(first.steering(t)[:, 0], other[:, 0])[0, 1] < 0.5


def test_sampled_angles_are_passed_and_the_last_one_is_held():
    steer = SampledSteer(times=(1.0, 1.5, 2.5), angles=(0.0, 0.1, 0.02), rate_limit=0.2, duration=4)
    t = np.array([0.0, 1.0, 1.25, 1.5, 2.0, 2.5, 4.0])
    wanted = [0.0, 0.0, 0.05, 0.1, 0.06, 0.02, 0.02]
    np.testing.assert_allclose(steer.steering(t)[:, 0], wanted, atol=1e-15)
    both = replace(steer, rear_ratio=-0.5).steering(t)
    np.testing.assert_array_equal(both[:, 1], -0.5 * both[:, 0])
