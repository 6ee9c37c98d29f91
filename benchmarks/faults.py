"""Faults of known kind and size: of a channel, a log, the road, and of what is declared of a car.

A fault of a recording takes the recording of a drive and returns what the log would hold with the
fault (`apply`); a wrong number takes the car and returns the one that is declared (`tell`).
Forces, where they are known, stay those of the drive. One channel that is broken from some time on
is `models.faults.SensorFault`.

x forward, y left, z up; SI units; angles and rates turn left when positive.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from scipy.signal import lfilter

from codegen.arrays import Array
from models.faults import channel_of
from models.recordings import Recording
from models.recordings.record import CHANNELS
from models.vehicle import GRAVITY, Vehicle

# How often a wrong unit fits into the right one: what is logged is the SI value times it.
UNITS: Mapping[str, float] = {"deg": 180.0 / math.pi, "km/h": 3.6, "g": 1.0 / GRAVITY}


def low_passed(signal: Array, lag: float, dt: float) -> Array:
    """Return what comes out of a low pass of first order that began at rest on the first value.

    It is exact for straight lines between samples.
    signal : u, what goes in (n,).   lag : time constant T of the low pass [s].
    dt : sampling interval [s].
    """
    keep = math.exp(-dt / lag)
    ramp = (1.0 - keep) * lag / dt  # lag of a straight line, T u_dot
    # y_k = keep y_(k-1) + (1 - keep) u_(k-1) + (1 - ramp) (u_k - u_(k-1)), from y_0 = u_0
    b, a = [1.0 - ramp, ramp - keep], [1.0, -keep]
    return np.asarray(lfilter(b, a, signal, zi=[ramp * signal[0]])[0])


class Fault(Protocol):
    """What is asked of a fault of a recording."""

    def apply(self, recording: Recording) -> Recording:
        """Return what the log of the same drive holds with the fault."""


def _through(
    recording: Recording, channels: tuple[str, ...], change: Callable[[Array], Array]
) -> Recording:
    """Return the recording with some of its channels changed, those it has where none is named."""
    names = channels or [name for name in CHANNELS if getattr(recording, name) is not None]
    changed: dict[str, Any] = {name: change(channel_of(recording, name)) for name in names}
    return replace(recording, **changed)


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongUnit:
    """A channel in another unit than it is said to have: deg for rad, km/h for m/s, g for m/s^2.

    unit : one of `UNITS`.
    """

    channel: str
    unit: str

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the channel in that unit."""
        return _through(recording, (self.channel,), lambda good: UNITS[self.unit] * good)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mirrored:
    """Channels in mirrored axes: y to the right, or z down, for these and not for the others.

    channels : that have the other sign.
    """

    channels: tuple[str, ...]

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the other sign in these channels."""
        return _through(recording, self.channels, lambda good: -good)


# Of time: what is sent late, smeared, held, or stamped wrongly. No channel named means all.


@dataclass(frozen=True, slots=True, kw_only=True)
class Late:
    """Channels that come some time after the others; before, their first value holds.

    channels : that come late; empty for all.
    delay : by this [s], between samples by straight lines.
    """

    channels: tuple[str, ...]
    delay: float

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with these channels as they were `delay` ago."""
        t = recording.t
        return _through(recording, self.channels, lambda good: np.interp(t - self.delay, t, good))


@dataclass(frozen=True, slots=True, kw_only=True)
class Lagging:
    """Channels behind a low pass of first order that began at rest on the first value.

    channels : that lag; empty for all.
    time_constant : of the low pass [s]; exact for straight lines between samples.
    """

    channels: tuple[str, ...]
    time_constant: float

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with these channels behind the low pass."""
        lag, dt = self.time_constant, recording.dt
        return _through(recording, self.channels, lambda good: low_passed(good, lag, dt))


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """Channels that repeat an old value for some time, again and again: drop-outs, a slow sensor.

    channels : that are held; empty for all.
    every : time from one hold to the next [s].
    lasts : how long each is [s]; equal to `every` for a sensor that samples so slowly.
    """

    channels: tuple[str, ...]
    every: float
    lasts: float

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with these channels at the value with which each hold began."""
        slack = 1e-6 * recording.dt
        since = recording.t - recording.t[0]
        begins = self.every * np.floor((since + slack) / self.every)
        first = np.searchsorted(since, begins - slack)
        held = since - begins < self.lasts - slack
        source = np.where(held, first, np.arange(since.size))
        return _through(recording, self.channels, lambda good: good[source])


