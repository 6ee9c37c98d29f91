"""Faults of the sensors of a drive: a channel that is wrong from some time on, or throughout."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from models.recordings import Recording
from models.recordings.record import CHANNELS

KINDS = ("stuck", "zero", "lost", "flipped", "scaled", "biased", "drifting", "noisy", "spiking")
SIZED = KINDS[4:]
_SPIKE_EVERY = 0.13  # s
_SPIKE_LASTS = 0.0098  # s: one sample at 100 Hz


class FaultError(TireidError, ValueError):
    """A fault breaks a rule; the message names the field, the rule and the value."""


def channel_of(recording: Recording, channel: str) -> Array:
    signal: Array | None = getattr(recording, channel, None) if channel in CHANNELS else None
    if signal is None:
        raise FaultError(f"{recording.name} has no channel {channel!r}, a fault needs one it has")
    return signal


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorFault:
    """One broken channel, for some time or throughout.
    kind : one of `KINDS`: holds its value; shows 0; shows no number (NaN); has the other sign; is
        multiplied by the size; is off by the size; runs away by the size each second; has white
        noise of the size; shows the size beside the truth for one sample in `_SPIKE_EVERY`.
    start : when it begins [s].   duration : how long it lasts [s]; infinite for ever.
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
        size = f" {self.size:g}" if self.kind in SIZED else ""
        for_long = "" if math.isinf(self.duration) else f" for {self.duration:g} s"
        since = f" from {self.start:g} s on" if self.start or for_long else ""
        return f"{self.channel} {self.kind}{size}{since}{for_long}"

    def active(self, t: Any) -> Any:
        """Return whether the channel is broken at a time.   t : time [s], a number or (n,)."""
        return (t >= self.start) & (t < self.start + self.duration)

    def measured(self, t: Any, value: Any, stuck_at: float, noise: Any) -> Any:
        """Return what the broken channel shows.   t : time [s], a number or (n,)."""
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
            raise FaultError("a recording holds numbers only: no channel of it can be lost")
        good, broken = channel_of(recording, self.channel), self.active(recording.t)
        noise = np.random.default_rng(self.seed).standard_normal(good.size)
        measured = self.measured(recording.t, good, float(good[np.argmax(broken)]), noise)
        changed: dict[str, Any] = {self.channel: np.where(broken, measured, good)}
        return replace(recording, **changed)
