import numpy as np
import pytest

from identifier.speed_limits import SpeedLimits
from mpc.path import (
    Path,
    PathError,
    handling_course,
    iso_3888_2,
    speed_profile,
    steady_speed,
)
from mpc.path.speed import BRAKED

ELLIPSE = SpeedLimits.ellipse(8.0, 3.0, 6.0)
GIVEN = {"share": 1.0, "v_max": 25.0}


@pytest.fixture(scope="module", params=[handling_course, iso_3888_2])
def path(request):
    return request.param()


def circle(radius):
    angle = np.linspace(0.0, 2.0 * np.pi, 101)[:-1]
    X, Y = radius * np.cos(angle), radius * np.sin(angle)
    return Path.from_waypoints(X, Y, closed=True, name="ring")


@pytest.fixture(scope="module")
def ring():
    return circle(30.0)


def pressed(**other):
    """Limits over speed: downforce, and less to drive with than to brake."""
    small = SpeedLimits.ellipse(1.0, 0.4, 0.8)
    v = np.array([0.0, 6.0, 13.0, 30.0])
    a_y = 8.0 + 0.004 * v**2
    sides = {
        name: side._replace(most=a_y[:, None] * side.most, axle=np.tile(side.axle, (4, 1)))
        for name, side in (("push", small.push), ("brake", small.brake))
    }
    return SpeedLimits(v=v, a_y=a_y, **sides, **other)


def left(limits, side, v, a_y):
    """What turning leaves lengthwise, of limits that are even over speed: read off the table."""
    row, shares = getattr(limits, side).most[0], np.linspace(0.0, 1.0, 41)
    return np.interp(a_y / limits.a_y[0], shares, row)


def test_the_profile_keeps_every_limit_and_uses_them(path):
    found = speed_profile(path, ELLIPSE, **GIVEN)
    v, a_y = found.v, np.abs(found.a_y)
    a_x = np.diff(v**2) / (2 * path.step)
    assert v.shape == path.s.shape
    assert v.max() <= 25.0 + 1e-12
    assert a_y.max() == pytest.approx(8.0, abs=1e-9)
    # the ellipse, with the lateral share of the end from which a pass comes
    ends = np.minimum(np.where(a_x > 0.0, a_y[:-1], a_y[1:]), 8.0)
    used = (a_x / np.where(a_x > 0.0, 3.0, 6.0)) ** 2 + (ends / 8.0) ** 2
    assert used.max() <= 1.0 + 1e-6
    assert np.mean(used > 0.97) > 0.25


def test_nowhere_could_the_car_be_faster(path):
    """Everywhere the speed is what the turn, the place before or the place behind allows."""
    v = speed_profile(path, ELLIPSE, **GIVEN).v[: -1 if path.closed else None]
    square, kappa = v**2, np.abs(path.kappa[: v.size])
    rise, fall = (
        np.roll(square + 2 * path.step * use * left(ELLIPSE, side, v, square * kappa), shift)
        for side, use, shift in (("push", 1.0, 1), ("brake", BRAKED, -1))
    )
    if not path.closed:
        rise[0] = fall[-1] = np.inf
    turn = np.minimum(25.0**2, 8.0 / np.maximum(kappa, 1e-9))
    np.testing.assert_allclose(square, np.minimum(turn, np.minimum(rise, fall)), rtol=1e-9)


def test_it_says_what_limits_where():
    """A straight, a bend, a straight: brakes, turns, drives, and then the engine has no more."""
    x = np.linspace(0.0, 300.0, 61)
    bend = Path.from_waypoints(x, 40.0 * np.arctan((x - 150.0) / 20.0), name="bend")
    found = speed_profile(bend, ELLIPSE, share=1.0, v_max=60.0, engine=2.0)
    order = list(dict.fromkeys(found.limited_by))
    assert set(order) == {"brake", "turn", "drive", "engine"}
    assert found.limited_by[0] == "brake" and found.limited_by[-1] == "engine"
    assert found.limited_by[np.abs(found.a_y).argmax()] == "turn"
    assert set(found.axle) <= {"front", "rear"}
    assert set(speed_profile(bend, ELLIPSE, v_max=5.0).limited_by) == {"v_max"}


def test_downforce_lets_a_car_turn_faster_by_hand():
    """v²/R = a + b v² where the table is exact, between its speeds along its chords."""
    wide = circle(36.0 / (8.0 + 0.004 * 36.0))
    assert speed_profile(wide, pressed(), share=1.0).v.max() == pytest.approx(6.0, rel=1e-3)
    known = np.interp(9.0, [6.0, 13.0], 8.0 + 0.004 * np.array([36.0, 169.0]))
    between = circle(81.0 / known)
    assert speed_profile(between, pressed(), share=1.0).v.max() == pytest.approx(9.0, rel=1e-3)


def test_half_the_friction_is_the_root_of_two_of_the_time_in_a_bend(ring):
    dry, wet = (speed_profile(ring, ELLIPSE.scaled(mu), engine=9.0) for mu in (1.0, 0.5))
    assert wet.lap_time / dry.lap_time == pytest.approx(np.sqrt(2.0), rel=1e-6)
    half = speed_profile(ring, ELLIPSE, share=0.41)
    np.testing.assert_allclose(half.v, wet.v, rtol=1e-12)


