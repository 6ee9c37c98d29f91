"""A circle for steady cornering, and a closed handling course of our own design."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import radians
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from codegen.arrays import Array
from mpc.path.gates import SPACING, iso_3888_1, iso_3888_2, slalom
from mpc.path.line import Line, PathError, line_from_heading
from mpc.path.path import Path

# Paths of straights and turns, whose curvature rises and falls smoothly between them.
#
# Over the easing of a turn, κ goes from 0 to 1/R as 3 u² - 2 u³: dκ/ds is continuous. The turn of
# the heading over an easing is half that of the same length at 1/R.


@dataclass(frozen=True, slots=True, kw_only=True)
class Straight:
    """A straight.   length : [m]."""

    length: float
    angle = 0.0  # heading gained [rad]

    def __post_init__(self) -> None:
        if not (self.length > 0.0 and math.isfinite(self.length)):
            raise PathError(f"length of a straight must be positive, it is {self.length}")

    def heading(self, s: Array) -> tuple[Array, Array]:
        """Return ψ [rad] since the start of the section and κ [1/m], (k,) each.
        s : since the start of the section [m], (k,).
        """
        return np.zeros_like(s), np.zeros_like(s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """A turn at constant radius between two easings, which it must have room for.
    radius : of the constant part [m].
    angle : heading gained over all of it [rad], > 0 to the left.
    easing : length over which the curvature rises, and falls again [m].
    """

    radius: float
    angle: float
    easing: float

    @property
    def length(self) -> float:
        """Both easings and the constant part [m]."""
        return abs(self.angle) * self.radius + self.easing

    def heading(self, s: Array) -> tuple[Array, Array]:
        """Return ψ [rad] since the start of the section and κ [1/m], (k,) each.
        s : since the start of the section [m], (k,).
        """
        peak = math.copysign(1.0 / self.radius, self.angle)
        into = np.clip(s / self.easing, 0.0, 1.0)
        out = np.clip((self.length - s) / self.easing, 0.0, 1.0)
        plateau = np.clip(s - self.easing, 0.0, self.length - 2.0 * self.easing)
        rise, fall = into**3 - 0.5 * into**4, 0.5 - (out**3 - 0.5 * out**4)  # ∫ 3 u² - 2 u³
        psi = peak * (self.easing * (rise + fall) + plateau)
        smaller = np.minimum(into, out)
        return psi, peak * smaller**2 * (3.0 - 2.0 * smaller)


Section: TypeAlias = Straight | Turn


def line_along(sections: Sequence[Section]) -> Line:
    """Put sections one after another, from the origin along X."""
    starts = np.append(0.0, np.cumsum([section.length for section in sections]))
    headings = np.append(0.0, np.cumsum([section.angle for section in sections]))
    steps = max(4, math.ceil(starts[-1] / SPACING - 1e-9))
    s = np.linspace(0.0, starts[-1], 4 * steps + 1)
    which = np.clip(np.searchsorted(starts, s, side="right") - 1, 0, len(sections) - 1)
    psi, kappa = np.empty_like(s), np.empty_like(s)
    for i, section in enumerate(sections):
        inside = which == i
        turned, kappa[inside] = section.heading(s[inside] - starts[i])
        psi[inside] = headings[i] + turned
    return line_from_heading(psi, kappa, float(starts[-1]) / steps)


def constant_radius(radius: float = 40.0, *, turns: float = 1.5) -> Path:
    """Return a straight, turns to the left at constant radius and another straight, as in ISO 4138.

    The curvature rises and falls over a length of radius/2, at most 20 m. With more than one turn
    the path passes places again: project onto it with `near`.

    Parameters
    ----------
    radius : [m].
    turns : how often the car goes round [-].
    """
    if not (radius > 0.0 and turns >= 0.1 and math.isfinite(radius * turns)):
        raise PathError(f"radius must be positive and turns 0.1 at least: {radius} m, {turns}")
    turn = Turn(radius=radius, angle=2.0 * math.pi * turns, easing=min(0.5 * radius, 20.0))
    straight = Straight(length=30.0)
    line = line_along([straight, turn, straight])
    center = straight.length + 0.5 * turn.easing, radius
    around = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
    ring = np.column_stack((np.cos(around), np.sin(around))) * (0.9 * radius) + center
    return Path.from_line(line, name=f"circle of {radius:g} m", cones=ring)


def handling_course() -> Path:
    """Return a closed course, 802 m a lap, driven counter-clockwise.

    Seven left and three right turns of 12 to 60 m; the hairpin to the right runs 25 m beside its
    own entrance, and the turns into and out of it have 30 and 18 m. It starts on a straight.

    Examples
    --------
    >>> course = handling_course()
    >>> f"{course.length:.0f} m, tightest radius {1.0 / course.peak_curvature:.1f} m"
    '802 m, tightest radius 12.0 m'
    """
    sections: list[Section] = [
        Straight(length=51.1838346911392),  # this one and the last close the course
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
        Straight(length=21.593884724428456),
        Turn(radius=25.0, angle=radians(130.0), easing=10.0),
    ]
    line = line_along(sections)
    path = Path.from_line(line, name="handling course", closed=True)
    X, Y, psi = path.pose(np.linspace(0.0, path.length, round(path.length / 8.0), endpoint=False))
    across = 2.5 * np.column_stack((-np.sin(psi), np.cos(psi)))
    middle = np.column_stack((X, Y))
    cones = np.vstack((middle + across, middle - across))  # in pairs, about every 8 m
    return Path.from_line(line, name=path.name, closed=True, cones=cones)


BUILT_IN: Mapping[str, Callable[[], Path]] = MappingProxyType(
    {
        "iso-3888-1": iso_3888_1, "iso-3888-2": iso_3888_2, "slalom": slalom,
        "circle": constant_radius, "course": handling_course,
    }
)  # fmt: skip
