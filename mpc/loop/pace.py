"""A speed that is earned on the way: no faster than the car has shown that it can turn.

Tires that were learnt on a dry road say nothing of a wet one, and a car that enters a bend too fast
is lost before any alarm. So a drive begins at a share of the limits that the wet road has, too, and
goes on to `GROWTH` times the largest one that it held without an alarm.
"""

import math
from collections.abc import Callable

import numpy as np

from mpc.loop.sensing import Measured
from mpc.path.speed import SpeedProfile

FIRST = 0.45  # of the limits: a wet road has half of a dry one
GROWTH = 1.08  # chosen on cars on .6 of the friction that they learnt on
KEPT = 0.35  # of a_y: braking that may always be taken
_TIME = 0.2  # s, over which a_y is averaged
_EVERY = 0.02  # change of the share that is worth another profile
_NOTED = 0.1  # change that is worth a note
_ALARM = 0.98  # friction over the identified one, below which it is lost


class Earned:
    """Plans the speed of a drive anew as the car shows what it holds.

    Attributes: profile, in use; share, of the limits that it uses.

    Parameters
    ----------
    profile : the fastest one, of `speed_profile`.
    period : of the samples [s].
    friction : of the road over the identified one, as it is known now [-]; NaN where nobody knows,
        which earns nothing.
    """

    def __init__(self, profile: SpeedProfile, period: float, friction: Callable[[], float]) -> None:
        assert profile.planned is not None
        (self._planner, self._most), self._friction = profile.planned, friction
        self._weight = period / _TIME
        self._a_y, self._held, self._ratio = 0.0, 0.0, 1.0
        self.share = min(self._most, FIRST)
        self._noted = self.share
        self.profile = self._planner.profile(self.share)

    def observe(self, measured: Measured, s: float, v: float) -> str | None:
        """Take a sample; return what was decided where that is worth a note.

        s : arc length, laps included [m].   v : speed [m/s].
        """
        limits = self._planner.limits
        shown, ratio = (measured.a_y, v * measured.r), self._friction()
        if math.isnan(ratio):
            ratio, self._a_y = self._ratio, 0.0
        elif np.isfinite(shown).all():  # a broken sensor alone earns nothing
            self._a_y += self._weight * (min(shown, key=abs) - self._a_y)
        ratio = min(ratio, 1.0)  # more grip than learnt is no reason to hurry
        if ratio < _ALARM and ratio < self._ratio:  # what was held was held on another road
            self._held = 0.0
        self._ratio = ratio
        self._held = max(self._held, abs(self._a_y) / float(np.interp(v, limits.v, limits.a_y)))
        share = min(self._most * ratio, max(FIRST, GROWTH * self._held))
        if 0.0 <= share - self.share < _EVERY:
            return None
        self.share = share
        whole = self._planner.profile(share)
        kept = KEPT * float(limits.a_y[0])
        self.profile = self._planner.begun(whole, share, s, v, kept)
        if abs(share - self._noted) < _NOTED:
            return None
        self._noted = share
        return f"drives at {share:.2f} of the limits"