@pytest.mark.parametrize("made", [handling_course, iso_3888_2])
def test_the_wanted_speed_is_nowhere_above_the_limits(made):
    path, limits = made(), pressed()
    found = speed_profile(path, limits, share=1.0, v_max=60.0)
    most = np.interp(found.v, limits.v, limits.a_y)
    assert (np.abs(found.a_y) <= most * (1.0 + 1e-9)).all()
    a_x = np.diff(found.v**2) / (2 * path.step)
    assert (a_x <= 0.4 * most[:-1] + 1e-9).all() and (a_x >= -0.8 * most[1:] - 1e-9).all()


def test_against_the_air_a_flying_lap_ends_as_fast_as_it_began(ring):
    """The engine holds v with a = drag v², below what the turn allows."""
    limits = pressed(drag=0.004)
    found = speed_profile(ring, limits, share=1.0, engine=0.5)
    assert found.v == pytest.approx(np.sqrt(0.5 / 0.004), rel=2e-3)
    assert set(found.limited_by) == {"engine"}


def test_an_engine_gives_what_its_table_says():
    straight = Path.from_waypoints([0.0, 100.0], [0.0, 0.0])
    tabled = ([0.0, 10.0, 20.0], [3.0, 3.0, 1.0])
    found = speed_profile(
        straight, SpeedLimits.ellipse(9.0), engine=tabled, v_max=40.0, start=(0, 10)
    )
    a_x = np.diff(found.v**2) / (2 * straight.step)
    np.testing.assert_allclose(a_x, np.interp(found.v[:-1], *tabled), rtol=1e-6)


def test_a_start_changes_the_speed_by_no_more_than_the_car_can(path):
    whole = speed_profile(path, ELLIPSE, **GIVEN)
    s, slow = 0.3 * path.length, 0.6 * float(whole.at(0.3 * path.length))
    found = speed_profile(path, ELLIPSE, start=(s, slow), **GIVEN)
    assert float(found.at(s)) == pytest.approx(slow)
    fine = s + np.arange(0.0, path.length if path.closed else 80.0, path.step)
    v = found.at(fine)
    assert (np.diff(v**2) / (2 * path.step)).max() <= 3.001
    assert (v <= whole.at(fine) * (1.0 + 1e-9)).all()
    assert v[-1] == pytest.approx(float(whole.at(fine[-1])), rel=1e-4), "and then it is the whole"
    times = np.array([found.time_at(float(place)) for place in fine])
    assert times[0] == 0.0
    np.testing.assert_allclose(found.place(times), fine, atol=1e-6)
    pace = 0.5 * (1 / v[1:] + 1 / v[:-1])
    np.testing.assert_allclose(np.diff(times), path.step * pace, rtol=0.01)
    np.testing.assert_allclose(found.v[found.s >= s], found.at(found.s[found.s >= s]))
    assert set(found.limited_by[(found.s >= s) & (found.s < s + 2.0)]) <= {"drive", "engine"}
    standing = speed_profile(path, ELLIPSE, start=(0.0, 3.0), **GIVEN)
    assert standing.v[0] == 3.0 and standing.lap_time > whole.lap_time
    assert standing.lap_time == pytest.approx(standing.time_at(path.length), rel=1e-6)


def test_a_straight_is_driven_at_v_max_and_has_no_limit_of_its_own():
    straight = Path.from_waypoints([0.0, 100.0], [0.0, 0.0])
    assert speed_profile(straight, ELLIPSE, **GIVEN).v == pytest.approx(25.0)
    with pytest.raises(PathError, match="nothing limits the speed: give v_max"):
        speed_profile(straight, ELLIPSE)
    with pytest.raises(PathError, match="has no turn"):
        steady_speed(straight, a_y_max=8.0)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"share": 0.0}, "share must be positive and finite, it is 0.0"),
        ({"engine": 0.0}, "engine must be positive and finite, it is 0.0"),
        ({"engine": ([0.0, 5.0], [0.0, 1.0])}, "engine must give 0 m/s² or more, and more at"),
        ({"engine": ([5.0, 0.0], [1.0, 1.0])}, "engine must be rising speeds and one accel"),
        ({"engine": ([], [])}, "engine must be rising speeds and one accel"),
        ({"brakes": -1.0}, "brakes must be positive"),
        ({"v_max": np.inf}, "v_max must be positive and finite"),
        ({"start": (1e4, 5.0)}, "arc length of the start must lie between 0 and"),
        ({"start": (0.0, 0.0)}, "speed of the start must be positive"),
        ({"start": (0.0, 80.0)}, r"from s = 0 m on .* m/s leave room to brake .* begin slower"),
    ],
)
def test_what_is_no_profile_is_one_clear_line(given, said):
    with pytest.raises(ValueError, match=said) as caught:
        speed_profile(iso_3888_2(), ELLIPSE, **given)
    assert "\n" not in str(caught.value)


def test_the_steady_speed_takes_its_acceleration_at_the_tightest_place(path):
    v = steady_speed(path, a_y_max=8.73)
    assert np.max(np.abs(path.kappa)) * v**2 == pytest.approx(8.73)


def test_a_circle_is_a_turn_however_wide_it_is():
    angle, radius = np.linspace(0.0, 2 * np.pi, 60)[:-1], 2e6
    X, Y = radius * np.cos(angle), radius * np.sin(angle)
    wide = Path.from_waypoints(X, Y, closed=True, spacing=2e4)
    assert wide.peak_curvature < 1e-6, "of 1 m nearly a straight, of a lap a full turn"
    assert steady_speed(wide, a_y_max=8.0) == pytest.approx(np.sqrt(8.0 * radius), rel=2e-3)
