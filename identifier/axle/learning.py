"""From motion to a regression that is linear in the weights, without derivative and stiffness.

dξ/dt = φ cos δ - v_x r/g, filtered by L(p) = 1/(p/κ + 1):
y = κ ξ - L(κ ξ - v_x r/g) = L(φ cos δ) = Σ θ_j L(g_j),  so y is measured and h = L(g) known.
The filter is trapezoidal: f⁺ = e f + (1 - e)/2 (u⁺ + u), e = exp(-κ dt), with the state
v = e f + (1 - e)/2 u.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.axle.car import larger, reciprocal, smaller, within
from identifier.axle.covariance import (
    LEAST_VARIANCE,
    Factors,
    Spread,
    Symmetric,
    excited,
    scaled,
    updated,
    width,
)
from identifier.setup import Range
from models.rules import Positive, require_positive_fields

_TINY = 1e-12  # of a size that is divided by
LEAN = 1e-4  # of a step that is limited: towards the center, by more than rounding can do


@dataclass(frozen=True, slots=True, kw_only=True)
class Regression(Positive):
    """Filter, error model and memory; times belong to drivers and sensors, not to the car's size.
    bandwidth : κ [1/s].   memory : of directional forgetting, in time with excitation [s].
    error : additive error of y [static axle loads]: 0.02 is 0.2 m/s².
    relative_error : of y [-], the model's.
    correlation_time : of these errors [s]; it makes the result independent of the sampling.
    lateness : by which steering and force may differ in time [s].
    noise : of v_y, which sits in the slip [m/s].
    sure : force from which on samples teach the curve, and not the sensors' offset alone [`error`]:
        a smaller one could be theirs.
    moment : over which that force is meant [s]: noise is no force.
    sure_time : its memory [s]: between left and right a curve is learnt at small forces, too.
    clip : largest error that counts in full, over the standard deviation that y is declared to have
        times `ErrorState.slow` [-].
    widest : trace of the covariance of weights at which forgetting stops, over the prior's [-].
    rate : by which learning may change the force of a curve [static axle loads/s]; three times what
        a change of friction asks for.
    """

    bandwidth: float = 4.0
    memory: float = 10.0
    error: float = 0.02
    relative_error: float = 0.04
    correlation_time: float = 0.1
    lateness: float = 0.005
    noise: float = 0.005
    sure: float = 3.5
    moment: float = 0.2
    sure_time: float = 0.7
    clip: float = 5.0
    widest: float = 2.0
    rate: float = 30.0

    def at(self, dt: float) -> "RegressionNumbers":
        """Return the numbers of a step.
        dt : sampling interval [s].
        """
        e = math.exp(-self.bandwidth * dt)
        return RegressionNumbers(
            bandwidth=self.bandwidth,
            e=e,
            half=0.5 * (1.0 - e),
            forgetting=math.expm1(dt / self.memory),
            error=self.error,
            relative_error=self.relative_error,
            samples=self.correlation_time / dt,
            lateness=self.lateness * self.bandwidth,
            noise=self.noise,
            least_force=self.sure * self.error,
            decay=math.exp(-dt / self.sure_time),
            smooth=min(dt / self.moment, 1.0),
            clip=self.clip,
            per_step=1.0 / (self.rate * dt),
        )


class RegressionNumbers(NamedTuple):
    """κ, e, (1 - e)/2; (1 - λ)/λ; errors; correlated samples; κ lateness; noise of v_y; least force
    to learn from, the decay of its memory and the gain of its mean; clip; 1/largest step.
    """

    bandwidth: Any
    e: Any
    half: Any
    forgetting: Any
    error: Any
    relative_error: Any
    samples: Any
    lateness: Any
    noise: Any
    least_force: Any
    decay: Any
    smooth: Any
    clip: Any
    per_step: Any


def filtered(numbers: RegressionNumbers, v: Any, u: Any, first: Any) -> tuple[Any, Any]:
    """Return f and the next state of the filter.
    u : its input now, which is also its output at a restart.
    """
    f = first * u + (1 - first) * (v + numbers.half * u)
    return f, numbers.e * f + numbers.half * u


# Recursive least squares with directional forgetting (R. Kulhavy, Automatica 23, 1987).
#
# Only the direction that the regressor excites is forgotten: no wind-up while the rest is not
# excited, and none that would make the covariance wider than its limit.


class Learnt(NamedTuple):
    """Parameters (q entries) and factors of the covariance after an update.
    uncertainty : h'Ph before it.   weights : block of the weights of P before it, by place.
    """

    theta: list[Any]
    P: Factors
    uncertainty: Any
    weights: Symmetric


def update(
    theta: list[Any],
    P: Factors,
    h: list[Any],
    *,
    innovation: Any,
    R: Any,
    forgetting: Any,
    spread: Spread,
    limits: list[Any],
    learns: Any,
) -> Learnt:
    """Return parameters and covariance after one sample.

    θ⁺ = θ + P h e/(R + a), a = h'Ph;  P⁺ = P - κ P h h'P/((R + a) a), κ = a - R (1 - λ)/λ, which
    keeps P positive definite for every a, also where κ < 0 and P grows: 1/h'P⁻¹h stays positive.
    No D of its factors falls below `LEAST_VARIANCE`: what would do so is learnt from, but P
    stays.
    theta : parameters, q entries.   P : factors of their covariance.   h : regressor, q entries.
    innovation : e = y - h'θ, clipped.   R : its variance.   forgetting : (1 - λ)/λ.
    spread : of P, and of what is added to it otherwise in this step.
    limits : as in `width`; where P would grow beyond them it stays as it is.
    learns : whether to update at all.
    """
    direction = excited(P, h, 1e-12 * R)
    v, a = direction.v, direction.a
    kappa = a - forgetting * R
    share = reciprocal((R + a) * a)
    growth = -kappa * share  # of P along v v'
    n = len(v) - len(spread.others)
    trace = spread.trace + sum(growth * one * one for one in v[:n])
    others = [p + growth * one * one for p, one in zip(spread.others, v[n:], strict=True)]
    wide = width(trace, others, limits)
    smallest = P.D[0]
    for one in P.D[1:]:
        smallest = smaller(one, smallest)
    thick = smallest * (R + R * forgetting) >= LEAST_VARIANCE * (R + a)
    moves = ca.logic_and(learns, ca.if_else(kappa >= 0, thick, wide <= 1))
    # β_q = 1 + c a = (R + a)/(R + R (1 - λ)/λ), so that c/β_q = κ/((R + a) a)
    c = ca.if_else(moves, kappa / (a * R * (1 + forgetting)), 0)
    gain = learns * innovation * a * share
    theta = [one + along * gain for one, along in zip(theta, v, strict=True)]
    after = scaled(updated(P, direction, c), moves * wide)
    return Learnt(theta, after, a, spread.weights)


# Another road, and errors that nothing explains.
#
# Another friction moves the force that the weights explain by g = h'M w times the change of ln μ
# (φ = μ φ₀(α/μ)), at both axles alike. With e of a second, leaking, that change is
# m = b/(A + 1/s²), A = Σ g²/V, b = Σ g e/V, V the variance of e with what the weights still leave
# open, and it takes b²/(A + 1/s²) off the squared errors Σ e²/V. Where that is twice `evidence`,
# and most of them, as no broken sensor has it, the road is believed: weights move by m M w, and P
# opens along it by what m still leaves open.
# q = e²/V of one sample is about one where all is as learnt. The square of its fast mean over its
# trend makes samples count less that come suddenly and that nothing explains, as of a sensor that
# breaks; the slow mean of e²/σ² is the noise to get used to.


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadChange(Positive):
    """When another friction is believed, and which errors teach less.
    evidence : from which another road is believed [nats].
    explains : share of the squared errors that it must take off, without its prior [-].
    time : over which evidence is collected [s].
    correlation_time : of errors that a friction could be taken for [s].
    spread : standard deviation of ln μ of another road.
    step : largest change of ln μ that is believed at once.
    fast, trend, slow : time constants of the means of squared errors [s].
    """

    evidence: float = 6.0
    explains: float = 0.8
    time: float = 1.0
    correlation_time: float = 0.5
    spread: float = 0.7
    step: float = 0.3
    fast: float = 0.2
    trend: float = 10.0
    slow: float = 20.0

    def at(self, dt: float, rate: float) -> "RoadNumbers":
        """Return the numbers of a step.
        dt : sampling interval [s].
        rate : by which learning may change a force, and so ln μ at a grip of one [1/s].
        """
        return RoadNumbers(
            twice_evidence=2.0 * self.evidence,
            keep=math.exp(-dt / self.time),
            per_sample=dt / self.correlation_time,
            before=self.spread**-2,
            explains=self.explains,
            step=self.step,
            most=min(self.step, rate * dt),
            fast=min(dt / self.fast, 1.0),
            trend=min(dt / self.trend, 1.0),
            slow=min(dt / self.slow, 1.0),
        )


class RoadNumbers(NamedTuple):
    """Twice the evidence; share that a sample keeps; share of it that is new; 1/s²; share that must
    be explained; largest step, and of it in a sample; gains of the means.
    """

    twice_evidence: Any
    keep: Any
    per_sample: Any
    before: Any
    explains: Any
    step: Any
    most: Any
    fast: Any
    trend: Any
    slow: Any


class RoadState(NamedTuple):
    """A, b and E = Σ e²/V; ln of the friction over that at the start [-]."""

    A: Any
    b: Any
    E: Any
    ln_friction: Any


class ErrorState(NamedTuple):
    """Columns (2,): fast mean of q and its trend [-]; slow mean of e²/σ², by which the variance of
    y is larger than declared, from 1 to 4 [-]; recent peak of the measured force, which is a mean
    of y over a moment [static axle loads].
    """

    fast: Any
    trend: Any
    slow: Any
    peak: Any


def believed(numbers: RoadNumbers, state: RoadState) -> tuple[Any, Any]:
    """Return by how much ln μ is believed to have changed, 0 where it has not, and its variance."""
    precision = state.A + numbers.before
    per_precision = reciprocal(precision)
    square = state.b * state.b
    explains = square > numbers.explains * state.E * state.A
    sure = ca.logic_and(square > numbers.twice_evidence * precision, explains)
    change = within(state.b * per_precision, -numbers.most, numbers.most)
    return ca.if_else(sure, change, 0), ca.if_else(sure, per_precision, 0)


def evidence(
    numbers: RoadNumbers,
    state: RoadState,
    change: Any,
    *,
    g: Any,
    e: Any,
    V: Any,
    holds: Any,
    learns: Any,
) -> Any:
    """Return the next state (4,); what was believed is asked no more, but for what the limit of a
    sample left of a step.

    Parameters
    ----------
    change : of ln μ that this sample is to accept.
    g, e, V : of both axles (2,).   holds : whether an axle carries a force (2,).
    learns : whether to take the sample.
    """
    cut = ca.logic_and(ca.fabs(change) >= numbers.most, numbers.most < numbers.step)
    keep = ca.if_else(ca.logic_or(change == 0, cut), numbers.keep, 0)
    weight = holds * numbers.per_sample / V
    b = state.b - change * state.A  # of the errors that are left
    E = state.E - change * (state.b + b)
    taken = ca.vertcat(
        keep * state.A + ca.dot(weight, g * g),
        keep * b + ca.dot(weight, g * e),
        keep * E + ca.dot(weight, e * e),
        state.ln_friction + change,
    )
    return ca.if_else(learns, taken, ca.vertcat(*state))


# Bounds of what is learnt, kept after every sample, exactly: also in float, whatever was learnt.
#
# The saturated force W = Σ w_j and the slope S = Σ a_j w_j of an axle are kept in their ranges by
# the least move in the metric of the covariance, which finds both at once: moving one unit alone,
# or clipping each, would break what was learnt. Rounding, and the box on each weight, are the
# business of what comes last: a move on the straight line towards the center of the set, where all
# units are equal, by just so much that every bound holds. The numbers of that test lie inside the
# declared bounds by more than rounding in float can do, so that what is declared holds of the
# stored numbers.

FLOAT = float(np.finfo(np.float32).eps)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Limits of parameters.
    least_grip, most_grip : of the saturated force [static axle loads]; a slick under downforce
        reaches three.
    least_stiffness, most_stiffness : of the curve at no slip [static axle loads/rad]; tires of cars
        and of their models lie between 4 and 40.
    weight : of each weight [static axle loads].   compliance : [m per static axle load].
    steering : of the steering's zero [rad].   v_y : of the bias of v_y [m/s].
    """

    least_grip: float = 0.1
    most_grip: float = 3.0
    least_stiffness: float = 2.0
    most_stiffness: float = 80.0
    weight: float = 3.0
    compliance: float
    steering: float = 0.03
    v_y: float

    def __post_init__(self) -> None:
        require_positive_fields(self)
        for of in ("grip", "stiffness"):
            least, most = getattr(self, f"least_{of}"), getattr(self, f"most_{of}")
            if not least < most:
                raise ValueError(f"least_{of} must be below most_{of}, they are {least}, {most}")

    def of_ladder(self, ladder: tuple[float, ...]) -> "BoundNumbers":
        """Return the numbers of a step.

        n products of weights that lie in the box sum up to within n + 8 roundings.
        ladder : slip scales of the n units [rad].

        Raises
        ------
        ValueError
            Where n weights within their box, all equal, cannot carry the middle of the grip, or
            are stiffer or softer than they may.
        """
        n, slopes = len(ladder), float((1.0 / np.array(ladder)).sum())
        rounding = (n + 8) * FLOAT * self.weight
        least, most = self.least_grip + n * rounding, self.most_grip - n * rounding
        center = 0.5 * (least + most) / n
        radius = self.weight - center - rounding
        if not (least < most and radius > 0.0):
            raise ValueError(
                f"{n} weights up to {self.weight} cannot carry a grip of {self.least_grip} to "
                f"{self.most_grip}"
            )
        flattest = self.least_stiffness / slopes + rounding
        steepest = self.most_stiffness / slopes - rounding
        if not flattest < center < steepest:
            raise ValueError(
                f"a ladder of {n} units of equal weight has a stiffness of {center * slopes:g} "
                f"loads/rad, outside of {self.least_stiffness:g} to {self.most_stiffness:g}"
            )
        return BoundNumbers(
            least_grip=least,
            most_grip=most,
            least_slope=flattest,
            most_slope=steepest,
            center=center,
            per_grip=2.0 / (most - least),
            per_falling=1.0 / (center - flattest),
            per_rising=1.0 / (steepest - center),
            per_weight=1.0 / radius,
            compliance=inward(self.compliance),
            steering=inward(self.steering),
            v_y=inward(self.v_y),
        )


