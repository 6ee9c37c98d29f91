"""A drive to learn tires on, of a simulated car, whose driver knows no grip."""

import math
from dataclasses import replace

import numpy as np

from models.recordings import Recording
from models.vehicle import Vehicle, sedan
from mpc.cars import DoubleTrackCar
from mpc.loop.lateral import LateralVelocity
from mpc.loop.sensing import Measured, Measures, inertial_unit
from tireid.driving.setup import PERIOD
from tireid.progress import Progress

DURATION = 40.0  # s
_SPEED = 20.0  # m/s
_STRAIGHT = 1.0  # s before the first swing
_SWING = 0.83  # s from one side to the other at the fastest: 0.6 Hz
_SLOWER = 1.2  # times that, at the slowest
_RATE_LIMIT = 1.0  # rad/s at the road wheels
_FORGOTTEN = 0.5  # s before a car spins that are not learnt from
_SPUN = math.tan(math.radians(15.0))  # of the side slip

# How swings grow: chosen on 72 random cars of three tire shapes, on roads of friction 0.2 to 1.2.
_FIRST = 1.0  # m/s², of the first swing of a car that does not slip
_GROWS = 1.2  # from swing to swing
_NO_MORE = 1.04  # times the most a_y: more steering that gives less turns the car no more
_IN_VAIN = 2  # such swings: one is the luck of its timing
_CREEPS = 1.05  # from swing to swing after the tail stepped out, up to the size where it did
_LEAST = 0.3  # of the size: smallest angle once it is held
_SMOOTH = 0.05  # s, time constant of what the sensors show
# Side slip at which the tail steps out, over the most a_y [rad s²/m], and its least and most [rad]:
# tires slide at a slip in proportion to friction.
_OUT, _LEAST_OUT, _MOST_OUT = np.radians([0.8, 3.0, 6.0])


class _Driver:
    """Steers to one side and the other, ever farther, until the car slides; then at random so far.

    Attributes: angle, commanded now [rad].
    seed : of times and angles.
    """

    def __init__(self, car: DoubleTrackCar, seed: int) -> None:
        self._rng, self._period = np.random.default_rng(seed), car.period
        self._size, self._grows, self._side = car.vehicle.wheelbase * _FIRST / _SPEED**2, _GROWS, 1
        self._begins, self._ends = 0.0, _STRAIGHT  # of the swing [s]
        self.angle = self._from = self._to = 0.0
        self._a_y = self._side_slip = 0.0  # smoothed
        self._peak = self._best = 0.0  # |a_y| of the swing, and of all before [m/s²]
        self._in_vain, self._too_far, self._largest = 0, False, math.inf

    def steer(self, measured: Measured) -> None:
        """Command the angle of the next period."""
        share = self._period / _SMOOTH
        self._a_y += share * (measured.a_y - self._a_y)
        self._side_slip += share * (measured.v_y / measured.v_x - self._side_slip)
        self._peak = max(self._peak, abs(self._a_y))
        out = min(max(_OUT * max(self._peak, self._best), _LEAST_OUT), _MOST_OUT)
        self._too_far |= abs(self._side_slip) > out
        if measured.t >= self._ends:
            self._begin_swing(measured.t)
        if self._too_far:
            goal = self._side_slip  # into the slide
        else:
            way = (measured.t - self._begins) / (self._ends - self._begins)
            goal = self._from + (self._to - self._from) * (0.5 - 0.5 * math.cos(math.pi * way))
        step = _RATE_LIMIT * self._period
        self.angle += min(max(goal - self.angle, -step), step)

    def _begin_swing(self, t: float) -> None:
        """Begin the next swing, of a size by what the last one has shown."""
        if self._too_far:
            self._largest = self._size if self._grows == _GROWS else self._largest
            self._size /= _GROWS
            self._grows = min(self._grows, _CREEPS)
        else:
            if self._grows == _GROWS:
                gained = self._peak > _NO_MORE * self._best
                self._in_vain = 0 if gained else self._in_vain + 1
                if self._in_vain == _IN_VAIN:
                    self._grows = 1.0
            self._size = min(self._grows * self._size, self._largest)
        self._best = max(self._best, self._peak)
        self._peak, self._too_far = 0.0, False
        self._begins, self._from, self._side = t, self.angle, -self._side
        fastest = max(_SWING, math.pi * self._size / _RATE_LIMIT)
        self._ends = t + fastest * self._rng.uniform(1.0, _SLOWER)
        self._to = self._size * self._side
        if self._grows < _GROWS:
            self._to = self._size * self._rng.choice([-1, 1]) * self._rng.uniform(_LEAST, 1.0)


def learning_drive(
    car: DoubleTrackCar,
    sensors: Measures,
    rng: np.random.Generator,
    *,
    seed: int,
    lateral: LateralVelocity | None = None,
) -> Recording:
    """Drive a car without a path and return what its sensors saw; a car that spins ends it.

    Steering is random and grows from swing to swing until the sensors show that more of it no
    longer turns the car, or that its tail steps out; then it is held there.

    lateral : estimates v_y, and a_y in the plane of the road, in place of the sensors; None takes
    what they measure.
    """
    driver, progress = _Driver(car, seed), Progress("the drive to learn on")
    state, samples, forces = car.start(_SPEED), [], []
    n = round(DURATION / car.period)
    for k in range(n):
        measured = sensors.measure(state, rng)
        if lateral is not None:
            measured = lateral.tell(measured).in_place_of(measured)
        samples.append(measured)
        forces.append(state.axle_force)
        if abs(measured.v_y) > _SPUN * measured.v_x:
            kept = max(len(samples) - round(_FORGOTTEN / car.period), 10)
            samples, forces = samples[:kept], forces[:kept]
            break
        driver.steer(measured)
        state = car.step(state, driver.angle, _SPEED)
        progress((k + 1) / n)
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

    It is steered at random and ever harder until the sensors show that it slides, 40 s: a drive to
    learn from.

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
    driven = learning_drive(car, inertial_unit(), np.random.default_rng([seed, 1]), seed=seed)
    return replace(driven, name=f"sample {seed}")
