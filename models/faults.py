"""Faults of sensors: what a channel shows while it is broken, of known kind, size and time.

A fault is a function of what a good sensor would show, of what it showed when the fault began, and
of time.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

KINDS = ("stuck", "zero", "lost", "flipped", "scaled", "biased", "drifting", "noisy", "spiking")
SIZED = KINDS[4:]
SPIKE_EVERY = 0.13  # s
SPIKE_LASTS = 0.0098  # s: one sample at 100 Hz


class FaultError(ValueError):
    """A fault breaks a rule; the message names the field, the rule and the value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorFault:
    """One broken channel for some time.

    Parameters
    ----------
    channel : name of the signal.
    kind : one of `KINDS`: holds its value; shows 0; shows no number (NaN); has the other sign; is
        multiplied by the size; is off by the size; runs away by the size each second; has white
        noise of the size; shows the size beside the truth for one sample in `SPIKE_EVERY`.
    start : when it begins [s].
    duration : how long it lasts [s]; infinite for ever.
    size : in the unit of the channel, or a factor; only for the kinds of `SIZED`.

    Raises
    ------
    FaultError
        For an unknown kind, a time that is negative or not finite, or a size that is not finite.
    """

    channel: str
    kind: str
    start: float
    duration: float
    size: float = 0.0

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
        return f"{self.channel} {self.kind}{size} from {self.start:g} s on{for_long}"

    def active(self, t: Any) -> Any:
        """Return whether the channel is broken at a time.

        Parameters
        ----------
        t : time [s], a number or (n,).
        """
        return (t >= self.start) & (t < self.start + self.duration)

    def shown(self, t: Any, value: Any, stuck_at: float, noise: Any) -> Any:
        """Return what the broken channel shows.

        Parameters
        ----------
        t : time [s], a number or (n,).
        value : what a good sensor would show, like t.
        stuck_at : what it showed when the fault began.
        noise : standard normal numbers, like t.
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
        return value + self.size * (np.mod(since + 0.5 * SPIKE_LASTS, SPIKE_EVERY) < SPIKE_LASTS)
