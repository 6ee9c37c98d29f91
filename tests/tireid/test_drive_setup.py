"""What is driven: when the car is expected where, where its road changes, and what a case is."""

import re
from dataclasses import replace

import numpy as np
import pytest

from identifier.speed_limits import SpeedLimits
from models.vehicle import GRAVITY, sedan
from mpc.path import Path, handling_course, speed_profile
from mpc.tires.ladder import cornering_force, oracle_tire
from tests.identifier.export.test_emitted import fitted, network
from tireid.commands.drive import parse_fault
from tireid.driving import runs
from tireid.driving.results import headline
from tireid.driving.runs import Conditions
from tireid.driving.setup import Setup, SpeedWish, _profile, faster_than, simulated

AROUND = np.linspace(0.0, 2.0 * np.pi, 101)[:-1]
COURSE = Path.from_waypoints(90.0 * np.cos(AROUND), 40.0 * np.sin(AROUND), closed=True, name="oval")
LANE_X = np.linspace(0.0, 120.0, 81)
LANE = Path.from_waypoints(LANE_X, 2.0 * np.tanh((LANE_X - 40.0) / 6.0), name="lane")


def setup(path, wish, drops=(), mu=1.0):
    return Setup(path=path, vehicle=sedan(), mu=mu, drops=drops, wish=wish)


def test_at_a_constant_speed_the_car_is_expected_after_way_over_speed_in_any_lap():
    around = setup(COURSE, SpeedWish(speed=16.0))
    for s in (0.0, 30.0, 0.999 * COURSE.length, 1.5 * COURSE.length, 3.25 * COURSE.length):
        assert around.time_at(s) == pytest.approx(s / 16.0, rel=1e-9)


def test_where_the_speed_changes_the_time_is_the_integral_of_its_inverse():
    around = setup(COURSE, SpeedWish(a_y=6.5))
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
    assert (v**2 * np.abs(COURSE.curvature(COURSE.s))).max() <= 6.5 * 1.001


def test_how_fast_a_share_of_the_tires_is_never_follows_from_the_road(monkeypatch):
    """Another friction, or a car whose true tire must not be looked at: the same speeds."""

    def looked(*_, **__):
        raise AssertionError("it has looked at the true tire")

    limits = SpeedLimits.ellipse(8.0)
    dry = setup(COURSE, SpeedWish(share=0.7))._replace(limits=limits)
    v = dry.speeds()
    monkeypatch.setattr("tireid.driving.setup.DoubleTrackCar", looked)
    monkeypatch.setattr("models.tires.MagicFormula.from_tir", looked)
    heavy = replace(sedan(), mass=3000.0)
    for other in (dry._replace(mu=0.5), dry._replace(vehicle=heavy, drops=((9.0, 0.3),))):
        _profile.cache_clear()
        np.testing.assert_array_equal(other.speeds(), v)
    assert (v**2 * np.abs(COURSE.kappa)).max() == pytest.approx(0.7 * 8.0)
    with pytest.raises(ValueError, match="no tires were identified that tell how fast"):
        dry._replace(limits=None).speeds()
    with pytest.raises(AssertionError, match="the true tire"):
        dry.oracle()


def test_a_plan_within_the_speed_of_the_log_is_asked_for_and_still_brakes_for_bends():
    free = setup(COURSE, SpeedWish(share=0.7))._replace(limits=SpeedLimits.ellipse(8.0))
    top = 0.5 * (free.speeds().min() + free.speeds().max())
    slower = float(
        re.search(r"add --v-max ([\d.]+)m/s$", faster_than(free.speeds(), top, "add"))[1]
    )
    bounded = free._replace(wish=free.wish._replace(most=slower)).speeds()
    assert faster_than(bounded, top, "add") == ""
    assert bounded.max() == pytest.approx(slower) and top - slower < 0.1
    assert bounded.min() == pytest.approx(free.speeds().min())
    constant = (SpeedWish(speed=9.0), COURSE), (SpeedWish(a_y=4.0), LANE)
    assert all(setup(path, wish).constant for wish, path in constant)
    assert not free.constant and not setup(COURSE, SpeedWish(a_y=4.0)).constant


def test_tires_that_are_not_sure_tell_no_speed():
    drive = setup(COURSE, SpeedWish(share=0.7))
    case = Conditions(setup=drive, delay=2, noise=True, seed=7, laps=1.0)
    with pytest.raises(
        ValueError, match=r"no speed follows .* no band; say how fast instead: --sp"
    ):
        case.on(network())
    assert case.on(fitted()).setup.speeds().max() > 5.0
    assert case.on(None) is case


