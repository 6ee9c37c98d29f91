"""Window means and fits of a recording: their errors are those that a repetition shows."""

from dataclasses import replace

import numpy as np
import pytest

from models.recordings.evidence import STRIDE, WINDOW, correlation, least_squares, windows
from tests.made import made

DT = 0.01


def overlapping_means(noise):
    """Means over windows that overlap as those of a recording do."""
    width, stride = round(WINDOW / DT), round(STRIDE / DT)
    total = np.concatenate([[0.0], np.cumsum(noise)])
    start = np.arange(0, noise.size - width, stride)
    return (total[start + width] - total[start]) / width


def test_the_standard_error_is_the_scatter_of_repeated_fits(rng):
    """Overlapping windows repeat each other: they are not counted as independent."""
    claimed, found = [], []
    for _ in range(300):
        x = overlapping_means(rng.normal(size=6000))
        y = 3.0 * x + overlapping_means(rng.normal(size=6000))
        fit = least_squares(np.column_stack([x]), y)
        found.append(fit[0][0])
        claimed.append(fit[1][0])
    assert np.mean(found) == pytest.approx(3.0, abs=0.05)
    # Neighbors at a quarter of a window count a little more than once: between 1 and 1.4.
    assert 0.7 < np.mean(claimed) / np.std(found) < 1.4


def test_a_fit_explains_what_it_fits():
    t = np.linspace(0.0, 10.0, 400)
    X = np.column_stack([np.sin(t), 1e4 * np.cos(2 * t)])
    fit = least_squares(X, X @ [2.0, -3e-4])
    np.testing.assert_allclose(fit[0], [2.0, -3e-4], rtol=1e-9)
    assert fit[2] == pytest.approx(1.0)
    assert least_squares(X, np.sign(np.sin(17.0 * t)))[2] < 0.2


def test_correlation_is_the_cosine_between_signals(rng):
    a = rng.normal(size=50)
    assert correlation(a, 3.0 * a) == pytest.approx(1.0)
    assert correlation(a, -a) == pytest.approx(-1.0)
    assert correlation(np.array([1.0, 0.0]), np.array([1.0, 1.0])) == pytest.approx(0.5**0.5)
    assert correlation(a, 0.0 * a) == 0.0


def turning(dt=DT):
    """A car that turns as a sine, with sideslip in proportion."""
    t = np.arange(0.0, 20.0, dt)
    r = 0.5 * np.sin(2.0 * t)
    return made(t, v_x=0.0 * t + 10.0, v_y=0.3 * r, r=r, delta_f=0.1 * np.sin(2.0 * t))


@pytest.mark.parametrize("dt", [0.002, 0.01, 0.04])
def test_window_means_and_slopes_are_those_of_the_signals_at_any_rate(dt):
    w = windows(turning(dt))
    width = max(round(WINDOW / dt), 1) * dt
    stride = max(round(STRIDE / dt), 1) * dt
    t_mid = np.arange(w.r.size) * stride + 0.5 * width
    shrink = np.sinc(2.0 * width / 2.0 / np.pi)  # of a sine, averaged over the window
    np.testing.assert_allclose(w.r, 0.5 * shrink * np.sin(2.0 * t_mid), atol=4e-4)
    np.testing.assert_allclose(w.r_dot, shrink * np.cos(2.0 * t_mid), atol=1e-3)
    np.testing.assert_allclose(w.v_y_dot, 0.3 * w.r_dot, rtol=1e-9)
    np.testing.assert_allclose(w.v_x_r, 10.0 * w.r, rtol=1e-9)


def test_what_counts_as_moving_is_three_tenths_of_the_usual_speed_and_not_of_a_short_peak():
    still = turning()
    v_x = np.full(still.t.size, 20.0)
    v_x[still.t > 19.5] = 60.0  # a fortieth of the time
    crawling = (still.t > 8.0) & (still.t < 12.0)
    for slow, counts in ((5.9, False), (6.1, True)):
        now = np.where(crawling, slow, v_x)
        w = windows(replace(still, v_x=now))
        assert (w.v_x.min() == pytest.approx(slow)) == counts
        assert (w.v_x.min() == pytest.approx(20.0)) != counts
    walking = windows(replace(still, v_x=np.where(crawling, 0.49, 1.0)))
    assert walking.v_x.min() == pytest.approx(1.0)  # noise, whatever share of the usual it is
