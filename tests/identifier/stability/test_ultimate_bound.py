from dataclasses import replace

import numpy as np
import pytest

from identifier.stability.loop import INSTANTANEOUS
from identifier.stability.lyapunov import LyapunovError, lyapunov
from identifier.stability.printed import (
    _bound_14,
    _canceling_pair,
    _printed_k_b,
    _tight_k_b,
    printed_bounds,
    trivial_bound,
    ultimate_bound,
)
from identifier.stability.sampled_bound import Disturbance
from tests.identifier.stability.test_certificate import CITY, gains

SKEWED = np.array([[-4.0, 3.0], [-0.5, -6.0]])
NUMBERS = {"W_M": 1.5, "n_h": 6, "eta_W": 3.0, "rho_W": 0.8}


def lyapunov_rate(pair, xi_tilde, W_t, W, s, w):
    """L' of the instantaneous law, term by term as the equations are written."""
    W_hat, A_d, P = W - W_t, pair.A_d, pair.P
    xi_dot = A_d @ xi_tilde + W_t @ s + w
    W_hat_dot = -3.0 * np.outer(np.linalg.solve(A_d.T, xi_tilde), s)
    W_hat_dot = W_hat_dot - 0.8 * np.linalg.norm(xi_tilde) * W_hat
    return xi_tilde @ P @ xi_dot + np.sum(W_t * -W_hat_dot) / 0.8


def random_states(n, seed):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        s = rng.uniform(-1, 1, NUMBERS["n_h"])
        W = rng.standard_normal((2, NUMBERS["n_h"]))
        W *= NUMBERS["W_M"] / np.linalg.norm(W)
        w = rng.standard_normal(2)
        w *= 0.4 / np.linalg.norm(w)
        W_t = rng.standard_normal((2, NUMBERS["n_h"])) * rng.uniform(0, 2)
        yield rng.standard_normal(2), W_t, W, s, w


@pytest.mark.parametrize("k_b_of", [_printed_k_b, _tight_k_b])
def test_the_lyapunov_function_falls_wherever_the_error_is_beyond_the_bound(k_b_of):
    pair = lyapunov(SKEWED, np.eye(2))
    k_b = k_b_of(pair, **NUMBERS)
    b = _bound_14(pair, w_bar=0.4, k_b=k_b)
    for xi_tilde, W_t, W, s, w in random_states(400, 1):
        beyond = 1.0001 * b * xi_tilde / np.linalg.norm(xi_tilde)
        assert lyapunov_rate(pair, beyond, W_t, W, s, w) < 0.0


def test_the_quadratic_in_the_weight_error_bounds_the_rate_and_a_wrong_sign_does_not():
    pair = lyapunov(SKEWED, np.eye(2))
    P, q = np.linalg.norm(pair.P, 2), np.linalg.eigvalsh(pair.Q)[0]
    coupling = pair.P + 3.0 / 0.8 * np.linalg.inv(SKEWED)
    wrong = pair.P - 3.0 / 0.8 * np.linalg.inv(SKEWED)

    def exact_coupling(matrix, xi_tilde, W_t, s):
        return xi_tilde @ matrix @ W_t @ s

    worst = 0.0
    for xi_tilde, W_t, W, s, w in random_states(200, 2):
        size, y = np.linalg.norm(xi_tilde), np.linalg.norm(W_t)
        rate = lyapunov_rate(pair, xi_tilde, W_t, W, s, w)
        k_b = _tight_k_b(pair, **NUMBERS)
        assert rate <= size * (-q * size / 2 + P * 0.4 + 2 * k_b * y - y**2) + 1e-9
        rest = -xi_tilde @ pair.Q @ xi_tilde / 2 + xi_tilde @ pair.P @ w
        rest += size * np.sum(W_t * (W - W_t))
        assert rate == pytest.approx(rest + exact_coupling(coupling, xi_tilde, W_t, s), abs=1e-9)
        worst = max(worst, abs(rate - rest - exact_coupling(wrong, xi_tilde, W_t, s)))
    assert worst > 0.1  # the sign matters