def test_speeds_are_those_of_the_path_that_is_driven():
    given = speed_profile(COURSE, SpeedLimits.ellipse(8.0), v_max=20.0)
    same = Path.from_waypoints(90.0 * np.cos(AROUND), 40.0 * np.sin(AROUND), closed=True)
    assert setup(same, SpeedWish(profile=given)).profile() is given
    with pytest.raises(ValueError, match="speeds are of the path oval, not of lane"):
        setup(LANE, SpeedWish(profile=given)).profile()


def test_a_drop_comes_at_a_place_along_x_and_at_a_time_elsewhere():
    drops = ((60.0, 0.5),)
    (along,) = setup(LANE, SpeedWish(speed=16.0), drops).friction().changes
    assert along.scale == 0.5 and along.at_time is None
    assert along.at_place == pytest.approx(float(LANE.pose(60.0)[0]))
    (around,) = setup(COURSE, SpeedWish(speed=16.0), drops).friction().changes
    assert around.at_place is None and around.at_time == pytest.approx(60.0 / 16.0)
    assert setup(LANE, SpeedWish(speed=16.0), mu=0.7).friction().scale == 0.7


def test_a_car_without_tire_file_has_stiffness_and_grip_of_its_identified_tires():
    """In steady cornering, load transfer included; one that names its tires is left alone."""
    tire = fitted()
    car, tires = simulated(replace(sedan(), chassis=None), tire)
    slip = np.linspace(0.0, 0.4, 401)
    for axle in (0, 1):
        force = cornering_force(car, tires[axle], axle, slip, 1.0)
        assert force[1] / slip[1] == pytest.approx(tire.stiffness[axle], rel=0.01)
        identified = tire.force(np.linspace(0.0, 2.0 * tire.known_slip[axle], 101))[:, axle]
        assert force.max() == pytest.approx(identified.max(), rel=0.01)
    both = setup(LANE, SpeedWish(speed=9.0))._replace(vehicle=car, tires=tires).oracle()
    assert not np.allclose(both.weights, oracle_tire(car, tires[0]).weights)
    assert simulated(sedan(), tire) == (sedan(), None)


def said(drive, delay=2, noise=True, faults=(), **more):
    case = Conditions(
        setup=drive, delay=delay, noise=noise, seed=7, laps=1.0, faults=tuple(faults), **more
    )
    return headline(case)


def test_a_case_is_said_with_its_speeds_share_drops_delay_and_seed():
    words = said(setup(LANE, SpeedWish(speed=16.0), ((60.0, 0.5),), mu=0.9))
    assert words.startswith("lane at 16.0 m/s; friction 0.9, 0.5 from 60 m on; double-track")
    assert words.endswith("20 ms delay, sensor noise, seed 7")
    broken = said(setup(LANE, SpeedWish(speed=16.0)), faults=[parse_fault("r:scaled:1:2:0.8")])
    assert "sensor noise, r scaled 0.8 from 1 s on for 2 s, seed 7" in broken
    drive = setup(COURSE, SpeedWish(a_y=0.5 * GRAVITY))
    words = said(drive, delay=0, noise=False)
    low, high = drive.speeds().min(), drive.speeds().max()
    assert (
        f"oval at {low:.1f} to {high:.1f} m/s as planned, up to 0.5 g in bends; friction 1;"
        in words
    )
    assert "0 ms delay, no noise" in words
    drive = setup(COURSE, SpeedWish(share=0.7))._replace(limits=SpeedLimits.ellipse(9.0))
    assert "m/s as planned, 70 % of what the identified tires allow, earned on the way;" in said(
        drive, confirm=True
    )


def test_a_long_drive_has_the_time_it_needs(monkeypatch):
    """Twenty laps take more than five minutes; a car that earns its speed takes longer still."""
    given = []

    def noted(*_, time_limit, **__):
        given.append(time_limit)
        raise InterruptedError

    monkeypatch.setattr(runs, "Tracker", lambda *_, **__: None)
    monkeypatch.setattr(runs, "drive_tracker", noted)
    for laps in (1.0, 20.0):
        with pytest.raises(InterruptedError):
            runs.drive(handling_course(), sedan(), speeds=10.0, laps=laps)
    assert given[0] >= 100.0 and given[1] > 2.0 * 20.0 * handling_course().length / 10.0
