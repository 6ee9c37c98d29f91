"""Low passes: by fine integration, by what they leave alone, and by going back."""

import numpy as np
import pytest

from models.smoothing import low_passed, smoothed, window, without_low_pass

DT = 0.01
T = DT * np.arange(400)
SWING = np.sin(2.0 * np.pi * 0.7 * T) + 0.3


@pytest.mark.parametrize("lag", [0.004, 0.05, 0.3])
def test_a_low_pass_is_that_of_straight_lines_between_samples(lag):
    fine = DT / 200.0
    times = np.arange(0.0, T[-1] + fine / 2.0, fine)
    source = np.interp(times + fine / 2.0, T, SWING)
    y = np.empty(times.size)
    y[0] = SWING[0]
    for k in range(times.size - 1):  # exact for what is held over a fine step
        y[k + 1] = source[k] + (y[k] - source[k]) * np.exp(-fine / lag)
    expected = y[::200]
    np.testing.assert_allclose(low_passed(SWING, lag, DT)[: expected.size], expected, atol=1e-4)
    assert np.abs(low_passed(SWING, 1.2 * lag, DT)[: expected.size] - expected).max() > 1e-3


def test_a_window_is_even_and_keeps_straight_lines_to_the_ends():
    bell = window(7)
    assert bell.size == 15 and bell.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(bell, bell[::-1], atol=1e-15)
    np.testing.assert_allclose(smoothed(3.0 * T + 1.0, 7), 3.0 * T + 1.0, atol=1e-12)
    one = np.zeros(T.size)
    one[100] = 1.0
    np.testing.assert_allclose(smoothed(one, 7)[93:108], bell, atol=1e-15)


def test_what_went_into_a_low_pass_comes_back():
    behind = low_passed(SWING, 0.1, DT)
    inside = slice(2, -2)
    assert np.abs(behind - SWING).max() > 0.3
    np.testing.assert_allclose(
        without_low_pass(behind, 0.1, DT, 0)[inside], SWING[inside], atol=0.02
    )
