"""Friction of the road as data: a scale on the tire's own friction over time or over the place.

Scale 1 is the road the tire was measured on. A change is a step or, with a width, a smooth ramp
(3 s² - 2 s³); it happens at a time for all wheels at once, or at a place X along the road, where
each wheel meets it on its own.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from models.rules import require_positive

MAX_PLACES = 4  # changes over the place that a compiled plant has room for


class FrictionError(TireidError, ValueError):
    """A friction breaks a rule; the message names the rule and the value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionChange:
    """From here on the friction is `scale`.
    scale : friction over the tire's own, after the change [-].
    at_time : when it starts [s]; give this or `at_place`.
    at_place : where it starts, coordinate X of the wheel [m].
    width : length of the smooth change [s or m], 0 for a step.
    """

    scale: float
    at_time: float | None = None
    at_place: float | None = None
    width: float = 0.0

    def __post_init__(self) -> None:
        require_positive(FrictionError, scale=self.scale)
        if not (self.width >= 0.0 and math.isfinite(self.width)):
            raise FrictionError(f"width must be zero or positive, it is {self.width}")
        if (self.at_time is None) == (self.at_place is None):
            raise FrictionError("a change needs exactly one of at_time and at_place")
        if not math.isfinite(self.start):
            raise FrictionError(f"a change must start at a finite value, it is {self.start}")

    @property
    def start(self) -> float:
        """Where the change starts [s or m]."""
        return self.at_time if self.at_time is not None else float(self.at_place or 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Friction:
    """A constant scale and the changes after it, all over time or all over the place.
    scale : friction over the tire's own before the first change [-].
    """

    scale: float = 1.0
    changes: tuple[FrictionChange, ...] = ()

    def __post_init__(self) -> None:
        require_positive(FrictionError, scale=self.scale)
        if len({change.at_time is None for change in self.changes}) > 1:
            raise FrictionError("changes must be all over time or all over the place")
        for before, after in pairwise(self.changes):
            if not before.start + before.width <= after.start:
                raise FrictionError(
                    f"the change at {after.start} starts before the one at {before.start} is over"
                )
        if self.by_place and len(self.changes) > MAX_PLACES:
            raise FrictionError(f"at most {MAX_PLACES} places, there are {len(self.changes)}")

    @property
    def by_place(self) -> bool:
        return bool(self.changes) and self.changes[0].at_time is None

    def over_time(self, t: Array) -> Array:
        """Scale over time (n,) [-], without the changes over the place.   t : times [s], (n,)."""
        scale = np.full(np.shape(t), self.scale)
        if not self.by_place:
            for change, step in zip(self.changes, self._steps(), strict=True):
                share = np.clip((t - change.start) / max(change.width, 1e-9), 0.0, 1.0)
                scale += step * share**2 * (3.0 - 2.0 * share)
        return scale

    def over_place(self) -> Array:
        """Rows [start X, width, step of the scale] (3, 4) of `place_change`, unused ones zero."""
        table = np.zeros((3, MAX_PLACES))
        if self.by_place:
            rows = zip(self.changes, self._steps(), strict=True)
            for k, (change, step) in enumerate(rows):
                table[:, k] = change.start, change.width, step
        return table

    def _steps(self) -> list[float]:
        scales = [self.scale, *(change.scale for change in self.changes)]
        return [after - before for before, after in pairwise(scales)]


def place_change(table: Any, place: Any) -> Any:
    """Return the sum of the changes over the place as a CasADi expression [-].
    table : from `Friction.over_place`, (3, 4).   place : coordinate X of the wheel [m].
    """
    change = 0.0
    for k in range(MAX_PLACES):
        start, width, step = table[0, k], table[1, k], table[2, k]
        share = ca.fmin(ca.fmax((place - start) / ca.fmax(width, 1e-6), 0.0), 1.0)
        change += step * share**2 * (3.0 - 2.0 * share)
    return change
