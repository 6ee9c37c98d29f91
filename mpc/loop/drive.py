"""The closed loop: a car that is not the prediction, noisy sensors, delay, and a tracker.

At t_k the car is measured and the tracker decides; what it decides acts from t_{k+d} to t_{k+d+1},
d periods later.
"""

import math
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from mpc.cars import CarState, DoubleTrackCar
from mpc.loop.guide import Guide, Place
from mpc.loop.lateral import LateralVelocity
from mpc.loop.pace import Earned
from mpc.loop.record import COMPLETED, Drive, Recorder
from mpc.loop.sensing import CarSensors, Measured, Measures
from mpc.path.path import Path, Projection
from mpc.path.speed import SpeedProfile
from mpc.problem import size_of
from mpc.realtime.instance import Status
from mpc.realtime.tracker import Tracker

_SPUN = math.radians(45.0)  # side slip of the center of gravity [rad]
_SLOWEST = 1.0  # m/s, of a full-size car
_PLANNED = 0.9  # share of the steps with a new plan, below which the tracker did not drive


class LearningTires(Protocol):
    """What runs beside the tracker and may hand it another tire."""

    def observe(self, measured: Measured, tracker: Any) -> str | None:
        """Look at a sample; return what was decided where that is worth a note."""


def drive(
    path: Path,
    car: DoubleTrackCar,
    tracker: Tracker,
    *,
    speed: SpeedProfile | Earned | float,
    sensors: Measures | None = None,
    delay: int = 1,
    rng: np.random.Generator,
    learner: LearningTires | None = None,
    lateral: LateralVelocity | None = None,
    laps: float = 1.0,
    time_limit: float = 300.0,
    widest: float = 2.0,
    blind: float = 2.0,
    plan_every: int = 10,
    name: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Drive:
    """Drive a car along a path.

    path : to follow, from s = 0.   tracker : which steers; it is reset.
    speed : wanted along the path, [m/s] where it is a number; one that is earned may be replaced
    on the way.
    sensors : of the car; None measures exactly.
    lateral : tells v_y, and a_y in the plane of the road, in place of the sensors; None takes what
    they show.
    laps : how often to drive a closed path; an open one is driven once.
    time_limit : after which the drive is given up [s].
    widest : deviation at which the car has left the path [m].
    blind : longest time without a number of a position, heading or speed [s]: until then the car
    goes on by dead reckoning, then the drive ends.
    plan_every : periods between two plans that are kept; 0 keeps none.
    name : of the drive; None takes that of the path.
    """
    if abs(car.period - tracker.period) > 1e-9:
        raise ValueError(f"the car steps {car.period} s, the tracker {tracker.period} s")
    if delay < 0:
        raise ValueError(f"delay must not be negative, it is {delay}")
    if not blind > 0.0:
        raise ValueError(f"blind must be positive, it is {blind}")
    earned = speed if isinstance(speed, Earned) else None
    if isinstance(speed, Earned):
        speed = speed.profile
    profile = speed if isinstance(speed, SpeedProfile) else SpeedProfile(path, speed)
    sensors = sensors if sensors is not None else CarSensors()
    goal = path.length * (laps if path.closed else 1.0)
    X, Y, psi = (float(value) for value in path.pose(0.0))
    kappa = float(path.curvature(0.0))
    state = car.start(float(profile.at(0.0)), X=X, Y=Y, psi=psi, kappa=kappa)
    tracker.reset(state.delta)
    waiting = deque([state.delta] * delay)
    record = Recorder(plan_every)
    here = path.project(state.X, state.Y, 0.0)
    start = Place(state.X, state.Y, state.psi, state.v_x)
    guide = Guide(path, tracker, car.speed_gain, start, here)
    slowest = _SLOWEST * size_of(car.vehicle) ** 0.5
    planned, ending = 0, ""
    while not ending:
        sensed = measured = sensors.measure(state, rng)
        given = None if lateral is None else lateral.tell(sensed)
        if given is not None:
            measured = given.in_place_of(sensed)
        guide.locate(measured, car.period)
        place, s = guide.place, guide.here.s
        for channel in place.just_lost(car.period):
            record.note(state.t, f"{channel} is no number: dead reckoning")
        if learner is not None:
            record.note(state.t, learner.observe(measured, tracker))
        if earned is not None:
            record.note(state.t, earned.observe(measured, s, place.v_x))
            profile = earned.profile
        command = guide.steer(measured, profile)
        planned += command.status < Status.QP_FAILED
        v_ref = profile.reference(here.s, car.speed_gain)
        if record.plan_is_due:
            record.plan(command, guide.ahead(profile, tracker.plan_times).s)
        record.add(state, here, sensed, guide.here.e_y, v_ref, command, given)
        waiting.append(command.steering)
        try:
            state = car.step(state, waiting.popleft(), v_ref)
        except ArithmeticError as error:
            ending = str(error)
            break
        here = path.project(state.X, state.Y, here.s)
        if progress is not None:
            progress(min(here.s / goal, 1.0))
        ending = _ending(state, here, goal, widest, slowest) or place.complaint(blind)
        if not ending and state.t >= time_limit:
            ending = f"not there after {time_limit:g} s"
    if ending == COMPLETED and planned < _PLANNED * record.steps:
        ending = f"the tracker planned in {planned} of {record.steps} steps only"
    return record.drive(name or path.name, path, car, ending)


def _ending(state: CarState, here: Projection, goal: float, widest: float, slowest: float) -> str:
    """Return why the drive is over, or nothing while it goes on."""
    if abs(here.e_y) > widest:
        return f"left the path by more than {widest:.2g} m"
    if abs(math.atan2(state.v_y, state.v_x)) > _SPUN:
        return "spun"
    if state.v_x < slowest:
        return f"slower than {slowest:.2g} m/s"
    return COMPLETED if here.s >= goal else ""
