"""Steering maneuvers as data: what the road wheels are asked to do over time.

Every maneuver is a frozen record with `.steering(t)`, commanded angles [δ_f, δ_r] [rad], δ > 0 to
the left, and `.duration` [s]. Angles never jump: |dδ/dt| <= rate_limit, which the identifier needs
(steering must be resolved at its sample time); a maneuver that cannot keep its limit is refused at
birth. Steering starts at `onset` [s]; a negative amplitude steers right first. `rear_ratio` is
δ_r/δ_f, zero for a car that steers in front only; `rate_limit` [rad/s] is that of either axle, of a
sine at least 2 pi frequency amplitude.
"""

import math
from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError


class ManeuverError(TireidError, ValueError):
    """A number of a maneuver breaks a rule; the message names it, the rule and the value."""


class Maneuver(Protocol):
    @property
    def duration(self) -> float:
        """Length [s]."""

    def steering(self, t: Array) -> Array:
        """Commanded [δ_f, δ_r] [rad], (n, 2).   t : times [s], (n,)."""


def _check(maneuver: Any, *, steepest: float) -> None:
    """Refuse numbers that are not physical and a steering rate above the limit."""
    name = type(maneuver).__name__
    free = ("amplitude", "onset", "rear_ratio", "seed", "pause")
    for field in fields(maneuver):
        value = getattr(maneuver, field.name)
        if isinstance(value, tuple):
            continue
        if not math.isfinite(value):
            raise ManeuverError(f"{name}: {field.name} must be finite, it is {value}")
        if field.name not in free and not value > 0.0:
            raise ManeuverError(f"{name}: {field.name} must be positive, it is {value}")
        if field.name in ("onset", "seed", "pause") and value < 0.0:
            raise ManeuverError(f"{name}: {field.name} must not be negative, it is {value}")
    rate = steepest * max(1.0, abs(maneuver.rear_ratio))
    if rate > maneuver.rate_limit * (1.0 + 1e-9):
        raise ManeuverError(
            f"{name}: steers at up to {rate:.4g} rad/s, more than rate_limit {maneuver.rate_limit}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Steered:
    """What every maneuver has.
    duration : length [s].
    """

    rate_limit: float
    duration: float
    rear_ratio: float = 0.0

    def _both(self, front: Any) -> Array:
        return np.column_stack((front, self.rear_ratio * front))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Swung(_Steered):
    """What every maneuver of sines has.
    amplitude : largest angle, that of a sine [rad].   frequency : of a sine, or of the fastest
        swing [Hz].
    """

    amplitude: float
    frequency: float
    onset: float

    def __post_init__(self) -> None:
        _check(self, steepest=2.0 * math.pi * self.frequency * abs(self.amplitude))


@dataclass(frozen=True, slots=True, kw_only=True)
class StepSteer(_Steered):
    """A ramp at `rate_limit` to a held angle: the step steer of ISO 7401, slow up to the limit.
    amplitude : final angle [rad].
    """

    amplitude: float
    onset: float

    def __post_init__(self) -> None:
        _check(self, steepest=0.0)

    def steering(self, t: Array) -> Array:
        rate = self.rate_limit / max(1.0, abs(self.rear_ratio))
        angle = np.clip(rate * (t - self.onset), 0.0, abs(self.amplitude))
        return self._both(np.copysign(angle, self.amplitude))


class Slalom(_Swung):
    """A sine of `amplitude` [rad] and `frequency` [Hz], from onset to the end."""

    __slots__ = ()

    def steering(self, t: Array) -> Array:
        phase = 2.0 * math.pi * self.frequency * np.maximum(t - self.onset, 0.0)
        return self._both(self.amplitude * np.sin(phase))


@dataclass(frozen=True, slots=True, kw_only=True)
class DoubleLaneChange(_Swung):
    """One sine to the next lane, a pause, and the opposite sine back: steered, not path-tracked.
    `amplitude` [rad] and `frequency` [Hz] are those of both sines.
    pause : time straight ahead between them [s].
    """

    pause: float

    def steering(self, t: Array) -> Array:
        there = np.clip((t - self.onset) * self.frequency, 0.0, 1.0) % 1.0
        second = self.onset + 1.0 / self.frequency + self.pause
        back = np.clip((t - second) * self.frequency, 0.0, 1.0) % 1.0
        wave = np.sin(2.0 * math.pi * there) - np.sin(2.0 * math.pi * back)
        return self._both(self.amplitude * wave)


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomSteer(_Swung):
    """Random angles, joined by half cosines: excitation without a period.

    The angles are drawn from `numpy.random.default_rng(seed)`, uniform in +-amplitude and one every
    half period, so that the steepest path between two is that of a sine of `frequency`. The same
    seed is the same maneuver, at any sampling.
    """

    seed: int

    def steering(self, t: Array) -> Array:
        rng = np.random.default_rng(self.seed)
        swings = 2 + math.ceil(2.0 * self.frequency * self.duration)
        angles = np.append(0.0, self.amplitude * rng.uniform(-1.0, 1.0, swings))
        swing = np.clip(2.0 * self.frequency * (t - self.onset), 0.0, swings)
        first = np.minimum(swing.astype(int), swings - 1)
        blend = 0.5 - 0.5 * np.cos(math.pi * (swing - first))
        return self._both(angles[first] + blend * np.diff(angles)[first])


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledSteer(_Steered):
    """Given angles at given times, joined by straight lines, as a planned maneuver is.

    After the last time, up to the duration, the last angle is held.
    times : of the angles [s], rising, (k,); straight ahead before the first.
    angles : of the front wheels [rad], (k,), the first zero.
    """

    times: tuple[float, ...]
    angles: tuple[float, ...]

    def __post_init__(self) -> None:
        t, angles = np.array(self.times), np.array(self.angles)
        if not (t.size == angles.size >= 2 and np.isfinite([*t, *angles]).all()):
            raise ManeuverError(
                "SampledSteer: times and angles must be two or more finite pairs, they are "
                f"{t.size} and {angles.size}"
            )
        if not (t[0] >= 0.0 and (np.diff(t) > 0.0).all()):
            raise ManeuverError(f"SampledSteer: times must rise from 0 on, they are {self.times}")
        if angles[0] != 0.0:
            raise ManeuverError(f"SampledSteer: the first angle must be 0, it is {angles[0]}")
        _check(self, steepest=float(np.abs(np.diff(angles) / np.diff(t)).max()))

    def steering(self, t: Array) -> Array:
        return self._both(np.interp(t, self.times, self.angles))
