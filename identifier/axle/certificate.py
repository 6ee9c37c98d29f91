"""What is proven of the axle identifier before it drives; proofs: docs/methods/certificates.md.

Weights w of an axle lie, after every sample, in the polytope of `Bounds`: grip Σ w_j and slope
Σ w_j/α_j in their ranges, |w_j| <= weight. What is linear in w is largest at a corner of it.
φ(x) = Σ w_j tanh(x/α_j), in static axle loads; every unit, its slope and its secant change
monotonically with x > 0, so that their values at the ends of a cell of slips bound them inside.
Of a car with downforce all that is of φ, and a force is λ φ, with λ = 1 + κ v_x². How long a drop
of friction takes is proven of λ = 1 alone, and not stated of such a car.
"""

import math
from functools import cache
from itertools import combinations, product
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from identifier.axle.covariance import LEAST_VARIANCE
from identifier.axle.curve import unit_slopes
from identifier.axle.learning import FLOAT, LEAN, Bounds, Regression, RoadChange
from identifier.certificate import Property, at_least, at_most, statement
from identifier.driving import Driving
from models.vehicle import Vehicle

_LARGEST_SLIP = 1.5  # rad
_CELLS = 2000  # of slip, each a part wider than the one before
_SMALLEST_CELL = 1e-5  # rad, from zero slip
_ON_BOUND = 1e-9  # of a bound, within which a corner lies on it
_LONGEST = 60.0  # s, beyond which a drop is not followed
_FORGETS = (0.5, 0.9)  # share of its own information that a sample may forget: good, bad
SLOW_Q = 4.0  # the slow mean does not follow a change
MOST_SLOW = 4.0  # squared errors: above twice the declared they are no noise to get used to


class Design(Protocol):
    """What of an `AxleIdentifier` the proofs follow from; words and units are of its fields."""

    @property
    def bounds(self) -> Bounds:
        """Limits of what is learnt."""

    @property
    def regression(self) -> Regression:
        """Filter, error model and memory."""

    @property
    def change(self) -> RoadChange:
        """When another friction is believed."""

    @property
    def ladder(self) -> tuple[float, ...]:
        """Slip scales of the units [rad]."""

    @property
    def dt(self) -> float:
        """Sampling interval [s]."""


@cache
def corners(bounds: Bounds, ladder: tuple[float, ...]) -> Array:
    """Return the corners of the set that weights are kept in, (k, n) [static axle loads].
    ladder : slip scales of the units [rad].
    """
    n, most = len(ladder), bounds.weight
    slabs = [
        (np.ones(n), (bounds.least_grip, bounds.most_grip)),
        (1.0 / np.array(ladder), (bounds.least_stiffness, bounds.most_stiffness)),
    ]
    found = []
    for active in range(len(slabs) + 1):
        for chosen in combinations(slabs, active):
            for free in map(list, combinations(range(n), active)):
                rest = [j for j in range(n) if j not in free]
                rows = np.array([row[free] for row, _ in chosen]).reshape(active, active)
                if active and abs(np.linalg.det(rows)) < _ON_BOUND:
                    continue
                for ends in product(*(range_ for _, range_ in chosen)):
                    for at in product((-most, most), repeat=n - active):
                        w = np.zeros(n)
                        w[rest] = at
                        missing = [
                            end - row @ w for (row, _), end in zip(chosen, ends, strict=True)
                        ]
                        w[free] = np.linalg.solve(rows, missing) if active else []
                        found.append(w)
    points = np.array(found)
    inside = (np.abs(points) <= most * (1.0 + _ON_BOUND)).all(axis=1)
    for row, (low, high) in slabs:
        value = points @ row
        inside &= (value >= low - _ON_BOUND * high) & (value <= high * (1.0 + _ON_BOUND))
    return points[inside]


class _CurveFacts(NamedTuple):
    """What holds of force curves from zero slip on, proven cell by cell.
    opposes_until, rises_until : slip up to which φ/x and φ' are positive for certain [rad].
    steepest : secants φ/x lie below it [static axle loads/rad].
    """

    opposes_until: float
    rises_until: float
    steepest: float


