"""A plan: passes through an area that teach most, one after the other, beside slalom and random.

A pass lasts as long as the area lets it. Where the car can turn inside, that is all of the time;
else it drives through, comes back slowly and enters again: each pass is planned with what is known
after those before it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.plan.chosen import CHOSEN
from identifier.plan.information import asked, covariance_after, deviation, expected_error
from identifier.plan.motion import NO_HOLD, Entry, Motion, hold_of, simulate, steps_of
from identifier.plan.rehearsal import rehearse
from identifier.plan.search import (
    Pass,
    PlanError,
    Search,
    Space,
    body_of,
    edge_distance,
    swing_time,
)
from identifier.plan.tires import PlausibleTires
from models.maneuvers import Maneuver, RandomSteer, Slalom
from models.plant import Plant
from models.recordings import Recording
from models.vehicle import GRAVITY, Vehicle

_AMPLITUDES = np.geomspace(0.05, 1.0, 24)  # of the largest angle
_LONGER = np.array([1.0, 1.5, 2.0, 3.0, 4.5, 6.0, 8.0, 10.0])  # times, of a slalom that catches up


class Rival(NamedTuple):
    """A maneuver of the same length, on an open field.
    error : expected after it [-].   length, width : of the field that the likely car takes [m].
    catches_up : after what time it is as good as the plan [s]; inf where not in ten times its time.
    """

    name: str
    error: float
    length: float
    width: float
    catches_up: float


class Rehearsal(NamedTuple):
    """A pass on a plant.

    log : what exact sensors see.   clearance : least distance to the edge [m].   side_slip : its
    largest size [rad].
    """

    log: Recording
    clearance: float
    side_slip: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What to drive, and what it is expected to teach."""

    tires: PlausibleTires
    space: Space
    passes: tuple[Pass, ...]
    rivals: tuple[Rival, ...]

    @property
    def time(self) -> float:
        """Length of all passes together [s]."""
        return sum(one.steering.duration for one in self.passes)

    @property
    def error_before(self) -> float:
        """Expected error of the forces over the grip before the maneuver [-]."""
        doubt = asked(self.tires, self.space.speed)
        return float(expected_error(self.tires, doubt, self.tires.covariance).mean())

    @property
    def error(self) -> float:
        """Expected error of the forces over the grip after all passes [-]."""
        return self.passes[-1].error

    def deviations(self) -> tuple[Array, Array, Array]:
        """Return slips [rad], and the deviation of the force there before and after, (2, s) [N]."""
        doubt = asked(self.tires, self.space.speed)
        loads = np.array(self.tires.vehicle.axle_loads)[:, None]
        before = deviation(doubt, self.tires.covariance) * loads
        return doubt.slips, before, deviation(doubt, self.passes[-1].covariance) * loads

    @property
    def clearance(self) -> float:
        """Least distance of any part of the car to the edge, with all plausible tires [m]."""
        ways = [(one.motion.X, one.motion.Y, one.motion.psi) for one in self.passes]
        body = body_of(self.tires)
        return min(float(edge_distance(self.space, body, *way).min()) for way in ways)

    def rehearsed(self, plant: Plant) -> tuple[Rehearsal, ...]:
        """Return how another car drives each pass: one whose tires need not be as planned."""
        hold = hold_of(self.tires, self.space.speed) if self.space.held else NO_HOLD
        body = body_of(self.tires)
        driven = []
        for one in self.passes:
            log, way = rehearse(plant, one.steering, one.course, self.space.speed, hold)
            inside = way[log.t >= CHOSEN.lead - 1e-9]
            assert log.v_y is not None
            side_slip = float(np.abs(np.arctan2(log.v_y, log.v_x)).max())
            clearance = float(edge_distance(self.space, body, *inside.T))
            driven.append(Rehearsal(log, clearance, side_slip))
        return tuple(driven)

    @property
    def lateral_acceleration(self) -> float:
        """Largest, of the likely tires [m/s²]."""
        loads = np.array(self.tires.vehicle.axle_loads)
        felt = [
            np.abs(np.tensordot(loads, one.motion.force[:, :, 0, 0], (0, 1))) for one in self.passes
        ]
        return float(max(one.max() for one in felt)) / self.tires.vehicle.mass


