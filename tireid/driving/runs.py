"""One drive for each tire that a tracker is given: linear, frozen, true, or learnt on the way."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from codegen import find_compiler
from codegen.arrays import Array
from codegen.compiler import NoCompilerError
from identifier.axle import AxleIdentifier, AxleModel
from identifier.axle.model import begun
from identifier.method import CannotFreezeError
from identifier.methods import continuing
from identifier.run import DivergedError, OnlineIdentifier
from identifier.tire_model import TireModel
from models.faults import SensorFault
from models.rules import require_kind, require_within
from models.tires import Tire
from models.vehicle import Vehicle
from mpc.handover.learner import Learner
from mpc.handover.supervisor import Supervisor
from mpc.loop.drive import LearningTires
from mpc.loop.drive import drive as drive_tracker
from mpc.loop.lateral import LateralVelocity
from mpc.loop.pace import Earned
from mpc.loop.record import Drive, Scores, scores
from mpc.loop.sensing import (
    CarSensors,
    FaultySensors,
    Measured,
    imu_and_localization,
    inertial_unit,
)
from mpc.path import Path, SpeedProfile
from mpc.problem import Problem, size_of
from mpc.realtime import Tracker
from mpc.tires import PredictionTire, prediction_tire
from tireid.driving.setup import PERIOD, Setup, SpeedWish, require_drivable, simulated
from tireid.progress import Progress

_NOTED = 0.1  # change of the grip that is worth a note
_EVERY = 8  # samples between two looks at what is known
_GIVEN_UP = 300.0, 5.0  # s, and of the time at the wanted speed: one that is earned may take twice
_PLAN_EVERY = 4  # periods between two plans that are kept: half a frame of the film
# least and most friction of a road over that of the measured tire [-]
FRICTIONS = (0.05, 1.5)


class _Informer:
    """Gives the tracker of an oracle the true tire of the road that the car is on."""

    def __init__(self, setup: Setup) -> None:
        self._setup, self._friction, self._mu = setup, setup.friction(), setup.mu

    def observe(self, measured: Measured, tracker: Any) -> str | None:
        """Change the tire where the friction has changed; return that it was done."""
        mu = self._friction.scale
        for change in self._friction.changes:  # steps
            here = measured.t if change.at_time is not None else measured.X
            mu = change.scale if here >= change.start else mu
        if mu == self._mu:
            return None
        self._mu = mu
        tracker.set_tire(self._setup.oracle(mu))
        return f"given friction {mu:g}"


class _BacksOff:
    """Stands between a drive and what learns, and notes where the tracker plans with less grip.

    Parameters
    ----------
    beside : which is asked, as if nobody stood between; None where nothing learns.
    """

    def __init__(self, beside: LearningTires | None) -> None:
        self._beside, self._noted = beside, 1.0

    def observe(self, measured: Measured, tracker: Any) -> str | None:
        """Ask what learns; return what it said, and the grip where that changed."""
        said = None if self._beside is None else self._beside.observe(measured, tracker)
        if abs(tracker.grip - self._noted) < _NOTED:
            return said
        self._noted = tracker.grip
        grip = f"plans with {tracker.grip:.2f} of the grip"
        return grip if said is None else f"{said}; {grip}"


# What was known of the tires at every moment of a drive: the tracker steers by the weights that it
# was handed; what the identifier has learnt by now runs ahead of them, until it is handed over.


class Known(NamedTuple):
    """What was known from a time [s] on.

    steering : weights that the tracker steers by.   learnt : weights that were learnt by then.
    slip : up to which these are known [rad], (2,).
    """

    t: float
    steering: Array
    learnt: Array
    slip: Array


class _Witness:
    """Stands between a drive and what learns, and keeps what was known.

    Attributes: known, in the order of time.

    Parameters
    ----------
    learner : which is asked, as if nobody stood between.
    period : of the samples [s].
    """

    def __init__(self, learner: Learner, period: float) -> None:
        self.known: list[Known] = []
        self._learner, self._period, self._samples = learner, period, 0

    def observe(self, measured: Measured, tracker: Any) -> str | None:
        """Ask the learner; return what it said."""
        said = self._learner.observe(measured, tracker)
        if self._samples % _EVERY == 0:
            self.known.append(self._seen(tracker.tire))
        self._samples += 1
        return said

    def _seen(self, steering: PredictionTire) -> Known:
        try:
            model = self._learner.supervisor.identifier.model()
        except (DivergedError, CannotFreezeError, ValueError):  # as the supervisor: no model now
            learnt, slip = np.full_like(steering.weights, np.nan), np.zeros(2)
        else:
            slip = np.full(2, np.nan) if model.known_slip is None else model.known_slip
            learnt = prediction_tire(model).weights
        return Known(self._samples * self._period, steering.weights.copy(), learnt, slip)


def make_learner(learnt: TireModel, vehicle: Vehicle, *, steers: bool = True) -> Learner:
    """Return what goes on learning while the tracker drives, and hands over what is fit.

    steers : False only watches the road.
    v_y is there, measured or estimated: what was learnt without it goes on by the axle identifier.
    """
    learnt = begun(learnt)
    try:
        method = continuing(learnt, vehicle, PERIOD)
    except ValueError as error:
        raise ValueError(f"learning and confirm go on from tires: {error}") from None
    if learnt.kind == AxleModel.kind:
        method = AxleIdentifier.for_vehicle(vehicle, dt=PERIOD)
    identifier = OnlineIdentifier(method, vehicle, PERIOD, learnt)
    return Learner(Supervisor(identifier, prediction_tire(learnt, vehicle)), steers=steers)


LINEAR, FROZEN, ORACLE, LEARNING = TIRES = ("linear", "frozen", "oracle", "learning")
FULL, IMU = SENSORS = ("full", "imu")


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What is alike for every tire.

    Parameters
    ----------
    kind : of the sensors, of `SENSORS`; imu measures no v_y.
    caution : share of what is not known of the tires that the tracker fears, from 0 to 1.
    confirm : whether the speed has to be earned on the way.
    """

    setup: Setup
    delay: int
    noise: bool
    seed: int
    laps: float
    faults: tuple[SensorFault, ...] = ()
    kind: str = FULL
    caution: float = 0.0
    confirm: bool = False

    def __post_init__(self) -> None:
        path = self.setup.path
        if not 0.0 < self.laps <= 100.0:
            raise ValueError(f"laps must be positive and at most 100, they are {self.laps:g}")
        if self.laps != 1.0 and not path.closed:
            raise ValueError(f"laps are of a closed path, {path.name} is not")
        if self.kind not in SENSORS:
            raise ValueError(f"sensors must be one of {', '.join(SENSORS)}, not {self.kind!r}")
        require_within(ValueError, *FRICTIONS, friction=self.setup.mu)
        require_within(ValueError, 0.0, 1.0, caution=self.caution)
        wish = self.setup.wish
        if self.confirm and wish.share is None and not (wish.profile and wish.profile.planned):
            raise ValueError(
                "--confirm goes with --speed tires, or with a share of what they allow"
            )
        self.setup.vehicle.require_chassis()

    def on(self, learnt: TireModel | None) -> "Conditions":
        """Return the same on these tires, where they tell how fast."""
        limits = self.setup.wish.limits(learnt)
        return self if limits is None else replace(self, setup=self.setup._replace(limits=limits))

    @property
    def sensors(self) -> CarSensors:
        """The sensors of the car, in order; those of one seed are the same unit."""
        size = size_of(self.setup.vehicle)
        if self.kind == IMU:
            rng = np.random.default_rng([self.seed, 3]) if self.noise else None
            return imu_and_localization(rng, size)
        return inertial_unit(size) if self.noise else CarSensors()

    def lateral(self, learnt: TireModel | None = None) -> LateralVelocity | None:
        """Return what estimates v_y on a drive, None where a sensor measures it."""
        if self.kind == FULL:
            return None
        return LateralVelocity.beginning_with(learnt, self.setup.vehicle, PERIOD)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ClosedLoop:
    """A drive and what is known of it.

    Parameters
    ----------
    learner : what changed the tire on the way, if anything could.
    known : what was known of the tires over time, where it goes on learning.
    """

    label: str
    model: PredictionTire
    final: PredictionTire
    problem: Problem
    drive: Drive
    scores: Scores
    learner: LearningTires | None
    known: Sequence[Known] = ()

    def __repr__(self) -> str:
        rms, peak = self.scores.rms_e_y_m, self.scores.peak_e_y_m
        return (
            f"<ClosedLoop on {self.label} tires along {self.drive.path.name}: {self.drive.ending}; "
            f"{rms:.3f} m rms off the path, {peak:.3f} m at most>"
        )


