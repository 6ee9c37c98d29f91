"""Samples that are refused count as time: what a gap costs, and when no force is told any more."""

import itertools

import casadi as ca
import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.export.package import synthetic_samples
from identifier.export.specialize import specialize
from identifier.methods import METHODS, make_method
from identifier.refused import SampleLimits, stale_samples
from identifier.run import OnlineIdentifier
from models.vehicle import sedan
from tests.identifier.conftest import slalom_of

CAR = sedan()
BEGIN = 1200  # sample at which a gap begins
RESTART = 30  # samples in which a restarted filter or observer may settle
BROKEN = (np.nan, np.inf, -np.inf, 1e308, -1e308)


@pytest.fixture(scope="module")
def slalom():
    return slalom_of(24.99)


def rows_of(recording):
    columns = (recording.v_x, recording.v_y, recording.r, recording.delta_f, recording.delta_r)
    return np.column_stack(columns)


def update(online, row, a_y=None):
    return online.update(row[1:3], row[3:], row[0], a_y)


def driven(method, rows, a_y=None):
    online = OnlineIdentifier(method, CAR, method.dt)
    felt = [None] * len(rows) if a_y is None else a_y
    return np.array([update(online, *one) for one in zip(rows, felt, strict=True)]), online


def error(force, truth):
    return float((np.sqrt(((force - truth) ** 2).mean(0) / (truth**2).mean(0))).max())


@pytest.mark.sweep("magic_formula_ekf")
@pytest.mark.parametrize("name", [one for one in METHODS if not make_method(one, CAR).whole])
def test_a_gap_of_refused_samples_costs_less_than_two_percent(name, slalom):
    rows, truth, method = rows_of(slalom), slalom.axle_force, make_method(name, CAR)
    a_y = slalom.a_y if "a_y" in method.needs else None
    clean = driven(method, rows, a_y)[0]
    for begin, gap in itertools.product((BEGIN, BEGIN + 30, BEGIN + 70), (20, 50, 100, 200)):
        broken = rows.copy()
        broken[begin : begin + gap, 2] = np.nan
        force, online = driven(method, broken, a_y)
        after = slice(begin + gap + RESTART, len(rows))
        cost = error(force[after], truth[after]) - error(clean[after], truth[after])
        assert cost < 0.02, (begin, gap)
        assert online.counts.refused == gap
        assert not online.stale


@pytest.mark.sweep("nan-*", "1e+308-0", "-inf-2")
@pytest.mark.parametrize("channel", range(5))
@pytest.mark.parametrize("broken", BROKEN)
def test_no_channel_without_a_number_changes_what_was_learnt(channel, broken, slalom):
    rows = rows_of(slalom)[:700]
    rows[500:600, channel] = broken
    method = AxleIdentifier.for_vehicle(CAR)
    online = OnlineIdentifier(method, CAR, method.dt)
    for k, row in enumerate(rows):
        if k == 500:
            before = online.state()
        force = update(online, row)
        assert np.isfinite(force).all()
        if 500 <= k < 600:
            state = online.state()
            for port in ("W", "own", "UD", "errors", "excitation"):
                np.testing.assert_array_equal(state[port], before[port])
    assert (online.counts.samples, online.counts.refused) == (600, 100)
    assert np.abs(force).max() > 100.0


@pytest.mark.heavy
def test_no_sample_is_refused_for_a_lateral_velocity_that_the_method_tells(slalom):
    """What no car can have is as if there were no sensor, to the bit; NaN is none."""
    method, rows, found = make_method("inertial", CAR), rows_of(slalom)[:900], []
    for absent in (*BROKEN, 1.001 * SampleLimits.of(CAR).speed):
        rows[200:800, 1] = absent
        forces, online = driven(method, rows, slalom.a_y[:900])
        assert (online.counts.samples, online.counts.refused) == (900, 0)
        found.append((forces, online.outputs["v_y"], *online.state().values()))
    for one in found[1:]:
        for value, expected in zip(one, found[0], strict=True):
            np.testing.assert_array_equal(value, expected)
    assert np.isfinite(found[0][0]).all()
    paper, refused = make_method("integral", CAR), rows_of(slalom)[:300]
    refused[200:250, 1] = np.nan
    assert driven(paper, refused)[1].counts.refused == 50


