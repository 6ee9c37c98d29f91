"""The drive to learn on: the same car on an open field, steered at random and ever harder."""

from collections.abc import Callable

import numpy as np

from identifier.history import DivergedError
from identifier.identify import identify
from identifier.method import FrozenModel
from identifier.methods import make_method
from models.maneuvers import RandomSteer
from models.recordings import Recording
from models.vehicle import Vehicle
from mpc.cars import Car
from mpc.loop import CarSensors, Measured

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


def learn(law: str, recording: Recording, vehicle: Vehicle) -> FrozenModel:
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