def test_the_canceling_pair_gives_the_closed_form_of_the_tight_bound():
    A_d = np.array([[-4.0, 1.0], [1.0, -6.0]])
    pair = _canceling_pair(A_d, eta_W=3.0, rho_W=0.8)
    k_b = _tight_k_b(pair, **NUMBERS)
    assert k_b == pytest.approx(NUMBERS["W_M"] / 2)
    inverse = np.linalg.norm(np.linalg.inv(A_d), 2)
    expected = inverse * 0.4 + 0.8 * 1.5**2 / (4 * 3.0)
    assert _bound_14(pair, w_bar=0.4, k_b=k_b) == pytest.approx(expected)
    with pytest.raises(LyapunovError, match="too far from symmetric"):
        _canceling_pair(np.array([[-1.0, 9.0], [0.0, -1.0]]), eta_W=1.0, rho_W=1.0)


def best_printed(*, w_bar, n_h, eta_W, rho_W):
    """The certificate's "printed_bound" for SKEWED: the ideal weights are zero."""
    skewed = replace(gains(eta_W=eta_W, rho_W=rho_W), A_d=tuple(map(tuple, SKEWED.tolist())))
    operation = replace(CITY, n_h=n_h, disturbance=Disturbance(residual=w_bar))
    entries = printed_bounds(skewed, INSTANTANEOUS, operation, trivial=1.0)
    return {entry.name: entry.value for entry in entries}["printed_bound"]


@pytest.mark.heavy
def test_the_best_scale_of_the_printed_bound_is_found_by_a_search_too():
    numbers = {"n_h": 6, "eta_W": 3.0, "rho_W": 0.8}
    found = min(
        _bound_14(pair, w_bar=0.4, k_b=_printed_k_b(pair, W_M=0.0, **numbers))
        for scale in np.geomspace(0.1, 1e3, 2000)
        for pair in [lyapunov(SKEWED, scale * np.eye(2))]
    )
    assert best_printed(w_bar=0.4, **numbers) == pytest.approx(found, rel=1e-4)


def test_the_printed_bound_is_never_below_that_of_an_identifier_without_a_network():
    rng = np.random.default_rng(6)
    for _ in range(50):
        w_bar, eta, rho = np.exp(rng.uniform(-3, 3, 3))
        b = best_printed(w_bar=w_bar, n_h=6, eta_W=eta, rho_W=rho)
        assert b > trivial_bound(SKEWED, w_bar)


def test_the_ultimate_bound_is_the_maximum_of_the_level_over_a_fine_grid():
    rng = np.random.default_rng(7)
    for _ in range(30):
        w_bar, k_b, rho = np.exp(rng.uniform(-2, 2, 3))
        pair = lyapunov(SKEWED, np.diag(rng.uniform(0.2, 3.0, 2)))
        p, q = np.linalg.eigvalsh(pair.P), np.linalg.eigvalsh(pair.Q)[0]
        b = _bound_14(pair, w_bar=w_bar, k_b=k_b)
        y = np.linspace(0.0, k_b + np.sqrt(k_b**2 + p[1] * w_bar), 400_001)
        x = np.maximum(0.0, b - 2 / q * (y - k_b) ** 2)
        expected = np.sqrt((p[1] * x**2 + y**2 / rho).max() / p[0])
        found = ultimate_bound(pair, w_bar=w_bar, k_b=k_b, rho_W=rho)
        assert found == pytest.approx(expected, rel=1e-6)
        assert found >= b


def test_without_ideal_weights_the_ultimate_bound_has_a_closed_form():
    a, eta, f_bar = 3.0, 5.0, 2.0
    for rho in (0.1, 20.0):
        pair = _canceling_pair(-a * np.eye(2), eta_W=eta, rho_W=rho)
        found = ultimate_bound(pair, w_bar=f_bar, k_b=0.0, rho_W=rho)
        assert found == pytest.approx(max(f_bar / a, np.sqrt(f_bar / rho)), rel=1e-9)
