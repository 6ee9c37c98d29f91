"""Curves that a drive leaves possible: the weights lie in a polytope, the force between two bounds.

For each mean over a moment |y - h'w| <= e (1 + β) + τ ρ, and the curve of any tire lies in the
prior's box: both are linear in the weights w, in static axle loads.   y: force that the motion
shows.   h: units at the lagged slip of the frozen model, times cos δ and, where the car has
downforce, the load of the axle over the static one.   e: error of curve and sensors.   β: by how
much slip is beyond that which taught, over it, now or a while ago, which fades with 0.3 s; and by
how much ρ is beyond that which taught, over it: errors of lag that a drive of one tempo hides in e
grow with ρ.   τ: time [s] by which force and curve may differ.   ρ: rate of the force [1/s], the
larger of its size now and of its mean over the last 0.3 s.
A linear function of w is largest at a vertex of the polytope, so that the two linear programs of
every slip, max and min of t'w with t = tanh(α/α_j), are one product with all vertices. The force
lies between them, wider by e (1 + β) + τ ρ (set membership: Milanese and Vicino, Automatica 27,
1991).
Of the constraints those are looked at that the answer to a part of them breaks, until none is left.

SciPy is imported where a band is asked for: that takes longer than to learn from a log of a minute.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codegen.arrays import Array
from identifier.axle.chosen import CHOSEN
from identifier.axle.curve import unit_matrix
from identifier.axle.learning import Bounds
from identifier.band import Axle, ends, of_axle
from models.recordings import Recording

SECANTS = tuple(0.004 * 2.0**k for k in np.arange(0.0, 7.5, 0.5))  # rad, where a curve bends down
PAIRS = ("error_static_axle_loads", "lateness_s", "fastest_static_axle_loads_per_s")


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceBound:
    """By how much a force may differ from the best curve, front and rear.
    error : e [static axle loads], above 0 and at most 10, (2,).
    lateness : τ [s], by which a force may be late or early, from 0 to 1, (2,).
    """

    error: tuple[float, float]
    lateness: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for value in self.error:
            if not 0.0 < value <= CHOSEN.largest_bound:
                raise ValueError(
                    f"the bound of an error must be above 0 and at most {CHOSEN.largest_bound:g} "
                    f"static axle loads, it is {value:g}"
                )
        for value in self.lateness:
            if not 0.0 <= value <= CHOSEN.longest_lateness:
                raise ValueError(
                    f"lateness must be from 0 to {CHOSEN.longest_lateness:g} s, it is {value:g}"
                )

    @classmethod
    def of(cls, given: "float | ForceBound") -> "ForceBound":
        """Return a bound as given: a number is the error of both axles, nothing is late.
        given : number [static axle loads], or the bound itself.
        """
        return given if isinstance(given, ForceBound) else cls(error=(float(given), float(given)))

    def allowed(self, beyond: Array, rate: Array) -> Array:
        """Return e (1 + β) + τ ρ [static axle loads], (k, 2).
        beyond : β of both axles, (k, 2).   rate : ρ of both axles [1/s], (k, 2).
        """
        wide: Array = np.array(self.error) * (1.0 + beyond) + np.array(self.lateness) * rate
        return wide


class Doubt(NamedTuple):
    """What opens a band over a drive, (n, 2) each: β, ρ [1/s], and the share of the force that a
    force along the car may cost.
    """

    beyond: Array
    rate: Array
    lost: Array


class Strips(NamedTuple):
    """What a drive says of the weights, mean by mean: y (m, 2), h (m, 2, n), means of `Doubt`
    (m, 2); speed (m,) [m/s]; when it begins t (m,) [s].
    """

    y: Array
    h: Array
    beyond: Array
    rate: Array
    lost: Array
    v_x: Array
    t: Array

    def until(self, m: int) -> "Strips":
        """Return the first m of them."""
        return Strips(*(values[:m] for values in self))


class HalfSpaces(NamedTuple):
    """A w <= b: (m, n) and (m,)."""

    A: Array
    b: Array

    def both(self, other: "HalfSpaces") -> "HalfSpaces":
        """Return what holds where this and the other do."""
        return HalfSpaces(np.vstack([self.A, other.A]), np.concatenate([self.b, other.b]))


def prior_box(bounds: Bounds, ladder: tuple[float, ...]) -> HalfSpaces:
    """Return what is believed of any tire, before a drive.

    Saturated force, stiffness at no slip and each weight are within bounds, and the secant
    stiffness φ(α)/α does not rise with slip, as of every brush and Magic Formula tire.
    ladder : slip scales of the units [rad].
    """
    n, scales = len(ladder), np.array(ladder)
    slip = np.array(SECANTS)
    T = unit_matrix(slip, ladder)
    secant = slip[:, None] * (1.0 - T * T) / scales - T  # of φ' α - φ <= 0
    rows = [np.ones(n), -np.ones(n), 1.0 / scales, -1.0 / scales]
    limits = [bounds.most_grip, -bounds.least_grip, bounds.most_stiffness, -bounds.least_stiffness]
    return HalfSpaces(
        np.vstack([*rows, np.eye(n), -np.eye(n), secant]),
        np.array([*limits, *[bounds.weight] * (2 * n), *[0.0] * len(slip)]),
    )


def strip_sides(y: Array, h: Array, allowed: Array) -> HalfSpaces:
    """Return |y - h'w| <= allowed of one axle.
    y : (m,).   h : (m, n).   allowed : e (1 + β) + τ ρ (m,).
    """
    return HalfSpaces(np.vstack([h, -h]), np.concatenate([allowed + y, allowed - y]))


def _least(cost: Array, among: HalfSpaces, free: int) -> Array | None:
    """Return x of least cost with A x <= b, not negative from place `free` on; None: no such."""
    from scipy.optimize import linprog

    limits = [(None, None)] * free + [(0.0, None)] * (cost.size - free)
    tried = _first(among.b.size)
    while True:
        found = linprog(cost, among.A[tried], among.b[tried], bounds=limits, method="highs")
        if not found.success:
            return None
        x: Array = found.x
        more = _broken(among.A @ x - among.b, tried)
        if not more.size:
            return x
        tried = np.append(tried, more)


def _first(m: int) -> NDArray[np.intp]:
    """Return which of m constraints are tried first: the first ones, a box, and some of all."""
    some = np.linspace(0, m - 1, CHOSEN.first).astype(np.intp)
    return np.union1d(np.arange(min(CHOSEN.first, m)), some)


def _broken(over: Array, tried: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return which of the constraints that were not tried are broken most; none: it holds."""
    over = over.copy()
    over[tried] = -np.inf
    worst = np.argsort(over)[-CHOSEN.more :]
    broken: NDArray[np.intp] = worst[over[worst] > CHOSEN.slack]
    return broken


