"""A speed that is earned: it begins slowly, grows by what was held, and falls with the friction."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifier.speed_limits import SpeedLimits
from mpc.loop.pace import Earned
from mpc.path import handling_course, speed_profile

LIMITS, PERIOD = SpeedLimits.ellipse(9.0), 0.01
PATH = handling_course()
FASTEST = speed_profile(PATH, LIMITS, share=0.82, v_max=30.0)


class Road:
    friction = 1.0

    def __call__(self):
        return self.friction


def earned(road):
    return Earned(FASTEST, PERIOD, road)


def turning(a_y, v):
    return SimpleNamespace(a_y=a_y, r=a_y / v)


def held(pace, a_y, s=0.0, times=300):
    """Hold a lateral acceleration for some samples; return the share then."""
    for _ in range(times):
        v = float(pace.profile.at(s))
        pace.observe(turning(a_y, v), s, v)
    return pace.share


def test_it_begins_at_what_a_wet_road_has_too():
    pace = earned(Road())
    assert pace.share == 0.45
    slow = speed_profile(PATH, LIMITS, share=0.45, v_max=30.0)
    np.testing.assert_allclose(pace.profile.v, slow.v)
    assert held(pace, 0.3 * 9.0) == 0.45, "which is less than it already may"


def test_it_grows_by_eight_per_cent_of_what_was_held_up_to_all():
    pace = earned(Road())
    assert held(pace, 0.5 * 9.0) == pytest.approx(1.08 * 0.5, abs=0.02)
    assert held(pace, 0.0) == pytest.approx(1.08 * 0.5, abs=0.02), "and keeps what it has shown"
    assert held(pace, -0.6 * 9.0) == pytest.approx(1.08 * 0.6, abs=0.02), "on either side"
    assert held(pace, 9.0) == pytest.approx(0.82)
    assert held(pace, np.nan) == pytest.approx(0.82), "a broken sensor shows nothing"
    s = 0.4 * PATH.length
    assert float(pace.profile.at(s + PATH.length)) == pytest.approx(float(FASTEST.at(s)), rel=1e-3)


def test_nothing_is_earned_while_nobody_knows_the_friction():
    road = Road()
    pace, road.friction = earned(road), np.nan
    assert held(pace, 0.7 * 9.0) == 0.45
    road.friction = 1.0
    assert held(pace, 0.5 * 9.0) == pytest.approx(1.08 * 0.5, abs=0.02)


def test_one_broken_sensor_earns_nothing():
    pace = earned(Road())
    for _ in range(300):
        pace.observe(SimpleNamespace(a_y=9.0, r=0.1), 0.0, 15.0)
        pace.observe(SimpleNamespace(a_y=1.0, r=0.9), 0.0, 15.0)
    assert pace.share == 0.45


def test_it_falls_with_a_friction_that_is_lost():
    road = Road()
    pace = earned(road)
    held(pace, 0.7 * 9.0)
    fast, s = float(pace.profile.at(90.0)), 90.0
    road.friction = 0.6
    pace.observe(turning(0.0, fast), s, fast)
    assert pace.share <= 0.6 * 0.82
    assert float(pace.profile.at(s)) == pytest.approx(fast), "from the speed that it has"
    ahead = s + np.arange(0.0, 60.0, PATH.step)
    v = pace.profile.at(ahead)
    braking = -np.diff(v**2) / (2.0 * PATH.step)
    assert 0.35 * 9.0 * 0.99 < braking.max() <= 0.6 * 9.0
    slow = speed_profile(PATH, LIMITS, share=pace.share, v_max=30.0)
    there = 0.3 * PATH.length + s
    assert float(pace.profile.at(there)) == pytest.approx(float(slow.at(there)), rel=1e-3)
    assert held(pace, 0.7 * 9.0) == pytest.approx(0.6 * 0.82), "no more, whatever is held"
    road.friction = 1.0
    assert held(pace, 0.0) == pytest.approx(1.08 * 0.7, abs=0.03)


def test_a_share_is_noted_in_tenths():
    pace, notes = earned(Road()), []
    for a_y in np.linspace(0.0, 9.0, 600):
        notes.append(pace.observe(turning(a_y, 10.0), 0.0, 10.0))
    said = [note for note in notes if note]
    assert 2 <= len(said) <= 4 and all(note.startswith("drives at 0.") for note in said)
