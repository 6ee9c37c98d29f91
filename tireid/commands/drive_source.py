"""Where frozen tires come from: a file, a network of one's own, or a drive to learn on."""

import argparse
from collections.abc import Callable, Sequence

import numpy as np

from identifier.method import vehicle_numbers
from identifier.methods import DEFAULT, REFERENCE, load_model, make_method
from identifier.run import DivergedError, identify
from identifier.tire_model import TireModel
from models.maneuvers import RandomSteer
from models.recordings import Recording
from models.vehicle import Vehicle
from mpc.cars import Car
from mpc.loop import CarSensors, Measured
from tireid.commands.drive_runs import FROZEN, LEARNING, Conditions
from tireid.commands.options import network_model
from tireid.progress import Ticker, say

# The drive to learn on: the same car on an open field, steered at random and ever harder.

DURATION = 40.0  # s
SPEED = 20.0  # m/s
FREQUENCY = 0.6  # Hz, of the fastest swings
SLIP = np.radians(3.5)  # of the front axle, at the limit of grip
GENTLE, GROWS = 0.3, 30.0  # share of the angles at the start, and time to all of them [s]
SPUN = np.tan(np.radians(15.0))  # of the side slip
TIPS = 1.2  # times the grip: a car that is said to have more is falling over
FORGOTTEN = 0.5  # s before a car spins or tips that are not learnt from
RATE_LIMIT = 1.0  # rad/s at the road wheels


def learning_drive(
    car: Car,
    sensors: CarSensors,
    rng: np.random.Generator,
    *,
    grip: float,
    seed: int,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Drive a car without a path and return what its sensors saw; a car that spins or tips ends it.

    Parameters
    ----------
    car : to drive.
    sensors : of the car.
    rng : of their noise.
    grip : largest lateral acceleration [m/s²], which sizes the steering.
    seed : of the steering.
    progress : called with the share of the time.
    """
    # Angle of a bend at that acceleration, and the slip that the front axle needs beyond it.
    amplitude = car.vehicle.wheelbase * grip / SPEED**2 + SLIP
    maneuver = RandomSteer(
        amplitude=amplitude,
        frequency=min(FREQUENCY, 0.9 * RATE_LIMIT / (2.0 * np.pi * amplitude)),
        seed=seed,
        onset=1.0,
        rate_limit=RATE_LIMIT,
        duration=DURATION,
    )
    t = car.period * np.arange(round(DURATION / car.period), dtype=np.float64)
    steering = maneuver.steering(t)[:, 0] * np.minimum(GENTLE + t / GROWS, 1.0)
    state, samples, forces = car.start(SPEED), [], []
    for k, angle in enumerate(steering):
        samples.append(sensors.measure(state, rng))
        forces.append(state.axle_force)
        state = car.step(state, float(angle), SPEED)
        if abs(state.v_y) > SPUN * state.v_x or abs(state.a_y) > TIPS * grip:
            kept = max(len(samples) - round(FORGOTTEN / car.period), 10)
            samples, forces = samples[:kept], forces[:kept]
            break
        if progress is not None:
            progress((k + 1) / t.size)
    signals = dict(zip(Measured._fields, np.array(samples).T, strict=True))
    return Recording(
        name="learning drive",
        delta_f=signals["delta"],
        delta_r=np.zeros(len(samples)),
        axle_force=np.array(forces),
        **{name: signals[name] for name in ("t", "v_x", "v_y", "r", "a_y")},
    )


def learn(law: str, recording: Recording, vehicle: Vehicle) -> TireModel:
    """Return what a method has learnt at the end of a drive.

    Parameters
    ----------
    law : name of the method.
    recording : the drive.
    vehicle : the car as the method is told of it.

    Raises
    ------
    DivergedError
        Where the law ran away.
    """
    history = identify(recording, vehicle, make_method(law, vehicle))
    if history.diverged_at is not None:
        raise DivergedError(f"{recording.name}: the {law} law diverged at {history.diverged_at} s")
    return history.freeze(float(recording.t[-1]))


def frozen_tires(
    options: argparse.Namespace, labels: Sequence[str], conditions: Conditions
) -> tuple[str, TireModel | None]:
    """Return where frozen tires come from, and the model where one is needed.

    Parameters
    ----------
    options : parsed arguments.
    labels : what the trackers are told.
    conditions : of the drives.

    Raises
    ------
    ValueError
        Where a file cannot be used, or a law runs away.
    """
    setup = conditions.setup
    if not {FROZEN, LEARNING} & set(labels):
        return "nothing was learnt", None
    if options.weights is not None:
        model = load_model(options.weights)
        if vehicle_numbers(model.vehicle) != vehicle_numbers(setup.vehicle):
            say(f"{options.weights} is of the car {model.vehicle.name!r}, another than is driven")
        return f"frozen ones from {options.weights}", model
    network = network_model(options, setup.vehicle, 1.0)
    if network is not None:
        return f"frozen ones from {options.network}", network
    law = REFERENCE if options.paper else DEFAULT
    recording = learning_drive(
        setup.car(open_field=True),
        conditions.sensors,
        np.random.default_rng([conditions.seed, 1]),
        grip=setup.grip,
        seed=conditions.seed,
        progress=Ticker("the drive to learn on"),
    )
    model = learn(law, recording, setup.vehicle)
    assert recording.a_y is not None
    return (
        f"frozen ones learnt by {law} on {recording.duration:.0f} s of random steering on an open "
        f"field, up to {np.abs(recording.a_y).max():.1f} m/s² sidewards"
    ), model
