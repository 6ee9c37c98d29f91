import numpy as np
import pytest

from mpc.path import Path, PathError, grip_speed, handling_course, iso_3888_2, steady_speed

LIMITS = {"a_y_max": 8.0, "v_max": 25.0, "a_accel": 3.0, "a_brake": 6.0}


@pytest.fixture(scope="module", params=[handling_course, iso_3888_2])
def path(request):
    return request.param()


def test_the_profile_keeps_every_limit_and_uses_them(path):
    v = grip_speed(path, **LIMITS)
    a_y = v**2 * np.abs(path.kappa)
    a_x = np.diff(v**2) / (2 * path.step)
    assert v.shape == path.s.shape
    assert v.max() <= 25.0 + 1e-12
    assert a_y.max() == pytest.approx(8.0, abs=1e-9)
    assert a_x.max() <= 3.0 + 1e-9
    assert a_x.min() >= -6.0 - 1e-9
    # the ellipse, with the lateral share of the end from which a pass comes
    ends = np.where(a_x > 0.0, a_y[:-1], a_y[1:])
    used = (a_x / np.where(a_x > 0.0, 3.0, 6.0)) ** 2 + (ends / 8.0) ** 2
    assert used.max() <= 1.0 + 1e-6
    assert np.mean(used > 0.99) > 0.25


def test_nowhere_could_the_car_be_faster(path):
    """Everywhere the speed is what the turn, the place before or the place behind allows."""
    square = grip_speed(path, **LIMITS)[: -1 if path.closed else None] ** 2
    bend = np.abs(path.kappa[: square.size]) / 8.0
    left = np.sqrt(np.maximum(0.0, 1.0 - (square * bend) ** 2))
    rise = np.roll(square + 2 * 3.0 * path.step * left, 1)
    fall = np.roll(square + 2 * 6.0 * path.step * left, -1)
    if not path.closed:
        rise[0] = fall[-1] = np.inf
    turn = np.minimum(25.0**2, 1.0 / np.maximum(bend, 1e-9))
    np.testing.assert_allclose(square, np.minimum(turn, np.minimum(rise, fall)), rtol=1e-9)


def test_a_straight_is_driven_at_v_max_and_has_no_limit_of_its_own():
    straight = Path.from_waypoints([0.0, 100.0], [0.0, 0.0])
    assert grip_speed(straight, **LIMITS) == pytest.approx(25.0)
    with pytest.raises(PathError, match="has no turn"):
        steady_speed(straight, a_y_max=8.0)


def test_the_steady_speed_takes_its_share_at_the_tightest_place(path):
    v = steady_speed(path, a_y_max=9.0, share=0.97)
    assert np.max(np.abs(path.kappa)) * v**2 == pytest.approx(0.97 * 9.0)


def test_a_circle_is_a_turn_however_wide_it_is():
    angle, radius = np.linspace(0.0, 2 * np.pi, 60)[:-1], 2e6
    X, Y = radius * np.cos(angle), radius * np.sin(angle)
    wide = Path.from_waypoints(X, Y, closed=True, spacing=2e4)
    assert wide.peak_curvature < 1e-6, "of 1 m nearly a straight, of a lap a full turn"
    assert steady_speed(wide, a_y_max=8.0) == pytest.approx(np.sqrt(8.0 * radius), rel=2e-3)