@pytest.mark.sweep("axle")
@pytest.mark.parametrize("name", ["axle", "inertial"])
def test_no_input_brings_a_number_into_a_step_that_is_none(name):
    """The step alone, without the door before it: every channel and all of them, in any state."""
    specialized, rng = specialize(make_method(name, CAR), CAR), np.random.default_rng(3)
    n, gate = len(specialized.carry), list(specialized.carry).index("gate")
    carry = [ca.DM(value) for value in specialized.carry.values()]
    states = [carry]
    for v_x, v_y, r, delta_f, delta_r, *a_y in synthetic_samples(specialized, 400):
        carry = list(specialized.function(*carry, [v_y, r], [delta_f, delta_r], v_x, *a_y))[:n]
        if rng.random() < 0.1:
            states += [carry, [*carry[:gate], np.array(carry[gate]), *carry[gate + 1 :]]]
            states[-1][gate][5] = 0.0  # just switched off: whatever comes first is near
    k = len(specialized.inputs)
    channels = [*((i,) for i in range(k)), tuple(range(k)), *itertools.combinations(range(k), 2)]
    cases = list(itertools.product(channels, BROKEN))
    samples = np.tile([[20.0], [0.1], [0.1], [0.01], [0.0], [2.0]], len(cases))
    for j, (which, broken) in enumerate(cases):
        samples[list(which), j] = broken
    given = [samples[1:3], samples[3:5], samples[:1], *samples[5:k, None]]
    for state in states:  # of all cases at once, one beside the other
        told = specialized.function(*state, *given)
        for port, value in zip([*specialized.carry, "axle_force"], told, strict=False):
            sizes = np.abs(np.hsplit(np.array(value), len(cases))).max(axis=(1, 2))
            assert (sizes < 1e9).all(), (port, cases[np.argmin(sizes < 1e9)])  # NaN is not


@pytest.mark.parametrize("name", ["axle", "integral"])
def test_forces_are_zero_and_stale_after_half_a_second_without_a_sample(name, slalom):
    rows, method = rows_of(slalom)[:700], make_method(name, CAR)
    rows[400:500, 0] = np.nan
    online = OnlineIdentifier(method, CAR, method.dt)
    for k, row in enumerate(rows):
        force = update(online, row)
        assert online.stale == (449 <= k < 500)
        if online.stale:
            np.testing.assert_array_equal(force, 0.0)
            assert all((value == 0.0).all() for value in online.outputs.values())
    assert np.abs(force).max() > 100.0
    assert online.counts.refused_in_row == 0


def test_a_held_force_is_told_until_it_is_stale(slalom):
    rows, method = rows_of(slalom)[:421], make_method("lagged_ekf", CAR)
    rows[400:, 1] = np.inf
    online = OnlineIdentifier(method, CAR, 0.01, stale_time=0.2)
    forces = np.array([update(online, row) for row in rows])
    np.testing.assert_array_equal(forces[400:419], np.tile(forces[399], (19, 1)))
    np.testing.assert_array_equal(forces[419:], 0.0)
    assert stale_samples(0.2, 0.01) == 20
    assert stale_samples(1e-9, 0.01) == 1  # the first one already


@pytest.mark.parametrize("time", [0.0, -1.0, np.nan, np.inf])
def test_a_time_that_is_none_is_refused(time):
    with pytest.raises(ValueError, match="stale_time must be positive and finite"):
        OnlineIdentifier(make_method("lagged_ekf", CAR), CAR, 0.01, stale_time=time)


def test_a_run_that_is_begun_anew_stays_stale_until_a_sample_comes(slalom):
    rows, method = rows_of(slalom)[:200], AxleIdentifier.for_vehicle(CAR)
    online = OnlineIdentifier(method, CAR, method.dt)
    for row in rows:
        update(online, row)
    for _ in range(60):
        update(online, np.full(5, np.nan))
    online.restart(None)
    assert online.stale
    np.testing.assert_array_equal(update(online, np.full(5, np.nan)), 0.0)
    update(online, rows[0])
    assert not online.stale


def test_before_the_first_sample_nothing_begins(slalom):
    rows, method = rows_of(slalom)[:300], make_method("integral", CAR)
    late, clean = (OnlineIdentifier(method, CAR, 0.01) for _ in range(2))
    for _ in range(10):
        update(late, np.full(5, np.nan))
    for row in rows:
        np.testing.assert_array_equal(update(late, row), update(clean, row))


def test_the_limits_are_those_of_the_car_s_size():
    limits = SampleLimits.of(CAR)
    good = (20.0, 0.5, 0.3, 0.05, 0.0)
    assert limits.accept(*good)
    for channel, most in enumerate((limits.speed, limits.speed, limits.yaw_rate, 1.5, 1.5)):
        for side in (-1.0, 1.0):
            sample = list(good)
            sample[channel] = side * most
            assert limits.accept(*sample)
            sample[channel] = side * most * 1.001
            assert not limits.accept(*sample)
