"""How fast a path can be driven: v² |κ| = a_y, with braking before the turn and power after it.

What a turn leaves lengthwise is that of `identifier.speed_limits`, of tires that were identified or
of a given ellipse: v²|κ| <= σ A(f/σ) and dv²/ds = 2 (f - drag v²), f <= engine(v), from place to
place, once forwards and once backwards.
"""

import math
from bisect import bisect_right
from collections.abc import Callable
from os import PathLike
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from codegen.arrays import Array
from codegen.writing import write_file
from models.rules import require_positive, require_within
from mpc.path.line import PathError
from mpc.path.path import Path

if TYPE_CHECKING:
    from identifier.speed_limits import SpeedLimits

SHARE = 0.82  # of the limits: passes the lap benchmark on cars that were not chosen for it
# Of the braking that turning leaves: a simulated car that is asked for all of it brakes late, and
# is up to a tenth too fast in the bend. Of 1, .8 and .7, on six random cars: margin .19, .26, .29.
BRAKED = 0.8
ENGINE = 5.0  # m/s², of a car of which nothing is said
TURN, DRIVE, BRAKE, POWER, TOP = REASONS = ("turn", "drive", "brake", "engine", "v_max")
_REASON = {name: i for i, name in enumerate(REASONS)}
_TOLERANCE = 1e-3  # of a speed at the start
_MET = 1e-4  # of v², where a lap goes over into the next one
_FASTEST = 200.0  # m/s, which no car of an identified tire reaches
_ROUNDS = 100
_TUM = ("s_m", "x_m", "y_m", "psi_rad", "kappa_radpm", "vx_mps", "ax_mps2")
_TURNING = 0.97  # of the largest v², from which on it is the turn that limits

Engine: TypeAlias = float | tuple[ArrayLike, ArrayLike]


class Preview(NamedTuple):
    """The road at some times ahead, each (k,): arc length [m], curvature [1/m], speed [m/s]."""

    s: Array
    kappa: Array
    v_x: Array


