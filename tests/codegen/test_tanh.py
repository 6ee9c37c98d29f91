"""Our own tanh, exp, atan and sin: how far from the true ones, and the same wherever computed."""

import casadi as ca
import numpy as np
import pytest

from codegen import elementary
from codegen.elementary import LIMIT, tanh

X = np.linspace(-20.0, 20.0, 200_001)


def largest_error(function, exact, x):
    return np.abs(function(x).astype(np.longdouble) - exact(x.astype(np.longdouble))).max()


def test_tanh_is_within_2e_11_and_in_float_within_1e_6():
    assert largest_error(tanh, np.tanh, X) <= 2e-11
    assert largest_error(tanh, np.tanh, X[np.abs(X) < LIMIT]) <= 3e-13
    assert largest_error(tanh, np.tanh, X.astype(np.float32)) <= 1e-6


def test_another_coefficient_would_be_noticed(monkeypatch):
    changed = tuple(c * (1 + 1e-9) if k == 3 else c for k, c in enumerate(elementary.PADE))
    monkeypatch.setattr(elementary, "PADE", changed)
    assert np.abs(elementary.exp(X) / np.exp(X) - 1.0).max() > 1e-12


def test_exp_is_within_1_3e_10_of_itself():
    y = np.linspace(-85.0, 85.0, 100_001)
    error = np.abs(elementary.exp(y) / np.exp(y) - 1.0)
    assert error.max() <= 1.3e-10
    assert error[np.abs(y) <= 40.0].max() <= 2e-14
    single = elementary.exp(y.astype(np.float32)).astype(np.float64)
    assert np.abs(single / np.exp(y.astype(np.float32).astype(np.float64)) - 1.0).max() <= 4e-5


def test_exp_saturates_and_never_overflows():
    assert elementary.exp(np.array([1e300]))[0] == elementary.exp(np.array([85.0]))[0]
    assert 0.0 < elementary.exp(np.array([-1e300]))[0] < 2e-37


def test_atan_is_within_1e_12():
    x = np.tan(np.linspace(-1.5707, 1.5707, 100_001))
    assert np.abs(elementary.atan(x) - np.arctan(x)).max() <= 1e-12
    ends = elementary.atan(np.array([-1e30, -1.0, 0.0, 1.0, 1e30]))
    np.testing.assert_allclose(ends, np.pi * np.array([-0.5, -0.25, 0, 0.25, 0.5]), atol=1e-12)


def test_sin_is_within_1e_13_on_one_turn_and_5e_13_on_a_thousand():
    assert np.abs(elementary.sin(X) - np.sin(X)).max() <= 1e-13
    far = 300.0 * X
    assert np.abs(elementary.sin(far) - np.sin(far)).max() <= 2e-12
    single = np.linspace(-np.pi, np.pi, 10_001).astype(np.float32)
    assert largest_error(elementary.sin, np.sin, single) <= 1e-6


@pytest.mark.parametrize("function", [tanh, elementary.atan, elementary.sin])
def test_odd_functions_are_odd_to_the_last_bit(function):
    np.testing.assert_array_equal(function(-X), -function(X))


@pytest.mark.parametrize("function", [tanh, elementary.exp, elementary.atan, elementary.sin])
def test_nan_passes(function):
    assert np.isnan(function(np.array([np.nan]))).all()


@pytest.mark.parametrize("function", [tanh, elementary.exp, elementary.atan, elementary.sin])
def test_casadi_and_numpy_compute_the_same_bits(function):
    x = ca.SX.sym("x", X[::20].size)
    in_casadi = np.array(ca.Function("f", [x], [function(x)])(X[::20])).ravel()
    np.testing.assert_array_equal(in_casadi, function(X[::20]))
