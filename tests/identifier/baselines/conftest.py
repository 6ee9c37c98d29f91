"""Drives on a tire curve that is known exactly, so that its parameters can be asked for."""

from dataclasses import replace

import numpy as np
import pytest

from tests.identifier.conftest import at_one_speed, bicycle

MAGIC = np.array([[12.0, 1.5, 6000.0], [14.0, 1.3, 5200.0]])  # B, C, D


def magic(axle, alpha):
    B, C, D = MAGIC[axle]
    return D * np.sin(C * np.arctan(B * alpha))


def simulate(car, curve, n=2000, dt=0.01, speed=20.0, amplitude=0.1, rng=None, lag=None):
    """A bicycle on curve(axle, slip) [N], steered at many frequencies; rng makes it noisy."""
    t = dt * np.arange(n)

    def delta(t):
        return (
            amplitude * (0.55 + 0.45 * np.sin(0.23 * t)) * np.sin(2.0 * t + 0.8 * np.sin(0.31 * t))
        )

    def push(slip, _):
        return np.array([curve(axle, slip[axle]) for axle in (0, 1)])

    v_y, r, force = bicycle(car, t, lambda _: speed, delta, push, lag)
    if rng is not None:
        v_y = v_y + 0.02 * rng.standard_normal(n)
        r = r + 0.002 * rng.standard_normal(n)
    return at_one_speed("curve", speed, t, v_y, r, delta(t), force)


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