@dataclass(frozen=True, slots=True, kw_only=True)
class Jitter:
    """Samples that were taken up to some time before their stamp, all channels late together.

    size : longest time that a sample is old [s]; uniform from zero.
    """

    size: float
    seed: int = 0

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with each sample as it was some time ago."""
        t, rng = recording.t, np.random.default_rng(self.seed)
        taken = t - self.size * rng.uniform(size=t.size)
        return _through(recording, (), lambda good: np.interp(taken, t, good))


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockJump:
    """The logger's clock jumps: time goes by that is not logged, or is logged twice.

    at : when [s], on the recording's clock.
    size : time that is missing [s]; negative where samples before are logged once more.
    """

    at: float
    size: float

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the jump; it ends where the drive does, forces jump with it."""
        t = recording.t
        stamps = (
            t
            if self.size >= 0.0
            else t[0] + recording.dt * np.arange(t.size + int(-self.size / recording.dt + 1e-6))
        )
        taken = np.where(stamps < self.at, stamps, np.maximum(stamps + self.size, t[0]))
        keep = (taken >= t[0]) & (taken <= t[-1])
        stamps, taken = stamps[keep], taken[keep]
        logged = {
            name: np.interp(taken, t, getattr(recording, name))
            for name in (*CHANNELS, "a_x")
            if getattr(recording, name) is not None
        }
        force = recording.axle_force
        if force is not None:
            logged["axle_force"] = np.column_stack([np.interp(taken, t, one) for one in force.T])
        return replace(recording, t=stamps, **logged)


# Of mounting: where a sensor sits and where it looks.


@dataclass(frozen=True, slots=True, kw_only=True)
class Misaligned:
    """A velocity sensor that does not look straight ahead.

    angle : by which it is turned to the left [rad]: v_y reads v_y cos - v_x sin of it.
    """

    angle: float

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the velocity in the axes of the sensor."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        v_x, v_y = recording.v_x, recording.needed("v_y")
        return replace(recording, v_x=c * v_x + s * v_y, v_y=c * v_y - s * v_x)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorElsewhere:
    """A sensor that is not at the center of gravity.

    Of velocity it shows v_x - y r and v_y + x r, of acceleration a_y + x dr/dt - y r^2, with the
    slope of r between neighboring samples.

    sensor : "velocity" or "accelerometer".
    x, y : where it is from the center of gravity, ahead and to the left [m].
    """

    sensor: str
    x: float = 0.0
    y: float = 0.0

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the signals of that place."""
        x, y, r = self.x, self.y, recording.r
        if self.sensor == "velocity":
            v_y = recording.needed("v_y") + x * r
            return replace(recording, v_x=recording.v_x - y * r, v_y=v_y)
        r_dot = np.gradient(r, recording.dt)
        return replace(recording, a_y=channel_of(recording, "a_y") + x * r_dot - y * r**2)


# Of the road.


@dataclass(frozen=True, slots=True, kw_only=True)
class Bank:
    """A road that falls to the left by an angle, or by one that swings: g sin of it on the body.

    On the plant, `Plant.simulate(bank=Bank(...).angle_at)` drives on it. On a recording it is put
    in by kinematics: the tires keep their slip and force, and the car turns downhill by
    Δr = g sin(angle)/v_x, while v_y rises by l_r Δr and the steering by what keeps the front slip.
    Newton's law holds exactly at constant speed and angle; as they change, dΔr/dt is a yaw
    acceleration without a moment and l_r dΔr/dt a lateral one without a force. An accelerometer
    feels the tires alone, so a_y stays. Below the car's lowest speed Δr fades to zero.

    vehicle : the car that drives; its l_f and l_r are what is needed.
    angle : of the road across the car, largest [rad].
    period : of the crown [s], a cosine; infinite for a constant angle.
    """

    vehicle: Vehicle
    angle: float
    period: float = math.inf

    def angle_at(self, t: Array) -> Array:
        """Return the angle [rad], (n,).

        t : times [s], (n,).
        """
        angle: Array = self.angle * np.cos(2.0 * math.pi * t / self.period)
        return angle

    def apply(self, recording: Recording) -> Recording:
        """Return the recording of the same tire forces on the banked road."""
        l_f, l_r, slow = self.vehicle.l_f, self.vehicle.l_r, self.vehicle.lowest_speed
        v_x = recording.v_x
        moving = np.clip(v_x / slow, 0.0, 1.0)
        turn = moving * GRAVITY * np.sin(self.angle_at(recording.t)) / np.maximum(v_x, slow)
        v_y = recording.needed("v_y") + l_r * turn
        on_bank = replace(recording, v_y=v_y, r=recording.r + turn)
        lost = recording.alpha(l_f, l_r) - on_bank.alpha(l_f, l_r)
        return replace(on_bank, delta_f=recording.delta_f + lost[:, 0])


# Put together.


@dataclass(frozen=True, slots=True, kw_only=True)
class Together:
    """Several faults at once, one after the other in their order."""

    faults: tuple[Fault, ...]

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with all of them."""
        for fault in self.faults:
            recording = fault.apply(recording)
        return recording


