"""A smooth line through way-points: a C2 spline X(s), Y(s), sampled at equal steps of arc length.

The spline runs over its own arc length, found by fitting again over the length of the last fit, so
that way-points need no equal gaps. Open ends are natural: κ = 0, as on the straight beyond them.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from codegen.arrays import Array
from models.logs.door import open_log
from models.logs.log import RecordingError
from models.logs.names import poses
from models.logs.units import LENGTH, to_si
from models.schema import require_few
from mpc.path.line import Line, PathError, uniform_grid

_SPACING = 0.25  # of samples [m], of the radius in turns of less than 1 m
_RADIUS = 3.0  # of a car's tightest turn [m]; less for a model car on its track, by
_GAPS = 2.0  # median gaps of way-points: a right angle between them is tighter
_FITS = 4  # of a line, each over the arc length of the one before
_FARTHEST = 1e8  # of a way-point from the origin [m]: every map of the earth fits
_SHORTEST = 0.1  # of a path [m]: 11 km in degrees
_SAME = 1e-6  # of the median gap: way-points as near as this are one
# Names of the columns of a file that has none, by their number: with a speed, with widths to the
# right and left as F1TENTH writes them, and the race line of TUM.
_UNNAMED = {
    2: ("x", "y"),
    3: ("x", "y", "v"),
    4: ("x", "y", "right", "left"),
    7: ("s", "x", "y", "psi", "kappa", "v", "a"),
}
_ENDS = 0.2  # of the median gap: the last way-point of a closed line as near as this is the first
_PIECES = 8  # of every interval between knots, for its length

_LOBES, _SHARES = np.polynomial.legendre.leggauss(8)  # nodes on -1 to 1, and weights


class _Waypoints(NamedTuple):
    """Points in driving order, X and Y [m], (k,)."""

    X: Array
    Y: Array

    def seems_closed(self) -> bool:
        """Whether the last point is as near to the first as neighbors are, 1.5 median gaps."""
        if self.X.size < 4:
            return False
        gaps = np.hypot(np.diff(self.X), np.diff(self.Y))
        last = np.hypot(self.X[-1] - self.X[0], self.Y[-1] - self.Y[0])
        return bool(last <= 1.5 * np.median(gaps))


def line_through(
    X: ArrayLike,
    Y: ArrayLike,
    *,
    closed: bool,
    name: str,
    spacing: float | None,
    minimum_radius: float | None,
) -> Line:
    """Draw the line; the arguments and errors are those of `Path.from_waypoints`.
    X : of the way-points [m], (k,).   Y : of the way-points [m], (k,).
    spacing : longest step of the samples [m], None: by the tightest turn.
    minimum_radius : tightest turn allowed [m], None: by the gaps.
    """
    if minimum_radius is not None and not minimum_radius > 0.0:
        raise PathError(f"{name}: minimum_radius must be positive, it is {minimum_radius}")
    points = _checked(X, Y, closed, name)
    gaps = _norm(np.diff(points, axis=0))
    if minimum_radius is None:  # a turn of a car and no kink
        minimum_radius = min(_RADIUS, _GAPS * float(np.median(gaps)))
    t = np.append(0.0, np.cumsum(gaps))
    for _ in range(_FITS):  # a C2 spline over its own arc length
        spline = CubicSpline(t, points, bc_type="periodic" if closed else "natural")
        t = np.append(0.0, np.cumsum(_lengths(spline.derivative(), t[:-1], t[1:])))
    if spacing is None:  # the curvature is largest at a knot
        bend = _norm(spline(spline.x, 2)).max()
        spacing = _SPACING * min(1.0, max(1.0 / max(bend, 1.0), minimum_radius))
    line = sample(spline, spline.x, spacing, name)
    # A spike between two samples shows in the heading alone.
    step = line.s[-1] / (line.s.size - 1)
    bend = np.maximum(np.abs(line.kappa[:-1]), np.abs(np.diff(line.psi)) / step)
    tightest = int(bend.argmax())
    if bend[tightest] * minimum_radius > 1.0:
        raise PathError(
            f"{name}: no turn may be tighter than {minimum_radius:.3g} m, at s = "
            f"{line.s[tightest]:.4g} m, X = {line.X[tightest]:.4g}, Y = {line.Y[tightest]:.4g} "
            f"the radius is {1.0 / bend[tightest]:.3g} m; move way-points, or give minimum_radius"
        )
    return line


def sample(spline: Any, knots: Array, spacing: float, name: str) -> Line:
    """Sample a plane curve at equal steps of its arc length.
    spline : t -> (X, Y) with `.derivative(order)`, C2, polynomial between its knots.
    knots : rising t, (k,).   spacing : longest step [m].
    """
    velocity, acceleration = spline.derivative(1), spline.derivative(2)
    # Quadrature needs pieces over which the speed changes little, even between far way-points.
    t = np.interp(
        np.arange(_PIECES * (knots.size - 1) + 1) / _PIECES,
        np.arange(knots.size),
        knots,
    )
    length_at_t = np.append(0.0, np.cumsum(_lengths(velocity, t[:-1], t[1:])))
    try:
        s = uniform_grid(float(length_at_t[-1]), spacing)
    except PathError as error:
        raise PathError(f"{name}: {error}") from None
    at = _times(velocity, t, length_at_t, s)
    (X, Y), (dX, dY), (ddX, ddY) = (f(at).T for f in (spline, velocity, acceleration))
    kappa = (dX * ddY - dY * ddX) / (dX**2 + dY**2) ** 1.5
    return Line(s, X, Y, np.unwrap(np.arctan2(dY, dX)), kappa)


def _times(velocity: Any, t: Array, length_at_t: Array, s: Array) -> Array:
    """Return where the arc length is s, by Newton's method from the last knot before it."""
    i = np.clip(np.searchsorted(length_at_t, s, side="right") - 1, 0, t.size - 2)
    rest = s - length_at_t[i]
    at = t[i] + np.diff(t)[i] * rest / np.diff(length_at_t)[i]
    for _ in range(20):
        error = _lengths(velocity, t[i], at) - rest
        at = np.clip(at - error / _norm(velocity(at)), t[i], t[i + 1])
        if np.abs(error).max() < 1e-12 * s[-1]:
            break
    return at


