"""Means over windows, what they measure and what is missed of it: by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identifier.evidence import (
    Evidence,
    brisk_windows,
    clean_rms,
    evidence,
    impulse_signals,
    lateral_noise,
    measured_force,
    motion_error,
    noise_variance,
    road_push,
)
from models.recordings.evidence import Windows
from models.vehicle import GRAVITY, sedan
from tests.made import made

CAR, DT = sedan(), 0.01
T = np.arange(2000) * DT


def recording(**others):
    return made(T, **{"v_x": np.full(T.size, 15.0), **others})


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
    return Evidence(
        windows=windows, measured=measured, modelled=modelled, noise=np.array(noise), predicted=None
    )


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


def test_some_windows_are_those_of_all_that_is_known(rng):
    measured, modelled = rng.standard_normal((2, 60, 2))
    found, kept = of(measured, modelled, noise=(0.1, 0.2)), rng.random(60) < 0.5
    some = found.where(kept)
    np.testing.assert_array_equal(some.windows.starts, found.windows.starts[kept])
    np.testing.assert_array_equal(some.measured, measured[kept])
    np.testing.assert_array_equal(some.modelled, modelled[kept])
    assert some.noise is found.noise


def test_the_worst_part_is_that_which_misses_most(rng):
    measured = np.tile([0.5, 0.4], (60, 1))
    missed = np.zeros((60, 2))
    missed[20:30] = [0.1, 0.2]
    found = of(measured, measured - missed, noise=(0.0001, 0.0))
    assert found.worst(10) == pytest.approx([np.sqrt(0.0099) / 0.5, 0.5])
    assert found.worst(20) == pytest.approx([np.sqrt(0.0049) / 0.5, 0.5 / np.sqrt(2.0)])
    assert found.worst(1000) == pytest.approx(found.model_error)


@pytest.mark.parametrize(
    ("first", "last", "elsewhere", "left_out"),
    [(0, 15, 0.0, True), (30, 45, 0.02, True), (10, 40, 0.0, False), (0, 15, 0.08, False)],
)
def test_one_segment_that_is_missed_is_left_out_where_the_rest_is_explained(
    first, last, elsewhere, left_out
):
    measured = np.tile([0.5, 0.5], (60, 1))
    missed = np.full((60, 2), elsewhere)
    missed[first:last] += 0.3
    found = of(measured, measured - missed)
    rest, some = found.but_a_segment()
    if not left_out:
        assert some is None and rest is found
        return
    assert some[0] <= first and last <= some[1] and some[1] - some[0] == 18
    assert len(rest.windows) == 42 and rest.model_error == pytest.approx(2 * [elsewhere / 0.5])
    assert of(measured, measured - 0.01).but_a_segment()[1] is None
    missed[:, 1] = elsewhere  # a segment that the front alone misses
    assert of(measured, measured - missed).but_a_segment()[1] is not None


@pytest.mark.parametrize("count", [7, 8])
def test_eight_windows_are_evidence(count):
    n = 15 * (count - 1) + 31
    driven = recording()[0.0 : T[n - 1]]
    model = SimpleNamespace(vehicle=CAR, min_speed=3.0, predict=lambda log: np.zeros((len(log), 2)))
    found = evidence(model, driven)
    assert (found is None) == (count < 8) and (found is None or len(found.windows) == 8)


def test_a_road_pushes_by_what_the_accelerometer_does_not_show():
    r, n = 0.1 * np.sin(2.0 * T), T.size
    fall = np.full(n, 0.0)
    fall[n // 2 :] = 0.08
    driven = recording(r=r, a_y=15.0 * r - GRAVITY * fall)
    model = SimpleNamespace(vehicle=CAR)
    push = road_push(driven, model)
    assert np.median(push[n // 2 + 200 :] - np.median(push[: n // 2 - 200])) == pytest.approx(
        0.08, abs=0.01
    )
    assert road_push(replace(driven, a_y=None), model) is None
    blind = replace(driven, v_y=None)
    for answer in (None, SimpleNamespace(beside=fall)):
        tires = SimpleNamespace(vehicle=CAR, estimated_v_y=lambda log, answer=answer: answer)
        assert road_push(blind, tires) is (None if answer is None else fall)


def test_what_forces_miss_of_a_motion_is_told_of_both_balances(rng):
    force = rng.standard_normal((T.size, 2)) * 1e-9 + [3000.0, 1000.0]
    yaw = (CAR.l_f * 3000.0 - CAR.l_r * 1000.0) / CAR.yaw_inertia
    driven = recording(r=yaw * T, v_y=(4000.0 / CAR.mass + 0.5) * T - 15.0 * yaw * T**2 / 2.0)
    counted = np.ones(T.size, dtype=bool)
    found = motion_error(force, driven, CAR, counted)
    assert (found.lateral, found.yaw) == pytest.approx((0.5, 0.0), abs=1e-3)
    assert found.lateral_rms == pytest.approx(4000.0 / CAR.mass + 0.5, abs=1e-3)
    assert found.explained[0] == pytest.approx(1.0 - (0.5 / found.lateral_rms) ** 2, abs=1e-3)
    assert found.yaw_rms == pytest.approx(abs(yaw)) and found.explained[1] == pytest.approx(1.0)
    blind = replace(driven, v_y=None, a_y=np.full(T.size, 4000.0 / CAR.mass))
    assert motion_error(force, blind, CAR, counted).lateral == pytest.approx(0.0, abs=1e-6)
    assert motion_error(force, driven, CAR, ~counted) is None
    still = motion_error(0.0 * force, recording(), CAR, counted)
    assert still.explained == (None, None)