@dataclass(frozen=True, slots=True, kw_only=True)
class Passing:
    """A fault of the beginning that fades away: a sensor that warms up, a road that levels out.

    until : time until which it is there in full [s], on the recording's clock.
    fade : how long it then takes to vanish, in a straight line [s].
    """

    fault: Fault
    until: float
    fade: float = 0.0

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the fault where it is not gone yet."""
        broken, over = self.fault.apply(recording), recording.t - self.until
        left = np.where(over <= 0.0, 1.0, 1.0 - over / max(self.fade, 1e-9))
        left = np.maximum(left, 0.0)
        return replace(
            recording,
            **{
                name: good + left * (getattr(broken, name) - good)
                for name in CHANNELS
                if (good := getattr(recording, name)) is not None
            },
        )


# Of what is told of the car.


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongNumber:
    """A number of the car that is told wrongly by a factor.

    field : name of the number in `Vehicle`.
    """

    field: str
    factor: float

    def tell(self, vehicle: Vehicle) -> Vehicle:
        """Return the car as it is told."""
        return replace(vehicle, **{self.field: self.factor * getattr(vehicle, self.field)})


@dataclass(frozen=True, slots=True, kw_only=True)
class SwappedAxles:
    """l_f told for l_r and l_r for l_f."""

    def tell(self, vehicle: Vehicle) -> Vehicle:
        """Return the car as it is told."""
        return replace(vehicle, l_f=vehicle.l_r, l_r=vehicle.l_f)


@dataclass(frozen=True, slots=True, kw_only=True)
class ShiftedCenter:
    """A center of gravity told farther back than it is, at the same wheelbase.

    share : of the wheelbase, by which l_f is told too long; negative where too short [-].
    """

    share: float

    def tell(self, vehicle: Vehicle) -> Vehicle:
        """Return the car as it is told."""
        shift = self.share * vehicle.wheelbase
        return replace(vehicle, l_f=vehicle.l_f + shift, l_r=vehicle.l_r - shift)


@dataclass(frozen=True, slots=True, kw_only=True)
class AnotherCar:
    """Another declared car than the one that drove: the file of a 1:10 car for one of two tons."""

    declared: Vehicle

    def tell(self, vehicle: Vehicle) -> Vehicle:
        """Return that other car, whatever car drove.

        vehicle : that drove; not looked at.
        """
        del vehicle
        return self.declared