def curve_ranges(bounds: Bounds, ladder: tuple[float, ...]) -> tuple[Range, ...]:
    """Return where the weights of both axles must lie: each, their grip and their stiffness.
    ladder : slip scales of the n units [rad].
    """
    b, n = bounds, len(ladder)
    return (
        *(Range("W", i, -b.weight, b.weight) for i in range(2 * n)),
        *(Range("W", i, b.least_grip, b.most_grip, (1.0,) * n) for i in (0, n)),
        *(
            Range("W", i, b.least_stiffness, b.most_stiffness, tuple(1.0 / one for one in ladder))
            for i in (0, n)
        ),
    )


def rising_shares(ladder: tuple[float, ...]) -> Array:
    """Return the units' slopes at zero slip over their sum, (n,), as `bounded` wants them.
    ladder : slip scales of the units [rad].
    """
    slopes = 1.0 / np.array(ladder)
    return slopes / slopes.sum()


def inward(limit: float) -> float:
    """Return the largest float that is not above a limit.
    limit : positive.
    """
    nearest = np.float32(limit)
    return float(nearest if float(nearest) <= limit else np.nextafter(nearest, np.float32(0)))


class BoundNumbers(NamedTuple):
    """Ends of grip and slope, the center, 1/its distance from them and from the box; other limits.

    Grip, slope and weight are inside the declared bounds by what rounding may do. The slope is
    that of the curve over the sum of the units' slopes.
    """

    least_grip: Any
    most_grip: Any
    least_slope: Any
    most_slope: Any
    center: Any
    per_grip: Any
    per_falling: Any
    per_rising: Any
    per_weight: Any
    compliance: Any
    steering: Any
    v_y: Any


