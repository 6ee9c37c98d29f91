"""Time stamps that nearly are a grid: a clock that drifts a little must not refuse a log."""

import numpy as np
import pytest

from models.recordings.record import resample

N, DT = 1000, 0.01


def require_the_grid(t):
    """The grid to the accuracy that a design asks of a recording, 1e-6, and values in their place.

    Values may be late or early by 1 % of a step, 1e-4 s; the ramp rises by 1 a second.
    """
    grid, columns = resample(t, {"ramp": t - t[0]}, DT)
    mean_step = (grid[-1] - grid[0]) / (grid.size - 1)
    assert abs(mean_step / DT - 1.0) < 1e-6
    rounding = 2.0 * np.spacing(t[-1])
    np.testing.assert_allclose(grid, t[0] + DT * np.arange(grid.size), rtol=0.0, atol=rounding)
    np.testing.assert_allclose(columns["ramp"], grid - t[0], rtol=0.0, atol=1.1e-4)


@pytest.mark.parametrize("drift", [8e-6, -8e-6, 5e-5, -5e-5, 1e-3])
@pytest.mark.parametrize("start", [0.0, -3.0, 1.7e9])
def test_a_clock_that_drifts_gives_the_grid(drift, start):
    require_the_grid(start + DT * (1.0 + drift) * np.arange(N))


def test_a_clock_that_jitters_gives_the_grid(rng):
    jitter = rng.uniform(-0.004, 0.004, N) * DT
    require_the_grid(DT * np.arange(N) + jitter)


def test_a_grid_keeps_its_bits(rng):
    for start in (0.0, 12.34):
        t = np.array([float(f"{start + DT * k:.2f}") for k in range(N)])  # as a log prints it
        value = rng.normal(size=N)
        grid, columns = resample(t, {"r": value}, DT)
        np.testing.assert_array_equal(grid, t)
        np.testing.assert_array_equal(columns["r"], value)
