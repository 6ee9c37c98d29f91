import numpy as np
import pytest

from identifier.stability.loop import worst_gain


def loop_gain(eta_W, eta_V, s, x_bar, W):
    """Largest eigenvalue of η_W |s|² I + η_V |x_bar|² W (I - Λ)² Wᵀ."""
    slope = W * (1.0 - s**2)
    G = eta_W * (s @ s) * np.eye(2) + eta_V * (x_bar @ x_bar) * slope @ slope.T
    return np.linalg.eigvalsh(G)[-1]


def test_no_random_regressor_exceeds_the_worst_gain_and_the_corners_reach_it():
    rng = np.random.default_rng(2)
    n_h, n_in, W_max, x_max = 4, 3, 2.0, 1.5
    for eta_V in (0.0, 0.05, 4.0):
        worst = worst_gain(eta_W=1.3, eta_V=eta_V, n_h=n_h, x_bar_max=x_max, W_max=W_max)
        s = np.tanh(rng.standard_normal((3000, n_h)) * rng.uniform(0, 5, (3000, 1)))
        W = rng.standard_normal((3000, 2, n_h)) * rng.choice([0.05, 1.0], (3000, 1, n_h))
        W *= W_max / np.linalg.norm(W, axis=(1, 2))[:, None, None]
        x_bar = rng.standard_normal((3000, n_in))
        x_bar *= x_max / np.linalg.norm(x_bar, axis=1)[:, None]
        each = zip(s, x_bar, W, strict=True)
        assert max(loop_gain(1.3, eta_V, *one) for one in each) <= worst * (1 + 1e-12)
        corner_W = np.zeros((2, n_h))
        corner_W[0, 0] = W_max
        first = 0.0 if eta_V * (x_max * W_max) ** 2 > 1.3 else 1.0
        corner = np.array([first, 1.0, 1.0, 1.0])
        found = loop_gain(1.3, eta_V, corner, x_bar[0], corner_W)
        assert found == pytest.approx(worst, rel=1e-12)