def least_bound(strips: Strips, axle: int, box: HalfSpaces) -> tuple[float, float]:
    """Return error [static axle loads] and lateness [s] with which one curve just fits a drive.

    The least e + 1.5 τ mean(ρ) is taken, a linear program: what error explains as well is not taken
    for lateness, which says nothing of slow forces.
    """
    y, h, rate = strips.y[:, axle], strips.h[:, axle], strips.rate[:, axle]
    n = h.shape[1]
    beside = np.column_stack([1.0 + strips.beyond[:, axle], rate])
    sides = np.vstack([np.hstack([h, -beside]), np.hstack([-h, -beside])])
    kept = np.hstack([box.A, np.zeros((box.b.size, 2))])
    among = HalfSpaces(np.vstack([kept, sides]), np.concatenate([box.b, y, -y]))
    cost = np.concatenate([np.zeros(n), [1.0, CHOSEN.unlikely * float(rate.mean())]])
    x = _least(cost, among, n)
    if x is None:  # the box alone is never empty, and errors may be as large as they like
        raise ArithmeticError("no bound fits: the linear program of the least bound has no answer")
    return max(float(x[n]), 0.0), max(float(x[n + 1]), 0.0)


def vertices(among: HalfSpaces) -> Array | None:
    """Return the vertices (k, n) of a bounded polytope; None where it has no inside."""
    from scipy.spatial import HalfspaceIntersection

    A, b = among
    n, length = A.shape[1], np.maximum(np.linalg.norm(A, axis=1), CHOSEN.guarantee_tiny)
    inside = _least(  # the largest ball
        np.append(np.zeros(n), -1.0), HalfSpaces(np.column_stack([A, length]), b), n
    )
    if inside is None or not inside[-1] >= CHOSEN.least_radius:
        return None
    center, slack = inside[:-1], b - A @ inside[:-1]
    tried = np.union1d(_first(b.size), np.argsort(slack / length)[: CHOSEN.first])
    while True:
        sides = np.column_stack([A[tried], -b[tried]])
        corners: Array = HalfspaceIntersection(sides, center).intersections
        more = _broken((A @ corners.T).max(axis=1) - b, tried)
        if not more.size:
            return np.unique(np.round(corners, 12), axis=0)
        tried = np.append(tried, more)


