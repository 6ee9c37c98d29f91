import numpy as np
import pytest

from mpc.path import Path, PathError


def circle(n, radius=30.0, gaps=None):
    gaps = np.ones(n) if gaps is None else gaps
    angle = 2 * np.pi * np.append(0.0, np.cumsum(gaps)[:-1]) / np.sum(gaps)
    return radius * np.cos(angle), radius * np.sin(angle)


def test_points_on_a_circle_give_a_circle_however_they_are_spaced(rng):
    for gaps in (np.ones(40), rng.uniform(0.5, 1.5, 40)):
        path = Path.from_waypoints(*circle(40, gaps=gaps), closed=True)
        assert np.hypot(path.X, path.Y) == pytest.approx(30.0, abs=2e-3)
        assert path.kappa == pytest.approx(1 / 30.0, rel=0.02)
        assert path.length == pytest.approx(60 * np.pi, rel=1e-4)
        assert path.lap_turn == pytest.approx(2 * np.pi, abs=1e-9)


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


def test_two_points_are_a_straight():
    path = Path.from_waypoints([0.0, 30.0], [0.0, 40.0])
    assert path.length == pytest.approx(50.0)
    assert path.peak_curvature < 1e-12
    assert path.psi == pytest.approx(np.arctan2(4.0, 3.0))


def test_a_repeated_last_way_point_of_a_ring_is_the_same_ring():
    X, Y = circle(24)
    once = Path.from_waypoints(X, Y, closed=True)
    again = Path.from_waypoints(np.append(X, X[0]), np.append(Y, Y[0] + 1e-12), closed=True)
    np.testing.assert_allclose(again.X, once.X, atol=1e-9)


@pytest.mark.parametrize(
    ("X", "Y", "options", "message"),
    [
        ([0.0, 1.0], [0.0], {}, r"\(2,\) and \(1,\)"),
        ([[0.0, 1.0]], [[0.0, 1.0]], {}, "alike"),
        ([0.0, 10.0, np.nan], [0.0, 0.0, 0.0], {}, "number 3 is"),
        (
            [0.0, 10.0, 10.0, 20.0],
            [0.0, 1.0, 1.0, 2.0],
            {},
            r"numbers 2 and 3 are both \[10.0, 1.0\]",
        ),
        ([0.0], [0.0], {}, "at least 2 different way-points, it has 1"),
        ([], [], {}, "it has 0"),
        ([0.0, 0.0], [0.0, 0.0], {}, "numbers 1 and 2"),
        ([0.0, 10.0, 10.0, 0.0], [0.0, 0.0, 10.0, 0.0], {"closed": True}, "at least 4"),
        ([0.0, 10.0, 0.0], [0.0, 0.0, 0.1], {}, r"tighter than 3.0 m, at s = "),
        ([0.0, 20.0, 40.0], [0.0, 5.0, 0.0], {"minimum_radius": 500.0}, "tighter than 500"),
        ([0.0, 20.0], [0.0, 5.0], {"minimum_radius": np.nan}, "minimum_radius must be positive"),
        ([0.0, 20.0], [0.0, 5.0], {"spacing": 0.0}, "way-points: spacing must be"),
        ([0.0, 20.0], [0.0, 5.0], {"spacing": 15.0}, "quarter of the length"),
    ],
)
def test_bad_way_points_are_named(X, Y, options, message):
    with pytest.raises(PathError, match=message):
        Path.from_waypoints(X, Y, **options)
