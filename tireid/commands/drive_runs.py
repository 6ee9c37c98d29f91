"""One drive for each tire that a tracker is told: linear, frozen, true, or learnt on the way."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path as FilePath
from typing import Any, NamedTuple, cast

import numpy as np

from codegen.arrays import Array
from identifier.methods import continuing
from identifier.run import OnlineIdentifier
from identifier.tire_model import TireModel
from models.faults import SensorFault
from models.friction import Friction, FrictionChange
from models.tires import Tire
from models.vehicle import Vehicle, sedan
from mpc.cars import Car, DoubleTrackCar
from mpc.handover.learner import Learner
from mpc.handover.supervisor import Supervisor
from mpc.loop import (
    CarSensors,
    Drive,
    FaultySensors,
    LearningTires,
    Measured,
    Measures,
    Scores,
    SpeedProfile,
    drive,
    inertial_unit,
    scores,
)
from mpc.loop.sensing import cornering_limit
from mpc.path import BUILT_IN, Path, grip_speed, steady_speed
from mpc.problem import Problem
from mpc.realtime import NoCompilerError, Tracker
from mpc.tires import PredictionTire, oracle_tire, prediction_tire
from tireid.progress import Ticker

# What `tireid drive` drives: a path, a car on its road, and how fast.
#
# Grip is that of the true tire in steady cornering on the friction of the start.

PLANTS = ("double-track", "multi-body", "drift")
FASTEST = 30.0  # on a closed course [m/s]
ACCELERATION, BRAKING = 2.0, 3.0  # on a closed course at friction 1 [m/s²]
PERIOD = 0.01  # control period [s]


class SpeedWish(NamedTuple):
    """How fast to drive: a share of the grip, or a speed [m/s]; one of them is None."""

    share: float | None
    speed: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """A car at the start of a path.

    Parameters
    ----------
    path : to follow.
    vehicle : the car as its tracker is told of it.
    plant : which equations drive, of `PLANTS`.
    mu : friction of the road over that of the tire's measurement, before the first drop [-].
    drops : arc length [m] and friction from there on.
    wish : how fast.
    """

    path: Path
    vehicle: Vehicle
    plant: str
    mu: float
    drops: tuple[tuple[float, float], ...]
    wish: SpeedWish

    def car(self, *, open_field: bool = False) -> Car:
        """Return a car on the road, or on a field that has the friction of the start everywhere.

        Parameters
        ----------
        open_field : leave the drops out.
        """
        friction = Friction(scale=self.mu) if open_field else self.friction()
        if self.plant == "double-track":
            return DoubleTrackCar(self.vehicle, friction=friction, period=PERIOD)
        from mpc.cars.commonroad import drift_car, multi_body_car

        make: Callable[..., Car] = multi_body_car if self.plant == "multi-body" else drift_car
        return make(friction=friction, period=PERIOD)

    def oracle(self, mu: float | None = None) -> PredictionTire:
        """Return the true tire on a road.

        Parameters
        ----------
        mu : its friction; None is that of the start.
        """
        tire = cast(Hashable, self._tire())
        return _oracle(self.vehicle, tire, self.mu if mu is None else mu)

    def _tire(self) -> Tire:
        return self.car(open_field=True).tire

    @property
    def grip(self) -> float:
        """Largest lateral acceleration on the road of the start [m/s²]."""
        return cornering_limit(self.vehicle, self._tire(), self.mu)

    def speeds(self) -> Array:
        """Return the wanted speed at the samples of the path, (n,) [m/s].

        On an open path it is constant; on a closed one it brakes for the bends and accelerates.
        """
        if self.wish.share is None:
            assert self.wish.speed is not None
            return np.full(self.path.s.size, self.wish.speed)
        a_y = self.wish.share * self.grip
        if not self.path.closed:
            return np.full(self.path.s.size, steady_speed(self.path, a_y_max=a_y))
        return grip_speed(
            self.path,
            a_y_max=a_y,
            v_max=FASTEST,
            a_accel=self.mu * ACCELERATION,
            a_brake=self.mu * BRAKING,
        )

    def profile(self) -> SpeedProfile:
        """Return the wanted speed along the path."""
        return SpeedProfile(self.path, self.speeds())

    def friction(self) -> Friction:
        """Return the road with its drops.

        On a path along X each wheel meets a drop at its place. Elsewhere all wheels meet it at the
        time at which the car is expected there.
        """
        if not self.drops:
            return Friction(scale=self.mu)
        if self._runs_along_x:
            changes = [
                FrictionChange(scale=mu, at_place=float(self.path.pose(s)[0]))
                for s, mu in self.drops
            ]
        else:
            changes = [FrictionChange(scale=mu, at_time=self.time_at(s)) for s, mu in self.drops]
        return Friction(scale=self.mu, changes=tuple(changes))

    def time_at(self, s: float) -> float:
        """Return when the car is expected at a place, at the wanted speed [s].

        Parameters
        ----------
        s : arc length [m]; a closed course counts laps.
        """
        v = self.speeds()
        pace = 0.5 * (1.0 / v[1:] + 1.0 / v[:-1]) * np.diff(self.path.s)
        t = np.concatenate([[0.0], np.cumsum(pace)])
        laps, within = divmod(s, self.path.length) if self.path.closed else (0.0, s)
        return float(laps * t[-1] + np.interp(within, self.path.s, t))

    @property
    def _runs_along_x(self) -> bool:
        return not self.path.closed and bool(np.all(np.cos(self.path.psi) > 0.2))


@cache
def _oracle(vehicle: Vehicle, tire: Hashable, mu: float) -> PredictionTire:
    return oracle_tire(vehicle, cast(Tire, tire), mu)


def named_path(name: str) -> Path:
    """Return a built-in path, or one from way-points in a file.

    Parameters
    ----------
    name : one of the built-in paths, or the name of a CSV file.

    Raises
    ------
    ValueError
        Where it is neither, or the file is no path.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]()
    if not FilePath(name).suffix:
        raise ValueError(f"--path: there is no path {name!r}; {', '.join(BUILT_IN)}, or FILE.csv")
    return Path.from_csv(FilePath(name))