def possible_weights(strips: Strips, axle: int, bound: ForceBound, box: HalfSpaces) -> Array | None:
    """Return the vertices (k, n) of the weights that a drive leaves to an axle.

    None where no curve keeps the bound: then it is violated.
    """
    allowed = bound.allowed(strips.beyond, strips.rate)[:, axle]
    return vertices(box.both(strip_sides(strips.y[:, axle], strips.h[:, axle], allowed)))


@dataclass(frozen=True, slots=True, kw_only=True)
class PossibleWeights:
    """What a drive leaves possible of the curves of both axles, under a bound of the errors.
    given : whether the bound was given; else it was estimated from the drive.
    corners : vertices of the possible weights of front and rear, (k, n) each.
    speed : mean of the drive that taught [m/s].
    fastest : largest ρ of its means [static axle loads/s], (2,): beyond it the band opens.
    """

    bound: ForceBound
    given: bool
    corners: tuple[Array, Array]
    speed: float
    fastest: tuple[float, float]

    def __post_init__(self) -> None:
        if not 0.0 < self.speed < np.inf:
            raise ValueError(f"speed of the guarantee must be positive, it is {self.speed}")
        for rate in self.fastest:
            if not 0.0 < rate < np.inf:
                raise ValueError(
                    f"the fastest force of the guarantee must be positive, it is {rate}"
                )
        for corners in self.corners:
            if corners.ndim != 2 or not 0 < len(corners) <= CHOSEN.most_vertices:
                raise ValueError(
                    f"corners of the possible weights must be (k, n), they are {corners.shape}"
                )
            if not np.isfinite(corners).all():
                raise ValueError("a corner of the possible weights holds no finite number")

    def too_fast(self, rate: Array) -> Array:
        """Return by how much ρ is beyond that of the drive that taught, over it, (k, 2).
        rate : ρ of both axles [1/s], (k, 2).
        """
        return _beyond_driven(rate, np.array(self.fastest))

    def reach(self, units: Array) -> tuple[Array, Array]:
        """Return least and largest h'w of the possible weights, (k, 2) each [static axle loads].
        units : h of both axles (k, 2, n).
        """
        of = [_extremes(units[:, i], corners) for i, corners in enumerate(self.corners)]
        least, most = (np.stack(both, axis=1) for both in zip(*of, strict=True))
        return least, most

    def limits(self, units: Array, doubt: Doubt) -> tuple[Array, Array]:
        """Return least and largest force, (k, 2) each [static axle loads].
        units : h of both axles (k, 2, n).
        """
        low, high = self.reach(units)
        kept, beside = 1.0 - doubt.lost, self.bound.allowed(doubt.beyond, doubt.rate)
        return np.minimum(low, kept * low) - beside, np.maximum(high, kept * high) + beside

    def contradicted(self, strips: Strips) -> NDArray[np.bool_]:
        """Return which means of another drive no possible curve explains, (m, 2).

        One is proof that the bound does not hold there: other tires, another road, a sensor.
        """
        low, high = self.limits(strips.h, Doubt(strips.beyond, strips.rate, strips.lost))
        outside: NDArray[np.bool_] = (strips.y < low - CHOSEN.slack) | (
            strips.y > high + CHOSEN.slack
        )
        return outside

    def to_dict(self) -> dict[str, Any]:
        """Return them as plain numbers, ready for JSON."""
        return {
            "error_static_axle_loads": list(self.bound.error),
            "lateness_s": list(self.bound.lateness),
            "given": self.given,
            "corners": [corners.tolist() for corners in self.corners],
            "speed_m_s": self.speed,
            "fastest_static_axle_loads_per_s": list(self.fastest),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], n: int) -> Self:
        """Return those that `to_dict` describes.
        n : weights of each.
        """
        pairs = []
        for name in (*PAIRS, "corners"):
            if not isinstance(data[name], list) or len(data[name]) != 2:
                raise ValueError(f"{name} of the guarantee must be a pair, front and rear")
            pairs.append(data[name])
        given = data.get("given", data.get("told"))  # "told": files of earlier versions
        if not isinstance(given, bool):
            raise ValueError(f"given of the guarantee must be true or false, not {given!r}")
        error, lateness, fastest, both = pairs
        front, rear = (np.array(corners, dtype=np.float64) for corners in both)
        for corners in (front, rear):
            if corners.ndim != 2 or corners.shape[1] != n:
                raise ValueError(f"corners must have {n} weights each, shape (k, {n})")
        return cls(
            bound=ForceBound(
                error=(float(error[0]), float(error[1])),
                lateness=(float(lateness[0]), float(lateness[1])),
            ),
            given=given,
            corners=(front, rear),
            speed=float(data["speed_m_s"]),
            fastest=(float(fastest[0]), float(fastest[1])),
        )


