"""A car steered along a path by a tracker that is told of some tires; a drive to learn them on."""

from dataclasses import replace

import numpy as np

from identifier.tire_model import TireModel
from models.recordings import Recording
from models.vehicle import Vehicle, sedan
from mpc.cars import DoubleTrackCar
from mpc.loop import cornering_limit, inertial_unit
from mpc.path import Path
from tireid.commands.drive import require_friction
from tireid.commands.drive_runs import (
    FROZEN,
    LEARNING,
    LINEAR,
    PERIOD,
    Conditions,
    Run,
    Setup,
    SpeedWish,
    run_drive,
)
from tireid.commands.drive_source import learning_drive


def drive(
    path: Path,
    vehicle: Vehicle,
    tire: TireModel | None = None,
    *,
    speed: float | None = None,
    share: float = 0.9,
    friction: float = 1.0,
    delay: float = 0.02,
    learning: bool = False,
    noise: bool = True,
    laps: float = 1.0,
    seed: int = 0,
) -> Run:
    """Drive a double-track car along a path; the tracker steers by the tires that it is told of.

    Parameters
    ----------
    path : to follow, of `tireid.paths`, or `tireid.paths.Path.from_csv`.
    vehicle : the car, with a chassis.
    tire : what was learnt; None tells the tracker of the linear tire of the vehicle.
    speed : constant speed [m/s]; None drives at a share of the grip.
    share : of the lateral acceleration that the tightest bend takes, over what the tires can give;
        a closed path brakes for bends.
    friction : of the road over that of the tire's measurement [-].
    delay : from a measurement until its command acts, a multiple of 0.01 s [s].
    learning : go on learning from the tire while driving, and hand over what is fit.
    noise : whether sensors are noisy.
    laps : of a closed path.
    seed : of the noise.

    Returns
    -------
    Run
        `drive` holds every signal, `scores` what it is worth.

    Raises
    ------
    VehicleError
        Where the vehicle has no chassis.
    ValueError
        Where a number is not that of a drive, there is no tire to go on learning from, or no C
        compiler for the tracker.
    """
    periods = delay / PERIOD
    if not (0.0 <= delay <= 0.1 and abs(periods - round(periods)) < 1e-9):
        raise ValueError(f"delay must be 0 to 0.1 s in steps of {PERIOD:g} s, it is {delay:g}")
    for name, value in (("share", share), ("laps", laps), ("speed", speed)):
        if value is not None and not value > 0.0:
            raise ValueError(f"{name} must be positive, it is {value:g}")
    if laps != 1.0 and not path.closed:
        raise ValueError(f"laps are of a closed path, {path.name} is not")
    if learning and tire is None:
        raise ValueError("learning goes on from a tire: none is given")
    vehicle.require_chassis()
    setup = Setup(
        path=path,
        vehicle=vehicle,
        plant="double-track",
        mu=require_friction("friction", friction),
        drops=(),
        wish=SpeedWish(share if speed is None else None, speed),
    )
    conditions = Conditions(setup=setup, delay=round(periods), noise=noise, seed=seed, laps=laps)
    label = LINEAR if tire is None else LEARNING if learning else FROZEN
    return run_drive(label, conditions, tire)


def sample_recording(vehicle: Vehicle | None = None, *, seed: int = 0) -> Recording:
    """Return what the sensors of a simulated car saw on an open field, with the true axle forces.

    It is steered at random and ever harder until it slides, 40 s: a drive to learn from.

    Parameters
    ----------
    vehicle : the car, with a chassis; None takes the sedan.
    seed : of steering and sensor noise.

    Raises
    ------
    VehicleError
        Where the vehicle has no chassis.
    """
    car = DoubleTrackCar(sedan() if vehicle is None else vehicle, period=PERIOD)
    grip = cornering_limit(car.vehicle, car.tire)
    rng = np.random.default_rng([seed, 1])
    driven = learning_drive(car, inertial_unit(), rng, grip=grip, seed=seed)
    return replace(driven, name=f"sample {seed}")
