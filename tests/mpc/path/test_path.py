import doctest
import importlib

import numpy as np
import pytest

from mpc.path import BUILT_IN, Path, PathError
from mpc.path.line import Line
from mpc.path.path import NO_CONES

WAYPOINTS = ([0.0, 20.0, 45.0, 60.0, 50.0, 20.0], [0.0, -5.0, 5.0, 30.0, 45.0, 35.0])


@pytest.fixture(scope="module", params=[*BUILT_IN, "way-points", "ring"])
def path(request):
    if request.param in BUILT_IN:
        return BUILT_IN[request.param]()
    return Path.from_waypoints(*WAYPOINTS, closed=request.param == "ring")


@pytest.fixture(scope="module")
def course():
    return BUILT_IN["course"]()


def fields_of(path, **changes):
    arrays = {name: getattr(path, name) for name in ("s", "X", "Y", "psi", "kappa")}
    return {"name": "planted", "closed": path.closed, **arrays, **changes}


def test_over_arc_length_heading_is_the_direction_and_curvature_its_rate(path, rng):
    s, h = rng.uniform(0.01, path.length - 0.01, 5000), 1e-4
    X_0, Y_0, psi_0 = path.pose(s - h)
    X_1, Y_1, psi_1 = path.pose(s + h)
    assert np.abs(np.hypot(X_1 - X_0, Y_1 - Y_0) / (2 * h) - 1.0).max() < 1e-6
    direction = np.arctan2(Y_1 - Y_0, X_1 - X_0)
    off = np.abs(np.angle(np.exp(1j * (direction - path.pose(s)[2]))))
    assert off.max() < 2e-5
    assert np.abs((psi_1 - psi_0) / (2 * h) - path.curvature(s)).max() < 3e-3 * path.peak_curvature


def test_curvature_has_no_jump_not_even_where_a_lap_or_the_path_ends(path):
    s = np.linspace(-1.0, path.length + 1.0, 200_000)
    step = s[1] - s[0]
    jump = np.abs(np.diff(path.curvature(s))).max()
    assert jump < 0.4 * path.peak_curvature * step  # from zero to the peak in 2.5 m at the least


def test_a_closed_path_counts_laps_and_turns(course, rng):
    s = rng.uniform(0.0, course.length, 200)
    for laps in (-2, 1, 3):
        X, Y, psi = course.pose(s + laps * course.length)
        np.testing.assert_allclose((X, Y), course.pose(s)[:2], atol=1e-9)
        np.testing.assert_allclose(psi, course.pose(s)[2] + laps * 2 * np.pi, atol=1e-9)
        np.testing.assert_allclose(
            course.curvature(s + laps * course.length), course.curvature(s), atol=1e-10
        )


def test_an_open_path_goes_straight_on_beyond_its_ends():
    path = Path.from_waypoints(*WAYPOINTS)
    for end, beyond in ((0.0, -7.0), (path.length, 7.0)):
        X, Y, psi = path.pose(end)
        assert path.pose(end + beyond) == pytest.approx(
            (X + beyond * np.cos(psi), Y + beyond * np.sin(psi), psi)
        )
        assert path.curvature(end + beyond) == 0.0


def test_values_along_a_path_wrap_with_the_laps_and_hold_at_open_ends(course):
    speed = 10.0 + 0.01 * course.s
    speed[-1] = speed[0]
    assert course.along(speed, 100.3 + 2 * course.length) == pytest.approx(11.003)
    path = Path.from_waypoints(*WAYPOINTS)
    assert path.along(path.s, [-5.0, 3.3, path.length + 5.0]) == pytest.approx(
        [0.0, 3.3, path.length]
    )


def test_arrays_cannot_be_written_and_are_not_those_of_the_caller(course):
    kappa = course.kappa.copy()
    copy = Path(**fields_of(course, kappa=kappa))
    kappa[:] = 9.0
    assert copy.peak_curvature == pytest.approx(course.peak_curvature)
    with pytest.raises(ValueError, match="read-only"):
        copy.kappa[0] = 1.0
    assert copy.cones.shape == NO_CONES.shape == (0, 2)


def test_samples_that_are_no_curve_over_arc_length_are_refused(course):
    bad_X = course.X.copy()
    bad_X[700] += 0.02
    gap = course.X.copy()
    gap[0] = np.nan
    for changes, message in (
        ({"X": course.X[:-1]}, r"X must have shape \(3210,\)|X must have shape"),
        ({"X": gap}, "X must be finite"),
        ({"s": course.s**1.1}, "equal steps"),
        ({"s": course.s + 1.0}, "from 0"),
        ({"X": bad_X}, r"one curve over s, at s = 17\d"),
        ({"kappa": -course.kappa}, "one curve"),
        ({"X": course.Y, "Y": course.X}, "one curve"),
        ({"s": 2.0 * course.s}, "one curve"),
        ({"cones": np.zeros((3, 3))}, r"cones must have shape \(3, 2\)"),
    ):
        with pytest.raises(PathError, match=message):
            Path(**fields_of(course, **changes))


def test_samples_too_coarse_for_the_turns_are_refused():
    angle = np.arange(20) * 0.35
    line = Line(
        12.0 * angle, 12 * np.sin(angle), 12 - 12 * np.cos(angle), angle, angle * 0 + 1 / 12
    )
    with pytest.raises(PathError, match=r"turn by at most 0.3 rad.*finer than 4.2 m"):
        Path.from_line(line, name="coarse")


def test_examples_in_the_documentation_are_true():
    tried = 0
    for name in ("path", "gates", "courses"):
        module = importlib.import_module(f"mpc.path.{name}")
        failed, count = doctest.testmod(module, extraglobs={"np": np})
        assert not failed
        tried += count
    assert tried >= 7
