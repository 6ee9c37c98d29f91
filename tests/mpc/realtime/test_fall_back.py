"""Steering without a plan: its gains by another road, and the built-in car at low and top speed."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from models.vehicle import sedan
from mpc.cars import DoubleTrackCar
from mpc.loop.drive import drive
from mpc.path.path import Path
from mpc.problem import Problem
from mpc.realtime import Guards, Status, Tracker
from mpc.realtime.fall_back import fall_back, feedback, motion, steady_turn
from mpc.tires import prediction_tire

CAR = sedan()
PERIOD, PROBLEM = 0.01, Problem(horizon=4)
DELAY = 1  # periods
GUARDS = Guards(hold_time=0.0)
SPEEDS = (3.0, 50.0)  # m/s


def table(vehicle=CAR, delay=DELAY * PERIOD):
    return fall_back(vehicle, period=PERIOD, delay=delay, e_y=1.0, acceleration=2.0)


def gains_at(found, v_x):
    return np.array([np.interp(v_x, found.speeds, column) for column in found.gains.T])


def closed_loop(gains, v_x, delay, vehicle=CAR):
    """The linear car with its commands on the way, each whole periods old, under the gains."""
    A, _ = motion(vehicle, v_x, 1.0)
    M = np.zeros((5, 5))
    M[:4, :4], M[:4, 4:] = A[:4, :4], A[:4, 4:]
    held = expm(PERIOD * M)
    loop = np.zeros((4 + delay, 4 + delay))
    loop[:4, :4], loop[:4, 3 + delay] = held[:4, :4], held[:4, 4]
    loop[4, :4], loop[4, 3 + delay] = -gains[:4], -gains[4]
    loop[5:, 4:-1] = np.eye(delay - 1)
    return np.abs(np.linalg.eigvals(loop))


@pytest.mark.parametrize("v_x", [2.0, 12.0, 80.0])
def test_the_gains_are_those_of_the_riccati_equation(v_x, rng):
    A, B = motion(CAR, v_x, 0.04)
    Q, R = np.diag(rng.uniform(0.1, 1.0, 5)), np.array([[40.0]])
    held = expm(PERIOD * np.block([[A, B], [np.zeros((1, 6))]]))
    A, B = held[:5, :5], held[:5, 5:]
    P = solve_discrete_are(A, B, Q, R)
    wanted = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    np.testing.assert_allclose(feedback(A, B, Q, R), wanted, rtol=1e-9)


def test_importing_the_tracker_imports_no_scipy():
    told = "import sys, mpc.realtime; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", told], check=False).returncode == 0


def test_the_steady_turn_is_where_the_car_turns_steadily():
    for v_x in (3.0, 20.0, 60.0):
        A, _ = motion(CAR, v_x, 1.0)
        delta, v_y = steady_turn(CAR, v_x)
        x_dot = A[:4] @ [0.0, -v_y / v_x, v_y, v_x, delta]  # a curvature of 1/m, linear
        np.testing.assert_allclose(x_dot[[0, 2, 3]], 0.0, atol=1e-9)
        assert x_dot[1] == pytest.approx(v_x)  # as the path turns


@pytest.mark.parametrize("delay", [1, 3, 10])
@pytest.mark.parametrize("v_x", [2.0, 2.7, 5.0, 10.0, 17.0, 30.0, 55.0, 100.0])
def test_the_car_is_damped_at_every_speed_and_delay_also_between_the_rows(v_x, delay):
    gains = gains_at(table(delay=delay * PERIOD), v_x)
    assert closed_loop(gains, v_x, delay).max() < np.exp(-0.3 * PERIOD)
    without_v_y = gains * np.array([1, 1, 0, 1, 1, 1, 1])
    assert closed_loop(without_v_y, v_x, delay).max() < np.exp(-0.3 * PERIOD)
    without_e_y = gains * np.array([0, 1, 1, 1, 1, 1, 1])
    np.testing.assert_allclose(closed_loop(without_e_y, v_x, delay).max(), 1.0)  # e_y alone drifts


def test_a_car_that_oversteers_is_held_beyond_its_critical_speed():
    loose = replace(CAR, cornering_stiffness_front=1.3e5, cornering_stiffness_rear=8e4)
    A, _ = motion(loose, 50.0, 1.0)
    assert np.linalg.eigvals(A[2:4, 2:4]).real.max() > 0.0  # it is not stable by itself
    gains = gains_at(table(loose), 50.0)
    assert closed_loop(gains, 50.0, DELAY, loose).max() < 1.0


class Blind:
    """A tracker whose road ahead is lost: every step is steered without a plan."""

    def __init__(self):
        self.seen = []
        self.tracker = Tracker(
            prediction_tire(CAR), PROBLEM, period=PERIOD, delay=PERIOD, guards=GUARDS
        )

        self.period, self.reset = PERIOD, self.tracker.reset
        self.times, self.plan_times = self.tracker.times, self.tracker.plan_times

    def step(self, measurement):
        measurement.kappa[-1] = np.nan
        command = self.tracker.step(measurement)
        assert command.status == Status.NOT_FINITE
        self.seen.append(measurement)
        return command


def bends(v_x):
    """Four seconds to the left and back, at up to 2 m/s² or on a radius of 12 m."""
    kappa = min(2.0 / v_x**2, 1.0 / 12.0)
    s = np.linspace(0.0, 6.0 * v_x, 61)
    heading = kappa * v_x / np.pi * 3.0 * (1.0 - np.cos(np.pi * s / (3.0 * v_x)))
    x, y = (
        np.concatenate([[0.0], np.cumsum(f(heading[:-1]) * np.diff(s))]) for f in (np.cos, np.sin)
    )
    return Path.from_waypoints(x, y, name="bends")


@pytest.mark.sweep("50.0")
@pytest.mark.parametrize("v_x", SPEEDS)
def test_without_a_plan_the_built_in_car_keeps_its_path(v_x):
    tracker = Blind()
    came = drive(bends(v_x), DoubleTrackCar(CAR), tracker, speed=v_x, rng=np.random.default_rng(0))
    assert not came.completed and "planned in 0 of" in came.ending  # but is at the end:
    assert came.s[-1] > came.path.length - 1.0 and len(tracker.seen) > 400
    assert max(abs(m.e_y) for m in tracker.seen) < 0.5
    assert max(abs(m.kappa[0]) * m.v_x[0] ** 2 for m in tracker.seen) > 0.7  # there are bends
