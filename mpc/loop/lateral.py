"""The lateral velocity of a car without a sensor of it, estimated online with its uncertainty.

Two that err differently are one: an inertial identifier, which knows what tires do, and position,
which knows where the car came to. A Kalman filter of what the dead reckoned place misses:
    p' = w + v_x n_ψ,   w' = -b - ρ ä + n_a,   b' = -b/T + n_b,   ρ' = 0
p [m] across the body, w [m/s] of v_y, which goes on by a - v_x r with a = a_y - b - ρ ä: b [m/s²]
bias of the accelerometer, and of the road where it is banked, ρ [rad/g] roll of the body, and ä
[m/s²] what the body rolls by: a by the second order of its springs and dampers.
Measured: the position gives p, the identifier's v_y gives w with the deviation that it tells, or
that it turns out to have: on a friction that it has not learnt it is off by more than it knows.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.inertial import InertialIdentifier
from identifier.inertial.beliefs import Body
from identifier.run import OnlineIdentifier
from identifier.tire_model import TireModel
from models.rules import Positive
from models.sensors import is_measured
from models.vehicle import Vehicle
from mpc.loop.sensing import Measured

_UNKNOWN = 1.0  # m/s: standard deviation of v_y where nothing is known
_FINEST = 1e-3  # m/s: least deviation that is believed


class LateralEstimate(NamedTuple):
    """What is given of a sample; NaN where nothing is known.

    v_y, v_y_sd : lateral velocity and its standard deviation [m/s].   observable : 1 where side
    slip is known well enough, else 0.   a_y : acceleration of the center of gravity in the plane of
    the road, without what is believed of bias and roll [m/s²].   inertial_v_y, inertial_v_y_sd : of
    the identifier alone, which knows of no position [m/s].
    """

    v_y: float
    v_y_sd: float
    observable: float
    a_y: float
    inertial_v_y: float
    inertial_v_y_sd: float

    def in_place_of(self, measured: Measured) -> Measured:
        """Return a sample with what is given of v_y and a_y in it."""
        return measured._replace(v_y=self.v_y, a_y=self.a_y)


@dataclass(frozen=True, slots=True, kw_only=True)
class Localization(Positive):
    """How far position, heading and acceleration are trusted.
    position : standard deviation [m].
    heading : standard deviation [rad].
    acceleration : of a_y - v_x r, sample by sample [m/s²].
    bias : of the accelerometer and the road's bank [m/s²].
    bias_time : in which that changes [s].
    correlation_time : for which the identifier errs alike [s].
    clip : standard deviations from which an innovation counts no more.
    lost : rate at which v_y may change where no acceleration is shown [m/s²].
    observable : largest standard deviation of side slip that counts as observed [rad].
    """

    position: float = 0.025
    heading: float = 0.002
    acceleration: float = 0.15
    bias: float = 0.15
    bias_time: float = 10.0
    correlation_time: float = 1.0
    clip: float = 3.0
    lost: float = 5.0
    observable: float = 0.01


class LateralVelocity:
    """Lateral velocity by an identifier from yaw rate, accelerometer, speed and steering.

    Position and heading correct it, where they are shown.
    identifier : of a method that tells v_y; it is given every sample here, and learns.
    localization : how far position and heading are trusted; None takes the default.
    body : how it rolls; None takes what the chassis of the identifier's vehicle tells.
    """

    def __init__(
        self,
        identifier: OnlineIdentifier,
        localization: Localization | None = None,
        body: Body | None = None,
    ) -> None:
        method = identifier.method
        sensor = method.accelerometer
        if sensor is None or sensor.body is None:
            raise ValueError(f"{type(method).__name__} estimates no v_y")
        self.identifier, self.trust = identifier, localization or Localization()
        self._dt = method.dt
        self._body = body or sensor.body(identifier.vehicle)
        self._rolls = (0.0, 0.0)  # ä and its rate [m/s²], [m/s³]
        self._place: Array | None = None  # X, Y [m], dead reckoned
        self._v_y, self._bias, self._roll = math.nan, 0.0, self._body.roll
        self._P = np.diag([0.0, _UNKNOWN**2, self.trust.bias**2, self._body.sd_roll**2])
        self._surprise = 1.0  # mean square of the identifier's errors over what it tells of them
        self._last: tuple[Measured, float] | None = None  # a sample ago, and a + b - v_x r of it

    @classmethod
    def beginning_with(
        cls, tire: TireModel | None, vehicle: Vehicle, period: float
    ) -> "LateralVelocity":
        """Return the estimate of a car by an inertial identifier on its tires, if any are known."""
        method, start = InertialIdentifier.beginning_with(tire, vehicle, dt=period)
        return cls(OnlineIdentifier(method, vehicle, period, start))

    def tell(self, measured: Measured) -> LateralEstimate:
        """Take a sample; return what it tells.

        measured : by the sensors; v_y is not read.
        """
        m, identifier, dt = measured, self.identifier, self._dt
        identifier.update(np.array([0.0, m.r]), np.array([m.delta, 0.0]), m.v_x, m.a_y)
        found = identifier.outputs
        silent = not found or identifier.stale or identifier.diverged
        v_y, sd = (math.nan if silent else float(found[k].item()) for k in ("v_y", "v_y_sd"))
        if math.isnan(self._v_y):
            self._v_y, self._P[1, 1] = (v_y, sd**2) if math.isfinite(v_y) else (0.0, _UNKNOWN**2)
        felt = m.a_y - self._bias
        if is_measured("a_y", m.a_y):
            level = felt - self._roll * self._rolls[0]
            self._rolls = self._body.step(self._rolls, level, dt)
        level = felt - self._roll * self._rolls[0]
        self._go_on(m, level)
        if self._place is not None:
            residual = _in_the_world(np.array([m.X, m.Y]) - self._place, -m.psi)  # and back
            moved = self._correct(0, residual[1], self.trust.position**2)
            self._place += _in_the_world(residual * [2.0 * dt, 0.0] + [0.0, moved], m.psi)
        if math.isfinite(v_y):
            self._listen(v_y, sd)
        deviation = math.sqrt(self._P[1, 1])
        observable = float(deviation < self.trust.observable * m.v_x)
        return LateralEstimate(self._v_y, deviation, observable, level, v_y, sd)

    def _listen(self, v_y: float, sd: float) -> None:
        """Correct by the identifier's v_y [m/s], as far as it has been as right as it says."""
        time, innovation, sd = self.trust.correlation_time, v_y - self._v_y, max(sd, _FINEST)
        surprise = innovation**2 / (self._P[1, 1] + sd**2)
        self._surprise += min(self._dt / time, 1.0) * (surprise - self._surprise)
        self._correct(1, innovation, sd**2 * max(self._surprise, 1.0), 2.0 * time / self._dt)

    def _go_on(self, m: Measured, level: float) -> None:
        """Move place and velocity by a sample of an acceleration in the plane of the road."""
        trust, dt = self.trust, self._dt
        felt = all(is_measured(name, getattr(m, name)) for name in ("v_x", "r", "a_y"))
        slides = level + self._bias - m.v_x * m.r if felt else self._bias
        last, before = self._last if self._last is not None else (m, slides)
        then = self._v_y
        self._v_y += dt * (0.5 * (before + slides) - self._bias)
        self._last = m, slides
        kept = math.exp(-dt / trust.bias_time)
        self._bias *= kept
        error = dt * (trust.acceleration if felt else trust.lost)
        F = np.eye(4)
        F[0, 1], F[2, 2] = dt, kept
        if felt:
            F[1, 2], F[1, 3] = -dt, -dt * self._rolls[0]
        turned = m.v_x * trust.heading * dt if is_measured("v_x", m.v_x) else 0.0
        Q = np.diag([turned**2, error**2, trust.bias**2 * (1.0 - kept**2), 0.0])
        self._P = F @ self._P @ F.T + Q
        if not all(is_measured(name, getattr(m, name)) for name in ("X", "Y", "psi", "v_x")):
            self._place = None
        elif self._place is None:
            self._place = np.array([m.X, m.Y])
            self._P[0, :] = self._P[:, 0] = 0.0
            self._P[0, 0] = trust.position**2
        else:
            velocity = _in_the_world(np.array([last.v_x, then]), last.psi)
            velocity += _in_the_world(np.array([m.v_x, self._v_y]), m.psi)
            self._place = self._place + 0.5 * dt * velocity

    def _correct(self, i: int, innovation: float, variance: float, alike: float = 1.0) -> float:
        """Correct by a measurement of p (0) or w (1); return the correction of p [m]."""
        P = self._P
        most = self.trust.clip * math.sqrt(P[i, i] + variance)
        gain = P[:, i] / (P[i, i] + alike * variance)
        moved = gain * min(max(innovation, -most), most)
        self._P = P - np.outer(gain, P[i])
        self._v_y += float(moved[1])
        self._bias += float(moved[2])
        self._roll = max(self._roll + float(moved[3]), 0.0)
        return float(moved[0])


def _in_the_world(way: Array, psi: float) -> Array:
    """Return a vector along and across the body on the ground; by -psi the other way."""
    c, s = math.cos(psi), math.sin(psi)
    return np.array([way[0] * c - way[1] * s, way[0] * s + way[1] * c])
