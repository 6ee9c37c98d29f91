"""Channels of several rates come to one clock without a look at what was logged later."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codegen import arrays
from models.logs.clock import (
    Raw,
    gaps,
    holes,
    on_one_clock,
    sampled,
    typical_step,
    without_codes,
    without_empty,
)
from models.logs.log import Channel
from models.recordings.map import LONGEST_GAP

DT = 0.01


def raw(t, values):
    t = np.asarray(t, dtype=np.float64)
    return Raw(t, np.asarray(values, dtype=np.float64), "sample", np.arange(t.size))


def wave(t):
    return np.sin(2.0 * np.pi * 0.5 * t)


@settings(max_examples=60, deadline=None)
@given(
    rate=st.sampled_from([7.0, 10.0, 25.0, 50.0, 100.0, 130.0, 1000.0]),
    cut=st.floats(0.3, 1.4),
    seed=st.integers(0, 2**31),
)
def test_what_is_logged_later_changes_nothing(rate, cut, seed):
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 2.0, 1.0 / rate)
    grid = t[0] + DT * np.arange(180)
    values = rng.normal(size=t.size)
    before = sampled(raw(t, values), grid, DT)
    later = np.where(t > cut, rng.normal(size=t.size), values)
    after = sampled(raw(t, later), grid, DT)
    known = grid + 1.1e-4 < cut
    assert np.array_equal(before[known], after[known])
    rest = grid > cut + 1.0 / rate + DT
    assert not np.allclose(before[rest], after[rest])  # the test can fail


def test_a_straight_line_is_followed_without_delay():
    t = np.arange(0.0, 3.0, 0.1)
    grid = DT * np.arange(290)
    got = sampled(raw(t, 3.0 + 2.0 * t), grid, DT)
    assert np.allclose(got[200:], 3.0 + 2.0 * grid[200:])  # it is one after 20 samples
    assert np.all(got[:10] == 3.0)  # one sample has no slope


def test_a_slow_channel_goes_on_for_one_interval_at_most():
    line = raw(0.1 * np.arange(30), np.arange(30.0))
    got = sampled(line, np.array([2.9, 2.95, 3.0, 3.05, 3.2]), DT)
    assert np.allclose(got, [29.0, 29.5, 30.0, 30.0, 30.0])


def jittered(rate, jitter, rng):
    t = np.arange(0.0, 20.0, 1.0 / rate)
    return np.maximum(t + rng.uniform(-jitter, jitter, t.size) / rate, 0.0)


@pytest.mark.parametrize("rate", [10.0, 50.0, 99.1])
def test_a_jump_does_not_go_on_beyond_what_was_measured(rate, rng):
    grid = DT * np.arange(3, 1990)
    t = jittered(rate, 0.3, rng)
    jumps = np.repeat(rng.normal(size=t.size // 8 + 1), 8)[: t.size]
    knocks = np.where(rng.random(t.size) < 0.02, 10.0, 0.0) + wave(t)
    for values in (jumps, knocks, rng.normal(size=t.size)):
        got = sampled(raw(t, values), grid, DT)
        room = 0.05 * np.ptp(values) + 1e-9
        assert values.min() - room <= got.min() and got.max() <= values.max() + room


@pytest.mark.parametrize(("jitter", "most"), [(0.0, 0.07), (0.3, 0.09)])
def test_steering_at_five_hertz_keeps_its_shape(jitter, most, rng):
    grid = DT * np.arange(50, 1990)
    t = jittered(99.1, jitter, rng)
    got = sampled(raw(t, wave(10.0 * t)), grid, DT)
    assert np.std(got - wave(10.0 * grid)) < most * np.std(wave(grid))


def test_a_channel_on_the_clock_keeps_its_bits():
    t, values = DT * np.arange(300), np.random.default_rng(0).normal(size=300)
    assert np.array_equal(sampled(raw(t, values), t, DT), values)


def test_a_fast_channel_is_the_mean_since_the_instant_before():
    t = 0.001 * np.arange(500)
    got = sampled(raw(t, np.arange(500.0)), DT * np.arange(40), DT)
    assert got[0] == 0.0
    assert np.allclose(got[1:], 10.0 * np.arange(1, 40) - 4.5)


def test_noise_above_the_clock_is_not_folded_into_the_drive():
    t = 0.001 * np.arange(2000)
    tone = np.sin(2 * np.pi * 102.0 * t)
    assert np.abs(sampled(raw(t, tone), DT * np.arange(1, 190), DT)).max() < 0.03


def test_the_clock_is_that_of_the_channel_nearest_to_it():
    t = 0.003 + DT * np.arange(400)
    slow = np.arange(0.0, 4.0, 0.1)
    (one,) = on_one_clock({"r": raw(t, wave(t)), "v_x": raw(slow, slow)}, DT, LONGEST_GAP)
    assert np.array_equal(one.t, t[: one.t.size]) and one.t.size >= 398
    assert np.array_equal(one.signals["r"], wave(t)[: one.t.size])
    assert np.allclose(one.signals["v_x"][200:], one.t[200:])


def test_a_gap_of_any_channel_ends_a_segment_of_all():
    t = DT * np.arange(1000)
    hole = (t < 3.0) | (t >= 5.0)
    slow = np.arange(0.0, 10.0, 0.1)
    channels = {"r": raw(t, wave(t)), "v_y": raw(t[hole], wave(t[hole])), "v_x": raw(slow, slow)}
    first, second = on_one_clock(channels, DT, LONGEST_GAP)
    assert first.t[0] == 0.0 and first.t[-1] == pytest.approx(2.99, abs=0.011)
    assert second.t[0] == pytest.approx(5.0) and second.t[-1] == pytest.approx(9.99)
    for one in (first, second):
        assert np.allclose(one.signals["v_y"], wave(one.t), atol=1e-9)


def test_clocks_of_the_calendar_are_compared_to_the_microsecond():
    t, slow, late = DT * np.arange(1000), 0.003 + 0.1 * np.arange(100), 1.7e9
    hole = (t < 3.0) | (t >= 5.0)
    channels = {"r": (t, wave(t)), "v_y": (t[hole], wave(t[hole])), "v_x": (slow, wave(slow))}
    near = on_one_clock({k: raw(t, v) for k, (t, v) in channels.items()}, DT, LONGEST_GAP)
    far = on_one_clock({k: raw(t + late, v) for k, (t, v) in channels.items()}, DT, LONGEST_GAP)
    assert len(near) == len(far) == 2
    for one, other in zip(near, far, strict=True):
        assert np.abs(other.t - late - one.t).max() < 3e-7
        for name, values in one.signals.items():
            assert np.allclose(other.signals[name], values, rtol=0, atol=1e-12)


def test_channels_that_never_overlap_have_no_segment():
    t = DT * np.arange(100)
    assert on_one_clock({"a": raw(t, t), "b": raw(t + 5.0, t)}, DT, LONGEST_GAP) == []


def test_slow_channels_have_no_gap_between_their_samples():
    assert gaps(np.arange(0.0, 3.0, 0.1), LONGEST_GAP).size == 0
    assert gaps(np.array([0.0, 0.1, 0.2, 0.5, 0.6, 0.7]), LONGEST_GAP).tolist() == [3]
    assert gaps(np.array([0.0, 0.01, 0.02, 0.12, 0.13]), LONGEST_GAP).size == 0
    assert gaps(np.array([0.0, 0.01, 0.02, 0.13, 0.14]), LONGEST_GAP).tolist() == [3]


def channel(values):
    rows = np.arange(100)
    return Channel(name="v", unit="", t=DT * rows, values=values, place="line", rows=rows)


CODES = [655.35, 655.35 / 3.6, 255.0, -327.68, 2.0**31 - 1.0, 65535.0 / 256.0, -9999.0, np.inf]


@pytest.mark.parametrize("code", CODES)
def test_the_largest_code_of_a_word_is_no_value_but_the_end_of_a_signal_is(code):
    ramp = np.linspace(-1.27, 1.27, 100)
    values = np.where(np.arange(100) % 30 == 5, code, ramp)
    left, said = without_codes(channel(values))
    assert said == f"{code:.9g}" and np.array_equal(left.values, values[values != code])
    for right in (ramp, np.sign(np.sin(np.arange(100.0))) * 0.127):
        assert without_codes(channel(right))[1] == ""


def test_empty_cells_of_a_slower_channel_are_no_holes_but_single_ones_are():
    t = DT * np.arange(100)
    every_tenth = np.where(np.arange(100) % 10 == 0, t, np.nan)
    slower = without_empty(channel(every_tenth))
    assert slower.t.size == 10 and np.isfinite(slower.values).all()
    broken = channel(np.where(np.arange(100) % 10 == 0, np.nan, t))
    assert without_empty(broken) is broken
    assert (
        holes(broken).tolist() == list(range(0, 100, 10)) and not holes(channel(every_tenth)).size
    )
    cut = without_empty(broken, cut=True)
    assert cut.t.size == 90 and np.array_equal(cut.values, cut.t) and cut.rows[0] == 1


@pytest.mark.parametrize("n", [2, 3, 999, 1000, 5000])
def test_gaps_of_a_long_clock_are_found_block_by_block(n, rng, monkeypatch):
    steps = rng.choice([0.01, 0.011, 0.3], n - 1, p=[0.6, 0.39, 0.01])
    t = np.concatenate([[5.0], 5.0 + np.cumsum(steps)])
    exact = np.diff(t)
    monkeypatch.setattr(arrays, "LONG", 100)
    monkeypatch.setattr(arrays, "BLOCK", 37)
    monkeypatch.setattr(arrays, "IN_MEMORY", 800)
    assert typical_step(t) == np.median(exact)
    limit = max(0.1 * (1.0 + 1e-6), 2.5 * float(np.median(exact)))
    np.testing.assert_array_equal(gaps(t, 0.1), np.flatnonzero(exact > limit) + 1)
