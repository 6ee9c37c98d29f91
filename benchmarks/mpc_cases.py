"""Cases of the driving benchmarks: a path at a share of the limit of grip, driven on some tires.

The car is the sedan, double-track with roll, load transfer, relaxation and lagged steering. Every
frozen model is learnt on one drive of the same car on the same friction before: 60 s of random
steering at 15 m/s, up to and beyond the limit of both axles, through the same noise.
"""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from mpc.tires.held import held

from identifier.axle import AxleDesign
from identifier.defaults import default_design
from identifier.identify import identify
from identifier.method import Method
from models.friction import Friction
from models.maneuvers import RandomSteer
from models.plant import Plant
from models.recordings import Recording
from models.sensors import Sensors
from models.vehicle import sedan
from mpc.cars import DoubleTrackCar
from mpc.loop import Drive, SpeedProfile, drive, inertial_unit
from mpc.loop.limit import cornering_limit
from mpc.path import BUILT_IN, Path, grip_speed, steady_speed
from mpc.realtime import Tracker
from mpc.tires import TireModel, oracle_tire, tire_model

TIRES = ("linear", "paper", "axle", "fine", "oracle")
FASTEST = 30.0  # m/s
ACCELERATION, BRAKING = 2.0, 3.0  # m/s^2, at friction 1
LEARNING_TIME = 60.0  # s


class Case(NamedTuple):
    """One drive: path by name, share of the limit of grip, friction, tires, seed of all noise."""

    path: str
    share: float
    mu: float
    tires: str
    seed: int

    @property
    def delay(self) -> int:
        """Periods of 10 ms until a command acts: 1, 2 or 3 by turns of the seed."""
        return 1 + self.seed % 3


@cache
def plant() -> Plant:
    """Return the car with its tires."""
    return Plant(sedan())


@cache
def learning_drive(mu: float, seed: int) -> Recording:
    """Return what the frozen models learn on.

    Parameters
    ----------
    mu : friction.
    seed : of steering and noise.
    """
    maneuver = RandomSteer(
        amplitude=0.24 * mu,
        frequency=0.5,
        seed=seed,
        onset=0.5,
        rate_limit=1.0,
        duration=LEARNING_TIME,
    )
    run = plant().simulate(maneuver, speed=15.0, friction=Friction(scale=mu), name="learning")
    on_board = inertial_unit()
    sensors = Sensors(v_x=on_board.v_x, v_y=on_board.v_y, r=on_board.r, delta=on_board.delta)
    return run.recording(sensors, np.random.default_rng([seed, 1]))


@cache
def tires(kind: str, mu: float, seed: int) -> TireModel:
    """Return what the tracker believes.

    Parameters
    ----------
    kind : one of `TIRES`.
    mu : friction, which only the oracle is told.
    seed : of the learning drive and the first weights.
    """
    car = sedan()
    if kind == "linear":
        return tire_model(car)
    if kind == "oracle":
        return held(oracle_tire(car, plant().tire, mu))
    history = identify(learning_drive(mu, seed), car, _method(kind, seed))
    return held(tire_model(history.freeze(LEARNING_TIME)))


def _method(kind: str, seed: int) -> Method:
    if kind == "paper":
        return default_design(sedan(), seed=seed)
    axle = AxleDesign.for_vehicle(sedan())
    if kind == "fine":
        return replace(axle, ladder=tuple(0.5 * scale for scale in axle.ladder))
    return axle


@cache
def road(name: str) -> Path:
    """Return a built-in path.

    Parameters
    ----------
    name : of it.
    """
    return BUILT_IN[name]()


@cache
def profile(name: str, share: float, mu: float) -> SpeedProfile:
    """Return the speed: on a course that of the grip, on a lane change a constant one.

    Parameters
    ----------
    name : of the path.
    share : of the limit of grip, which the tightest turn takes.
    mu : friction.
    """
    path, limit = road(name), cornering_limit(sedan(), plant().tire, mu)
    if not path.closed:
        return SpeedProfile(path, steady_speed(path, a_y_max=limit, share=share))
    v = grip_speed(
        path,
        a_y_max=share * limit,
        v_max=FASTEST,
        a_accel=mu * ACCELERATION,
        a_brake=mu * BRAKING,
    )
    return SpeedProfile(path, v)


def run(case: Case) -> Drive:
    """Drive a case.

    Parameters
    ----------
    case : what to drive.
    """
    model = tires(case.tires, case.mu, case.seed)
    car = DoubleTrackCar(sedan(), friction=Friction(scale=case.mu))
    lag = sedan().require_chassis().steering_lag
    tracker = Tracker(model, period=car.period, delay=case.delay * car.period + lag)
    return drive(
        road(case.path),
        car,
        tracker,
        speed=profile(case.path, case.share, case.mu),
        sensors=inertial_unit(),
        delay=case.delay,
        rng=np.random.default_rng([case.seed, 2]),
        plan_every=0,
        name=f"{case.path}, {case.tires}",
    )