def _longest_pass(tires: PlausibleTires, space: Space) -> float:
    """Return how long a pass may last [s]: inf where the car can turn inside the area."""
    body = body_of(tires)
    slippery = float(tires.grip.min(axis=1).min())
    radius = space.speed**2 / (CHOSEN.turns * space.share * slippery * GRAVITY)
    reach = math.hypot(radius + body.side, body.ahead) + space.margin
    if 2.0 * reach <= space.width:
        return math.inf
    free = space.length - 2.0 * space.margin - body.ahead - body.behind
    return max(free, 0.0) / space.speed


def make_plan(
    tires: PlausibleTires,
    space: Space,
    time: float,
    rng: np.random.Generator,
    progress: Callable[[float], None] | None = None,
) -> Plan:
    """Return the passes that teach most.
    tires : that the car may have, under static loads; the plan's are those under the loads of its
        speed.
    time : of all passes together [s].
    """
    if not CHOSEN.least_time <= time <= CHOSEN.most_time:
        raise PlanError(
            f"the time must be {CHOSEN.least_time:g} to {CHOSEN.most_time:g} s, it is {time:g}"
        )
    least = tires.vehicle.lowest_speed * 3.0
    if space.speed < least:
        raise PlanError(
            f"no sample counts below {least:.3g} m/s with this car, the speed is {space.speed:g}"
        )
    tires = tires.at_speed(space.speed)
    body = body_of(tires)
    narrowest = 2.0 * (space.margin + body.side)
    if space.width < narrowest:
        raise PlanError(
            f"the area is {space.width:g} m wide and the car with its margins {narrowest:.3g} m: "
            "give more room or less margin"
        )
    longest = _longest_pass(tires, space)
    needed = CHOSEN.fewest * swing_time(tires, space)
    if min(longest, time) < needed:
        if longest >= needed:
            raise PlanError(
                f"{needed:.2g} s are needed to steer three times at {space.speed:g} m/s, "
                f"the time is {time:g}"
            )
        raise PlanError(_too_small(tires, space, longest, needed))
    count = max(1, math.ceil(time / longest))
    if count > CHOSEN.most_passes:
        raise PlanError(
            f"{time:g} s in this area take {count} passes of {longest:.2g} s, more than "
            f"{CHOSEN.most_passes}: give more room or less time"
        )
    passes: list[Pass] = []
    known = tires
    for k in range(count):
        search = Search(tires=known, space=space, duration=time / count, guided=longest < math.inf)

        def share(done: float, before: int = k) -> None:
            if progress is not None:
                progress((before + done) / count)

        passes.append(search.best(rng, share))
        known = known.after(passes[-1].covariance)
    rivals = _rivals(tires, space, time, passes[-1].error)
    return Plan(tires=tires, space=space, passes=tuple(passes), rivals=rivals)


def _too_small(tires: PlausibleTires, space: Space, longest: float, needed: float) -> str:
    """Return why there is no pass, and what would make one."""
    body = body_of(tires)
    own = 2.0 * space.margin + body.ahead + body.behind
    slower = max(space.length - own, 0.0) / needed
    given = f", or drive at {slower:.3g} m/s" if slower > 3.0 * tires.vehicle.lowest_speed else ""
    return (
        f"at {space.speed:g} m/s a pass lasts {longest:.2g} s, and {needed:.2g} s are needed to "
        f"steer three times: the area must be {own + needed * space.speed:.3g} m long{given}"
    )


Steering = Callable[[float], Maneuver]  # of an amplitude [rad]


