"""A loop of one's own: a state goes in, the steering comes out."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from models.tires import FialaTire
from mpc.cars import SPEED_GAIN, DoubleTrackCar
from mpc.problem import Guards, Problem
from mpc.realtime import Status

CAR = ti.sedan()
LAG = CAR.require_chassis().steering_lag
PATH = ti.paths.Path.from_waypoints([0, 20, 40, 60, 80], [0, 0, 2, 2, 0], name="bend")
HERE = ti.VehicleState(0.0, 0.0, 0.0, 12.0, 0.0, 0.0)
SPEED = ti.SpeedProfile(PATH, np.linspace(12.0, 16.0, PATH.s.size))


def tracker(**more):
    return ti.Tracker(PATH, CAR, **{"speeds": SPEED, "delay": 0.02 + LAG} | more)


def driven(steers, seen=lambda state: state):
    """Steer the double-track car to the end; return states and steering, 20 ms late."""
    X, Y, psi = map(float, PATH.pose(0.0))
    plant, commands, states = DoubleTrackCar(CAR), [0.0, 0.0], []
    state = plant.start(float(SPEED.at(0.0)), X=X, Y=Y, psi=psi, kappa=float(PATH.curvature(0.0)))
    while not states or not steers.finished:
        X, Y, psi, v_x, v_y, r = state[1:7]
        given = ti.VehicleState(X, Y, psi, v_x, r, v_y, state.a_y)
        commands.append(steers.step(seen(given)))
        states.append(state)
        assert len(states) < 1000
        faster = steers.wanted_speed + steers.wanted_acceleration / SPEED_GAIN
        state = plant.step(state, commands[len(states) - 1], faster)
    return states, np.array(commands[2:])


def test_it_steers_as_a_drive_does():
    whole = ti.drive(PATH, CAR, speeds=SPEED, noise=False, delay=0.02).drive
    mine = tracker()
    assert not mine.finished
    states, steering = driven(mine)
    assert len(whole) in (len(states) - 1, len(states))  # of which the last is past the end
    np.testing.assert_allclose(steering[: len(whole)], whole.command, atol=1e-9)
    assert mine.status == Status.OK and mine.s == pytest.approx(PATH.length, abs=0.2)


@pytest.mark.parametrize("a_y", [True, False], ids=["a_y", "position alone"])
def test_without_v_y_it_is_estimated(a_y):
    seen = {"v_y": None} | ({} if a_y else {"a_y": None})
    states, _ = driven(tracker(), lambda state: state._replace(**seen))
    off = [PATH.project(state.X, state.Y).e_y for state in states]
    assert np.abs(off).max() < 0.15


def test_the_plan_begins_at_the_car_and_leads_along_the_path():
    mine = tracker(delay=0.0)
    mine.step(ti.VehicleState(10.0, 0.3, 0.0, 14.0, 0.0, 0.0))
    plan = mine.plan
    assert plan.shape == (41, 2) and plan[0] == pytest.approx([10.0, 0.3], abs=1e-6)
    end = PATH.project(*plan[-1])
    assert end.s - mine.s == pytest.approx(2.0 * 14.0, rel=0.1) and abs(end.e_y) < 0.2
    here = PATH.project(10.0, 0.3)
    assert (mine.e_y, mine.e_psi) == pytest.approx((here.e_y, -here.psi)) and mine.blind == 0.0


@pytest.mark.parametrize("s", [-0.05, 0.0, 100.0, -100.0])
def test_a_lap_is_first_met_within_half_of_it(s):
    course = ti.paths.handling_course()
    mine = ti.Tracker(course, CAR, speeds=10.0)
    mine.step(ti.VehicleState(*map(float, course.pose(s)), 10.0, 0.2, 0.0))
    assert mine.s == pytest.approx(s, abs=1e-3) and abs(mine.e_psi) < 1e-3


def test_tires_of_another_car_are_refused_until_they_are_mounted():
    tire = ti.identify(ti.sample_recording(), CAR, check=False).tire
    light = replace(CAR, mass=900.0, name="light")
    for drives in (ti.Tracker, ti.drive):
        with pytest.raises(ValueError, match=r"\(mass 1500, driven 900\): .* tire.mounted_on"):
            drives(PATH, light, tire, speeds=SPEED)
    mine = ti.Tracker(PATH, light, tire.mounted_on(light), speeds=SPEED)
    with pytest.raises(ValueError, match="tire is of another car"):
        mine.set_tire(tire)


def test_what_is_lost_is_bridged_and_said():
    mine, lost = tracker(), math.nan
    with pytest.raises(ValueError, match="the first state needs a number of X, v_x"):
        mine.step(ti.VehicleState(lost, 0.0, 0.0, lost, 0.0, 0.0))
    mine.step(HERE)
    for _ in range(20):
        assert math.isfinite(mine.step(HERE._replace(X=lost)))
    assert mine.blind == pytest.approx(0.2) and mine.s == pytest.approx(20 * 0.12, abs=0.01)
    assert mine.status == Status.OK
    assert math.isfinite(mine.step(HERE._replace(X=2.5, r=lost)))
    assert (mine.status, mine.blind) == (Status.NOT_FINITE, 0.0)
    assert math.isfinite(mine.step(HERE._replace(X=2.6, Y=9.0)))
    assert mine.status == Status.OFF_PATH
    mine.reset()
    mine.step(HERE._replace(X=60.0, Y=2.0))
    assert mine.status == Status.OK and mine.s == pytest.approx(PATH.project(60.0, 2.0).s)


def test_other_tires_steer_otherwise_from_the_next_step_on():
    aside = ti.VehicleState(*map(float, PATH.pose(15.0)), 14.0, 0.0, 0.0)
    one, other = tracker(), tracker()
    assert one.step(aside) == other.step(aside)
    other.set_tire(replace(CAR, cornering_stiffness_front=0.5 * CAR.cornering_stiffness_front))
    assert one.step(aside) != other.step(aside)
    assert abs(tracker(max_steering_rate=0.1).step(aside._replace(Y=1.0))) <= 0.0011
    with pytest.raises(ValueError, match="the tracker is built for"):
        other.set_tire(FialaTire(C_alpha=6e4, C_kappa=8e4, friction=1.0))


@pytest.mark.parametrize(
    ("error", "call", "said"),
    [
        (TypeError, lambda: ti.Tracker([[0, 0], [9, 0]], CAR), "path must be a Path, as of paths."),
        (TypeError, lambda: ti.Tracker(PATH, "car.toml"), "car must be a Vehicle, as of Vehicle."),
        (TypeError, lambda: tracker(tire="weights.json"), "can be made of str: give a TireModel"),
        (TypeError, lambda: tracker().step((0.0, 0.0)), "state must be a VehicleState, as"),
        (ValueError, lambda: ti.Tracker(PATH, CAR), "give speeds, such as 15.0 m/s"),
        (ValueError, lambda: tracker(speeds=1.0), "speed_profile, must lie between 2 and 100"),
        (
            ValueError,
            lambda: tracker(speeds=np.ones(3)),
            "or a profile of speed_profile, must be a",
        ),
        (ValueError, lambda: tracker(period=0.06), "period must be positive and at most 0.05"),
        (ValueError, lambda: tracker(max_steering=0.0), "max_steering must be positive"),
        (ValueError, lambda: tracker(max_steering=30), "at most 1.2 rad, it is 30: degrees?"),
        (ValueError, lambda: tracker(max_steering_rate=45), "at most 20 rad/s, it is 45: degrees?"),
        (ValueError, lambda: tracker().step(HERE._replace(delta=10)), "delta must be at most 0.5"),
        (ValueError, lambda: tracker().step(HERE._replace(X=np.ones(1))), "X must be a number"),
        (ValueError, lambda: tracker(delay=0.5), "delay must be between 0 and 0.31 s"),
        (ValueError, lambda: tracker().s, "call step first"),
    ],
)
def test_an_error_names_what_is_wrong_and_what_to_give(error, call, said):
    with pytest.raises(error, match=said):
        call()


TENTH = ti.Vehicle(
    name="tenth", mass=1.58, yaw_inertia=0.00481, l_f=0.0805, l_r=0.093,
    cornering_stiffness_front=40.0, cornering_stiffness_rear=40.0,
)  # fmt: skip
ROUND = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
LAB = ti.paths.Path.from_waypoints(1.25 * np.cos(ROUND), 0.75 * np.sin(ROUND), closed=True)


def lab_drive(**changed):
    """Drive a model car along an ellipse of 2.5 by 1.5 m."""
    tire = FialaTire(C_alpha=20.0, C_kappa=30.0, friction=0.6)
    return ti.drive(LAB, TENTH.with_chassis(), **{"tires": (tire, tire), "speeds": 1.2} | changed)


def test_a_model_car_follows_a_path_of_a_lab_to_a_centimeter():
    came = lab_drive()
    assert came.scores.completed and not came.scores.failures
    assert came.scores.rms_e_y_m < 0.01 and np.abs(came.drive.r).max() > 2.0


def test_a_model_car_steers_in_a_loop_of_ones_own_and_refuses_a_turn_beyond_its_lock():
    mine = ti.Tracker(LAB, TENTH, speeds=1.2, period=0.02, delay=0.04)
    X, Y, psi = map(float, LAB.pose(1.0))
    steering = mine.step(ti.VehicleState(X, Y, psi, 1.2, 1.5, v_y=0.0))
    assert mine.status == Status.OK and steering > 0.02 and mine.plan.shape == (41, 2)
    with pytest.raises(ValueError, match=r"radius of 0\.44. m; tenth turns in 0\.561 m"):
        ti.Tracker(LAB, TENTH, speeds=1.2, max_steering=0.3)


def test_a_drive_without_plans_is_not_completed(monkeypatch):
    strict = replace(Guards.of(TENTH), yaw_rate=0.1)
    monkeypatch.setattr("mpc.realtime.tracker.Guards.of", lambda car: strict)
    came = lab_drive(speeds=0.8)
    assert "the tracker planned in" in came.drive.ending and not came.scores.completed


def test_the_problem_of_a_car_of_full_size_is_the_default_and_of_a_model_car_a_similar_one():
    for car in (CAR, replace(CAR, l_f=0.7, l_r=0.8)):
        assert Problem.of(car, 0.01) == Problem() and Guards.of(car) == Guards()
    small, guards = Problem.of(TENTH), Guards.of(TENTH)
    ratio = TENTH.wheelbase / 2.7
    assert small.dt == pytest.approx(0.05 * ratio**0.5)
    assert small.cost.numbers()[0] * ratio**2 == pytest.approx(Problem().cost.numbers()[0])
    assert guards.min_speed**2 / TENTH.wheelbase == pytest.approx(Guards().min_speed ** 2 / 2.7)
    assert Problem.of(TENTH, 0.02).dt == 0.02
