"""Sums under windows and weights that are not negative, against SciPy: sparse matrix, `nnls`."""

import numpy as np
import pytest
from scipy.optimize import nnls
from scipy.sparse import csr_array

from identifier.doctor.windows import Windows, not_negative


@pytest.mark.parametrize("shape", [(200,), (200, 5)])
def test_windows_sum_as_a_sparse_matrix_does(shape):
    rng = np.random.default_rng(0)
    starts, weights, x = np.array([0, 3, 50, 180]), rng.standard_normal(20), rng.random(shape)
    under = starts[:, None] + np.arange(20)
    rows = np.repeat(np.arange(4), 20)
    matrix = csr_array((np.tile(weights, 4), (rows, under.ravel())), (4, 200))
    np.testing.assert_allclose(Windows(under, weights) @ x, matrix @ x, rtol=1e-12, atol=1e-14)


def test_no_window_sums_nothing():
    nowhere = Windows(np.zeros((0, 20), dtype=np.intp), np.ones(20))
    assert (nowhere @ np.zeros(5)).shape == (0,)
    assert (nowhere @ np.zeros((5, 3))).shape == (0, 3)


@pytest.mark.parametrize("seed", range(40))
def test_weights_are_those_of_nnls(seed):
    """Well and badly conditioned, from a curve that has such weights and from noise."""
    rng = np.random.default_rng(seed)
    scales = np.array([0.016, 0.032, 0.064, 0.128, 0.256])
    basis = np.tanh(0.1 * rng.standard_normal((60, 1)) / scales)
    y = rng.standard_normal(60) if seed % 2 else basis @ rng.exponential(size=5)
    gram = basis.T @ basis + 1e-6 * np.eye(5)
    R = np.linalg.cholesky(gram)
    known, _ = nnls(R.T, np.linalg.solve(R, basis.T @ y))
    near = {"rtol": 1e-6, "atol": 1e-8 * np.abs(known).max()}
    np.testing.assert_allclose(not_negative(gram, basis.T @ y), known, **near)
    for guess in (known > 0.0, known == 0.0, np.ones(5, bool), np.zeros(5, bool)):
        np.testing.assert_allclose(not_negative(gram, basis.T @ y, guess), known, **near)


def test_a_moment_that_pushes_down_leaves_all_weights_at_zero():
    assert (not_negative(np.eye(3), np.array([-1.0, -2.0, -3.0])) == 0.0).all()
