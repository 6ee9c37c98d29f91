"""The steering that teaches most within an area: one pass through it, found by a global search.

A pass enters at the left edge of the area (X along its length, Y to the left, origin in its corner)
at a place and a heading that are found too. Steering is N angles joined by half cosines, whose
durations change from the first to the last by one ratio; in a long pass they repeat, every other
time mirrored. Where a car cannot turn inside, what is planned also comes back to the middle line,
slowly, as who drives holds the course: no angles alone keep a lane for long. Differential evolution
(R. Storn, K. Price, J. Global Optimization 11, 1997) makes the expected error small, meant over all
tires that the car may have; a pass is possible where each of these cars stays in the area, none
slides at the rear, all are calm at its end, and the likely one keeps its share of the grip at both
axles.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import differential_evolution

from codegen.arrays import Array
from codegen.errors import TireidError
from identifier.plan.chosen import CHOSEN
from identifier.plan.information import asked, covariance_after, expected_error
from identifier.plan.motion import NO_HOLD, Entry, Guide, Motion, hold_of, simulate, steps_of
from identifier.plan.tires import PlausibleTires
from models.maneuvers import SampledSteer
from models.rules import require_positive, require_within
from models.vehicle import GRAVITY


class PlanError(TireidError, ValueError):
    """No maneuver is possible as asked; the message says what would be."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Space:
    """Where, how fast and how hard it is driven.
    length, width : of the area [m], the longer side first.   speed : that is held [m/s].
    share : of the grip that the likely tires take at most, at both axles [-].
    margin : between any part of the car and the edge of the area [m].
    rate_limit : largest steering rate of the front wheels [rad/s].
    max_angle : of the front wheels [rad].
    held : whether who drives holds the planned course, or steers blindly.
    """

    length: float
    width: float
    speed: float
    share: float
    margin: float
    rate_limit: float
    max_angle: float
    held: bool = True

    def __post_init__(self) -> None:
        require_positive(
            PlanError,
            **{name: getattr(self, name) for name in ("length", "width", "speed", "rate_limit")},
        )
        require_within(PlanError, 0.0, 1e3, margin=self.margin)
        require_within(PlanError, 0.2, CHOSEN.rear, share=self.share)
        require_within(PlanError, math.radians(1.0), math.radians(60.0), max_angle=self.max_angle)


class _Body(NamedTuple):
    """How far a car reaches from its center of gravity [m]: ahead, behind, to each side."""

    ahead: float
    behind: float
    side: float


def body_of(tires: PlausibleTires) -> _Body:
    car = tires.vehicle
    over = CHOSEN.overhang * car.wheelbase
    side = CHOSEN.half_width * car.wheelbase
    if car.chassis is not None:
        track = max(car.chassis.track_front, car.chassis.track_rear)
        side = 0.5 * CHOSEN.wider * track
    return _Body(car.l_f + over, car.l_r + over, side)


def edge_distance(space: Space, body: _Body, X: Array, Y: Array, psi: Array) -> Array:
    """Return the least distance of a body on its way to the edge of the area [m], (...).
    X, Y, psi : center of gravity [m] and heading [rad] over time, (n, ...).
    """
    c, s = np.cos(psi), np.sin(psi)
    least = np.full(psi.shape[1:], math.inf)
    for along in (body.ahead, -body.behind):
        for side in (body.side, -body.side):
            x, y = X + along * c - side * s, Y + along * s + side * c
            for distance in (x, space.length - x, y, space.width - y):
                least = np.minimum(least, distance.min(axis=0))
    return least


def swing_time(tires: PlausibleTires, space: Space) -> float:
    """Return the mean duration of a change from angle to angle [s].

    Soft tires need large angles: as long as a half cosine takes, at the limit of the steering rate,
    from the slip of the wanted share of the grip to the same slip on the other side.
    """
    across = math.pi * float(tires.slip_at(space.share)[0, 0]) / space.rate_limit
    return max(CHOSEN.swing * tires.vehicle.froude_time, across)


class _Steerings(NamedTuple):
    """m steerings: times (m, N + 1) [s], angles (m, N + 1) [rad], and entries."""

    times: Array
    angles: Array
    entry: Entry

    def delta(self, t: Array) -> Array:
        """Return the angles of the front wheels over time [rad], (n, m).   t : [s], (n,)."""
        lines = []
        for times, angles in zip(self.times, self.angles, strict=True):
            k = np.clip(np.searchsorted(times, t, side="right") - 1, 0, times.size - 2)
            share = np.clip((t - times[k]) / np.diff(times)[k], 0.0, 1.0)
            lines.append(angles[k] + (0.5 - 0.5 * np.cos(math.pi * share)) * np.diff(angles)[k])
        return np.column_stack(lines)