class SpeedProfile:
    """A wanted speed along a path; a closed path is driven lap after lap.

    Attributes: path; planned, by what and within which share of the limits, or None.

    Parameters
    ----------
    path : to drive.
    v : wanted speed [m/s], a number or one for each sample of the path, (n,).
    limited_by : what limits it there, (n,): turn, drive, brake (the tires), engine or v_max;
        empty where the speed is given.
    axle : front or rear, which one slides first there, (n,); empty where the speed is given.
    """

    def __init__(
        self,
        path: Path,
        v: ArrayLike,
        *,
        limited_by: ArrayLike = (),
        axle: ArrayLike = (),
        planned: "tuple[Planner, float] | None" = None,
    ) -> None:
        self.v: Array = np.broadcast_to(np.asarray(v, dtype=np.float64), path.s.shape).copy()
        if not (self.v > 0.0).all() or not np.isfinite(self.v).all():
            raise ValueError(f"speeds must be positive and finite, the least is {self.v.min()}")
        self.path, self.planned = path, planned
        self.limited_by, self.axle = np.asarray(limited_by, str), np.asarray(axle, str)
        pace = 0.5 * (1.0 / self.v[1:] + 1.0 / self.v[:-1])
        self._t = np.append(0.0, np.cumsum(pace * np.diff(path.s)))
        self._acceleration = self.v * np.gradient(self.v, path.s)

    def __repr__(self) -> str:
        low, high = self.v.min(), self.v.max()
        return (
            f"<SpeedProfile of {self.path.name}: {self.lap_time:.2f} s, "
            f"{low:.1f} to {high:.1f} m/s>"
        )

    @property
    def s(self) -> Array:
        """Arc length of the samples [m], (n,)."""
        return self.path.s

    @property
    def a_y(self) -> Array:
        """Lateral acceleration at the wanted speed, to the left [m/s²], (n,)."""
        return self.v**2 * self.path.kappa

    @property
    def a_x(self) -> Array:
        """Acceleration along the path at the wanted speed [m/s²], (n,)."""
        return self._acceleration.copy()

    @property
    def used(self) -> Array:
        """Share of the limits that planned speeds use, 1 where the tires give all, (n,)."""
        if self.planned is None:
            raise ValueError("these speeds are given: plan them by speed_profile to have limits")
        limits, a_y = self.planned[0].limits, np.abs(self.a_y)
        f, reach = self.a_x + limits.drag * self.v**2, []
        for most, push, brake in zip(
            limits.a_y, limits.push.most, limits.brake.most, strict=True
        ):  # around the edge: from braking over turning to driving
            turn = most * np.linspace(0.0, 1.0, push.size)
            y, x = np.append(-brake, push[::-1]), np.append(turn, turn[::-1])
            reach.append(np.interp(np.arctan2(f, a_y), np.arctan2(y, x), np.hypot(y, x)))
        row = np.interp(self.v, limits.v, np.arange(limits.v.size))
        low, sample, reached = row.astype(int), np.arange(f.size), np.array(reach)
        high = np.minimum(low + 1, limits.v.size - 1)
        edge = (1.0 + low - row) * reached[low, sample] + (row - low) * reached[high, sample]
        return np.asarray(np.hypot(f, a_y) / edge)

    def to_csv(self, file: str | PathLike[str], *, tum: bool = False) -> None:
        """Write the speeds and what they ask of the tires, a row for each sample.

        Parameters
        ----------
        file : to write.
        tum : write a race line as planners of TUM do; 0 of its psi_rad is along Y.
        """
        path = self.path
        columns = {
            "s_m": path.s, "X_m": path.X, "Y_m": path.Y, "psi_rad": path.psi,
            "kappa_1_m": path.kappa, "v_m_s": self.v, "a_x_m_s2": self.a_x,
            "a_y_m_s2": self.a_y, "t_s": self.t,
        }  # fmt: skip
        if tum:
            columns["psi_rad"] = np.remainder(path.psi + 0.5 * np.pi, 2.0 * np.pi) - np.pi
            columns = dict(zip(_TUM, columns.values(), strict=False))
        elif self.planned is not None:
            columns |= {"used": self.used, "limited_by": self.limited_by, "axle": self.axle}
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        text = ("; " if tum else ",").join
        lines = [text(x if isinstance(x, str) else f"{x:.9g}" for x in row) for row in rows]
        write_file(FilePath(file), "\n".join(["# " * tum + text(columns), *lines, ""]))

    @property
    def lap_time(self) -> float:
        """Time from the first to the last sample at the wanted speed [s]."""
        return float(self._t[-1])

    @property
    def t(self) -> Array:
        """Time since the first sample at the wanted speed [s], (n,)."""
        return self._t.copy()

    def at(self, s: ArrayLike) -> Array:
        """Return the wanted speed [m/s] in the shape of s.

        Parameters
        ----------
        s : arc length [m].
        """
        return self.path.along(self.v, s)

    def reference(self, s: float, gain: float) -> float:
        """Return what to ask of a proportional driver, so that it does not lag behind [m/s].

        Parameters
        ----------
        s : arc length [m].
        gain : acceleration that the driver asks for, per error of the speed [1/s].
        """
        beyond = not self.path.closed and not 0.0 <= s <= self.path.length
        slope = 0.0 if beyond else float(self.path.along(self._acceleration, s))
        return float(self.at(s)) + slope / gain

    def ahead(self, s: float, v_x: float, t: Array, gain: float) -> Preview:
        """Return the road that the car will be on.

        Parameters
        ----------
        s : arc length now [m].
        v_x : speed now [m/s].
        t : times from now [s], (k,).
        gain : of the driver [1/s].
        """
        error, fades = v_x - float(self.at(s)), np.exp(-gain * t)
        there = self.place(self.time_at(s) + t) + error * (1.0 - fades) / gain
        return Preview(there, self.path.curvature(there), self.at(there) + error * fades)

    def time_at(self, s: float) -> float:
        """Return the time at which a car at the wanted speed is at s, laps included."""
        if self.path.closed:
            laps, within = divmod(s, self.path.length)
            return laps * self.lap_time + float(np.interp(within, self.path.s, self._t))
        if s > self.path.length:
            return self.lap_time + (s - self.path.length) / float(self.v[-1])
        return float(np.interp(s, self.path.s, self._t)) + min(s, 0.0) / float(self.v[0])

    def place(self, t: Array) -> Array:
        """Return where a car at the wanted speed is, laps included: the inverse of `time_at`.

        Parameters
        ----------
        t : times [s], (k,).
        """
        if self.path.closed:
            laps = np.floor(t / self.lap_time)
            within = np.interp(t - laps * self.lap_time, self._t, self.path.s)
            return laps * self.path.length + within
        before, after = np.minimum(t, 0.0), np.maximum(t - self.lap_time, 0.0)
        there = np.interp(t, self._t, self.path.s)
        return there + before * self.v[0] + after * self.v[-1]