def make_setup(
    path: Path,
    *,
    vehicle: FilePath | None,
    plant: str,
    mu: float,
    drops: Sequence[tuple[float, float]],
    wish: SpeedWish,
) -> Setup:
    """Return a car at the start of a path.

    Parameters
    ----------
    path : to follow.
    vehicle : TOML file of the car, None for the built-in sedan or the car of the plant.
    plant : of `PLANTS`.
    mu : friction before the first drop [-].
    drops : arc length [m] and friction from there on.
    wish : how fast.

    Raises
    ------
    ValueError
        Where the plant brings its own car, or a drop is beyond the path.
    """
    ordered = tuple(sorted(drops))
    for s, _ in ordered:
        if not path.closed and s >= path.length:
            raise ValueError(f"--mu-drop {s:g} is beyond the path, which is {path.length:.0f} m")
    if plant == "double-track":
        car = sedan() if vehicle is None else Vehicle.from_toml(vehicle)
        car.require_chassis()
    else:
        if vehicle is not None:
            raise ValueError(f"--plant {plant} brings a car of its own: give no --vehicle with it")
        from mpc.cars.bmw import bmw

        car = bmw()
    return Setup(path=path, vehicle=car, plant=plant, mu=mu, drops=ordered, wish=wish)


# What may change the tire of a tracker on the way: learning, or being told the true friction.


