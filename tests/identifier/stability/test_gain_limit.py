import numpy as np
import pytest

from benchmarks.limits import (
    critical_frequency,
    instantaneous_damping,
    instantaneous_euler_limit,
    integral_euler_limit,
    integral_limit,
)
from identifier.stability.checks import worst_damping
from identifier.stability.loop import INSTANTANEOUS, INTEGRAL, Loop, euler, exact, growth_rate, rk4
from identifier.stability.margins import gain_margin


def scalar(a, lam, g, leakage, law=INTEGRAL):
    return Loop(A_d=-a * np.eye(2), forgetting=lam, law=law, G=g * np.eye(2), leakage=leakage)


def random_cases(n, seed):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        a, lam = np.exp(rng.uniform(np.log(0.5), np.log(30.0), 2))
        yield a, lam, rng.choice([0.0, rng.uniform(0.0, 5.0)])


def test_the_limit_of_the_integral_law_is_where_its_eigenvalues_cross():
    for a, lam, leakage in random_cases(40, 1):
        limit = integral_limit(a, lam, leakage)
        found = gain_margin(scalar(a, lam, limit, leakage))
        assert found.factor == pytest.approx(1.0, rel=1e-8)
        assert found.frequency == pytest.approx(critical_frequency(a, lam, leakage), rel=1e-8)


def test_a_limit_that_is_one_permille_off_is_noticed():
    limit = integral_limit(6.0, 9.0)
    assert growth_rate(scalar(6.0, 9.0, 0.999 * limit, 0.0).matrix()) < -1e-6
    assert growth_rate(scalar(6.0, 9.0, 1.001 * limit, 0.0).matrix()) > 1e-6


def test_the_euler_limit_is_where_the_sampled_eigenvalues_leave_the_unit_circle():
    for a, lam, leakage in random_cases(40, 2):
        dt = 0.01
        limit = integral_euler_limit(a, lam, dt, leakage)
        found = gain_margin(scalar(a, lam, limit, leakage), euler, dt)
        assert found.factor == pytest.approx(1.0, rel=1e-6)


def test_the_euler_limit_holds_for_steps_so_long_that_a_real_root_leaves_first():
    a, lam, dt = 1.9, 1.9, 1.0
    limit = integral_euler_limit(a, lam, dt, leakage=1.8)
    assert limit == pytest.approx((2 - 1.9) ** 2 * (2 - 1.8) * a, rel=1e-12)
    assert gain_margin(scalar(a, lam, limit, 1.8), euler, dt).factor == pytest.approx(1.0, rel=1e-6)


def test_at_ten_milliseconds_euler_costs_a_part_of_the_limit_and_runge_kutta_nothing():
    for a in (5.0, 10.0, 15.0):
        ratio = integral_euler_limit(a, a, 0.01) / integral_limit(a, a)
        assert 0.6 < ratio < 0.9
        margin = gain_margin(scalar(a, a, integral_limit(a, a), 0.0), rk4, 0.01)
        assert margin.factor == pytest.approx(1.0, rel=2e-3)
    assert integral_euler_limit(5.0, 5.0, 1e-4) == pytest.approx(integral_limit(5.0, 5.0), rel=2e-3)


def test_the_instantaneous_law_is_damped_as_the_formula_says_and_has_no_limit():
    for a, _, leakage in random_cases(20, 3):
        g = 7.0 * a**3
        loop = scalar(a, 4.0, g, leakage, INSTANTANEOUS)
        assert worst_damping(loop) == pytest.approx(instantaneous_damping(a, g, leakage), rel=1e-9)
        assert gain_margin(loop, exact).factor == np.inf
    assert instantaneous_damping(4.0, 64.0) == pytest.approx(0.5)


def test_the_instantaneous_law_stepped_with_euler_has_the_limit_of_the_formula():
    for a, _, leakage in random_cases(20, 4):
        limit = instantaneous_euler_limit(a, 0.01, leakage)
        loop = scalar(a, 4.0, limit, leakage, INSTANTANEOUS)
        assert gain_margin(loop, euler, 0.01).factor == pytest.approx(1.0, rel=1e-6)
    assert instantaneous_euler_limit(3.0, 0.01) == pytest.approx(900.0)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_rates_that_are_not_positive_are_refused(bad):
    with pytest.raises(ValueError, match="a must be positive"):
        integral_limit(bad, 1.0)
    with pytest.raises(ValueError, match="below 2"):
        integral_euler_limit(250.0, 1.0, 0.01)
