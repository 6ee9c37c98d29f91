"""A drive to learn tires on, of a simulated car."""

from dataclasses import replace

import numpy as np

from models.maneuvers import RandomSteer
from models.recordings import Recording
from models.vehicle import Vehicle, sedan
from mpc.cars import DoubleTrackCar
from mpc.loop.lateral import LateralVelocity
from mpc.loop.sensing import Measured, Measures, cornering_limit, inertial_unit
from tireid.driving.setup import PERIOD
from tireid.progress import Progress

DURATION = 40.0  # s
_SPEED = 20.0  # m/s
_FREQUENCY = 0.6  # Hz, of the fastest swings
_GENTLE = 0.3  # share of the angles at the start
_GROWS = 30.0  # s, in which angles grow by their whole size
_TIPS = 1.2  # times the grip: a car that is said to have more is falling over
_FORGOTTEN = 0.5  # s before a car spins or tips that are not learnt from
_RATE_LIMIT = 1.0  # rad/s at the road wheels

_SLIP = np.radians(3.5)  # of the front axle, at the limit of grip
_SPUN = np.tan(np.radians(15.0))  # of the side slip


def learning_drive(
    car: DoubleTrackCar,
    sensors: Measures,
    rng: np.random.Generator,
    *,
    grip: float,
    seed: int,
    lateral: LateralVelocity | None = None,
) -> Recording:
    """Drive a car without a path and return what its sensors saw; a car that spins or tips ends it.

    grip : largest lateral acceleration [m/s²], which sizes the steering.
    lateral : estimates v_y, and a_y in the plane of the road, in place of the sensors; None takes
    what they measure.
    """
    # Angle of a bend at that acceleration, and the slip that the front axle needs beyond it.
    amplitude = car.vehicle.wheelbase * grip / _SPEED**2 + _SLIP
    maneuver = RandomSteer(
        amplitude=amplitude,
        frequency=min(_FREQUENCY, 0.9 * _RATE_LIMIT / (2.0 * np.pi * amplitude)),
        seed=seed,
        onset=1.0,
        rate_limit=_RATE_LIMIT,
        duration=DURATION,
    )
    t = car.period * np.arange(round(DURATION / car.period), dtype=np.float64)
    steering = maneuver.steering(t)[:, 0] * np.minimum(_GENTLE + t / _GROWS, 1.0)
    progress = Progress("the drive to learn on")
    state, samples, forces = car.start(_SPEED), [], []
    for k, angle in enumerate(steering):
        measured = sensors.measure(state, rng)
        if lateral is not None:
            measured = lateral.tell(measured).in_place_of(measured)
        samples.append(measured)
        forces.append(state.axle_force)
        state = car.step(state, float(angle), _SPEED)
        if abs(state.v_y) > _SPUN * state.v_x or abs(state.a_y) > _TIPS * grip:
            kept = max(len(samples) - round(_FORGOTTEN / car.period), 10)
            samples, forces = samples[:kept], forces[:kept]
            break
        progress((k + 1) / t.size)
    signals = dict(zip(Measured._fields, np.array(samples).T, strict=True))
    return Recording(
        name="learning drive",
        delta_f=signals["delta"],
        delta_r=np.zeros(len(samples)),
        axle_force=np.array(forces),
        **{name: signals[name] for name in ("t", "v_x", "v_y", "r", "a_y")},
    )


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