def require_compiler() -> None:
    """Say that there is no C compiler for the tracker before anything is learnt or driven."""
    if find_compiler() is None:
        raise ValueError(
            "no C compiler found: the tracker cannot be built; install gcc or clang, or name one "
            "in the environment as CC"
        )


def delay_periods(delay: float, name: str = "delay") -> int:
    """Return a delay in control periods.

    delay : a multiple of the period [s].   name : of the argument, in an error.
    """
    periods = delay / PERIOD
    if not (0.0 <= delay <= 0.1 and abs(periods - round(periods)) < 1e-9):
        raise ValueError(
            f"{name} must be 0 to 100 ms in steps of {1e3 * PERIOD:g} ms, it is {1e3 * delay:g}"
        )
    return round(periods)


def given_tire(label: str, setup: Setup, learnt: TireModel | None) -> PredictionTire:
    """Return the tire that a tracker is given at the start."""
    if label == LINEAR:
        return prediction_tire(setup.vehicle)
    if label == ORACLE:
        return setup.oracle()
    assert learnt is not None
    return prediction_tire(begun(learnt) if label == LEARNING else learnt, setup.vehicle)


def run_drive(label: str, conditions: Conditions, learnt: TireModel | None) -> ClosedLoop:
    """Drive the path once with the tracker on a tire."""
    setup = conditions.setup
    require_drivable(setup.path, setup.vehicle)
    profile = setup.profile()
    model = given_tire(label, setup, learnt)
    lag = setup.vehicle.require_chassis().steering_lag
    try:
        tracker = Tracker(
            model,
            period=PERIOD,
            delay=conditions.delay * PERIOD + lag,
            caution=conditions.caution,
        )
    except NoCompilerError as error:
        raise ValueError(str(error)) from None
    informed = label == ORACLE and setup.drops
    learner: LearningTires | None = _Informer(setup) if informed else None
    beside, witness, watcher = learner, None, None
    speed: SpeedProfile | Earned = profile
    if label == LEARNING or (conditions.confirm and label == FROZEN):
        assert learnt is not None
        watcher = make_learner(learnt, setup.vehicle, steers=label == LEARNING)
        learner = beside = watcher
        if label == LEARNING:
            beside = witness = _Witness(watcher, PERIOD)
    if conditions.confirm:
        road = watcher and watcher.supervisor
        speed = Earned(profile, PERIOD, lambda: road.friction if road else 1.0)
    driven = drive_tracker(
        setup.path,
        setup.car(),
        tracker,
        speed=speed,
        sensors=FaultySensors(conditions.sensors, conditions.faults),
        delay=conditions.delay,
        rng=np.random.default_rng([conditions.seed, 2]),
        learner=_BacksOff(beside) if conditions.caution > 0.0 else beside,
        lateral=conditions.lateral(learnt),
        laps=conditions.laps,
        time_limit=max(_GIVEN_UP[0], _GIVEN_UP[1] * conditions.laps * profile.lap_time),
        widest=setup.widest,
        plan_every=_PLAN_EVERY,
        name=f"{setup.path.name}, {label}",
        progress=Progress(f"driving on {label} tires"),
    )
    return ClosedLoop(
        label=label,
        model=model,
        final=tracker.tire,
        problem=tracker.problem,
        drive=driven,
        scores=scores(driven),
        learner=learner,
        known=() if witness is None else tuple(witness.known),
    )


