import numpy as np
import pytest

from mpc.path import Path


def test_the_path_of_a_sine_has_its_curvature_and_converges_with_the_way_points():
    errors = []
    for n in (40, 80):
        x = np.linspace(0.0, 120.0, n + 1)
        path = Path.from_waypoints(x, 3.0 * np.sin(x / 12.0), spacing=0.1)
        dy, ddy = 0.25 * np.cos(path.X / 12.0), -np.sin(path.X / 12.0) / 48.0
        inside = (path.X > 20.0) & (path.X < 100.0)
        errors.append(np.abs(path.kappa - ddy / (1 + dy**2) ** 1.5)[inside].max())
    assert errors[0] < 0.02 / 48.0
    assert errors[1] < 0.35 * errors[0]


def test_the_path_passes_through_every_way_point(rng):
    X, Y = 12.0 * np.arange(12) + rng.uniform(-2, 2, 12), rng.uniform(-4, 4, 12)
    path = Path.from_waypoints(X, Y)
    for x, y in zip(X, Y, strict=True):
        assert abs(path.project(x, y).e_y) < 1e-4
    assert (path.X[0], path.Y[0]) == pytest.approx((X[0], Y[0]))
    assert (path.X[-1], path.Y[-1]) == pytest.approx((X[-1], Y[-1]))


def test_a_repeated_last_way_point_of_a_ring_is_the_same_ring():
    angle = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
    X, Y = 30.0 * np.cos(angle), 30.0 * np.sin(angle)
    once = Path.from_waypoints(X, Y, closed=True)
    again = Path.from_waypoints(np.append(X, X[0]), np.append(Y, Y[0] + 1e-12), closed=True)
    np.testing.assert_allclose(again.X, once.X, atol=1e-9)
