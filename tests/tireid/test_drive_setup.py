"""What is driven: when the car is expected where, where its road changes, and what a case is."""

import numpy as np
import pytest

from models.vehicle import sedan
from mpc.path import Path
from tireid.commands.drive import parse_fault
from tireid.driving.results import headline
from tireid.driving.runs import Conditions
from tireid.driving.setup import Setup, SpeedWish

AROUND = np.linspace(0.0, 2.0 * np.pi, 101)[:-1]
COURSE = Path.from_waypoints(90.0 * np.cos(AROUND), 40.0 * np.sin(AROUND), closed=True, name="oval")
LANE_X = np.linspace(0.0, 120.0, 81)
LANE = Path.from_waypoints(LANE_X, 2.0 * np.tanh((LANE_X - 40.0) / 6.0), name="lane")


def setup(path, wish, drops=(), mu=1.0):
    return Setup(path=path, vehicle=sedan(), mu=mu, drops=drops, wish=wish)


def test_at_a_constant_speed_the_car_is_expected_after_way_over_speed_in_any_lap():
    around = setup(COURSE, SpeedWish(None, 16.0))
    for s in (0.0, 30.0, 0.999 * COURSE.length, 1.5 * COURSE.length, 3.25 * COURSE.length):
        assert around.time_at(s) == pytest.approx(s / 16.0, rel=1e-9)


def test_where_the_speed_changes_the_time_is_the_integral_of_its_inverse():
    around = setup(COURSE, SpeedWish(0.8, None))
    v = around.speeds()
    assert np.ptp(v) > 1.0, "it brakes for the bends"
    lap = around.time_at(COURSE.length * (1.0 - 1e-12))
    fine = np.linspace(0.0, COURSE.length, 20001)
    speeds = np.interp(fine, COURSE.s, v)
    expected = float(np.sum(np.diff(fine) * 0.5 * (1.0 / speeds[1:] + 1.0 / speeds[:-1])))
    assert lap == pytest.approx(expected, rel=2e-3)
    assert around.time_at(1.3 * COURSE.length) - around.time_at(0.3 * COURSE.length) == (
        pytest.approx(lap, rel=1e-6)
    )
    assert (v**2 * np.abs(COURSE.curvature(COURSE.s))).max() <= 0.8 * around.grip * 1.001


def test_a_drop_comes_at_a_place_along_x_and_at_a_time_elsewhere():
    drops = ((60.0, 0.5),)
    (along,) = setup(LANE, SpeedWish(None, 16.0), drops).friction().changes
    assert along.scale == 0.5 and along.at_time is None
    assert along.at_place == pytest.approx(float(LANE.pose(60.0)[0]))
    (around,) = setup(COURSE, SpeedWish(None, 16.0), drops).friction().changes
    assert around.at_place is None and around.at_time == pytest.approx(60.0 / 16.0)
    assert setup(LANE, SpeedWish(None, 16.0), mu=0.7).friction().scale == 0.7


def said(drive, delay=2, noise=True, faults=()):
    case = Conditions(setup=drive, delay=delay, noise=noise, seed=7, laps=1.0, faults=tuple(faults))
    return headline(case)


def test_a_case_is_said_with_its_speeds_share_drops_delay_and_seed():
    words = said(setup(LANE, SpeedWish(None, 16.0), ((60.0, 0.5),), mu=0.9))
    assert words.startswith("lane at 16.0 m/s; friction 0.9, 0.5 from 60 m on; double-track")
    assert words.endswith("20 ms delay, sensor noise, seed 7")
    broken = said(setup(LANE, SpeedWish(None, 16.0)), faults=[parse_fault("r:scaled:1:2:0.8")])
    assert "sensor noise, r scaled 0.8 from 1 s on for 2 s, seed 7" in broken
    drive = setup(COURSE, SpeedWish(0.8, None))
    words = said(drive, delay=0, noise=False)
    low, high = drive.speeds().min(), drive.speeds().max()
    assert f"oval at {low:.1f} to {high:.1f} m/s, 80 % of a grip of {drive.grip:.1f} m/s²" in words
    assert "0 ms delay, no noise" in words
