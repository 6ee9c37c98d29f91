"""Means over windows, what they measure and what is missed of it: by hand."""

import numpy as np
import pytest

from identifier.evidence import (
    Evidence,
    brisk_windows,
    clean_rms,
    impulse_signals,
    lateral_noise,
    measured_force,
    noise_variance,
)
from models.recordings import Recording
from models.recordings.evidence import Windows
from models.vehicle import GRAVITY, sedan

CAR, DT = sedan(), 0.01
T = np.arange(2000) * DT


def recording(**others):
    still = np.zeros(T.size)
    signals = {"v_x": still + 15.0, "v_y": still, "r": still, "delta_f": still, "delta_r": still}
    return Recording(name="made", t=T, **{**signals, **others})


def test_windows_overlap_by_half_and_lie_in_what_counts():
    driven = recording(v_x=np.where((T >= 5.0) & (T < 5.005), 2.9, 15.0))
    windows = brisk_windows(driven, 3.0)
    assert (windows.n, windows.duration) == (30, pytest.approx(0.3))
    assert set(np.diff(windows.starts)) == {15, 45}, "one sample is slow: two windows fall out"
    left = windows.starts[(windows.starts < 500) & (windows.starts + 30 >= 500)]
    assert left.size == 0
    assert windows.starts[-1] + 30 <= T.size - 1 < windows.starts[-1] + 45
    wide = Windows.where(np.ones(T.size, dtype=bool), driven, 1.0, every=25)
    assert (wide.n, int(np.diff(wide.starts).max())) == (100, 25)
    assert len(Windows.where(np.ones(T.size, dtype=bool), driven, 60.0)) == 0


def test_means_and_rates_over_windows_are_those_of_the_integral():
    windows = brisk_windows(recording(), 3.0)
    begin, end = T[windows.starts], T[windows.starts + windows.n]
    square = (end**3 - begin**3) / 3.0 / 0.3
    np.testing.assert_allclose(windows.mean(T**2), square, atol=2e-5)
    both = windows.mean(np.column_stack([T**2, T]))
    np.testing.assert_allclose(both[:, 1], 0.5 * (begin + end))
    np.testing.assert_allclose(windows.rate(T**2), begin + end)


def test_the_force_that_motion_shows_is_newtons():
    """v_y and r of forces that are given: integrated by hand."""
    F_f, F_r = 2000.0 * np.sin(2.0 * T), 1500.0 * np.cos(1.3 * T)
    r_dot = (CAR.l_f * F_f - CAR.l_r * F_r) / CAR.yaw_inertia
    r = np.concatenate([[0.0], np.cumsum(0.5 * (r_dot[1:] + r_dot[:-1]) * DT)])
    v_y_dot = (F_f + F_r) / CAR.mass - 15.0 * r
    v_y = np.concatenate([[0.0], np.cumsum(0.5 * (v_y_dot[1:] + v_y_dot[:-1]) * DT)])
    driven = recording(v_y=v_y, r=r, a_y=(F_f + F_r) / CAR.mass)
    windows = brisk_windows(driven, 3.0)
    loads = np.array(CAR.axle_loads)
    true = windows.mean(np.column_stack([F_f, F_r])) / loads
    np.testing.assert_allclose(measured_force(driven, CAR, windows), true, atol=1e-5)
    pushed = measured_force(driven, CAR, windows, np.full(T.size, 0.02))
    np.testing.assert_allclose(pushed, true - 0.02, atol=1e-5)
    impulse, sideways = impulse_signals(driven, CAR)
    np.testing.assert_allclose(sideways, 15.0 * r / GRAVITY)
    np.testing.assert_allclose(impulse @ loads / CAR.mass, v_y, atol=1e-12)  # ± I_z r/L cancels


def test_noise_leaves_the_variance_that_is_told(rng):
    windows = brisk_windows(recording(), 3.0)
    found, lateral = [], []
    for _ in range(30):
        v_y, r = (s * rng.standard_normal(T.size) for s in (0.03, 0.004))
        driven = recording(v_y=v_y, r=r)
        found.append(np.mean(measured_force(driven, CAR, windows) ** 2, axis=0))
        felt = windows.rate(v_y) + windows.mean(15.0 * r)
        lateral.append(np.mean(felt**2))
    np.testing.assert_allclose(
        np.mean(found, axis=0), noise_variance(driven, CAR, windows), rtol=0.1
    )
    assert np.mean(lateral) == pytest.approx(lateral_noise(driven, windows), rel=0.1)


def of(measured, modelled, noise=(0.0, 0.0)):
    starts = 15 * np.arange(len(measured))
    windows = Windows(starts=starts, n=30, duration=0.3)
    return Evidence(windows=windows, measured=measured, modelled=modelled, noise=np.array(noise))


def test_what_is_missed_is_a_share_of_the_force_with_the_noise_taken_off():
    measured = np.column_stack([np.full(100, 0.5), np.linspace(0.0, 1.0, 100)])
    found = of(measured, measured - [0.05, 0.0], noise=(0.0009, 0.0))
    assert found.model_error == pytest.approx([np.sqrt(0.05**2 - 0.0009) / 0.5, 0.0])
    assert found.force == pytest.approx(
        [np.sqrt(0.25 - 0.0009), np.sqrt(np.mean(measured[:, 1] ** 2))]
    )
    assert found.peak == pytest.approx([0.5 - 3.0 * 0.03, 0.98])
    nothing = np.zeros((9, 2))
    assert of(nothing, nothing).model_error.tolist() == [1.0, 1.0]
    assert clean_rms(nothing, np.ones(2)).tolist() == [0.0, 0.0]