class Pass(NamedTuple):
    """One way through the area.

    steering : of the front wheels from the entry on.   entry : where and how it comes in.
    motion : of all plausible tires, as `Motion` with m = 1.   covariance : after it, of the likely
    tires, (2, q, q).   error : expected after it, meant over all tires [-].   t : of motion [s].
    """

    steering: SampledSteer
    entry: Entry
    motion: Motion
    covariance: Array
    error: float
    t: Array

    def course(self, t: Array) -> Array:
        """Return X, Y [m] and heading [rad] of the likely tires, (n, 3).
        t : since the entry [s], (n,).
        """
        lines = (one[:, 0, 0] for one in (self.motion.X, self.motion.Y, self.motion.psi))
        return np.column_stack([np.interp(t, self.t, line) for line in lines])


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """A pass of a given duration that is looked for.
    duration : of the pass [s].
    guided : along the middle of the area; else the way is free, as where a car can turn inside.
    """

    tires: PlausibleTires
    space: Space
    duration: float
    guided: bool

    @property
    def swings(self) -> int:
        """How many changes of the angle there are before they repeat."""
        wanted = round(self.duration / swing_time(self.tires, self.space))
        return max(CHOSEN.fewest, round(wanted / self.repeats))

    @property
    def repeats(self) -> int:
        """How often the swings are driven, every other time mirrored."""
        wanted = self.duration / swing_time(self.tires, self.space)
        return max(1, math.ceil(wanted / CHOSEN.most))

    @property
    def largest_angle(self) -> float:
        """Angle that no swing passes [rad]: a bend at the grip, and the slip it takes."""
        car, grip = self.tires.vehicle, float(self.tires.grip[0].mean())
        bend = car.wheelbase * grip * GRAVITY / self.space.speed**2
        return min(self.space.max_angle, bend + 1.5 * float(self.tires.slip_at(CHOSEN.rear)[0, 0]))

    def steerings(self, numbers: Array) -> _Steerings:
        """Return the steerings that numbers between -1 and 1 stand for; rates are kept.
        numbers : N - 1 angles, ratio of durations, place and heading of the entry, (m, N + 2).
        """
        N, space = self.swings, self.space
        u, (chirp, place, heading) = numbers[:, : N - 1], numbers[:, N - 1 :].T
        spans = np.exp(CHOSEN.chirp * chirp[:, None] * np.linspace(-1.0, 1.0, N))
        spans *= self.duration / self.repeats / spans.sum(axis=1, keepdims=True)
        angles = np.zeros((len(numbers), N + 1))
        angles[:, 1:N] = u * self.largest_angle
        reach = 2.0 / math.pi * space.rate_limit * spans * (1.0 - 1e-9)
        forward = ((k, k - 1, k - 1) for k in range(1, N))
        back = ((k, k + 1, k) for k in range(N - 1, 0, -1))
        for k, beside, span in (*forward, *back):
            low, high = angles[:, beside] - reach[:, span], angles[:, beside] + reach[:, span]
            angles[:, k] = np.clip(angles[:, k], low, high)
        again = [(-1.0) ** k * angles[:, 1:] for k in range(self.repeats)]
        angles = np.column_stack([angles[:, :1], *again])
        spans = np.tile(spans, self.repeats)
        times = np.column_stack([np.zeros(len(numbers)), np.cumsum(spans, axis=1)])
        body = body_of(self.tires)
        psi = CHOSEN.largest_heading * heading
        free = 0.5 * space.width - space.margin - body.side
        X = space.margin + body.behind * np.cos(psi) + body.side * np.abs(np.sin(psi))
        return _Steerings(times, angles, Entry(X, 0.5 * space.width + free * place, psi))

    def costs(self, numbers: Array) -> Array:
        """Return the expected error of steerings, more than 1 where they are not possible, (m,)."""
        steerings = self.steerings(numbers)
        motion = self.motion(steerings)
        cost = 1.0 + self.violation(motion)
        possible = cost <= 1.0
        if possible.any():
            kept = Motion(*(one[..., possible, :] for one in motion))
            P = covariance_after(self.tires, kept, self.space.speed)
            doubt = asked(self.tires, self.space.speed)
            cost[possible] = expected_error(self.tires, doubt, P).mean(axis=1)
        return cost

    def motion(self, steerings: _Steerings) -> Motion:
        """Return what all tires do under steerings."""
        t = steps_of(self.tires, self.duration)
        space, hold = self.space, hold_of(self.tires, self.space.speed)
        guide = Guide(hold, 0.5 * space.width, space.rate_limit, space.max_angle)
        return simulate(
            self.tires,
            steerings.delta(t),
            space.speed,
            steerings.entry,
            hold if space.held else NO_HOLD,
            guide if self.guided else None,
        )

    def violation(self, motion: Motion) -> Array:
        """Return by how much motions break a limit, not positive where they are possible, (m,)."""
        slip = np.abs(motion.slip).max(axis=0)  # (2, m, k)
        limit = self.tires.slip_at(CHOSEN.rear).T  # (2, k)
        over = [slip[1] / limit[1] - 1.0]
        over += [slip[:, :, 0].T / self.tires.slip_at(self.space.share)[0] - 1.0]
        over += [np.abs(motion.slip[-1, 1]) / self.tires.slip_at(CHOSEN.calm)[:, 1] - 1.0]
        outside = self.beyond(motion) / self.tires.vehicle.wheelbase
        worst = [one.max(axis=1) for one in (*over, outside)]
        return np.asarray(np.sum(np.maximum(worst, 0.0), axis=0))

    def beyond(self, motion: Motion) -> Array:
        """Return by how far the margin is broken at most [m], (m, k); negative inside."""
        way = motion.X, motion.Y, motion.psi
        return self.space.margin - 1e-6 - edge_distance(self.space, body_of(self.tires), *way)

    def beginnings(self, rng: np.random.Generator) -> Array:
        """Return numbers to begin with, swings to the left and the right of all sizes, (m, N +
        2).
        """
        N = self.swings
        size = np.exp(rng.uniform(math.log(0.05), 0.0, (CHOSEN.population, 1)))
        sign = np.where(np.arange(N - 1) % 2 == 0, 1.0, -1.0)
        u = size * sign * rng.uniform(-0.2, 1.0, (CHOSEN.population, N - 1))
        u *= rng.choice([-1.0, 1.0], (CHOSEN.population, 1))
        rest = rng.uniform(-1.0, 1.0, (CHOSEN.population, 3)) * [1.0, 0.9, 0.3]
        return np.column_stack([u, rest])

    def best(
        self, rng: np.random.Generator, progress: Callable[[float], None] | None = None
    ) -> Pass:
        least: list[float] = []  # cost, after each generation

        def costs(numbers: Array) -> Array:
            found = self.costs(numbers.T)
            least.append(min([*least[-1:], float(found.min())]))
            return found

        def after(*_: object) -> bool:
            if progress is not None:
                progress(len(least) / CHOSEN.generations)
            possible = least[-1] < 1.0 and len(least) > CHOSEN.stalled
            return possible and least[-1] > (1.0 - CHOSEN.gain) * least[-1 - CHOSEN.stalled]

        found = differential_evolution(
            costs,
            [(-1.0, 1.0)] * (self.swings + 2),
            init=self.beginnings(rng),
            maxiter=CHOSEN.generations,
            mutation=(0.3, 0.8),
            recombination=0.8,
            tol=0.0,
            polish=False,
            updating="deferred",
            vectorized=True,
            callback=after,
            seed=rng,
        )
        if not found.fun < 1.0:
            raise PlanError(
                f"no pass of {self.duration:.3g} s at {self.space.speed:g} m/s stays in "
                f"{self.space.length:g} x {self.space.width:g} m with every tire that the car may "
                "have: give more room, a lower speed, a shorter pass or less margin"
            )
        return self.as_pass(np.array([found.x]))

    def as_pass(self, numbers: Array) -> Pass:
        steerings = self.steerings(numbers)
        motion = self.motion(steerings)
        P = covariance_after(self.tires, motion, self.space.speed)
        error = expected_error(self.tires, asked(self.tires, self.space.speed), P)
        t = steps_of(self.tires, self.duration)
        steering = SampledSteer(
            times=tuple(t.tolist()),
            angles=tuple(motion.asked[:, 0, 0].tolist()),
            rate_limit=self.space.rate_limit,
            duration=self.duration,
        )
        return Pass(steering, steerings.entry, motion, P[0, 0], float(error.mean()), t)