def drive(
    path: Path,
    vehicle: Vehicle,
    tire: TireModel | None = None,
    *,
    speeds: SpeedProfile | float | None = None,
    confirm: bool = False,
    friction: float = 1.0,
    tires: tuple[Tire, Tire] | None = None,
    delay: float = 0.02,
    learning: bool = False,
    noise: bool = True,
    sensors: str = FULL,
    laps: float = 1.0,
    seed: int = 0,
    caution: float = 0.0,
) -> ClosedLoop:
    """Drive a double-track car along a path; the tracker steers by the given tires.

    Parameters
    ----------
    path : to follow, of `tireid.paths`, or `tireid.paths.Path.from_csv`.
    vehicle : the car; where it has no chassis a typical one is assumed.
    tire : the identified tires; None takes the linear tires of the vehicle.
    speeds : a profile of `tireid.speed_profile`, or a constant speed [m/s]; None plans the profile
        of the identified tires.
    confirm : whether the speed has to be earned: it begins at .45 of the limits, and goes on as the
        car holds what it drives and nothing says that the friction is another.
    friction : of the road over that of the tire's measurement [-].
    tires : that the car truly has, front and rear; None reads the file named by its chassis, or
        without one scales tires of a sedan to the identified stiffness and grip.
    delay : from a measurement until its command acts, a multiple of 0.01 s [s].
    learning : go on learning from the tire while driving, and hand over what is fit.
    noise : whether sensors are noisy.
    sensors : full, or imu: gyro, accelerometer, wheel speed, steering and a localization of
        position and heading, but no v_y, which an inertial identifier estimates.
    laps : of a closed path.
    seed : of the noise.
    caution : share of the tires' uncertainty that the tracker plans for, from 0 to 1, the least
        grip that the motion leaves possible.

    Returns
    -------
    ClosedLoop
        `drive` holds every signal, `scores` what it is worth.

    Raises
    ------
    VehicleError
        Where the vehicle has no chassis and no identified tires are given.
    ValueError
        Where a number is not that of a drive, the tire is of another car, there is none to go on
        learning from or to plan speeds of, speeds are of another path, or no C compiler is there
        for the tracker.
    """
    if tire is not None:
        require_kind(TireModel, "as run.tire", tire=tire)
        tire.require_car(vehicle)
    elif learning:
        raise ValueError("learning goes on from a tire: none is given")
    wish = SpeedWish.of(speeds, tire, vehicle)
    vehicle, true_tires = (vehicle, tires) if tires else simulated(vehicle, tire)
    conditions = Conditions(
        setup=Setup(path, vehicle, friction, (), wish, tires=true_tires),
        delay=delay_periods(delay),
        noise=noise,
        seed=seed,
        laps=laps,
        kind=sensors,
        caution=caution,
        confirm=confirm,
    )
    label = LINEAR if tire is None else LEARNING if learning else FROZEN
    return run_drive(label, conditions.on(tire), tire)
