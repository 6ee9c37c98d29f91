"""The path that a car is to follow: X, Y, heading and curvature over arc length.

s: arc length [m], e_y > 0 left of the path, κ > 0 turns left. Between the samples X and Y are
quintics with the slopes cos ψ and sin ψ, ψ a cubic with the slope κ, and κ is linear: |dP/ds| = 1
to 1e-6 and κ continuous.
An open path goes on straight beyond both ends; a closed one counts laps, s may be any number.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path as FilePath
from typing import NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from codegen.arrays import Array
from mpc.path.line import Ends, Line, PathError, check_line
from mpc.path.waypoints import line_through, read_waypoints

_LONGEST_STEP = 1.0  # m; shorter than any turn that a car can drive, so that no step skips a bend
_SMALLEST_SLOPE = 0.3  # of 1 - κ e_y: near the center of a turn every s is as close as the next
_TOLERANCE = 1e-9  # m
_SEARCH_DISTANCE = 10.0  # m, from the last place of a car
_STEPS = 200  # in search of the nearest point, at most

# Where a car is along a path: the foot of the perpendicular, found by walking and never jumping.
#
# e_y > 0: the car is left of the path. At the foot the along-track residual g = (P - C(s)) · t(s)
# is zero; dg/ds = -(1 - κ e_y), so that s += g/(1 - κ e_y) is Newton's step.

# s [m] -> X, Y [m], ψ [rad], κ [1/m]
_PointOf: TypeAlias = Callable[[float], tuple[float, float, float, float]]


class Projection(NamedTuple):
    """The point of a path that a car is at.

    s: arc length [m], counting laps on a closed path; e_y: deviation to the left [m];
    psi: heading of the path there [rad], unwrapped; kappa: its curvature [1/m].
    """

    s: float
    e_y: float
    psi: float
    kappa: float

    def heading_error(self, psi: float) -> float:
        """Return e_psi = ψ - ψ_path [rad], between -pi and pi.

        Parameters
        ----------
        psi : heading of the car [rad], however many turns it has counted.
        """
        return math.remainder(psi - self.psi, 2.0 * math.pi)


def _walk_to_foot(
    point_of: _PointOf, X: float, Y: float, near: float, search_distance: float
) -> Projection:
    """Walk from `near` towards the car until the path passes square beside it.

    The walk follows the path, so that another leg that passes close by cannot catch it.

    point_of : s [m] -> X, Y [m], ψ [rad], κ [1/m] of the path.   X : of the car [m].
    Y : of the car [m].   near : s where the walk starts [m].
    search_distance : how far from `near` the walk may go [m]; where it must stop short, e_y is the
    deviation there.
    """
    s = near
    for _ in range(_STEPS):
        X_s, Y_s, psi, kappa = point_of(s)
        cos_psi, sin_psi = math.cos(psi), math.sin(psi)
        along = (X - X_s) * cos_psi + (Y - Y_s) * sin_psi
        e_y = (Y - Y_s) * cos_psi - (X - X_s) * sin_psi
        step = along / max(1.0 - kappa * e_y, _SMALLEST_SLOPE)
        step = min(max(step, -_LONGEST_STEP), _LONGEST_STEP)
        goal = min(max(s + step, near - search_distance), near + search_distance)
        if abs(goal - s) < _TOLERANCE:
            break
        s = goal
    return Projection(float(s), float(e_y), float(psi), float(kappa))


NO_CONES = np.empty((0, 2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Path:
    """A smooth path, sampled at equal steps of arc length; arrays are read-only.

    Parameters
    ----------
    s : arc length [m], (n,), from 0.
    X : [m], (n,).
    Y : [m], (n,).
    psi : heading [rad], (n,), unwrapped.
    kappa : curvature dψ/ds [1/m], (n,).
    closed : whether the last sample is the first one again.
    cones : X, Y [m], (k, 2), for pictures; k may be 0.

    Raises
    ------
    PathError
        Where shapes differ, a value is not finite, s is not uniform from 0, samples are too coarse
        or disagree with one another, or a closed path does not close.

    Examples
    --------
    >>> path = Path.from_waypoints([0.0, 40.0, 80.0], [0.0, 3.0, 0.0], name="bump")
    >>> here = path.project(41.0, 2.5)
    >>> round(here.s, 2), round(here.e_y, 2)
    (41.14, -0.5)
    >>> ahead = path.curvature(here.s + np.arange(40))  # (40,) [1/m]
    """

    name: str
    s: Array
    X: Array
    Y: Array
    psi: Array
    kappa: Array
    closed: bool = False
    cones: Array = field(default_factory=lambda: NO_CONES)

    def __post_init__(self) -> None:
        for part in fields(self):
            if part.name in ("name", "closed"):
                continue
            values = np.array(getattr(self, part.name), dtype=np.float64)
            values.setflags(write=False)
            object.__setattr__(self, part.name, values)
            shape = (values.shape[0], 2) if part.name == "cones" else (np.size(self.s),)
            if values.shape != shape:
                raise PathError(
                    f"{self.name}: {part.name} must have shape {shape}, it has {values.shape}"
                )
            if not np.isfinite(values).all():
                raise PathError(f"{self.name}: {part.name} must be finite")
        line = Line(self.s, self.X, self.Y, self.psi, self.kappa)
        check_line(line, self.name, self.closed)

    def __repr__(self) -> str:
        kind = "closed" if self.closed else "open"
        return f"<Path {self.name!r}: {self.length:.4g} m, {kind}>"

    @classmethod
    def from_line(
        cls, line: Line, *, name: str, closed: bool = False, cones: Array = NO_CONES
    ) -> Self:
        """Wrap samples of a curve.

        Parameters
        ----------
        line : samples at equal steps of arc length.
        closed : whether the last sample is the first one again.
        cones : X, Y [m], (k, 2).
        """
        return cls(name=name, closed=closed, cones=cones, **line._asdict())

    @classmethod
    def from_waypoints(
        cls,
        X: ArrayLike,
        Y: ArrayLike,
        *,
        closed: bool = False,
        name: str = "way-points",
        spacing: float | None = None,
        minimum_radius: float | None = None,
    ) -> Self:
        """Draw a spline with continuous curvature through way-points.

        Parameters
        ----------
        X : of the way-points in driving order [m], (k,).
        Y : of the way-points [m], (k,).
        closed : whether the last way-point leads back to the first; that may be repeated.
        spacing : longest step of the samples [m]; None: 0.25, less in turns of less than 1 m.
        minimum_radius : tightest turn allowed [m]; None: 3 m, or two median gaps if that is less.

        Raises
        ------
        PathError
            Where there are too few way-points, one is not finite or equals its neighbor, or the
            path turns tighter than minimum_radius.
        """
        line = line_through(
            X, Y, closed=closed, name=name, spacing=spacing, minimum_radius=minimum_radius
        )  # fmt: skip
        return cls.from_line(line, name=name, closed=closed)

    @classmethod
    def from_csv(
        cls,
        file: FilePath | str,
        *,
        closed: bool | None = None,
        minimum_radius: float | None = None,
    ) -> Self:
        """Read way-points from columns x and y of a table, as race lines and center lines have.

        Other columns, as of widths, heading and speed, are ignored. The name of the path is that of
        the file without folder and ending.

        Parameters
        ----------
        file : CSV, or another format of logs; without a header 2 to 4 columns begin with x and y, 7
            are those of a race line of TUM.
        closed : as for way-points; None: closed where the last point is no farther from the first
            than 1.5 median gaps between neighbors.
        minimum_radius : as for way-points.

        Raises
        ------
        PathError
            Naming the file and the column, line or rule that is broken.
        """
        waypoints = read_waypoints(FilePath(file))
        path = cls.from_waypoints(
            waypoints.X,
            waypoints.Y,
            closed=waypoints.seems_closed() if closed is None else closed,
            name=str(file),
            minimum_radius=minimum_radius,
        )
        return replace(path, name=FilePath(file).stem)

    @property
    def length(self) -> float:
        """Arc length of the path, of one lap where it is closed [m]."""
        return float(self.s[-1])

    @property
    def step(self) -> float:
        """Arc length between two samples [m]."""
        return float(self.s[-1]) / (self.s.size - 1)

    @property
    def lap_turn(self) -> float:
        """Heading gained from the first to the last sample [rad]: +-2 pi for a plain circuit."""
        return float(self.psi[-1] - self.psi[0])

    @property
    def peak_curvature(self) -> float:
        """Largest |κ| [1/m]."""
        return float(np.abs(self.kappa).max())

    def pose(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        """Return X, Y [m] and ψ [rad], each of the shape of s.

        Parameters
        ----------
        s : arc length [m]; beyond the ends an open path goes on straight, a closed one counts laps.
        """
        s = np.asarray(s, dtype=np.float64)
        laps = np.floor(s / self.length) if self.closed else np.zeros_like(s)
        inside = s - laps * self.length
        within = np.clip(inside, 0.0, self.length)
        i = np.minimum((within / self.step).astype(int), self.s.size - 2)
        parts = self.X, self.Y, self.psi, self.kappa
        ends = Ends(*((part[i], part[i + 1]) for part in parts))
        X, Y, psi, _ = ends.between(within / self.step - i, self.step, np.cos, np.sin)
        beyond = inside - within
        X, Y = X + beyond * np.cos(psi), Y + beyond * np.sin(psi)
        return X, Y, psi + laps * self.lap_turn

    def curvature(self, s: ArrayLike) -> Array:
        """Return κ [1/m] in the shape of s; zero beyond the ends of an open path.

        Parameters
        ----------
        s : arc length [m].
        """
        s = np.asarray(s, dtype=np.float64)
        if self.closed:
            return np.asarray(np.interp(s % self.length, self.s, self.kappa))
        return np.asarray(np.interp(s, self.s, self.kappa, left=0.0, right=0.0))

    def along(self, values: ArrayLike, s: ArrayLike) -> Array:
        """Interpolate values given at the samples, such as a speed, in the shape of s.

        Parameters
        ----------
        values : at `self.s`, (n,).
        s : arc length [m]; laps count alike, and an open path holds its end values.
        """
        s = np.asarray(s, dtype=np.float64)
        at = s % self.length if self.closed else s
        return np.asarray(np.interp(at, self.s, np.asarray(values, dtype=np.float64)))

    def project(self, X: float, Y: float, near: float | None = None) -> Projection:
        """Return the point of the path that a car is at.

        Parameters
        ----------
        X : of the car [m].
        Y : of the car [m].
        near : s of the last projection [m], laps included: the search follows the path from there
            at most 10 m, and does not jump to another leg. None: the nearest point of the path.
        """
        if not (math.isfinite(X) and math.isfinite(Y) and math.isfinite(near or 0.0)):
            raise PathError(f"{self.name}: cannot project X = {X}, Y = {Y}, near = {near}")
        if near is not None:
            return _walk_to_foot(self._point, X, Y, near, _SEARCH_DISTANCE)
        nearest = int(np.argmin((self.X - X) ** 2 + (self.Y - Y) ** 2))
        start = float(self.s[nearest])
        if nearest in (0, self.s.size - 1) and not self.closed:  # perhaps far beyond an end
            psi = float(self.psi[nearest])
            start += (X - self.X[nearest]) * math.cos(psi) + (Y - self.Y[nearest]) * math.sin(psi)
        found = _walk_to_foot(self._point, X, Y, start, 2.0 * self.step)
        if self.closed and not 0.0 <= found.s < self.length:
            return _walk_to_foot(self._point, X, Y, found.s % self.length, 2.0 * self.step)
        return found

    def _point(self, s: float) -> tuple[float, float, float, float]:
        """Return X, Y [m], ψ [rad], κ [1/m] at one s; plain numbers are quicker than arrays."""
        laps = math.floor(s / self.length) if self.closed else 0
        inside = s - laps * self.length
        within = min(max(inside, 0.0), self.length)
        i = min(int(within / self.step), self.s.size - 2)
        parts = self.X, self.Y, self.psi, self.kappa
        ends = Ends(*((part.item(i), part.item(i + 1)) for part in parts))
        X, Y, psi, kappa = ends.between(within / self.step - i, self.step, math.cos, math.sin)
        if beyond := inside - within:
            X, Y = X + beyond * math.cos(psi), Y + beyond * math.sin(psi)
            kappa = 0.0
        return X, Y, psi + laps * self.lap_turn, kappa
