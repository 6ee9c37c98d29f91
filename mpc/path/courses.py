"""A circle for steady cornering, and a closed handling course of our own design."""

import math
from math import radians

import numpy as np

from mpc.path.line import Array, PathError
from mpc.path.path import Path
from mpc.path.sections import Section, Straight, Turn, close, line_along


def constant_radius(
    radius: float = 40.0,
    *,
    turns: float = 1.5,
    left: bool = True,
    run_in: float = 30.0,
    spacing: float = 0.25,
) -> Path:
    """Return a straight, turns at constant radius and another straight, as in ISO 4138.

    The curvature rises and falls over a length of radius/2, at most 20 m. With more than one turn
    the path passes places again: project onto it with `near`.

    Parameters
    ----------
    radius : [m].
    turns : how often the car goes round [-].
    left : whether to the left.
    run_in : straights before and after [m].
    spacing : longest step of the samples [m].

    Raises
    ------
    PathError
        Where a number is out of range.
    """
    if not (radius > 0.0 and turns >= 0.1 and math.isfinite(radius * turns)):
        raise PathError(f"radius must be positive and turns 0.1 at least: {radius} m, {turns}")
    angle = math.copysign(2.0 * math.pi * turns, 1.0 if left else -1.0)
    turn = Turn(radius=radius, angle=angle, easing=min(0.5 * radius, 20.0))
    straight = Straight(length=run_in)
    line = line_along([straight, turn, straight], spacing=spacing)
    center = run_in + 0.5 * turn.easing, math.copysign(radius, angle)
    around = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
    ring = np.column_stack((np.cos(around), np.sin(around))) * (0.9 * radius) + center
    return Path.from_line(line, name=f"circle of {radius:g} m", cones=ring)


def handling_course(*, spacing: float = 0.25) -> Path:
    """Return a closed course, 802 m a lap, driven counter-clockwise.

    Seven left and three right turns of 12 to 60 m; the hairpin to the right runs 25 m beside its
    own entrance, and the turns into and out of it have 30 and 18 m. It starts on a straight.

    Parameters
    ----------
    spacing : longest step of the samples [m].

    Raises
    ------
    PathError
        Where spacing is not positive.

    Examples
    --------
    >>> course = handling_course()
    >>> f"{course.length:.0f} m, tightest radius {1.0 / course.peak_curvature:.1f} m"
    '802 m, tightest radius 12.0 m'
    """
    sections: list[Section] = [
        Straight(length=50.0),
        Turn(radius=30.0, angle=radians(110.0), easing=12.0),
        Straight(length=30.0),
        Turn(radius=12.0, angle=radians(-180.0), easing=7.0),
        Straight(length=35.0),
        Turn(radius=18.0, angle=radians(120.0), easing=8.0),
        Straight(length=20.0),
        Turn(radius=60.0, angle=radians(60.0), easing=20.0),
        Straight(length=30.0),
        Turn(radius=40.0, angle=radians(90.0), easing=15.0),
        Turn(radius=22.0, angle=radians(-70.0), easing=9.0),
        Turn(radius=15.0, angle=radians(100.0), easing=8.0),
        Straight(length=40.0),
        Turn(radius=45.0, angle=radians(55.0), easing=16.0),
        Straight(length=10.0),
        Turn(radius=35.0, angle=radians(-55.0), easing=14.0),
        Straight(length=30.0),
        Turn(radius=25.0, angle=radians(130.0), easing=10.0),
    ]
    line = line_along(close(sections, (0, 16)), spacing=spacing)
    path = Path.from_line(line, name="handling course", closed=True)
    return Path.from_line(line, name=path.name, closed=True, cones=pairs_beside(path))


def pairs_beside(path: Path, *, gap: float = 8.0, half_width: float = 2.5) -> Array:
    """Return pairs of cones on both sides of a path, X and Y [m], (k, 2).

    Parameters
    ----------
    path : between the cones.
    gap : about the distance from pair to pair along the path [m].
    half_width : from the path to a cone [m].
    """
    s = np.linspace(0.0, path.length, max(2, round(path.length / gap)), endpoint=not path.closed)
    X, Y, psi = path.pose(s)
    across = half_width * np.column_stack((-np.sin(psi), np.cos(psi)))
    middle = np.column_stack((X, Y))
    return np.vstack((middle + across, middle - across))
