"""Sensors that contradict each other are noticed, those that agree are not.

The car here is kinematic: a turn whose signals follow from each other exactly, with the noise of
the inertial unit.
"""

import math

import numpy as np
import pytest

from models.faults import SensorFault
from mpc.handover.consistency import CALM, Consistency
from mpc.loop.sensing import CarSensors, FaultySensors, Measured, inertial_unit

DT, DELAY = 0.01, 0.05
BREAKS = 4.0  # s


def steering(t):
    return 0.05 * np.sin(2.0 * np.pi * 0.4 * t)


class State:
    """Truth at a time; X, Y, ψ by integrating finely what v_x, v_y and r are."""

    def __init__(self, t, X, Y, psi):
        self.t, self.X, self.Y, self.psi = t, X, Y, psi
        self.v_x, self.v_y, self.r = motion(t)
        before, after = motion(t - 1e-5)[1], motion(t + 1e-5)[1]
        self.a_y = (after - before) / 2e-5 + self.v_x * self.r
        self.delta = float(steering(t - DELAY))


def motion(t):
    """v_x, v_y, r."""
    return 20.0 + math.sin(0.5 * t), 0.6 * math.sin(2.4 * t), 0.4 * math.sin(2.4 * t + 0.5)


def states(duration):
    X = Y = psi = 0.0
    fine = 20
    for k in range(round(duration / DT)):
        yield State(k * DT, X, Y, psi)
        for j in range(fine):
            h = DT / fine
            v_x, v_y, r = motion(k * DT + (j + 0.5) * h)
            middle = psi + 0.5 * h * r
            X += h * (v_x * math.cos(middle) - v_y * math.sin(middle))
            Y += h * (v_x * math.sin(middle) + v_y * math.cos(middle))
            psi += h * r


def watch(*faults, sensors=None, seed=0):
    """Times at which they do not agree, and the first reason."""
    broken = FaultySensors(sensors or inertial_unit(), faults)
    watch, rng = Consistency(DT), np.random.default_rng(seed)
    times, reason = [], ""
    for state in states(8.0):
        if not watch.observe(broken.measure(state, rng), float(steering(state.t - DELAY))):
            times.append(state.t)
            reason = reason or str(watch.worst)
    return np.array(times), reason


@pytest.mark.parametrize("sensors", [CarSensors(), inertial_unit()])
@pytest.mark.parametrize("seed", range(3))
def test_good_sensors_agree(sensors, seed):
    times, _ = watch(sensors=sensors, seed=seed)
    assert not times.size


@pytest.mark.sweep("v_y-biased-0.5-v_y", "r-zero*", "v_x-scaled*", "X-lost*", "delta-stuck*")
@pytest.mark.parametrize(
    ("channel", "kind", "size", "relation"),
    [
        ("v_y", "biased", 0.5, "v_y"),
        ("v_y", "biased", -0.5, "v_y"),
        ("v_y", "stuck", 0.0, "v_y"),
        ("v_y", "flipped", 0.0, "v_y"),
        ("r", "biased", 0.06, "yaw rate"),
        ("r", "zero", 0.0, "yaw rate"),
        ("r", "flipped", 0.0, "yaw rate"),
        ("v_x", "scaled", 0.8, "v_x"),
        ("v_x", "lost", 0.0, "no number"),
        ("delta", "biased", math.radians(2.0), "steering"),
        ("delta", "stuck", 0.0, "steering"),
        ("X", "lost", 0.0, "no number"),
        ("psi", "biased", 0.03, ""),
    ],
)
def test_a_broken_sensor_is_noticed_within_half_a_second(channel, kind, size, relation):
    fault = SensorFault(channel=channel, kind=kind, start=BREAKS, duration=math.inf, size=size)
    times, reason = watch(fault)
    assert BREAKS <= times[0] <= BREAKS + 0.5
    assert relation in reason


def test_a_sensor_that_is_good_again_is_believed_again_after_a_while():
    fault = SensorFault(channel="r", kind="zero", start=2.0, duration=1.0)
    times, _ = watch(fault)
    assert 3.0 + CALM - 0.1 <= times[-1] <= 3.0 + CALM + 1.5


@pytest.mark.sweep("nan-*", "-1e+308-v_y", "inf-delta")
@pytest.mark.parametrize("channel", Measured._fields[1:])
@pytest.mark.parametrize("value", [math.nan, math.inf, -1e308])
def test_one_sample_that_is_no_number_is_noticed_and_forgotten(channel, value):
    class Once:
        def measure(self, state, rng):
            shown = inertial_unit().measure(state, rng)
            return shown._replace(**{channel: value}) if state.t == BREAKS else shown

    watcher, rng, doubted = Consistency(DT), np.random.default_rng(0), []
    for state in states(8.0):
        if not watcher.observe(Once().measure(state, rng), float(steering(state.t - DELAY))):
            doubted.append(state.t)
    assert doubted[0] == BREAKS
    assert doubted[-1] == pytest.approx(BREAKS + 0.5, abs=0.02)
    assert len(doubted) == pytest.approx(50, abs=2)
