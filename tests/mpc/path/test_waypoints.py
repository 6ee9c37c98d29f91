import numpy as np
import pytest

from mpc.path import Path, PathError


def circle(n, radius=30.0, gaps=None):
    gaps = np.ones(n) if gaps is None else gaps
    angle = 2 * np.pi * np.append(0.0, np.cumsum(gaps)[:-1]) / np.sum(gaps)
    return radius * np.cos(angle), radius * np.sin(angle)


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
    X, Y = circle(24)
    once = Path.from_waypoints(X, Y, closed=True)
    again = Path.from_waypoints(np.append(X, X[0]), np.append(Y, Y[0] + 1e-12), closed=True)
    np.testing.assert_allclose(again.X, once.X, atol=1e-9)


def test_smoothing_takes_the_noise_of_a_survey_out_of_the_curvature(rng):
    X, Y = circle(380)
    noisy = X + rng.normal(0, 0.05, 380), Y + rng.normal(0, 0.05, 380)
    with pytest.raises(PathError, match="smooth or move the way-points"):
        Path.from_waypoints(*noisy, closed=True)
    path = Path.from_waypoints(*noisy, closed=True, smoothing=0.05)
    assert path.kappa == pytest.approx(1 / 30.0, rel=0.05)
    moved = [path.project(x, y).e_y for x, y in zip(*noisy, strict=True)]
    assert np.sqrt(np.mean(np.square(moved))) == pytest.approx(0.05, abs=0.01)


@pytest.mark.parametrize("points", [5, 6, 8, 12])
@pytest.mark.parametrize("distance", [0.05, 0.5, 5.0])
def test_a_closed_line_of_few_points_keeps_the_distance_that_smoothing_allows(points, distance):
    X, Y = circle(points)
    path = Path.from_waypoints(X, Y, closed=True, smoothing=distance)
    radius = np.hypot(path.X, path.Y)
    assert radius.min() == pytest.approx(30.0 - distance, rel=0.03)
    apart = [path.project(x, y).e_y for x, y in zip(X, Y, strict=True)]
    assert np.sqrt(np.mean(np.square(apart))) == pytest.approx(distance, rel=1e-3)


@pytest.mark.parametrize("points", [4, 6, 40])
def test_an_open_line_that_may_move_far_becomes_one_of_constant_bending(points):
    x = np.linspace(0.0, 90.0, points)
    path = Path.from_waypoints(x, 5.0 * np.sin(x / 20.0), smoothing=1e3, minimum_radius=1.0)
    apart = [path.project(a, 5.0 * np.sin(a / 20.0)).e_y for a in x]
    assert np.abs(apart).max() < 5.0
