"""Faults of the signals of a log: a channel that is wrong, and samples that are late, held or lost.

x forward, y left, z up; SI units; angles and rates turn left when positive.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from models.recordings import Recording
from models.recordings.record import CHANNELS
from models.rules import require_positive
from models.smoothing import low_passed
from models.vehicle import GRAVITY

# How often a wrong unit fits into the right one: what is logged is the SI value times it.
UNITS: Mapping[str, float] = {"deg": 180.0 / math.pi, "km/h": 3.6, "g": 1.0 / GRAVITY}

KINDS = ("stuck", "zero", "lost", "flipped", "scaled", "biased", "drifting", "noisy", "spiking")
SIZED = KINDS[4:]
_SPIKE_EVERY = 0.13  # s
_SPIKE_LASTS = 0.0098  # s: one sample at 100 Hz


class FaultError(TireidError, ValueError):
    """A fault breaks a rule; the message names the field, the rule and the value."""


class Fault(Protocol):
    """What is asked of a fault of a recording."""

    def apply(self, recording: Recording) -> Recording:
        """Return what the log of the same drive holds with the fault."""


def require_finite(fault: Any) -> None:
    """Refuse a fault with a number that is not finite."""
    for field in fields(fault):
        value = getattr(fault, field.name)
        if isinstance(value, float | int) and not math.isfinite(value):
            raise FaultError(f"{field.name} must be finite, it is {value}")


def channel_of(recording: Recording, channel: str) -> Array:
    """Return a channel of a recording that has it."""
    signal: Array | None = getattr(recording, channel, None) if channel in CHANNELS else None
    if signal is None:
        raise FaultError(f"{recording.name} has no channel {channel!r}, a fault needs one it has")
    return signal


def _through(
    recording: Recording, channels: tuple[str, ...], change: Callable[[Array], Array]
) -> Recording:
    """Return the recording with some of its channels changed, those it has where none is named."""
    names = channels or [name for name in CHANNELS if getattr(recording, name) is not None]
    changed: dict[str, Any] = {name: change(channel_of(recording, name)) for name in names}
    return replace(recording, **changed)


def _named(channels: tuple[str, ...]) -> str:
    return ", ".join(channels) or "all channels"


# Of one channel.


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorFault:
    """One broken channel, for some time or throughout.

    kind : one of `KINDS`: holds its value; shows 0; shows no number (NaN); has the other sign; is
        multiplied by the size; is off by the size; runs away by the size each second; has white
        noise of the size; shows the size beside the truth for one sample in `_SPIKE_EVERY`.
    start : when it begins [s].
    duration : how long it lasts [s]; infinite for ever.
    size : in the unit of the channel, or a factor; only for the kinds of `SIZED`.
    seed : of the noise of `apply`.
    """

    channel: str
    kind: str
    start: float = 0.0
    duration: float = math.inf
    size: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise FaultError(f"kind must be one of {', '.join(KINDS)}, it is {self.kind!r}")
        if not (0.0 <= self.start < math.inf and self.duration > 0.0):
            raise FaultError(
                "start must be finite and not negative and duration positive, they are "
                f"{self.start} and {self.duration}"
            )
        if not math.isfinite(self.size):
            raise FaultError(f"size must be finite, it is {self.size}")

    def __str__(self) -> str:
        """Return it in words."""
        size = f" {self.size:g}" if self.kind in SIZED else ""
        for_long = "" if math.isinf(self.duration) else f" for {self.duration:g} s"
        since = f" from {self.start:g} s on" if self.start or for_long else ""
        return f"{self.channel} {self.kind}{size}{since}{for_long}"

    def active(self, t: Any) -> Any:
        """Return whether the channel is broken at a time.

        t : time [s], a number or (n,).
        """
        return (t >= self.start) & (t < self.start + self.duration)

    def shown(self, t: Any, value: Any, stuck_at: float, noise: Any) -> Any:
        """Return what the broken channel shows.

        t : time [s], a number or (n,).
        value : what a good sensor would show, like t.
        """
        since = t - self.start
        match self.kind:
            case "stuck":
                return stuck_at + 0.0 * since
            case "zero":
                return 0.0 * since
            case "lost":
                return np.nan + 0.0 * since
            case "flipped":
                return -value
            case "scaled":
                return self.size * value
            case "biased":
                return value + self.size
            case "drifting":
                return value + self.size * since
            case "noisy":
                return value + self.size * noise
        return value + self.size * (np.mod(since + 0.5 * _SPIKE_LASTS, _SPIKE_EVERY) < _SPIKE_LASTS)

    def apply(self, recording: Recording) -> Recording:
        """Return what the log of the same drive holds with the fault.

        recording : the drive without it; the fault's times are on its clock.
        """
        if self.kind == "lost":
            raise FaultError("a recording holds numbers only: a lost channel is `Held` in a log")
        good, broken = channel_of(recording, self.channel), self.active(recording.t)
        noise = np.random.default_rng(self.seed).standard_normal(good.size)
        shown = self.shown(recording.t, good, float(good[np.argmax(broken)]), noise)
        changed: dict[str, Any] = {self.channel: np.where(broken, shown, good)}
        return replace(recording, **changed)


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongUnit:
    """A channel in another unit than it is said to have: deg for rad, km/h for m/s, g for m/s^2.

    unit : one of `UNITS`.
    """

    channel: str
    unit: str

    def __post_init__(self) -> None:
        if self.unit not in UNITS:
            raise FaultError(f"unit must be one of {', '.join(UNITS)}, it is {self.unit!r}")

    def __str__(self) -> str:
        """Return it in words."""
        return f"{self.channel} in {self.unit}"

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the channel in that unit."""
        return _through(recording, (self.channel,), lambda good: UNITS[self.unit] * good)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mirrored:
    """Channels in mirrored axes: y to the right, or z down, for these and not for the others.

    channels : that have the other sign.
    """

    channels: tuple[str, ...]

    def __str__(self) -> str:
        """Return it in words."""
        return f"{_named(self.channels)} mirrored"

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

    def __post_init__(self) -> None:
        require_positive(FaultError, delay=self.delay)

    def __str__(self) -> str:
        """Return it in words."""
        return f"{_named(self.channels)} {1e3 * self.delay:g} ms late"

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

    def __post_init__(self) -> None:
        require_positive(FaultError, time_constant=self.time_constant)

    def __str__(self) -> str:
        """Return it in words."""
        return f"{_named(self.channels)} low-passed by {self.time_constant:g} s"

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

    def __post_init__(self) -> None:
        require_positive(FaultError, every=self.every, lasts=self.lasts)
        if not self.lasts <= self.every:
            raise FaultError(f"lasts must be at most every {self.every}, it is {self.lasts}")

    def __str__(self) -> str:
        """Return it in words."""
        return f"{_named(self.channels)} held {self.lasts:g} s in every {self.every:g} s"

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
    """Samples that were taken up to some time before their stamp, each by its own time.

    size : longest time that a sample is old [s]; uniform from zero.
    channels : concerned; empty for all, which then are late together.
    """

    size: float
    channels: tuple[str, ...] = ()
    seed: int = 0

    def __post_init__(self) -> None:
        require_positive(FaultError, size=self.size)

    def __str__(self) -> str:
        """Return it in words."""
        return f"{_named(self.channels)} up to {1e3 * self.size:g} ms late at random"

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with each sample as it was some time ago."""
        t, rng = recording.t, np.random.default_rng(self.seed)
        taken = t - self.size * rng.uniform(size=t.size)
        return _through(recording, self.channels, lambda good: np.interp(taken, t, good))


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockJump:
    """The logger's clock jumps: time goes by that is not logged, or is logged twice.

    at : when [s], on the recording's clock.
    size : time that is missing [s]; negative where samples before are logged once more.
    """

    at: float
    size: float

    def __post_init__(self) -> None:
        require_finite(self)

    def __str__(self) -> str:
        """Return it in words."""
        return f"clock jumps by {self.size:g} s at {self.at:g} s"

    def apply(self, recording: Recording) -> Recording:
        """Return the recording with the jump; it ends where the drive does, forces jump with it."""
        t = recording.t
        if not t[0] <= self.at <= t[-1]:
            raise FaultError(f"at must be within {t[0]:g} to {t[-1]:g} s, it is {self.at}")
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
