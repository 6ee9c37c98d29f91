"""The wanted speed along a path, and what a tracker is told of the road ahead.

v(s): wanted speed [m/s] at the samples of the path. The car's speed v_x runs to it with the time
constant 1/k of the driver's gain, so that ahead it is v(s(t)) + (v_x - v(s)) exp(-k t).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpc.path.path import Path

Array = NDArray[np.float64]


class Preview(NamedTuple):
    """The road at some times ahead, each (k,)."""

    s: Array
    """Arc length [m]."""
    kappa: Array
    """Curvature [1/m]."""
    v_x: Array
    """Speed [m/s]."""


class SpeedProfile:
    """A wanted speed along a path.

    Parameters
    ----------
    path : the path.
    v : wanted speed [m/s], a number or one for each sample of the path, (n,).

    Raises
    ------
    ValueError
        When the shape is wrong, or a speed is not positive and finite.
    """

    def __init__(self, path: Path, v: ArrayLike) -> None:
        self.v: Array = np.broadcast_to(np.asarray(v, dtype=np.float64), path.s.shape).copy()
        if not (self.v > 0.0).all() or not np.isfinite(self.v).all():
            raise ValueError(f"speeds must be positive and finite, the least is {self.v.min()}")
        self.path = path
        pace = 0.5 * (1.0 / self.v[1:] + 1.0 / self.v[:-1])
        self._t = np.concatenate([[0.0], np.cumsum(pace * np.diff(path.s))])
        self._acceleration = self.v * np.gradient(self.v, path.s)

    @property
    def lap_time(self) -> float:
        """Time from the first to the last sample at the wanted speed [s]."""
        return float(self._t[-1])

    def at(self, s: ArrayLike) -> Array:
        """Return the wanted speed [m/s] in the shape of s.

        Parameters
        ----------
        s : arc length [m].
        """
        return self.path.along(self.v, s)

    def reference(self, s: float, gain: float) -> float:
        """Return what to ask of a proportional driver, so that it does not lag behind [m/s].

        Parameters
        ----------
        s : arc length [m].
        gain : acceleration that the driver asks for, per error of the speed [1/s].
        """
        beyond = not self.path.closed and not 0.0 <= s <= self.path.length
        slope = 0.0 if beyond else float(self.path.along(self._acceleration, s))
        return float(self.at(s)) + slope / gain

    def ahead(self, s: float, v_x: float, t: Array, gain: float) -> Preview:
        """Return the road that the car will be on.

        Parameters
        ----------
        s : arc length now [m].
        v_x : speed now [m/s].
        t : times from now [s], (k,).
        gain : of the driver [1/s].
        """
        error, fades = v_x - float(self.at(s)), np.exp(-gain * t)
        there = self._place(self._time(s) + t) + error * (1.0 - fades) / gain
        return Preview(there, self.path.curvature(there), self.at(there) + error * fades)

    def _time(self, s: float) -> float:
        """Return the time at which a car at the wanted speed is at s, laps included."""
        if self.path.closed:
            laps, within = divmod(s, self.path.length)
            return laps * self.lap_time + float(np.interp(within, self.path.s, self._t))
        if s > self.path.length:
            return self.lap_time + (s - self.path.length) / float(self.v[-1])
        return float(np.interp(s, self.path.s, self._t)) + min(s, 0.0) / float(self.v[0])

    def _place(self, t: Array) -> Array:
        """Return where a car at the wanted speed is, laps included: the inverse of `_time`."""
        if self.path.closed:
            laps = np.floor(t / self.lap_time)
            within = np.interp(t - laps * self.lap_time, self._t, self.path.s)
            return np.asarray(laps * self.path.length + within)
        before, after = np.minimum(t, 0.0), np.maximum(t - self.lap_time, 0.0)
        there = np.interp(t, self._t, self.path.s)
        return np.asarray(there + before * self.v[0] + after * self.v[-1])