class _Lead(SpeedProfile):
    """A profile that begins on the way at another speed and goes over into it.

    s : arc length, rising [m], (k,).   v : speeds there [m/s], (k,); the last one is the profile's.
    why, axle : what limits there, and which axle, as in the profile, (k,).
    """

    def __init__(
        self, profile: SpeedProfile, s: Array, v: Array, why: ArrayLike, axle: ArrayLike
    ) -> None:
        self._profile, self._lead_s, self._lead_v = profile, s, v
        path, begins = profile.path, float(s[0])
        leads = (path.s >= begins) & (path.s < s[-1])
        at = np.searchsorted(s, path.s[leads], side="right") - 1
        named = [profile.limited_by.copy(), profile.axle.copy()]
        for mine, theirs in zip(named, (why, axle), strict=True):
            mine[leads] = np.asarray(theirs)[at]
        super().__init__(
            path,
            np.where(path.s < begins, profile.v, self.at(path.s)),
            limited_by=named[0],
            axle=named[1],
            planned=profile.planned,
        )
        pace = 0.5 * (1.0 / v[1:] + 1.0 / v[:-1])
        self._lead_t = np.append(0.0, np.cumsum(pace * np.diff(s)))
        self._lead_a = v * np.gradient(v, s)
        self._after = profile.time_at(float(s[-1])) - float(self._lead_t[-1])

    def at(self, s: ArrayLike) -> Array:
        s = np.asarray(s, dtype=np.float64)
        lead = np.interp(s, self._lead_s, self._lead_v)
        return np.where(s < self._lead_s[-1], lead, self._profile.at(s))

    def reference(self, s: float, gain: float) -> float:
        if s >= self._lead_s[-1]:
            return self._profile.reference(s, gain)
        return float(self.at(s) + np.interp(s, self._lead_s, self._lead_a) / gain)

    def time_at(self, s: float) -> float:
        if s >= self._lead_s[-1]:
            return self._profile.time_at(s) - self._after
        before = min(s - float(self._lead_s[0]), 0.0) / float(self._lead_v[0])
        return float(np.interp(s, self._lead_s, self._lead_t)) + before

    def place(self, t: Array) -> Array:
        before = np.minimum(t, 0.0) * self._lead_v[0]
        lead = np.interp(t, self._lead_t, self._lead_s) + before
        return np.where(t < self._lead_t[-1], lead, self._profile.place(t + self._after))


def speed_profile(
    path: Path,
    limits: "SpeedLimits",
    *,
    share: float = SHARE,
    engine: Engine | None = None,
    brakes: float | None = None,
    v_max: float | None = None,
    start: tuple[float, float] | None = None,
) -> SpeedProfile:
    """Return the fastest speed along a path that keeps the limits.

    On a closed path the lap is a flying one.

    Parameters
    ----------
    path : to drive.
    limits : of the car, of `speed_limits`, or an ellipse.
    share : of them that is used [-].
    engine : largest acceleration that it gives, before drag [m/s²]: a number, or rising speeds
        [m/s] and what it gives there, (k,) each; None takes 5 m/s².
    brakes : largest deceleration that they give [m/s²]; None leaves it to the tires.
    v_max : speed allowed [m/s]; None for no bound of its own.
    start : arc length [m] and speed [m/s] at which to begin; the speed changes by no more than
        tires, engine and brakes give. None begins as fast as the limits allow.

    Raises
    ------
    PathError
        Where the start is too fast for what comes, or nothing limits the speed.
    ValueError
        Where a number is none of those.
    """
    require_positive(ValueError, share=share)
    planner = Planner(path, limits, engine=engine, brakes=brakes, v_max=v_max)
    profile = planner.profile(share)
    if start is None:
        return profile
    s, v = start
    require_within(ValueError, 0.0, path.length, **{"arc length of the start": s})
    require_positive(ValueError, **{"speed of the start": v})
    most = float(profile.at(s))
    if v > most * (1.0 + _TOLERANCE):
        raise PathError(
            f"{path.name}: from s = {s:g} m on {most:.1f} m/s leave room to brake for what comes, "
            f"the start has {v:.1f} m/s: begin slower or farther ahead"
        )
    return planner.begun(profile, share, s, v)


