"""Each fault of a drive does what its size says; the sizes are found again by another road."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.faults import (
    Bank,
    ClockJump,
    Held,
    Jitter,
    Lagging,
    Late,
    Mirrored,
    Misaligned,
    Passing,
    SensorElsewhere,
    Together,
    WrongUnit,
)
from models.faults import SensorFault
from models.maneuvers import RandomSteer
from models.plant import Plant
from models.recordings import Recording
from models.recordings.record import CHANNELS
from models.tires import FialaTire
from models.vehicle import GRAVITY, sedan

CAR = sedan()
TIRE = FialaTire(C_alpha=50e3, C_kappa=80e3, friction=1.0)
T = 0.01 * np.arange(2001)
STEER = RandomSteer(amplitude=0.08, frequency=0.5, seed=3, onset=1.0, rate_limit=2.0, duration=12.0)
BIAS = SensorFault(channel="v_y", kind="biased", size=0.3)
ALL = (
    BIAS, WrongUnit(channel="r", unit="deg"), Mirrored(channels=("v_y", "a_y")),
    Late(channels=("delta_f",), delay=0.02), Lagging(channels=("r",), time_constant=0.38),
    Held(channels=(), every=0.1, lasts=0.1), Jitter(size=0.02), ClockJump(at=5.0, size=0.5),
    Misaligned(angle=0.01), SensorElsewhere(sensor="velocity", x=0.5, y=0.2),
    SensorElsewhere(sensor="accelerometer", x=0.5, y=0.2),
    Bank(vehicle=CAR, angle=0.05, period=20.0), Together(faults=(BIAS, Misaligned(angle=0.01))),
    Passing(fault=BIAS, until=2.0, fade=1.0),
)  # fmt: skip


@pytest.fixture(scope="module")
def drive():
    return Plant(CAR, TIRE).simulate(STEER, speed=20.0).recording()


def waves():
    """Signals with closed forms: another frequency in each channel."""
    wave = {name: 0.1 * np.sin((1.0 + 0.3 * k) * T) for k, name in enumerate(CHANNELS)}
    wave["v_x"] = 20.0 + wave["v_x"]
    return Recording(name="waves", t=T, **wave)


WAVES = waves()


@pytest.mark.parametrize("fault", ALL, ids=lambda fault: type(fault).__name__)
def test_a_fault_is_pure_leaves_the_truth_and_changes_what_is_logged(drive, fault):
    before = {name: getattr(drive, name).copy() for name in CHANNELS}
    once, again = fault.apply(drive), fault.apply(drive)
    assert any(not np.array_equal(getattr(once, name), before[name]) for name in CHANNELS)
    for name in CHANNELS:
        np.testing.assert_array_equal(getattr(once, name), getattr(again, name))
        np.testing.assert_array_equal(getattr(drive, name), before[name])
    if not isinstance(fault, ClockJump):
        np.testing.assert_array_equal(once.axle_force, drive.axle_force)


def test_a_broken_channel_is_broken_from_start_to_end_and_alone():
    fault = SensorFault(channel="r", kind="biased", start=3.0, duration=2.0, size=0.05)
    good, shown = WAVES, fault.apply(WAVES)
    inside = (T >= 3.0) & (T < 5.0)
    np.testing.assert_allclose(shown.r - good.r, 0.05 * inside, atol=1e-15)
    np.testing.assert_array_equal(shown.v_y, good.v_y)


def test_noise_has_its_size_and_its_seed():
    def noise(seed):
        fault = SensorFault(channel="v_y", kind="noisy", size=0.05, seed=seed)
        return fault.apply(WAVES).v_y - WAVES.v_y

    assert np.std(noise(1)) == pytest.approx(0.05, rel=0.06)
    assert np.corrcoef(noise(1), noise(2))[0, 1] == pytest.approx(0.0, abs=0.08)


def test_a_lagging_channel_has_gain_and_phase_of_a_first_order_low_pass():
    lag, rate = 0.38, 1.0 + 0.3 * CHANNELS.index("r")
    shown = Lagging(channels=("r",), time_constant=lag).apply(WAVES).r
    gain, phase = 1.0 / math.hypot(1.0, rate * lag), math.atan(rate * lag)
    late = slice(400, None)
    np.testing.assert_allclose(shown[late], 0.1 * gain * np.sin(rate * T[late] - phase), atol=2e-5)


def test_held_channels_change_once_in_a_period_and_are_right_when_they_do():
    shown = Held(channels=("v_y",), every=0.1, lasts=0.1).apply(WAVES).v_y
    np.testing.assert_array_equal(shown[::10], WAVES.v_y[::10])
    np.testing.assert_array_equal(shown, np.repeat(WAVES.v_y[::10], 10)[: T.size])
    some = Held(channels=("v_y",), every=1.0, lasts=0.2).apply(WAVES).v_y
    stale = np.flatnonzero(some != WAVES.v_y)
    assert set(stale % 100) == set(range(1, 20))


@pytest.mark.parametrize("size", [0.5, -0.5])
def test_a_clock_that_jumps_misses_or_repeats_time_in_all_channels(size):
    ramp = replace(WAVES, v_y=T, axle_force=np.column_stack((T, T)))
    shown = ClockJump(at=5.0, size=size).apply(ramp)
    before = shown.t < 5.0
    np.testing.assert_allclose(shown.v_y[before], shown.t[before], atol=1e-12)
    np.testing.assert_allclose(shown.v_y[~before], shown.t[~before] + size, atol=1e-12)
    np.testing.assert_array_equal(shown.axle_force[:, 0], shown.v_y)
    assert shown.t[-1] == pytest.approx(T[-1] - size)
    assert shown.dt == pytest.approx(0.01)


def test_a_banked_recording_keeps_slip_and_obeys_newton_with_the_slope(drive):
    fault = Bank(vehicle=CAR, angle=math.radians(3.0), period=60.0)
    shown, m = fault.apply(drive), CAR.mass
    np.testing.assert_allclose(
        shown.alpha(CAR.l_f, CAR.l_r), drive.alpha(CAR.l_f, CAR.l_r), atol=1e-13
    )
    np.testing.assert_array_equal(shown.a_y, drive.a_y)
    slope = GRAVITY * np.sin(fault.angle_at(drive.t))
    inertial = m * (np.gradient(shown.v_y, shown.dt) + shown.v_x * shown.r)
    rest = inertial - drive.axle_force.sum(axis=1) - m * slope
    assert np.abs(rest[2:-2]).max() < 0.02 * m * np.abs(slope).max()
