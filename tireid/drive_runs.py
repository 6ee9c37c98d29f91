"""One drive for each tire that a tracker is told: linear, frozen, true, or learnt on the way."""

from dataclasses import dataclass

import numpy as np

from identifier.method import FrozenModel
from models.faults import SensorFault
from mpc.loop import (
    CarSensors,
    Drive,
    FaultySensors,
    Learner,
    Measures,
    Scores,
    drive,
    inertial_unit,
    scores,
)
from mpc.problem import Problem
from mpc.realtime import NoCompilerError, Tracker
from mpc.tires import TireModel, tire_model
from tireid.drive_learners import Informer, make_learner
from tireid.drive_setup import PERIOD, Setup
from tireid.progress import Ticker

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
    model: TireModel
    final: TireModel
    problem: Problem
    drive: Drive
    scores: Scores
    learner: Learner | None

    def __repr__(self) -> str:
        rms, peak = self.scores.rms_e_y_m, self.scores.peak_e_y_m
        return (
            f"<Run on {self.label} tires along {self.drive.path.name}: {self.drive.ending}; "
            f"{rms:.3f} m rms off the path, {peak:.3f} m at most>"
        )


def told_tire(label: str, setup: Setup, learnt: FrozenModel | None) -> TireModel:
    """Return the tire that a tracker is told at the start.

    Parameters
    ----------
    label : of `TIRES`.
    setup : path, car and road.
    learnt : what was learnt before the drive, for `frozen` and, where there is any, `learning`.
    """
    if label == LINEAR:
        return tire_model(setup.vehicle)
    if label == ORACLE:
        return setup.oracle()
    assert learnt is not None
    return tire_model(learnt, setup.vehicle)


def run_drive(
    label: str,
    conditions: Conditions,
    learnt: FrozenModel | None,
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


def _learner(label: str, setup: Setup, learnt: FrozenModel | None) -> Learner | None:
    if label == ORACLE and setup.drops:
        return Informer(setup)
    if label == LEARNING:
        assert learnt is not None
        return make_learner(learnt, setup.vehicle)
    return None
