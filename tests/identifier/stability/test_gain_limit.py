import numpy as np
import pytest

from identifier.stability.checks import _worst_damping
from identifier.stability.loop import INSTANTANEOUS, INTEGRAL, Loop, growth_rate
from identifier.stability.margins import gain_margin
from tests.identifier.stability.limits import (
    critical_frequency,
    instantaneous_damping,
    instantaneous_euler_limit,
    integral_euler_limit,
    integral_limit,
)


def scalar(a, lam, g, leakage, law=INTEGRAL):
    return Loop(A_d=-a * np.eye(2), forgetting=lam, law=law, G=g * np.eye(2), leakage=leakage)


def random_cases(n, seed):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        a, lam = np.exp(rng.uniform(np.log(0.5), np.log(30.0), 2))
        yield a, lam, rng.choice([0.0, rng.uniform(0.0, 5.0)])


@pytest.mark.parametrize(
    ("law", "dt", "limit_of"),
    [
        (INTEGRAL, None, integral_limit),
        (INTEGRAL, 0.01, lambda a, lam, leakage: integral_euler_limit(a, lam, 0.01, leakage)),
        (INSTANTANEOUS, 0.01, lambda a, _, leakage: instantaneous_euler_limit(a, 0.01, leakage)),
    ],
)
def test_the_limits_of_the_formulas_are_where_eigenvalues_leave_stability(law, dt, limit_of):
    for a, lam, leakage in random_cases(30, 1):
        limit = limit_of(a, lam, leakage)
        found = gain_margin(scalar(a, lam, limit, leakage, law), dt)
        assert found.factor == pytest.approx(1.0, rel=1e-6)
        if dt is None:
            frequency = critical_frequency(a, lam, leakage)
            assert found.frequency == pytest.approx(frequency, rel=1e-8)
        for share, stable in ((0.999, True), (1.001, False)):
            loop = scalar(a, lam, share * limit, leakage, law)
            assert (growth_rate(loop.matrix(), dt) < 0.0) is np.bool_(stable)


def test_the_euler_limit_holds_for_steps_so_long_that_a_real_root_leaves_first():
    a, lam, dt = 1.9, 1.9, 1.0
    limit = integral_euler_limit(a, lam, dt, leakage=1.8)
    assert limit == pytest.approx((2 - 1.9) ** 2 * (2 - 1.8) * a, rel=1e-12)
    assert gain_margin(scalar(a, lam, limit, 1.8), dt).factor == pytest.approx(1.0, rel=1e-6)


def test_the_instantaneous_law_is_damped_as_the_formula_says_and_has_no_limit():
    for a, _, leakage in random_cases(20, 3):
        g = 7.0 * a**3
        loop = scalar(a, 4.0, g, leakage, INSTANTANEOUS)
        assert _worst_damping(loop) == pytest.approx(instantaneous_damping(a, g, leakage), rel=1e-9)
        assert gain_margin(loop).factor == np.inf
