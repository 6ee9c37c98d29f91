"""Braking and driving in the estimate: where a_x comes from, what a car tells of itself."""

from dataclasses import replace

import numpy as np
import pytest

from codegen.arrays import Array
from identifier.estimate.drive import Drive
from identifier.estimate.nodes import Nodes
from identifier.estimate.priors import OF_CAR, Priors
from identifier.estimate.solve import simulate
from identifier.motion.model import SIGNALS
from identifier.motion.parameters import INDEX
from models.vehicle import GRAVITY, sedan
from tests.made import made

CAR = replace(sedan(), chassis=None)
T = 0.01 * np.arange(3000)
SPEED = 20.0 + 3.0 * np.sin(T) + np.sin(2.5 * T)
PULL = 3.0 * np.cos(T) + 2.5 * np.cos(2.5 * T)  # d v_x/dt


def a_x_of(a_x: Array | None) -> Array:
    """Return the a_x that the estimate takes of a drive through bends."""
    r = 0.2 * np.sin(0.7 * T)
    drive = made(T, v_x=SPEED, r=r, delta_f=0.15 * r, a_x=a_x)
    column: Array = Drive.of(drive, CAR).signals[:, SIGNALS.index("a_x")]
    return column


def test_an_accelerometer_that_follows_the_speed_is_taken_on_a_slope_too() -> None:
    slope = 0.5 + 0.3 * np.tanh((T - 15.0) / 5.0)  # m/s²: the tires push more than the car gains
    taken = a_x_of(PULL + slope)
    np.testing.assert_allclose(taken[200:-200], (PULL + slope)[200:-200], atol=0.1)
    of_speed = a_x_of(None)
    np.testing.assert_allclose(of_speed[200:-200], PULL[200:-200], atol=0.4)


@pytest.mark.parametrize("felt", [-PULL, PULL / GRAVITY, 2.0 * PULL, np.cos(40.0 * T), 0.0 * T])
def test_a_channel_that_does_not_follow_the_speed_is_left_aside(felt: Array) -> None:
    np.testing.assert_array_equal(a_x_of(felt), a_x_of(None))


def test_of_speed_alone_it_is_the_change_of_a_mean_over_a_longer_mean() -> None:
    """Of a wave the means of 0.15 s and 0.31 s, of the drive's smoothing before, keep a share."""
    omega = 8.0
    wave = np.sin(omega * T)
    drive = made(T, v_x=20.0 + wave, r=0.01 * T / T[-1], a_y=0.0 * T)
    shares = [np.sin(x) / x for x in 0.5 * omega * np.array([0.15, 0.31])]
    smoothed = np.sin(0.5 * omega * 0.07) / (0.5 * omega * 0.07)
    found = Drive.of(drive, CAR).signals[200:-200, SIGNALS.index("a_x")]
    assert np.std(found) * np.sqrt(2.0) == pytest.approx(
        omega * np.prod(shares) * smoothed, rel=0.02
    )
    nodes = Nodes.of(drive, CAR).given[60:-60, 3]
    assert np.std(nodes) * np.sqrt(2.0) == pytest.approx(omega * np.prod(shares), rel=0.03)


@pytest.mark.parametrize("turn", [0.0, 1.9])
def test_without_v_y_an_accelerometer_ahead_of_a_rear_that_swings_out_is_taken(turn: float) -> None:
    """v_y is l_r r there: what is felt is less than the speed gains, by l_r r²."""
    r = turn * np.sin(1.4 * T)
    a_x = PULL - CAR.l_r * r**2
    drive = made(T, v_x=SPEED, v_y=None, r=r, delta_f=0.1 * r, a_y=SPEED * r, a_x=a_x)
    given = Nodes.of(drive, CAR).given
    assert (given[:, 4] == 0.0).all()
    assert (Nodes.of(replace(drive, a_x=None), CAR).given[:, 4] == 1.0).all()


def test_height_and_shares_move_what_is_believed() -> None:
    L = CAR.wheelbase
    told = replace(CAR, cg_height=0.6, drive_front_share=0.0, brake_front_share=0.7)
    priors = Priors.of(told)
    mean = {name: priors.mean[k] for name, k in INDEX.items()}
    sd = {name: priors.information[k, k] ** -0.5 for name, k in INDEX.items() if priors.moves[k]}
    assert mean["load_transfer"] == pytest.approx(0.6 * 0.6 / L)
    assert sd["load_transfer"] < 0.5 * OF_CAR["load_transfer"].sd
    assert mean["driving_f"] == 0.0 and sd["driving_f"] == pytest.approx(0.1)
    assert mean["driving_r"] == pytest.approx(0.65 * L / CAR.l_f / 0.85)
    assert mean["braking_f"] / mean["braking_r"] == pytest.approx(0.7 / 0.3 * CAR.l_f / CAR.l_r)
    assert sd["braking_f"] == pytest.approx(0.5 * mean["braking_f"])


def test_tires_push_against_the_air_at_one_speed() -> None:
    """A drag of a tenth of the weight is an acceleration of a tenth of g."""
    area = 0.1 * CAR.weight / (0.6 * 30.0**2)
    one = np.ones(len(T))
    bend = made(T, v_x=30.0 * one, v_y=-0.5 * one, r=0.2 * one, delta_f=0.06 * one)
    drive = Drive.of(bend, replace(CAR, drag_area=0.0))
    pushed = drive.signals.copy()
    pushed[:, SIGNALS.index("a_x")] += 0.1 * GRAVITY
    p = Priors.of(CAR).mean
    p[INDEX["driving_f"]] = 2.0
    against_air = simulate(drive, p, replace(CAR, drag_area=area))["force"]
    gaining = simulate(replace(drive, signals=pushed), p, replace(CAR, drag_area=0.0))["force"]
    coasting = simulate(drive, p, replace(CAR, drag_area=0.0))["force"]
    np.testing.assert_allclose(against_air, gaining, rtol=1e-9)
    assert np.abs(against_air - coasting)[-1, 0] > 0.01