class Planner:
    """Plans speeds of one car along one path; the arguments are those of `speed_profile`."""

    def __init__(
        self,
        path: Path,
        limits: "SpeedLimits",
        *,
        engine: Engine | None,
        brakes: float | None,
        v_max: float | None,
    ) -> None:
        given = {"brakes": brakes, "v_max": v_max}
        require_positive(ValueError, **{name: x for name, x in given.items() if x is not None})
        self.path, self.limits = path, limits
        self._engine = _engine(ENGINE if engine is None else engine)
        self._brakes = math.inf if brakes is None else brakes
        self._bounded = v_max is not None
        self._most = (_FASTEST if v_max is None else v_max) ** 2  # of v² [m²/s²]

    def profile(self, share: float) -> SpeedProfile:
        """Return the fastest profile within a share of the limits."""
        path, limits = self.path, self.limits.scaled(share)
        kappa = np.abs(path.kappa[:-1] if path.closed else path.kappa)
        square = np.full(kappa.size, self._most)
        for _ in range(_ROUNDS):  # downforce allows more where it is faster
            last, a_y = square, np.interp(np.sqrt(square), limits.v, limits.a_y)
            square = np.minimum(square, a_y / np.maximum(kappa, 1e-12))
            if np.allclose(last, square, rtol=1e-12):
                break
        if path.closed:  # the slowest place limits itself; both passes start there
            order = (np.arange(square.size + 1) + int(square.argmin())) % square.size
        else:
            order = np.arange(square.size)
        why = np.where(square < self._most, _REASON[TURN], _REASON[TOP])[order]
        tops, lap, bend = square[order], square[order].tolist(), kappa[order].tolist()
        slides = np.interp(np.sqrt(lap), limits.v, np.arange(limits.v.size)).round().astype(int)
        axle = limits.push.axle[slides, -1]
        table = _Table(limits)
        for _ in range(_ROUNDS):  # until a lap ends as fast as it began, against the air
            for i in range(1, len(lap)):
                here = lap[i - 1]
                left, row = table.left(here, bend[i - 1], 0)
                gives = self._engine(math.sqrt(here))
                reached = here + 2.0 * path.step * (min(left, gives) - limits.drag * here)
                if reached < lap[i]:
                    lap[i], why[i] = reached, _REASON[DRIVE if left < gives else POWER]
                    axle[i] = limits.push.axle[row]
            if not path.closed or lap[-1] >= lap[0] * (1.0 - _MET):
                break
            lap[0], why[0], axle[0] = lap[-1], why[-1], axle[-1]
        for i in range(len(lap) - 2, -1, -1):
            here = lap[i + 1]
            left, row = table.left(here, bend[i + 1], 1)
            braked = min(BRAKED * left, self._brakes)
            reached = here + 2.0 * path.step * (braked + limits.drag * here)
            if reached < lap[i]:
                lap[i], why[i], axle[i] = reached, _REASON[BRAKE], limits.brake.axle[row]
        turning = (np.array(lap) > _TURNING * tops) & (why != _REASON[TOP]) & (tops < self._most)
        why[turning] = _REASON[TURN]
        if not self._bounded and math.sqrt(max(lap)) >= _FASTEST * 0.999:
            raise PathError(f"{path.name}: nothing limits the speed: give v_max (--v-max)")
        if path.closed:
            order = order[:-1]
        v, reasons, axles = np.empty(square.size), np.empty_like(why[: square.size]), axle.copy()
        v[order], reasons[order] = np.sqrt(lap[: square.size]), why[: square.size]
        axles[order] = axle[: square.size]
        names = [np.array(REASONS)[reasons], np.array(("front", "rear"))[axles[: square.size]]]
        if path.closed:
            v, names = np.append(v, v[0]), [np.append(one, one[0]) for one in names]
        return SpeedProfile(path, v, limited_by=names[0], axle=names[1], planned=(self, share))

    def begun(
        self, profile: SpeedProfile, share: float, s: float, v: float, kept: float = 0.0
    ) -> SpeedProfile:
        """Return a profile that begins on the way and goes over into another, however fast.

        s : arc length, laps included [m].   v : speed there [m/s].
        kept : braking that is taken even where turning leaves less [m/s²].
        """
        path, limits = self.path, self.limits.scaled(share)
        table, step = _Table(limits), path.step
        places, speeds, why, axles, here = [s], [v], [""], [""], v * v
        slower = v < float(profile.at(s))
        sides, side = (limits.push, limits.brake), 0 if slower else 1
        for _ in range(_ROUNDS * path.s.size if path.closed else path.s.size):
            bend = abs(float(path.curvature(places[-1])))
            left, row = table.left(here, bend, side)
            places.append(places[-1] + step)
            goal = float(profile.at(places[-1])) ** 2
            if slower:
                gives = self._engine(math.sqrt(here))
                why.append(DRIVE if left < gives else POWER)
                here = min(here + 2.0 * step * (min(left, gives) - limits.drag * here), goal)
            else:
                why.append(BRAKE)
                left = min(max(left, kept), self._brakes)
                here = max(here - 2.0 * step * (left + limits.drag * here), goal)
            axles.append(("front", "rear")[sides[side].axle[row]])
            speeds.append(math.sqrt(here))
            if abs(here - goal) <= _MET * goal:
                speeds[-1] = math.sqrt(goal)
                break
        why[0], axles[0] = why[1], axles[1]
        return _Lead(profile, np.array(places), np.array(speeds), why, axles)


