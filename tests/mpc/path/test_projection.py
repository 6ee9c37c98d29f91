import numpy as np
import pytest

from mpc.path import BUILT_IN, Path, constant_radius, handling_course
from mpc.path.courses import Straight, Turn, line_along

# Two legs, 6 m apart, 40 m long, joined by a turn of 3 m with easings.
HAIRPIN = Path.from_line(
    line_along(
        [Straight(length=40.0), Turn(radius=2.5, angle=np.pi, easing=1.5), Straight(length=40.0)],
    ),
    name="hairpin",
)


def beside(path, s, e_y):
    X, Y, psi = path.pose(s)
    return float(X - e_y * np.sin(psi)), float(Y + e_y * np.cos(psi))


@pytest.mark.parametrize("name", BUILT_IN)
def test_points_beside_the_path_are_found_again(name, rng):
    path = BUILT_IN[name]()
    for _ in range(300):
        s, e_y = rng.uniform(0.0, path.length), rng.uniform(-2.0, 2.0)
        found = path.project(*beside(path, s, e_y), near=s + rng.uniform(-3.0, 3.0))
        assert found.s == pytest.approx(s, abs=1e-6)
        assert found.e_y == pytest.approx(e_y, abs=1e-7)
        assert found.psi == pytest.approx(float(path.pose(s)[2]), abs=1e-7)
        assert found.kappa == pytest.approx(float(path.curvature(s)), abs=1e-6)


def test_without_a_hint_the_nearest_point_of_all_is_found(rng):
    path = handling_course()
    fine = np.arange(0.0, path.length, 0.01)
    X, Y, _ = path.pose(fine)
    for x, y in rng.uniform((-40.0, -10.0), (190.0, 220.0), (200, 2)):
        found = path.project(x, y)
        assert abs(found.e_y) == pytest.approx(np.hypot(X - x, Y - y).min(), abs=1e-4)
        assert 0.0 <= found.s < path.length


def test_a_car_between_the_legs_of_a_hairpin_stays_on_its_own():
    gap = float(HAIRPIN.Y[-1])
    x = np.arange(5.0, 35.0, 0.2)
    s = 5.0
    for X in x:  # on the way out, 70 % of the gap to the left: nearer to the way back
        here = HAIRPIN.project(X, 0.7 * gap, near=s)
        assert here.s == pytest.approx(X, abs=1e-6)
        assert here.e_y == pytest.approx(0.7 * gap)
        s = here.s
    assert HAIRPIN.project(20.0, 0.7 * gap).s > 60.0  # what the nearest point would have said


def test_laps_are_counted_forwards_and_backwards():
    path = handling_course()
    for direction in (1.0, -1.0):
        s = 0.0
        for true in direction * np.arange(0.0, 3.0 * path.length, 0.9):
            s = path.project(*beside(path, true, 0.8), near=s).s
            assert s == pytest.approx(true, abs=1e-6)
        assert abs(s) > 2.99 * path.length


def test_beyond_the_ends_s_goes_on():
    path = Path.from_waypoints([0.0, 30.0, 60.0], [0.0, 4.0, 0.0])
    for s in (-300.0, -4.0, path.length + 4.0, path.length + 300.0):
        for near in (None, s + 1.0):
            found = path.project(*beside(path, s, 1.5), near=near)
            assert (found.s, found.e_y, found.kappa) == pytest.approx((s, 1.5, 0.0), abs=1e-6)


def test_the_search_stops_at_its_reach():
    path = Path.from_waypoints([0.0, 100.0], [0.0, 0.0])
    assert path.project(90.0, 1.0, near=20.0).s == pytest.approx(30.0)


def test_a_car_in_the_center_of_a_turn_gets_an_answer():
    path = constant_radius(12.0)
    X, Y = beside(path, 60.0, 12.0)
    for offset in (-0.1, 0.0, 0.1):
        found = path.project(X + offset, Y, near=60.0)
        assert abs(found.s - 60.0) <= 10.0
        assert found.e_y == pytest.approx(12.0, abs=0.2)


def test_heading_errors_are_told_within_half_a_turn():
    here = handling_course().project(0.0, 0.0, near=802.0)
    assert here.psi == pytest.approx(2 * np.pi, abs=0.01)
    assert here.heading_error(0.1) == pytest.approx(0.1, abs=0.01)
    assert here.heading_error(-0.1 + 6 * np.pi) == pytest.approx(-0.1, abs=0.01)