def bounded(
    numbers: BoundNumbers,
    theta: list[Any],
    P: Symmetric,
    *,
    offset: Any,
    slope: list[Any],
) -> list[Any]:
    """Return [w, s, k, offset] of an axle within its bounds; what is within them is not moved.
    theta : parameters, n + 3 entries.
    P : covariance of the weights, the metric: upper triangle by place.
    slope : of `rising_shares`, n entries.
    """
    n = len(theta) - 3
    w, (s, k, o) = theta[:n], theta[n:]
    return [
        *towards_center(numbers, _rising(numbers, w, P, slope), slope),
        within(s, 0, numbers.compliance),
        within(k, 0, 1),
        within(o, -offset, offset),
    ]


def _dot(a: list[Any], b: list[Any]) -> Any:
    return sum(x * y for x, y in zip(a, b, strict=True))


def _times(P: Symmetric, row: list[Any]) -> list[Any]:
    n = len(row)
    return [sum(P[min(i, j), max(i, j)] * row[j] for j in range(n)) for i in range(n)]


def _positive(x: Any) -> Any:
    """Return a size that rounding may have made zero or negative, as a divisor."""
    return larger(x + _TINY, _TINY)


def _rising(numbers: BoundNumbers, w: list[Any], P: Symmetric, slope: list[Any]) -> list[Any]:
    """Move w by the least, in the metric of P, so that its grip and its slope are in range.

    Where the slope is not once the grip alone is mended, it ends at its bound: the move to it, then
    one along it (P-orthogonal, which leaves the slope) to the grip.
    """
    by_grip, by_slope = _times(P, [1] * len(w)), _times(P, slope)
    A, B, C = sum(by_grip), sum(by_slope), _dot(slope, by_slope)
    least, most = numbers.least_grip, numbers.most_grip
    grip, steep = sum(w), _dot(slope, w)
    by_grip_alone = B * (within(grip, least, most) - grip)
    falls = (numbers.least_slope - steep) * A > by_grip_alone
    rises = (numbers.most_slope - steep) * A < by_grip_alone
    missing = ca.if_else(falls, numbers.least_slope, numbers.most_slope) - steep
    per_C = ca.if_else(ca.logic_or(falls, rises), reciprocal(_positive(C)), 0)
    to_slope, share = missing * per_C, B * per_C
    grip = grip + B * to_slope
    to_grip = (within(grip, least, most) - grip) / _positive(A - B * share)
    to_slope = to_slope - to_grip * share
    return [a + b * to_grip + c * to_slope for a, b, c in zip(w, by_grip, by_slope, strict=True)]


