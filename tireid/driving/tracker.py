"""The tracker for a loop of one's own: a state in, the steering out, once a period."""

import math
from collections import deque
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.tire_model import TireModel
from models.rules import require_kind, require_number, require_positive
from models.sensors import is_measured
from models.vehicle import Vehicle
from mpc.cars import SPEED_GAIN
from mpc.loop.guide import GUIDES, Guide, Place
from mpc.loop.lateral import LateralVelocity
from mpc.loop.record import Plan
from mpc.loop.sensing import Measured
from mpc.path import Path, SpeedProfile
from mpc.problem import Problem
from mpc.realtime.instance import Command, Status
from mpc.realtime.tracker import Tracker as _Tracker
from mpc.tires import PredictionTire, prediction_tire
from tireid.driving.setup import PERIOD, Setup, SpeedWish, require_drivable

# Beyond which an angle is one in degrees: wheels turn by 0.7 rad, and in models within 0.1 s.
_WIDEST, _FASTEST = 1.2, 20.0  # rad, rad/s


class VehicleState(NamedTuple):
    """A car at one instant, SI, axes x forward, y left, z up; NaN is a sample that was lost.

    Parameters
    ----------
    X, Y : position of the center of gravity [m].
    psi : heading [rad], of any number of turns.
    v_x : speed along the body [m/s].
    r : yaw rate [rad/s], positive to the left.
    v_y : velocity of the center of gravity to the left [m/s]; None where no sensor measures it.
    a_y : lateral acceleration [m/s²], read where v_y is estimated; None where none is measured.
    delta : angle of the front road wheels [rad]; None takes the steering that acts by now.
    """

    X: float
    Y: float
    psi: float
    v_x: float
    r: float
    v_y: float | None = None
    a_y: float | None = None
    delta: float | None = None


def _of_car(tire: Any, car: Vehicle) -> PredictionTire:
    if isinstance(tire, TireModel):
        tire.require_car(car)
    return prediction_tire(tire, car)


def _require_radians(most: float, unit: str, **values: float) -> None:
    for name, value in values.items():
        if abs(value) > most:
            raise ValueError(f"{name} must be at most {most:g} {unit}, it is {value:g}: degrees?")