def _cells(until: float) -> Array:
    """Return the ends of cells of slip from 0 on [rad]."""
    narrow = np.geomspace(min(_SMALLEST_CELL, 0.1 * until), until, _CELLS)
    return np.append(0.0, narrow)


def curve_facts(W: Array, ladder: tuple[float, ...], until: float) -> _CurveFacts:
    """Return what holds of every curve of a set.

    On a cell from a to b a falling function s of a unit is between s(b) and s(a), so that
    Σ w_j s_j is at least Σ_(w>0) w_j s_j(b) + Σ_(w<0) w_j s_j(a).
    W : weights of the curves (k, n) [static axle loads].   ladder : slip scales of the units [rad].
    until : largest slip [rad].
    """
    edges = _cells(until)
    scales = np.array(ladder)
    at = edges[:, None] / scales
    slopes = unit_slopes(edges, ladder)
    with np.errstate(invalid="ignore", divide="ignore"):
        secants = np.where(at > 0.0, np.tanh(at) / edges[:, None], 1.0 / scales)
    up, down = np.maximum(W, 0.0).T, np.minimum(W, 0.0).T

    def least(s: Array) -> Array:
        return (s[1:] @ up + s[:-1] @ down).min(axis=1)

    rising, opposing = least(slopes) > 0.0, least(secants)
    return _CurveFacts(
        opposes_until=_first(edges, opposing > 0.0),
        rises_until=_first(edges, rising),
        steepest=float((secants[:-1] @ up + secants[1:] @ down).max()),
    )


def _first(edges: Array, good: NDArray[np.bool_]) -> float:
    """Return the slip up to which all cells are good."""
    return float(edges[-1] if good.all() else edges[int(np.argmin(good))])


def _widest_range(W: Array, ladder: tuple[float, ...], until: float) -> float:
    """Return by how much two curves of a set may differ at one slip [static axle loads].
    W : corners of the set (k, n).   ladder : slip scales of the units [rad].
    until : largest slip [rad].
    """
    units = np.tanh(_cells(until)[:, None] / np.array(ladder))
    up, down = np.maximum(W, 0.0).T, np.minimum(W, 0.0).T
    most = (units[1:] @ up + units[:-1] @ down).max(axis=1)
    least = (units[:-1] @ up + units[1:] @ down).min(axis=1)
    return float((most - least).max())


class FrictionDrop(NamedTuple):
    """A drop of friction in a steady corner, for which the time to follow it is proven.
    to : friction after it over that before [-].
    left : share of the change that may still be missing when it counts as followed [-].
    seen : least |φ - x φ'| of the regressor: what a change of ln μ makes [static axle loads].
    noise : largest error of the measured force [static axle loads].
    unsure : standard deviation that weights, lag and offsets leave in it [static axle loads].
    slope : of the curves in the corner [static axle loads/rad].
    errors : slow mean of the squared error over what is given, when it drops [-].
    """

    to: float = 0.5
    left: float = 0.5
    seen: float = 0.2
    noise: float = 0.01
    unsure: float = 0.02
    slope: float = 20.0
    errors: float = 1.0

    def time(self, design: Design, friction: float, v_x: float) -> float:
        """Return for how long at most both axles stay wrong by more than `left` of it [s].

        While both are, evidence of the drop grows at least as fast as here, where errors are the
        least, are given the largest and are cut; what is then believed takes that off the error.
        That is of errors that are one change of ln μ at both axles, but for `RoadChange.explains`
        of their squares. inf where it does not end within a minute.
        friction : before the drop [-].   v_x : speed [m/s].
        """
        r, dt = design.regression, design.dt
        at = design.change.at(dt, r.rate)
        error = friction * (1.0 - self.to)
        wrong = self.left * error
        declared = r.error + r.relative_error * friction + r.noise * self.slope / v_x
        A, b, slow = 0.0, 0.0, self.errors
        for k in range(1, math.ceil(_LONGEST / dt) + 1):
            slow = min(slow * (1.0 + (SLOW_Q - 1.0) * at.slow), MOST_SLOW)
            weight = 2.0 * at.per_sample / (declared**2 * slow + self.unsure**2)
            e = min(wrong - self.noise, r.clip * declared)
            A, b = at.keep * A + weight * self.seen**2, at.keep * b + weight * self.seen * e
            precision = A + at.before
            if b > 0.0 and b * b > at.twice_evidence * precision:
                change = min(b / precision, at.most)
                error -= self.seen * change
                cut = change >= at.most < at.step
                A, b = (A, b - change * A) if cut else (0.0, 0.0)
            if error <= wrong:
                return k * dt
        return math.inf