class Guarantee(NamedTuple):
    """Between which forces the true ones lie, if the bound holds of which weights are possible.

    Parameters
    ----------
    possible : weights that the drive left.
    ladder : slip scales of the units [rad].
    driven : largest slip of the drive [rad], (2,).
    loads : of the axles, static [N], (2,).
    min_speed : below which forces read zero [m/s].
    signals : over a drive units times load and cos δ (n, 2, ladder), and what opens the band.
    """

    possible: PossibleWeights
    ladder: tuple[float, ...]
    driven: Array
    loads: Array
    min_speed: float
    signals: Callable[[Recording], tuple[Array, Doubt]]

    @overload
    def at(self, alpha: float, axle: Axle, rate: float = ...) -> tuple[float, float]: ...
    @overload
    def at(
        self, alpha: ArrayLike, axle: Axle | None = None, rate: ArrayLike = ...
    ) -> tuple[Array, Array]: ...

    def at(
        self, alpha: ArrayLike, axle: Axle | None = None, rate: ArrayLike = 0.0
    ) -> tuple[float, float] | tuple[Array, Array]:
        """Return least and largest steady force under static loads [N], each as of `force`.

        Parameters
        ----------
        alpha : slip angles in the paper's sign [rad], a number or an array of any shape.
        axle : "front" or "rear", for ends of the shape of `alpha`; None gives both, (..., 2).
        rate : how fast the force changes [static axle loads/s], of the shape of `alpha` or one
            number: a force may be late. 0 is steady.
        """
        slip = np.asarray(alpha, dtype=np.float64)
        rates = np.tile(np.broadcast_to(np.abs(rate), slip.shape).ravel(), (2, 1)).T
        units = np.tile(unit_matrix(slip.ravel(), self.ladder)[:, None], (1, 2, 1))
        beyond = _beyond_driven(slip.reshape(-1, 1), self.driven) + self.possible.too_fast(rates)
        sides = self.possible.limits(units, Doubt(beyond, rates, np.zeros_like(rates)))
        low, high = (of_axle((side * self.loads).reshape(*slip.shape, 2), axle) for side in sides)
        return ends(low, high)

    def over(self, recording: Recording) -> tuple[Array, Array]:
        """Return least and largest force over a drive, (n, 2) [N]; NaN below the lowest speed."""
        low, high = self.possible.limits(*self.signals(recording))
        stands = recording.v_x < self.min_speed
        low[stands], high[stands] = np.nan, np.nan
        return low * self.loads, high * self.loads


