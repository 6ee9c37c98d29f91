import numpy as np
import pytest

from mpc.path import constant_radius, handling_course


@pytest.fixture(scope="module")
def course():
    return handling_course()


def test_the_course_has_turns_of_many_radii_to_both_sides(course):
    held = np.abs(np.diff(course.kappa)) < 1e-9
    radii = np.unique((1 / course.kappa[:-1][held & (np.abs(course.kappa[:-1]) > 1e-3)]).round(3))
    assert sorted(radii) == pytest.approx([-35, -22, -12, 15, 18, 25, 30, 40, 45, 60], abs=1e-3)
    assert 700.0 < course.length < 1000.0
    assert course.lap_turn == pytest.approx(2 * np.pi)
    assert abs(course.kappa[0]) < 1e-9 and abs(course.curvature(30.0)) < 1e-9


def test_a_circle_is_entered_and_left_gently():
    path = constant_radius(25.0, turns=1.25)
    assert path.lap_turn == pytest.approx(2.5 * np.pi)
    assert path.kappa.max() == pytest.approx(1 / 25.0)
    assert np.all(path.kappa >= 0.0)
    middle = (path.s > 50.0) & (path.s < path.length - 50.0)
    X = path.X - 25.0 * np.sin(path.psi)
    Y = path.Y + 25.0 * np.cos(path.psi)
    center = X[middle][0], Y[middle][0]
    np.testing.assert_allclose(X[middle], center[0], atol=1e-6)
    np.testing.assert_allclose(Y[middle], center[1], atol=1e-6)
    assert np.hypot(*(path.cones - center).T).max() < 25.0


def test_cones_stand_beside_the_path(course):
    cones = course.cones
    near = [course.project(x, y).e_y for x, y in cones]
    half = len(cones) // 2
    assert near == pytest.approx([2.5] * half + [-2.5] * half, abs=1e-6)
    assert len(cones) == 2 * round(course.length / 8.0)