class Tracker:
    """Steers a car along a path by a plan of the next 2 s; it is what steers in `tireid.drive`.

    For a model car, of a wheelbase below 1.5 m, lengths, speeds and times of plans and limits are
    those of its size: at 1:10 it plans 0.5 s and drives from 0.5 m/s on.

    Attributes: profile, the wanted speed along the path.

    Parameters
    ----------
    path : to follow, of `tireid.paths`: `Path.from_waypoints(X, Y)` or `Path.from_csv(file)`.
    car : the vehicle; it needs no chassis.
    tire : identified tires, as `run.tire`, or a tire of `models.tires`; None takes the linear ones
        of the car.
    speeds : a profile of `tireid.speed_profile`, or a constant speed [m/s]; None plans the profile
        of the identified tires.
    period : between two steps [s], at most 0.05.
    delay : from a state until its steering has reached the wheels [s], the lag of the steering
        included; at most 31 periods.
    max_steering : largest angle of the front road wheels [rad]; None: 0.5.
    max_steering_rate : fastest change of it [rad/s]; None: 0.8, for a model car more, such as 3.2
        at 1:10.
    caution : share of the tires' uncertainty that the plan allows for, from 0 to 1.

    Raises
    ------
    TypeError
        Where path, car or tire is another kind of object.
    ValueError
        Where a number breaks its rule, tires are of another car, speeds of another path, or
        nothing tells a speed.
    NoCompilerError
        Where there is no C compiler.
    """

    def __init__(
        self,
        path: Path,
        car: Vehicle,
        tire: Any = None,
        *,
        speeds: SpeedProfile | float | None = None,
        period: float = PERIOD,
        delay: float = 0.0,
        max_steering: float | None = None,
        max_steering_rate: float | None = None,
        caution: float = 0.0,
    ) -> None:
        require_kind(Path, "as of paths.Path.from_waypoints or Path.from_csv", path=path)
        require_kind(Vehicle, "as of Vehicle.from_toml or sedan", car=car)
        model = _of_car(car if tire is None else tire, car)
        self._known = tire if isinstance(tire, TireModel) else None
        wish = SpeedWish.of(speeds, self._known, car)
        problem = Problem.of(car, period)
        limits = problem.limits
        steering = limits.steering if max_steering is None else max_steering
        rate = limits.steering_rate if max_steering_rate is None else max_steering_rate
        require_positive(ValueError, max_steering=steering, max_steering_rate=rate)
        _require_radians(_WIDEST, "rad", max_steering=steering)
        _require_radians(_FASTEST, "rad/s", max_steering_rate=rate)
        problem = replace(problem, limits=replace(limits, steering=steering, steering_rate=rate))
        require_drivable(path, car, steering)
        self._tracker = _Tracker(model, problem, period=period, delay=delay, caution=caution)
        self.profile = Setup(path, car, 1.0, (), wish, wish.limits(self._known)).profile()
        self._path, self._car, self._most = path, car, steering
        self._guide: Guide | None = None
        self._lateral: LateralVelocity | None = None
        self._steered = deque([0.0], maxlen=1 + round(delay / period))  # and acts the first
        self._command: Command

    def reset(self) -> None:
        """Forget where the car is and what was planned: the next step begins anew."""
        self._guide = None

    def set_tire(self, tire: Any) -> None:
        """Plan with other tires from the next step on; the speeds stay.

        Parameters
        ----------
        tire : of the kind that the tracker was made with, with other numbers.

        Raises
        ------
        ValueError
            Where it is of another kind, or of another car.
        """
        self._tracker.set_tire(_of_car(tire, self._car))

    def step(self, state: VehicleState) -> float:
        """Return the angle to steer the front road wheels by [rad], positive to the left.

        Call it once a period. The first step looks for the nearest place of the path; later ones
        follow the path from the last place. What shows no number of X, Y, psi or v_x goes on by
        dead reckoning; without r or v_y the last plan steers on, then a feedback, see `status`.

        Parameters
        ----------
        state : of the car now. Whether v_y is measured or estimated is decided by the first one.

        Raises
        ------
        TypeError
            Where it is no `VehicleState`.
        ValueError
            Where a field is no number, or the first state lacks X, Y, psi or v_x, or its delta is
            beyond max_steering.
        """
        require_kind(VehicleState, "as VehicleState(X, Y, psi, v_x, r)", state=state)
        given = {name: math.nan if x is None else x for name, x in state._asdict().items()}
        for name, x in given.items():
            require_number(ValueError, name, x)
        X, Y, psi, v_x, r, v_y, a_y, delta = map(float, given.values())
        measured = Measured(0.0, X, Y, psi, v_x, v_y, r, delta, a_y)
        guide = self._guide or self._begin(measured, estimates=state.v_y is None)
        if state.delta is None:
            measured = measured._replace(delta=self._steered[0])
        if self._lateral is not None:
            measured = self._lateral.tell(measured).in_place_of(measured)
        guide.locate(measured, self._tracker.period)
        self._command = guide.steer(measured, self.profile)
        self._steered.append(self._command.steering)
        return self._command.steering

    def _begin(self, first: Measured, *, estimates: bool) -> Guide:
        lost = [name for name in GUIDES if not is_measured(name, getattr(first, name))]
        if lost:
            raise ValueError(f"the first state needs a number of {', '.join(lost)}")
        place = Place(first.X, first.Y, first.psi, first.v_x)
        here, length = self._path.project(place.X, place.Y), self._path.length
        if self._path.closed and here.s > 0.5 * length:  # not yet at the start of the first lap
            here = self._path.project(place.X, place.Y, here.s - length)
        wheels = 0.0 if math.isnan(first.delta) else first.delta
        _require_radians(self._most, "rad", delta=wheels)
        self._tracker.reset(wheels)
        self._steered.extend([wheels] * (self._steered.maxlen or 1))
        self._lateral, period = None, self._tracker.period
        if estimates:
            self._lateral = LateralVelocity.beginning_with(self._known, self._car, period)
        self._guide = Guide(self._path, self._tracker, SPEED_GAIN, place, here)
        return self._guide

    @property
    def _located(self) -> Guide:
        if self._guide is None:
            raise ValueError("the tracker knows no place yet: call step first")
        return self._guide

    @property
    def status(self) -> Status:
        """What the last step did: OK, or why it steers by the last plan or by feedback."""
        assert self._located
        return Status(self._command.status)

    @property
    def s(self) -> float:
        """Arc length along the path now [m]; a closed path counts laps, and is first met within
        half a lap of its start: s < 0 is before it.
        """
        return self._located.here.s

    @property
    def e_y(self) -> float:
        """Deviation from the path now, to the left [m]."""
        return self._located.here.e_y

    @property
    def e_psi(self) -> float:
        """Heading against that of the path now, to the left [rad]."""
        return self._located.here.heading_error(self._located.place.psi)

    @property
    def finished(self) -> bool:
        """Whether the car is past the end of an open path; a closed one has none."""
        begun = self._guide is not None
        return begun and not self._path.closed and self.s >= self._path.length

    @property
    def blind(self) -> float:
        """For how long one of X, Y, psi and v_x has been no number [s]."""
        return max(self._located.place.silent)

    @property
    def wanted_speed(self) -> float:
        """Speed of the profile here [m/s], for a controller of the speed."""
        return float(self.profile.at(self.s))

    @property
    def wanted_acceleration(self) -> float:
        """Change of that speed along the way [m/s²], to be added to what a controller asks for."""
        return self.profile.reference(self.s, 1.0) - self.wanted_speed

    @property
    def plan(self) -> Array:
        """Where the car is planned to be in the next 2 s, X and Y [m], (41, 2)."""
        road = self._located.ahead(self.profile, self._tracker.plan_times)
        plan = Plan(0, road.s, self._command.plan_x, self._command.plan_u)
        return np.column_stack(plan.line(self._path))

    def __repr__(self) -> str:
        return f"<Tracker along {self._path.name} on {self._tracker.tire.structure}>"
