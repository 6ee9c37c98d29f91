"""Drives on a tire curve that is known exactly, so that its parameters can be asked for."""

from dataclasses import replace
from math import atan2, cos, sin

import numpy as np
import pytest

from tests.identifier.conftest import at_one_speed


def steering(t, amplitude):
    """A sweep of frequency and amplitude: the tire is asked everywhere."""
    return amplitude * (0.55 + 0.45 * sin(0.23 * t)) * sin(2.0 * t + 0.8 * sin(0.31 * t))


def slips(car, speed, v_y, r, delta):
    """Slip angles of both axles in the paper's sign."""
    return np.array([delta - atan2(v_y + car.l_f * r, speed), -atan2(v_y - car.l_r * r, speed)])


def rates(car, curve, speed, moved, delta, lag):
    """Rates of [v_y, r, α'] and both axle forces in the frame of the body; lag [m] or None."""
    v_y, r = moved[:2]
    alpha = slips(car, speed, v_y, r, delta)
    slip = alpha if lag is None else moved[2:]
    F_f, F_r = cos(delta) * curve(0, slip[0]), curve(1, slip[1])
    rate = (F_f + F_r) / car.mass - speed * r, (car.l_f * F_f - car.l_r * F_r) / car.yaw_inertia
    slip_rate = np.zeros(2) if lag is None else speed / lag * (alpha - slip)
    return np.array([*rate, *slip_rate]), F_f, F_r


def simulate(car, curve, n=2000, dt=0.01, speed=20.0, amplitude=0.1, rng=None, lag=None):
    """A bicycle on curve(axle, α' or α) [N], by midpoint steps; rng makes v_y and r noisy."""
    moved = np.zeros(4)
    rows, fine = [], 5
    h = dt / fine
    for k in range(n * fine):
        t = k * h
        here, *forces = rates(car, curve, speed, moved, steering(t, amplitude), lag)
        if k % fine == 0:
            rows.append((t, *moved[:2], steering(t, amplitude), *forces))
        half = moved + h / 2 * here
        moved = moved + h * rates(car, curve, speed, half, steering(t + h / 2, amplitude), lag)[0]
    t, v_y, r, delta, F_f, F_r = np.array(rows).T
    if rng is not None:
        v_y = v_y + 0.02 * rng.standard_normal(n)
        r = r + 0.002 * rng.standard_normal(n)
    return at_one_speed("curve", speed, t, v_y, r, delta, np.column_stack([F_f, F_r]))


@pytest.fixture(name="curve_drive")
def a_curve_drive():
    """The function `simulate(car, curve, n, dt, speed, amplitude, rng, lag)`."""
    return simulate


@pytest.fixture(name="halted_drive")
def a_halted_drive(car, drive):
    """A slalom that stands still between its fourth and sixth second, and where it does."""
    recording = drive(n=1000)
    rest = (recording.t >= 4.0) & (recording.t < 6.0)
    v_x = np.where(rest, 0.0, recording.v_x)
    return replace(recording, v_x=v_x), rest