def _lengths(velocity: Any, start: Array, end: Array) -> Array:
    """Return the arc lengths from each start to its end, by quadrature."""
    half = 0.5 * (end - start)
    nodes = start[:, None] + half[:, None] * (1.0 + _LOBES)
    return half * (_norm(velocity(nodes)) @ _SHARES)


def _norm(vectors: Array) -> Array:
    return np.hypot(vectors[..., 0], vectors[..., 1])


def _checked(X: ArrayLike, Y: ArrayLike, closed: bool, name: str) -> Array:
    """Return the way-points (k, 2), the first repeated at the end where the path is closed."""
    X, Y = np.asarray(X, dtype=np.float64), np.asarray(Y, dtype=np.float64)
    if X.ndim != 1 or X.shape != Y.shape:
        raise PathError(f"{name}: X and Y must be (k,) alike, they are {X.shape} and {Y.shape}")
    points = np.column_stack((X, Y))
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        raise PathError(
            f"{name}: way-points must be finite, number {bad[0] + 1} is {points[bad[0]].tolist()}"
        )
    far = np.flatnonzero(np.abs(points).max(axis=1) > _FARTHEST)
    if far.size:
        raise PathError(
            f"{name}: way-points must lie within +-{_FARTHEST:g} m, number {far[0] + 1} is "
            f"{points[far[0]].tolist()}"
        )
    gaps = _norm(np.diff(points, axis=0))
    if closed and gaps.size and _norm(points[0] - points[-1]) <= _ENDS * np.median(gaps):
        points = points[:-1]
    fewest = 4 if closed else 2
    if len(points) < fewest:
        kind = "a closed" if closed else "an open"
        raise PathError(
            f"{name}: {kind} path needs at least {fewest} different way-points, it has "
            f"{len(points)}"
        )
    if closed:
        points = np.vstack((points, points[:1]))
    gaps = _norm(np.diff(points, axis=0))
    if gaps.sum() < _SHORTEST:
        raise PathError(f"{name}: the path is {gaps.sum():.2g} m long: are X and Y degrees?")
    same = np.flatnonzero(gaps <= _SAME * np.median(gaps))
    if same.size:
        raise PathError(
            f"{name}: neighboring way-points must differ, numbers {same[0] + 1} and "
            f"{same[0] + 2} are both {points[same[0]].tolist()}"
        )
    return points


def read_waypoints(file: Path) -> _Waypoints:
    """Read the position of a table, named as in logs; other columns are ignored.
    file : in any format of logs; a row is a way-point, and the time is not looked at.
    """
    try:
        log = open_log(file, rate=1.0, unnamed=_UNNAMED)
        headings = log.headings()
        named = [some for some in poses(headings).values() if {"x", "y"} <= set(some)]
        found = [one for some in named for axis in ("x", "y") for one in some[axis]]
        if len(found) != 2:
            raise PathError(
                f"{file}: one pair of columns must be x and y, in a unit of length (x_m, y [mm], "
                f"east_m), found {', '.join(one.name for one in headings)[:120]!r}"
            )
        columns = log.read([one.name for one in found])
        factors = [to_si(one.unit, LENGTH, f"{file}: {one.name}") for one in found]
    except RecordingError as error:
        raise PathError(str(error)) from None
    for one in columns:
        require_few(PathError, str(file), one.values.size, "path", "rows")
        if (bad := np.flatnonzero(~np.isfinite(one.values))).size:
            place = f"{one.place} {one.rows[bad[0]]}"
            raise PathError(f"{file}: {one.name} must be a finite number, {place} has none")
    return _Waypoints(*(k * one.values for k, one in zip(factors, columns, strict=True)))