def _extremes(rows: Array, corners: Array) -> tuple[Array, Array]:
    """Return least and largest product of each row (k, n) with corners (m, n), (k,) each."""
    least, most = np.empty(len(rows)), np.empty(len(rows))
    for first in range(0, len(rows), CHOSEN.at_once):
        part = slice(first, first + CHOSEN.at_once)
        products = corners @ rows[part].T
        least[part], most[part] = products.min(axis=0), products.max(axis=0)
    return least, most


def force_rate(
    units: Array, curves: Sequence[Array], dt: float, segments: Iterable[slice]
) -> Array:
    """Return ρ (k, 2) [1/s]: the larger of |dφ/dt| and of its mean over the last 0.3 s.

    Of several curves that which changes most counts, at each instant.
    units : tanh(x/α_j) of both axles (k, 2, n).
    curves : weights of front and rear, (m, n) each [static axle loads].
    dt : sampling interval [s].
    """
    rate = np.zeros(units.shape[:2])
    for part in segments:
        if part.stop - part.start < 2:
            continue
        change = np.gradient(units[part], dt, axis=0)
        of = [_extremes(change[:, i], weights) for i, weights in enumerate(curves)]
        now = np.column_stack([np.maximum(-least, most) for least, most in of])
        rate[part] = np.maximum(now, _faded(now, dt))
    return rate


def _faded(signal: Array, dt: float) -> Array:
    """Return the mean of a signal (k, ...) over the last 0.3 s, fading."""
    from scipy.signal import lfilter

    e = math.exp(-dt / CHOSEN.memory)
    mean: Array = lfilter([1.0 - e], [1.0, -e], signal, axis=0, zi=e * signal[:1])[0]
    return mean


def _beyond_driven(slip: Array, driven: Array) -> Array:
    """Return by how much slip, or ρ, is beyond that of a drive, over it, (k, 2); 0 within.
    slip : of both axles [rad], (k, 2), or (k, 1) where both have the same; or ρ [1/s].
    driven : largest of the drive (2,), positive, of the same unit.
    """
    return np.maximum(np.abs(slip) / driven - 1.0, 0.0)


def slip_beyond(slip: Array, driven: Array, dt: float, segments: Iterable[slice]) -> Array:
    """Return β (k, 2): the largest |x|/x_driven - 1 until now, each fading with 0.3 s; 0 within.
    slip : lagged x (k, 2) [rad].   driven : largest of the drive that taught (2,), positive [rad].
    dt : sampling interval [s].
    """
    beyond = np.zeros_like(slip)
    for part in segments:
        over = _beyond_driven(slip[part], driven)
        age = dt / CHOSEN.memory * np.arange(len(over))[:, None]
        with np.errstate(divide="ignore"):  # ln 0: nothing was beyond yet
            beyond[part] = np.exp(np.maximum.accumulate(np.log(over) + age, axis=0) - age)
    return beyond


def grip_lost(along: Array, grip: Array) -> Array:
    """Return which share of a side force a force along the car may cost, (k, 2).

    An ellipse: 1 - √(1 - (f/grip)²). Which axle is driven or braked nobody tells; each could be.
    along : f, force along the car over the load of each axle (k, 2).
    grip : what the axle carries at least (2,) or (k, 2) [static axle loads].
    """
    lost: Array = 1.0 - np.sqrt(
        1.0 - np.minimum(np.abs(along) / np.maximum(grip, CHOSEN.guarantee_tiny), 1.0) ** 2
    )
    return lost


def along_acceleration(v_x: Array, turning: Array, dt: float, segments: Iterable[slice]) -> Array:
    """Return dv_x/dt - v_y r over the last 0.3 s (k,) [m/s²].
    v_x : forward speed (k,) [m/s].   turning : v_y r (k,) [m/s²].   dt : sampling interval [s].
    """
    along = np.zeros_like(v_x)
    for part in segments:
        along[part] = (v_x[part] - _faded(v_x[part], dt)) / CHOSEN.memory - _faded(
            turning[part], dt
        )
    return along
