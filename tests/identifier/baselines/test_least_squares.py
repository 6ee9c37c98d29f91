"""Levenberg-Marquardt against closed forms and another program."""

import numpy as np
import pytest
import scipy.optimize

from identifier.baselines.floor import least_squares

FREE = np.full(2, np.inf)


def rosenbrock(p):
    return np.array([10.0 * (p[1] - p[0] ** 2), 1.0 - p[0]])


def test_the_valley_of_rosenbrock_is_followed_to_its_end():
    fit = least_squares(rosenbrock, np.array([-1.2, 1.0]), -FREE, FREE, steps=100)
    np.testing.assert_allclose(fit.parameters, [1.0, 1.0], rtol=1e-5)
    short = least_squares(rosenbrock, np.array([-1.2, 1.0]), -FREE, FREE, steps=2)
    assert short.cost > 1.0


def test_a_linear_problem_is_solved_as_the_normal_equations_do(rng):
    A, b = rng.standard_normal((50, 4)), rng.standard_normal(50)
    free = np.full(4, np.inf)
    fit = least_squares(lambda p: A @ p - b, np.zeros(4), -free, free, steps=30)
    np.testing.assert_allclose(fit.parameters, np.linalg.lstsq(A, b)[0], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("start", [(0.0, 0.0), (0.5, 2.0), (9.0, -9.0)])
def test_bounds_hold_and_the_minimum_on_them_is_that_of_scipy(start):
    lower, upper = np.array([-0.5, -1.0]), np.array([0.6, 2.0])
    fit = least_squares(rosenbrock, np.array(start), lower, upper, steps=200)
    other = scipy.optimize.least_squares(rosenbrock, [0.0, 0.0], bounds=(lower, upper))
    np.testing.assert_allclose(fit.parameters, other.x, atol=1e-4)
    assert fit.parameters[0] == 0.6
    assert fit.cost == pytest.approx(2 * other.cost, rel=1e-6)


def test_a_parameter_that_does_nothing_stays():
    fit = least_squares(lambda p: p[:1] - 3.0, np.array([0.0, 0.7]), -FREE, FREE, steps=30)
    np.testing.assert_allclose(fit.parameters, [3.0, 0.7], atol=1e-6)


@pytest.mark.parametrize("unit", [1e-9, 1e6])
def test_the_unit_of_the_residual_does_not_matter(unit):
    start = np.array([-1.2, 1.0])
    fit = least_squares(lambda p: unit * rosenbrock(p), start, -FREE, FREE, steps=12)
    plain = least_squares(rosenbrock, start, -FREE, FREE, steps=12)
    np.testing.assert_allclose(fit.parameters, plain.parameters, rtol=1e-5)
    assert fit.cost == pytest.approx(unit**2 * plain.cost, rel=1e-4)


@pytest.mark.parametrize("start", [0.5, 0.7, 0.8, 0.9, 1.0, 1.05])
def test_the_damping_of_the_second_step_follows_nielsens_rule(start):
    """r = tanh p, whose steps overshoot: by the length of the second step, its damping."""

    def after(steps):
        first = np.array([start])
        free = np.array([np.inf])
        return float(least_squares(np.tanh, first, -free, free, steps=steps).parameters[0])

    def damping(p, then):
        return -np.tanh(p) * np.cosh(p) ** 2 / (then - p) - 1.0

    one, two = after(1), after(2)
    slope = 1.0 / np.cosh(start) ** 2
    linear = np.tanh(start) + slope * (one - start)
    cost = np.tanh(start) ** 2
    gained = (cost - np.tanh(one) ** 2) / (cost - linear**2)
    assert 0.0 < gained < 1.0
    ratio = damping(one, two) / damping(start, one)
    assert ratio == pytest.approx(max(1 / 3, 1 - (2 * gained - 1) ** 3), rel=5e-3)
