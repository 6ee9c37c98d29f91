"""The detector of a friction change by its rules, on numbers."""

from typing import NamedTuple

import casadi as ca
import numpy as np
import pytest

from identifier.axle.car import larger, smaller, within
from identifier.axle.learning import (
    LARGEST_Q,
    SLOW_Q,
    ChangeDetector,
    ChangeNumbers,
    ErrorState,
    alarm,
    error_means,
)

DT = 0.01


def numbers(dt: float = DT) -> ChangeNumbers:
    return ChangeDetector().at(dt)


class Means(NamedTuple):
    fast: np.ndarray
    slow: np.ndarray


def means(q, *, fast=(1.0, 1.0), slow=(1.0, 1.0), learns=1, dt=DT) -> Means:
    state = ErrorState(ca.DM(fast), ca.DM(slow), ca.DM([1.0, 1.0]))
    found = error_means(numbers(dt), state, ca.DM(q), learns)
    return Means(*(np.array(value).ravel() for value in found))


def settled(q, n, dt) -> Means:
    """The means after n samples of one error."""
    fast, slow = ca.SX.sym("fast", 2), ca.SX.sym("slow", 2)
    found = error_means(numbers(dt), ErrorState(fast, slow, ca.SX.ones(2)), ca.SX(q), 1)
    step = ca.Function("step", [ca.vertcat(fast, slow)], [ca.vertcat(*found)])
    return Means(*np.array(step.mapaccum(n)(np.ones(4)))[:, -1].reshape(2, 2))


def test_the_means_approach_a_constant_error_with_their_time_constants():
    detector = ChangeDetector()
    state = settled([3.0, 2.0], round(detector.fast / 0.001), dt=0.001)
    reached = 1.0 - np.exp(-1.0)
    np.testing.assert_allclose(state.fast, [1 + 2 * reached, 1 + reached], rtol=0.01)
    share = 1.0 - np.exp(-detector.fast / detector.slow)
    np.testing.assert_allclose(state.slow, [1 + 2 * share, 1 + share], rtol=1e-3)


def test_the_slow_mean_is_at_least_one_and_keeps_what_is_above():
    assert list(means([0.0, 0.0]).slow) == [1.0, 1.0]
    assert list(means([0.0, 0.0], slow=(3.0, 3.0)).slow) == pytest.approx([2.9985, 2.9985])


def test_an_outlier_counts_as_the_largest_error_and_no_more():
    k = numbers()
    found = means([1e9, 2.0])
    assert found.fast[0] == pytest.approx(1.0 + k.fast * (LARGEST_Q - 1.0))
    assert found.fast[1] == pytest.approx(1.0 + k.fast * 1.0)
    assert found.slow[0] == pytest.approx(1.0 + k.slow * (SLOW_Q - 1.0))


def test_nothing_moves_while_learning_rests():
    found = means([9.0, 9.0], fast=(2.0, 3.0), slow=(4.0, 3.5), learns=0)
    assert list(found.fast) == [2.0, 3.0]
    assert list(found.slow) == [4.0, 3.5]


def test_learning_does_not_get_used_to_errors_that_are_no_noise():
    state = settled([1e3, 2.0], 5000, dt=0.1)
    np.testing.assert_allclose(state.slow, [4.0, 2.0], rtol=1e-6)


@pytest.mark.parametrize(
    ("ratio", "expected"),
    [
        ((4.0, 1.0), (0.0, 0.0)),
        ((6.0, 5.0), (0.5, 0.25)),
        ((5.0, 8.0), (0.25, 1.0)),
        ((90.0, 0.0), (1.0, 0.0)),
    ],
)
def test_an_axle_alarms_from_the_threshold_on_and_twice_of_it_is_all(ratio, expected):
    slow = ca.DM([2.0, 3.0])
    found = np.array(alarm(numbers(), ca.DM(ratio) * slow, slow)).ravel()
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_the_inflation_adds_the_square_of_the_step_in_its_time():
    detector = ChangeDetector(step=0.4, step_time=0.5)
    per_sample = detector.at(DT).inflation
    assert per_sample * 0.5 / DT == pytest.approx(0.4**2)


def test_larger_smaller_and_within_are_those_of_numpy(rng):
    a, b = rng.normal(size=20), rng.normal(size=20)
    a[0] = b[0]
    np.testing.assert_array_equal(np.array(larger(ca.DM(a), ca.DM(b))).ravel(), np.maximum(a, b))
    np.testing.assert_array_equal(np.array(smaller(ca.DM(a), ca.DM(b))).ravel(), np.minimum(a, b))
    clipped = np.array(within(ca.DM(a), -0.3, 0.5)).ravel()
    np.testing.assert_array_equal(clipped, np.clip(a, -0.3, 0.5))