class Informer:
    """Tells the tracker of an oracle the true tire of the road that the car is on.

    Parameters
    ----------
    setup : path, car and road.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup, self._friction, self._mu = setup, setup.friction(), setup.mu

    def observe(self, measured: Measured, tracker: Any) -> str | None:
        """Change the tire where the friction has changed; return that it was done.

        Parameters
        ----------
        measured : by the sensors.
        tracker : which steers.
        """
        mu = friction_now(self._friction, measured)
        if mu == self._mu:
            return None
        self._mu = mu
        tracker.set_tire(self._setup.oracle(mu))
        return f"told of friction {mu:g}"


def friction_now(friction: Friction, measured: Measured) -> float:
    """Return the friction where the car is, of a road whose changes are steps [-].

    Parameters
    ----------
    friction : of the road.
    measured : time and place of the car.
    """
    mu = friction.scale
    for change in friction.changes:
        here = measured.t if change.at_time is not None else measured.X
        if here >= change.start:
            mu = change.scale
    return mu


def make_learner(learnt: TireModel, vehicle: Vehicle) -> Learner:
    """Return what goes on learning while the tracker drives, and hands over what is fit.

    Parameters
    ----------
    learnt : what the tracker is told at the start.
    vehicle : the car.

    Raises
    ------
    ValueError
        Where no method can go on from there, or its law has no certificate.
    """
    try:
        method = continuing(learnt, vehicle, PERIOD)
    except ValueError as error:
        raise ValueError(f"--tires learning: {error}") from None
    identifier = OnlineIdentifier(method, vehicle, PERIOD, learnt)
    return Learner(Supervisor(identifier, prediction_tire(learnt, vehicle)))


LINEAR, FROZEN, ORACLE, LEARNING = TIRES = ("linear", "frozen", "oracle", "learning")
WIDEST = 2.0  # deviation at which a car is off the path [m]
PLAN_EVERY = 4  # periods between two plans that are kept: half a frame of the film


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What is alike for every tire.

    Parameters
    ----------
    setup : path, car and road.
    delay : periods from a measurement until what follows from it acts.
    noise : whether sensors are noisy.
    seed : of the noise.
    laps : of a closed path.
    faults : of the sensors, while the path is driven.
    """

    setup: Setup
    delay: int
    noise: bool
    seed: int
    laps: float
    faults: tuple[SensorFault, ...] = ()

    @property
    def sensors(self) -> CarSensors:
        """The sensors of the car, in order."""
        return inertial_unit() if self.noise else CarSensors()

    @property
    def driving_sensors(self) -> Measures:
        """The sensors on the path, new ones for each drive: broken ones remember."""
        return FaultySensors(self.sensors, self.faults) if self.faults else self.sensors


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Run:
    """A drive and what is known of it.

    Parameters
    ----------
    label : the tire that the tracker was told.
    model, final : that tire, at the start and at the end.
    problem : of the tracker.
    drive : what happened.
    scores : what it is worth.
    learner : what changed the tire on the way, if anything could.
    """

    label: str
    model: PredictionTire
    final: PredictionTire
    problem: Problem
    drive: Drive
    scores: Scores
    learner: LearningTires | None

    def __repr__(self) -> str:
        rms, peak = self.scores.rms_e_y_m, self.scores.peak_e_y_m
        return (
            f"<Run on {self.label} tires along {self.drive.path.name}: {self.drive.ending}; "
            f"{rms:.3f} m rms off the path, {peak:.3f} m at most>"
        )


def told_tire(label: str, setup: Setup, learnt: TireModel | None) -> PredictionTire:
    """Return the tire that a tracker is told at the start.

    Parameters
    ----------
    label : of `TIRES`.
    setup : path, car and road.
    learnt : what was learnt before the drive, for `frozen` and, where there is any, `learning`.
    """
    if label == LINEAR:
        return prediction_tire(setup.vehicle)
    if label == ORACLE:
        return setup.oracle()
    assert learnt is not None
    return prediction_tire(learnt, setup.vehicle)


def run_drive(
    label: str,
    conditions: Conditions,
    learnt: TireModel | None,
    *,
    linearizations: int = 1,
) -> Run:
    """Drive the path once with the tracker told of a tire.

    Parameters
    ----------
    label : of `TIRES`.
    conditions : what is alike for every tire.
    learnt : what was learnt before the drive.
    linearizations : a step of the tracker.

    Raises
    ------
    ValueError
        Where there is no C compiler for the tracker.
    """
    setup, problem = conditions.setup, Problem()
    model = told_tire(label, setup, learnt)
    lag = setup.vehicle.require_chassis().steering_lag
    try:
        tracker = Tracker(
            model,
            problem,
            period=PERIOD,
            delay=conditions.delay * PERIOD + lag,
            linearizations=linearizations,
        )
    except NoCompilerError as error:
        raise ValueError(str(error)) from None
    learner = _learner(label, setup, learnt)
    driven = drive(
        setup.path,
        setup.car(),
        tracker,
        speed=setup.profile(),
        sensors=conditions.driving_sensors,
        delay=conditions.delay,
        rng=np.random.default_rng([conditions.seed, 2]),
        learner=learner,
        laps=conditions.laps,
        widest=WIDEST,
        plan_every=PLAN_EVERY,
        name=f"{setup.path.name}, {label}",
        progress=Ticker(f"driving on {label} tires"),
    )
    return Run(
        label=label,
        model=model,
        final=tracker.tire,
        problem=problem,
        drive=driven,
        scores=scores(driven),
        learner=learner,
    )


def _learner(label: str, setup: Setup, learnt: TireModel | None) -> LearningTires | None:
    if label == ORACLE and setup.drops:
        return Informer(setup)
    if label == LEARNING:
        assert learnt is not None
        return make_learner(learnt, setup.vehicle)
    return None
