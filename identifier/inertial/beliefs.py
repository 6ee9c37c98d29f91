"""What is believed before the car drives, and how far motion, road and sensors are trusted.

Numbers of one `Beliefs` and one `Trust` hold for every car: what belongs to its size scales by
Froude's rule when they become the inputs of the compiled step.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

from models.rules import Positive
from models.vehicle import Vehicle

TOLD_ROLL = 0.25  # standard deviation of the roll that a chassis tells, as a share of it


class Body(NamedTuple):
    """A body that rolls under lateral acceleration.
    frequency, damping : of its roll [rad/s], [-].   roll, sd_roll : outwards, as the accelerometer
    feels it, and the standard deviation of that [rad/g].
    """

    frequency: float
    damping: float
    roll: float
    sd_roll: float

    @classmethod
    def of_chassis(cls, vehicle: Vehicle) -> Self | None:
        """Return the body of a car as its chassis tells it; None where it tells none."""
        if vehicle.chassis is None:
            return None
        leans = vehicle.weight * vehicle.roll_arm  # N m per g, and per rad of roll
        spring, inertia = vehicle.chassis.roll_stiffness - leans, vehicle.chassis.roll_inertia
        frequency, roll = math.sqrt(spring / inertia), leans / spring
        damping = vehicle.chassis.roll_damping / (2.0 * inertia * frequency)
        return cls(frequency, damping, roll, TOLD_ROLL * roll)

    def step(self, rolls: tuple[float, float], level: float, dt: float) -> tuple[float, float]:
        """Return what it rolls by and the rate of that a sample later, implicit.
        level : acceleration in the plane of the road [m/s²].   dt : sampling interval [s].
        """
        now, rate = rolls
        stiff = dt * self.frequency**2
        rate = (rate + stiff * (level - now)) / (
            1.0 + 2.0 * self.damping * self.frequency * dt + dt * stiff
        )
        return now + dt * rate, rate


@dataclass(frozen=True, slots=True, kw_only=True)
class Beliefs(Positive):
    """Means and standard deviations of what is learnt beside the curves, before the first sample.
    bias : of the accelerometer [g].
    roll, sd_roll : of the body, outwards, as the accelerometer feels it [rad per g]; 0 and nearly 0
        for an acceleration in the plane of the road.
    steering : of the zero of the front steering [rad].
    gyro : bias of the yaw rate, in a car with a wheelbase of 2.7 m [rad/s].
    grip : of ln of the grip of tires that are held [-].
    """

    bias: float = 0.015
    roll: float = 0.06
    sd_roll: float = 0.04
    steering: float = 0.005
    gyro: float = 0.002
    grip: float = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Trust(Positive):
    """How far motion, road and sensors are trusted; sensors as of a car with a wheelbase of 2.7 m.
    v_y : of v_y at the first sample and below the lowest speed of learning [sqrt(g L)].
    r : of the yaw rate then [rad/s].
    error, relative_error : what curves miss of a force [static axle loads], [-].
    correlation_time : of that [s].
    bank : sine of the bank of a road [-].   bank_time : in which a road banks [s].
    jerk : what pushes the yaw rate beside tires, as a random walk [(g/L)^(3/4)].
    r_error, a_y_error : what no noise explains of the yaw rate [rad/s] and of a_y [m/s²].
    a_y_share : of a_y, what no noise explains of it beside that [-].
    r_noise, a_y_noise : first guess of the noise [rad/s], [m/s²], which is learnt from the signals.
    noise_samples : over which noise is learnt [samples].
    lateness : by which the channels may differ in time [s].
    clip : standard deviations from which an innovation counts no more.
    alarm : mean square of what curves miss, over its deviation, from which the road is taken for
        another one [-]; from twice it on in full.
    alarm_time : of that mean [s].
    step, step_time : change of ln μ that may happen in that time then [-], [s].
    surge : largest acceleration [m/s²].
    observable : largest standard deviation of side slip that counts as observed [rad].
    """

    v_y: float = 0.017
    r: float = 0.01
    error: float = 0.01
    relative_error: float = 0.08
    correlation_time: float = 0.06
    bank: float = 0.05
    bank_time: float = 20.0
    jerk: float = 0.03
    r_error: float = 0.009
    a_y_error: float = 0.2
    a_y_share: float = 0.05
    r_noise: float = 0.03
    a_y_noise: float = 2.0
    noise_samples: float = 100.0
    lateness: float = 0.015
    clip: float = 4.0
    alarm: float = 0.4
    alarm_time: float = 0.2
    step: float = 0.7
    step_time: float = 0.3
    surge: float = 98.0
    observable: float = 0.01

    def at(self, dt: float, wheelbase: float, froude_time: float) -> "TrustNumbers":
        """Return the numbers of a step.
        dt : sampling interval [s].   wheelbase : L [m].   froude_time : sqrt(L/g) [s].
        """
        scale = math.sqrt(wheelbase / 2.7)
        speed = wheelbase / froude_time
        kept = math.exp(-dt / self.correlation_time)
        return TrustNumbers(
            v_y=(self.v_y * speed) ** 2,
            r=(self.r / scale) ** 2,
            error=self.error,
            relative_error=self.relative_error,
            renewed=1.0 - kept**2,
            bank=self.bank**2,
            bank_walk=2.0 * self.bank**2 * dt / self.bank_time,
            r_walk=(self.jerk / froude_time**1.5) ** 2 * dt,
            r_error=(self.r_error / scale) ** 2,
            a_y_error=self.a_y_error**2,
            a_y_share=self.a_y_share**2,
            noise_gain=1.0 / self.noise_samples,
            lateness=self.lateness,
            clip=self.clip,
            per_alarm=1.0 / self.alarm,
            alarm_gain=min(dt / self.alarm_time, 1.0),
            inflation=dt * self.step**2 / self.step_time,
            surge=self.surge,
            observable=self.observable**2,
            r_noise=(self.r_noise / scale) ** 2,
            a_y_noise=self.a_y_noise**2,
        )


class TrustNumbers(NamedTuple):
    """Variances of v_y, r and bank at a start; what curves miss and what it gains in a
    step; variances that bank and r gain in one; of r and a_y beside their noise; gain of the
    noise; lateness; clip; 1/alarm and its gain; what an alarm adds; surge; variance of side slip
    that is observed; variances of the noise of r and a_y at first.
    """

    v_y: Any
    r: Any
    error: Any
    relative_error: Any
    renewed: Any
    bank: Any
    bank_walk: Any
    r_walk: Any
    r_error: Any
    a_y_error: Any
    a_y_share: Any
    noise_gain: Any
    lateness: Any
    clip: Any
    per_alarm: Any
    alarm_gain: Any
    inflation: Any
    surge: Any
    observable: Any
    r_noise: Any
    a_y_noise: Any