class _Table:
    """Reads what turning leaves, one place after another."""

    def __init__(self, limits: "SpeedLimits") -> None:
        self._v, self._speeds = limits.v.tolist(), limits.v.size - 1
        self._a_y = limits.a_y.tolist()
        self._sides = [limits.push.most.tolist(), limits.brake.most.tolist()]
        self._shares = limits.push.most.shape[1] - 1

    def left(self, square: float, bend: float, side: int) -> tuple[float, tuple[int, int]]:
        """Return the largest push [m/s²], and the row of the table.

        square : v² [m²/s²].   bend : |κ| [1/m].   side : 0 to drive, 1 to brake.
        """
        i, x = 0, 0.0
        if self._speeds:
            v = math.sqrt(square)
            i = min(bisect_right(self._v, v), self._speeds) - 1
            x = min((v - self._v[i]) / (self._v[i + 1] - self._v[i]), 1.0)
        a_y, most = self._a_y, self._sides[side]
        limit = a_y[i] + x * (a_y[i + 1] - a_y[i]) if x else a_y[i]
        q = square * bend / limit * self._shares
        if q >= self._shares:
            return 0.0, (i, self._shares)
        j = int(q)
        low = most[i][j] + (q - j) * (most[i][j + 1] - most[i][j])
        if x:
            high = most[i + 1][j] + (q - j) * (most[i + 1][j + 1] - most[i + 1][j])
            low += x * (high - low)
        return low, (i, j)


def _engine(engine: Engine) -> Callable[[float], float]:
    """Return what an engine gives at a speed [m/s²]."""
    if isinstance(engine, tuple):
        v, a = (np.atleast_1d(np.asarray(one, dtype=np.float64)) for one in engine)
        if v.ndim != 1 or not v.size or v.shape != a.shape or not (np.diff(v) > 0.0).all():
            raise ValueError("engine must be rising speeds and one acceleration for each")
        if not (np.isfinite(a).all() and (a >= 0.0).all() and a[0] > 0.0):
            raise ValueError(f"engine must give 0 m/s² or more, and more at first: {a.min():g}")
        speeds, gives = v.tolist(), a.tolist()
        return lambda at: float(np.interp(at, speeds, gives))
    require_positive(ValueError, engine=engine)
    given = float(engine)
    return lambda _: given


def steady_speed(path: Path, *, a_y_max: float) -> float:
    """Return the constant speed [m/s] at which the tightest place takes a_y_max.

    Parameters
    ----------
    a_y_max : lateral acceleration at the limit of grip, or less [m/s²].
    """
    require_positive(PathError, **{f"{path.name}: a_y_max": a_y_max})
    if path.peak_curvature * path.length < 1e-6:
        raise PathError(f"{path.name}: has no turn that limits the speed, choose one")
    return math.sqrt(a_y_max / path.peak_curvature)
