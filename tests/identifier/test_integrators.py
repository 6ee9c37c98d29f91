"""The order of each integrator, from the error of one step against a solution in closed form."""

import numpy as np
import pytest

from identifier.paper.laws import INTEGRATORS, euler, rk4

ROTATION = np.array([[0.0, 1.0], [-4.0, -0.4]])


def rate(state):
    """dX/dt = A X and dy/dt = y²: a matrix, and a scalar that is not linear."""
    X, y = state
    return [ROTATION @ X, y**2]


def exact(h):
    """X = exp(A h), by a series; y = 1/(1 - h)."""
    X, term = np.eye(2), np.eye(2)
    for k in range(1, 30):
        term = term @ ROTATION * h / k
        X = X + term
    return [X, 1.0 / (1.0 - h)]


def check_order(step, order):
    """One step of h misses by a constant times h to the order plus one, in every part."""
    errors = []
    for h in (0.04, 0.02):
        parts = zip(step(rate, [np.eye(2), 1.0], h), exact(h), strict=True)
        errors.append([np.abs(part - wanted).max() for part, wanted in parts])
    observed = np.log2(np.array(errors[0]) / np.array(errors[1])) - 1.0
    np.testing.assert_allclose(observed, order, atol=0.15)


def test_euler_is_of_first_and_rk4_of_fourth_order():
    check_order(euler, 1)
    check_order(rk4, 4)
    assert {"euler": euler, "rk4": rk4} == INTEGRATORS
    with pytest.raises(AssertionError):
        check_order(euler, 4)