def towards_center(numbers: BoundNumbers, w: list[Any], slope: list[Any]) -> list[Any]:
    """Move w towards the center of the set until every bound holds."""
    away = [one - numbers.center for one in w]
    over = larger(ca.fabs(sum(away)) * numbers.per_grip, 1)
    steep = _dot(slope, away)
    over = larger(larger(-steep * numbers.per_falling, steep * numbers.per_rising), over)
    for one in away:
        over = larger(ca.fabs(one) * numbers.per_weight, over)
    part = reciprocal(over)
    rest = (1 - part) * numbers.center
    return [part * one + rest for one in w]


def limited(numbers: BoundNumbers, per_step: Any, last: list[Any], w: list[Any]) -> list[Any]:
    """Return weights on the way to others; no force of the curve changes by more than a limit.

    φ changes by Σ T_j Δw_j with 1 >= T_1 >= ... >= T_n >= 0 at any slip, the narrowest unit first:
    by no more than the largest partial sum |Σ_(j<=k) Δw_j| (Abel). What is within is not moved; a
    step that is cut leans to the center a little, so that rounding does not leave the bounds.
    per_step : 1/the largest change of a force [1/static axle loads].
    last, w : weights before the sample and after it, both within their bounds, n entries.
    """
    moves = [b - a for a, b in zip(last, w, strict=True)]
    over, reached = 1, 0
    for move in moves:
        reached = reached + move
        over = larger(ca.fabs(reached) * per_step, over)
    part, stay = (1 - LEAN) * reciprocal(over), over <= 1
    return [
        ca.if_else(stay, b, a + part * move + LEAN * (numbers.center - a))
        for a, b, move in zip(last, w, moves, strict=True)
    ]
