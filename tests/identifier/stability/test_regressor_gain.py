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


def test_a_learning_V_without_bounds_is_refused():
    with pytest.raises(ValueError, match="x_bar_max and W_max"):
        worst_gain(eta_W=1.0, eta_V=1.0, n_h=5, x_bar_max=1.0, W_max=np.inf)


@pytest.mark.parametrize("wrong", [0.0, -2.0, np.nan, np.inf])
@pytest.mark.parametrize("name", ["x_bar_max", "W_max"])
def test_where_V_learns_its_bounds_must_be_positive_and_finite(name, wrong):
    good = {"x_bar_max": 2.0, "W_max": 3.0}
    assert worst_gain(eta_W=1.0, eta_V=0.5, n_h=4, **good) == pytest.approx(3.0 + 0.5 * 36.0)
    with pytest.raises(ValueError, match="where V learns, give x_bar_max and W_max"):
        worst_gain(eta_W=1.0, eta_V=0.5, n_h=4, **{**good, name: wrong})
    assert worst_gain(eta_W=1.0, eta_V=0.0, n_h=4, **{**good, name: wrong}) == 4.0


@pytest.mark.parametrize(("eta_W", "eta_V", "n_h"), [(-1.0, 0.0, 4), (1.0, -1.0, 4), (1.0, 0.0, 0)])
def test_rates_and_sizes_that_are_negative_are_refused(eta_W, eta_V, n_h):
    with pytest.raises(ValueError, match="n_h >= 1"):
        worst_gain(eta_W=eta_W, eta_V=eta_V, n_h=n_h, x_bar_max=1.0, W_max=1.0)
