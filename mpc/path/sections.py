"""Paths of straights and turns, whose curvature rises and falls smoothly between them.

Over the easing of a turn, κ goes from 0 to 1/R as 3 u² - 2 u³: dκ/ds is continuous. The turn of the
heading over an easing is half that of the same length at 1/R.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from mpc.path.line import Array, Line, PathError, line_from_heading

SHORTEST_FREE = 1.0  # m, of a straight that closes a course


@dataclass(frozen=True, slots=True, kw_only=True)
class Straight:
    """A straight.

    Parameters
    ----------
    length : [m].

    Raises
    ------
    PathError
        Where it is not positive and finite.
    """

    length: float

    def __post_init__(self) -> None:
        if not (self.length > 0.0 and math.isfinite(self.length)):
            raise PathError(f"length of a straight must be positive, it is {self.length}")

    def heading(self, s: Array) -> tuple[Array, Array]:
        """Return ψ [rad] since the start of the section and κ [1/m], (k,) each.

        Parameters
        ----------
        s : since the start of the section [m], (k,).
        """
        return np.zeros_like(s), np.zeros_like(s)

    @property
    def angle(self) -> float:
        """Heading gained [rad]."""
        return 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """A turn at constant radius between two easings.

    Parameters
    ----------
    radius : of the constant part [m].
    angle : heading gained over all of it [rad], > 0 to the left.
    easing : length over which the curvature rises, and falls again [m].

    Raises
    ------
    PathError
        Where a number is not finite, radius or easing not positive, angle zero, or the angle too
        small for the easing.
    """

    radius: float
    angle: float
    easing: float

    def __post_init__(self) -> None:
        if not (self.radius > 0.0 and self.easing > 0.0 and math.isfinite(self.length)):
            raise PathError(f"radius and easing of a turn must be positive and finite: {self}")
        if abs(self.angle) * self.radius < self.easing:
            raise PathError(
                f"a turn by {self.angle:.4g} rad at {self.radius} m has an easing of at most "
                f"{abs(self.angle) * self.radius:.4g} m, it is {self.easing}"
            )

    @property
    def length(self) -> float:
        """Both easings and the constant part [m]."""
        return abs(self.angle) * self.radius + self.easing

    def heading(self, s: Array) -> tuple[Array, Array]:
        """Return ψ [rad] since the start of the section and κ [1/m], (k,) each.

        Parameters
        ----------
        s : since the start of the section [m], (k,).
        """
        peak = math.copysign(1.0 / self.radius, self.angle)
        into = np.clip(s / self.easing, 0.0, 1.0)
        out = np.clip((self.length - s) / self.easing, 0.0, 1.0)
        held = np.clip(s - self.easing, 0.0, self.length - 2.0 * self.easing)
        rise, fall = into**3 - 0.5 * into**4, 0.5 - (out**3 - 0.5 * out**4)  # ∫ 3 u² - 2 u³
        psi = peak * (self.easing * (rise + fall) + held)
        smaller = np.minimum(into, out)
        return psi, peak * smaller**2 * (3.0 - 2.0 * smaller)


Section: TypeAlias = Straight | Turn


def line_along(sections: Sequence[Section], *, spacing: float = 0.25) -> Line:
    """Put sections one after another, from the origin along X.

    Parameters
    ----------
    sections : in driving order.
    spacing : longest step of the samples [m].

    Raises
    ------
    PathError
        Where spacing is not positive or there is no section.
    """
    if not (spacing > 0.0 and sections):
        raise PathError(f"{len(sections)} sections cannot be sampled every {spacing} m")
    starts = np.append(0.0, np.cumsum([section.length for section in sections]))
    headings = np.append(0.0, np.cumsum([section.angle for section in sections]))
    steps = max(4, math.ceil(starts[-1] / spacing - 1e-9))
    s = np.linspace(0.0, starts[-1], 4 * steps + 1)
    which = np.clip(np.searchsorted(starts, s, side="right") - 1, 0, len(sections) - 1)
    psi, kappa = np.empty_like(s), np.empty_like(s)
    for i, section in enumerate(sections):
        inside = which == i
        turned, kappa[inside] = section.heading(s[inside] - starts[i])
        psi[inside] = headings[i] + turned
    return line_from_heading(psi, kappa, float(starts[-1]) / steps)


def close(sections: Sequence[Section], free: tuple[int, int]) -> list[Section]:
    """Choose the lengths of two straights so that the course ends where it starts.

    Parameters
    ----------
    sections : in driving order; they must turn by a multiple of 2 pi altogether.
    free : which two sections are straights of free length; they must not be parallel.

    Raises
    ------
    PathError
        Where a rule is broken or a straight would need a negative length.
    """
    turned = sum(section.angle for section in sections)
    if abs(math.remainder(turned, 2.0 * math.pi)) > 1e-9 or turned == 0.0:
        raise PathError(f"a closed course must turn by 2 pi or a multiple, it turns by {turned}")
    line = line_along(sections)
    headings = np.append(0.0, np.cumsum([section.angle for section in sections]))[list(free)]
    directions = np.array([np.cos(headings), np.sin(headings)])
    if abs(np.linalg.det(directions)) < 0.1:
        raise PathError(f"straights {free} must not be parallel, they head {headings.tolist()}")
    missing = np.linalg.solve(directions, [-line.X[-1], -line.Y[-1]])
    closed = list(sections)
    for i, more in zip(free, missing, strict=True):
        length = closed[i].length + float(more)
        if not (isinstance(closed[i], Straight) and length >= SHORTEST_FREE):
            raise PathError(f"section {i} cannot close the course with a length of {length:.4g} m")
        closed[i] = Straight(length=length)
    return closed