def hardest(tires: PlausibleTires, space: Space, of: Steering) -> Maneuver:
    """Return the hardest of maneuvers that keeps the share of the grip, with the likely tires.
    space : speed and share; its sides are not looked at.
    """
    sizes = _AMPLITUDES * Search(tires=tires, space=space, duration=1.0, guided=False).largest_angle
    every = [of(float(size)) for size in sizes]
    t = steps_of(tires, min(every[0].duration, CHOSEN.probed * tires.vehicle.froude_time))
    delta = np.column_stack([one.steering(t)[:, 0] for one in every])
    slip = np.abs(free_motion(tires, delta, space.speed).slip[..., 0]).max(axis=0)
    kept = (slip <= tires.slip_at(space.share)[0][:, None]).all(axis=0)
    return every[max(int(kept.argmin()) - 1, 0) if not kept.all() else -1]


def slalom_of(vehicle: Vehicle, duration: float, frequency: float | None = None) -> Steering:
    """Return slaloms by their amplitude.
    duration : [s].   frequency : [Hz]; None takes 0.27 sqrt(g/L), 0.5 Hz for a sedan.
    """
    f = CHOSEN.slalom / vehicle.froude_time if frequency is None else frequency
    return lambda amplitude: Slalom(
        amplitude=amplitude, frequency=f, onset=0.0, rate_limit=2.1 * math.pi * f * amplitude,
        duration=duration,
    )  # fmt: skip


def random_of(vehicle: Vehicle, duration: float, seed: int) -> Steering:
    """Return random steerings by their amplitude, swings half as fast again as those of a slalom.
    duration : [s].
    """
    f = 1.5 * CHOSEN.slalom / vehicle.froude_time
    return lambda amplitude: RandomSteer(
        amplitude=amplitude, frequency=f, seed=seed, onset=0.0,
        rate_limit=2.1 * math.pi * f * amplitude, duration=duration,
    )  # fmt: skip


def _rivals(tires: PlausibleTires, space: Space, time: float, error: float) -> tuple[Rival, ...]:
    """Return a slalom and random steering at the share of the grip, with as much room as wanted."""
    slalom = hardest(tires, space, slalom_of(tires.vehicle, float(_LONGER[-1]) * time))
    late = math.inf
    for times in _LONGER:
        if _rated(tires, space, [slalom], float(times) * time).error <= error:
            late = float(times) * time
            break
    drawn = [
        hardest(tires, space, random_of(tires.vehicle, time, seed)) for seed in range(CHOSEN.random)
    ]
    first = _rated(tires, space, [slalom], time)._replace(name="slalom", catches_up=late)
    return first, _rated(tires, space, drawn, time)


def _rated(
    tires: PlausibleTires, space: Space, maneuvers: Sequence[Maneuver], time: float
) -> Rival:
    t = steps_of(tires, time)
    delta = np.column_stack([one.steering(t)[:, 0] for one in maneuvers])
    motion = free_motion(tires, delta, space.speed)
    P = covariance_after(tires, motion, space.speed)
    found = expected_error(tires, asked(tires, space.speed), P).mean(axis=1)
    one, body = int(np.argsort(found)[len(maneuvers) // 2]), body_of(tires)
    length, width = extent(motion.X[:, one, 0], motion.Y[:, one, 0])
    length, width = length + body.ahead + body.behind, width + 2.0 * body.side
    return Rival("random", float(found[one]), length, width, math.nan)


def free_motion(tires: PlausibleTires, delta: Array, v_x: float) -> Motion:
    """Return the motion on an open field, from the origin along X.
    delta : angles of the front wheels at steps of the simulation [rad], (n, m).
    v_x : speed [m/s].
    """
    at = np.zeros(delta.shape[1])
    return simulate(tires, delta, v_x, Entry(at, at, at), hold_of(tires, v_x))


def extent(X: Array, Y: Array) -> tuple[float, float]:
    """Return length and width [m] of the least rectangle, however turned, around a way.
    X, Y : of the way [m], (n,).
    """
    angles = np.linspace(0.0, math.pi, 361)[:-1]
    c, s = np.cos(angles), np.sin(angles)
    along, across = (np.ptp(np.outer(a, X) + np.outer(b, Y), axis=1) for a, b in ((c, s), (-s, c)))
    k = int((along * across).argmin())
    return float(max(along[k], across[k])), float(min(along[k], across[k]))