def certified(design: Design, vehicle: Vehicle, driving: Driving) -> tuple[Property, ...]:
    """Return what is proven of a design, whatever is measured unless a title says more.

    Of a car with downforce without the time that a drop of friction takes.
    """
    b, dt = design.bounds, design.dt
    set_ = corners(b, design.ladder)
    facts = curve_facts(set_, design.ladder, _LARGEST_SLIP)
    apart = _widest_range(set_, design.ladder, _LARGEST_SLIP)
    jump = jump_by_learning(design)
    forgets = -math.expm1(-dt / design.regression.memory)
    # how far a limited step leans inwards, over what rounding in float may do to it
    inside, n = design.bounds.of_ladder(design.ladder), len(design.ladder)
    nearest = max(inside.per_grip, inside.per_weight, inside.per_falling, inside.per_rising)
    lean = float(LEAN / nearest / (8.0 * n * FLOAT * design.bounds.weight))
    proven = (
        Property(
            name="forgets",
            title="information along its regressor that a sample forgets: P stays positive",
            value=forgets,
            limit=_FORGETS[0],
            margin=_FORGETS[0] / forgets,
            status=at_most(forgets, good=_FORGETS[0], bad=_FORGETS[1]),
            unit="-",
            advice="sample faster, or let the memory be longer",
        ),
        statement(
            "smallest_factor",
            "smallest factor D of the covariance U D U', double and float",
            LEAST_VARIANCE,
            "units of weights^2",
        ),
        Property(
            name="lean",
            title="lean of a limited step inwards over rounding in float: boxes hold exactly",
            value=lean,
            limit=1.0,
            margin=lean,
            status=at_least(lean, good=1.0, bad=1.0),
            unit="-",
            advice="leave more room between the bounds",
        ),
        statement(
            "opposes_until",
            "slip up to which every possible curve pushes against its slip",
            facts.opposes_until,
            "rad",
        ),
        statement(
            "rises_until",
            "slip up to which every possible curve rises",
            facts.rises_until,
            "rad",
        ),
        statement("steepest", "steepest secant of any curve", facts.steepest, "static loads/rad"),
        Property(
            name="jump",
            title="largest jump of a force by learning, in one sample",
            value=jump,
            limit=apart,
            margin=apart / jump,
            status=at_most(jump, good=apart, bad=None),
            unit="static loads",
            advice="only the limits bound it: sample faster, or lower the rate",
        ),
    )
    return proven if vehicle.has_downforce else (*proven, _drop(design, driving))


def _drop(design: Design, driving: Driving) -> Property:
    """Return how long the drop of friction of a car takes whose loads are the static ones."""
    follows = FrictionDrop().time(design, driving.friction, driving.v_x)
    by_memory = design.regression.memory * math.log(2.0)
    return Property(
        name="drop_time",
        title="friction drops to half in a steady corner, alike at both axles: half wrong for",
        value=follows,
        limit=by_memory,
        margin=by_memory / follows,
        status=at_most(follows, good=by_memory, bad=None),
        unit="s",
        advice="it is not proven to be followed: the declared errors exceed those of the drop",
    )


def jump_by_learning(design: Design) -> float:
    """Return by how much learning changes a force in one sample at most [static axle loads].

    The step that is let through, and its lean to the center: no partial sum of weights is further
    from there than n times the weight and the grip.
    """
    b, n = design.bounds, len(design.ladder)
    return design.regression.rate * design.dt + LEAN * n * (b.weight + b.most_grip)
