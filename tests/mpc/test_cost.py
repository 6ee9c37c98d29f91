"""Weights of the cost: what 1 means, and what is refused."""

from dataclasses import fields, replace

import numpy as np
import pytest

from mpc.problem import SCALES, Cost


def test_a_weight_of_one_costs_a_half_at_its_scale():
    for i, (name, scale) in enumerate(SCALES.items()):
        alone = Cost(**{**dict.fromkeys(SCALES, 0.0), name: 1.0})
        y = np.zeros(len(SCALES))
        y[i] = scale
        assert 0.5 * np.sum(alone.numbers() * y**2) == pytest.approx(0.5)
        assert np.count_nonzero(alone.numbers()) == 1
    price = 0.5 * Cost(steering_rate=1.0).R * 0.5**2
    assert price == pytest.approx(0.5)


def test_the_end_is_all_errors_times_a_factor():
    cost = Cost(e_psi=0.5, progress=0.1, terminal=7.0)
    np.testing.assert_allclose(cost.terminal_numbers(), 7.0 * cost.numbers())
    np.testing.assert_array_equal(replace(cost, terminal=0.0).terminal_numbers(), 0.0)


@pytest.mark.parametrize("field", [field.name for field in fields(Cost)])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_no_weight_is_negative_or_not_a_number(field, value):
    with pytest.raises(ValueError, match=f"{field} must not be negative"):
        Cost(**{field: value})


def test_the_input_must_cost_something():
    with pytest.raises(ValueError, match=r"steering_rate must be positive and finite, it is 0\.0"):
        Cost(steering_rate=0.0)
