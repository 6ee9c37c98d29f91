"""Samples as they come, on the uniform clock of a method, without a look at later ones.

A sample within a hundredth of a step of its place on the clock is taken as it is; between others
straight lines are drawn, and of several in one step the mean of the lines over the step about each
instant is taken: what `models.recordings.record.resample` does with a whole log.
"""

import math
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from models.logs.clock import FASTER, ON_STEP
from models.recordings.map import LONGEST_GAP
from tireid.live.state import Counts

DT = 0.01  # s between two instants of the recursion
BACK = 1.0  # s, from which a clock that goes back begins anew: less is a sample that is late
_MISSING = 1.5  # usual intervals, beyond which a sample was lost
_GAP = 2.5  # usual intervals, beyond which nothing is known of the way there, as beyond BACK
_FAR = 60.0  # s, from which a clock that goes on jumped: no samples were lost
_SAME = 1e-6  # s, below which two times are one: what waits for the next instant stays bounded
_USUAL = 0.05  # weight of a new interval in the usual one


class Instant(NamedTuple):
    """Values at an instant [s]; whether a gap lies before it, and a jump of the clock."""

    t: float
    values: Array
    gap: bool = False
    jump: bool = False


class Clock:
    """Brings samples to instants that are dt apart.

    Parameters
    ----------
    dt : between instants [s].
    counts : in which samples that are lost, doubled or late are counted, and jumps of the clock.
    """

    def __init__(self, dt: float, counts: Counts) -> None:
        self._dt, self._counts = dt, counts
        self._last: deque[tuple[float, Array]] = deque()  # samples, oldest first
        self._zero, self._k, self._usual = math.nan, 0, 0.0

    def add(self, t: float, values: Array) -> Iterator[Instant]:
        """Take a sample; yield the instants that are known from it on.

        Parameters
        ----------
        t : time by the sender's clock [s].
        values : NaN where there is none.
        """
        h, counts = t - self._last[-1][0] if self._last else math.inf, self._counts
        if abs(h) < _SAME:
            counts.doubled += 1
        elif -BACK < h < 0.0:
            counts.late += 1
        elif h < 0.0:
            counts.jumps += 1
            yield self._begin(t, values, jump=True)
        elif not self._last:
            yield self._begin(t, values)
        else:
            usual = self._usual or min(max(h, self._dt), BACK)
            if h >= _FAR:
                counts.jumps += 1
            elif h > _MISSING * usual:
                counts.lost += round(h / usual) - 1
            if h > max(LONGEST_GAP * (1.0 + 1e-6), min(_GAP * usual, BACK)):
                yield self._begin(t, values, gap=True)
                return
            self._usual = usual + _USUAL * (min(h, _MISSING * usual) - usual)
            yield from self._between(t, values)

    def _begin(self, t: float, values: Array, *, gap: bool = False, jump: bool = False) -> Instant:
        self._last.clear()
        self._last.append((t, values))
        self._zero, self._k = t, 1
        return Instant(t, values, gap, jump)

    def _between(self, t: float, values: Array) -> Iterator[Instant]:
        dt, last = self._dt, self._last
        last.append((t, values))
        if FASTER * self._usual < dt:
            while self._instant + 0.5 * dt <= t:
                yield self._next(self._mean())
            while len(last) > 2 and last[1][0] <= self._instant - 0.5 * dt:
                last.popleft()
            return
        while len(last) > 2:
            last.popleft()
        before, old = last.popleft()
        if abs(t - self._instant) <= ON_STEP * dt:
            yield self._next(values)
        slope = (values - old) / (t - before)
        while self._instant <= t:
            here = self._instant
            yield self._next(values if here == t else slope * (here - before) + old)

    @property
    def _instant(self) -> float:
        return self._zero + self._dt * self._k

    def _next(self, values: Array) -> Instant:
        instant = Instant(self._instant, values)
        self._k += 1
        return instant

    def _mean(self) -> Array:
        """Return the mean of the lines between samples over the step about the next instant."""
        t, rows = np.array([one for one, _ in self._last]), [row for _, row in self._last]
        half = min(0.5 * self._dt, self._instant - float(t[0]))
        begin, end = self._instant - half, self._instant + half
        at = np.concatenate([[begin], t[(t > begin) & (t < end)], [end]])
        lines = np.stack([np.interp(at, t, one) for one in np.stack(rows).T])
        area = np.sum(np.diff(at) * (lines[:, 1:] + lines[:, :-1]) / 2.0, axis=1)
        return np.asarray(area / (end - begin))
