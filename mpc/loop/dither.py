"""A weave that teaches while the car drives its path: off unless it is asked for.

The path that the tracker is given is displaced sideways by d = g A (0.6 sin ωt + 0.4 sin 1.618 ωt),
with its curvature ahead (κ + d̈/v²) and its heading (ḋ/v): the tracker plans it as it plans any
path, and the deviation from the true path bears it, at most A. g, from 0 to 1, follows within a
second what is still unknown, and the lateral acceleration that bends ahead leave free: a car that
knows its tires, or that needs its grip, does not weave.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from codegen.arrays import Array
from models.rules import require_positive
from models.vehicle import Vehicle
from mpc.realtime.instance import Measurement

FREQUENCY = 0.27  # 1/sqrt(L/g) of the slower sine, 0.5 Hz for a sedan
SHARES, RATIO = (0.6, 0.4), 0.5 * (1.0 + math.sqrt(5.0))  # two sines that never repeat
FOLLOWS = 1.0  # s, time constant of g
USED = 0.7  # share of the grip that path and weave may take together


@dataclass(slots=True, kw_only=True)
class Dither:
    """Displaces the path that a tracker is given.

    Parameters
    ----------
    amplitude : A, the deviation that is borne [m].
    grip : largest lateral acceleration of the car [m/s²].
    need : how much is unknown now, 0 to 1; None teaches a log, with full strength.
    strength : g now [-].
    """

    vehicle: Vehicle
    amplitude: float
    grip: float
    need: Callable[[], float] | None = None
    strength: float = 0.0

    def __post_init__(self) -> None:
        require_positive(ValueError, amplitude=self.amplitude, grip=self.grip)

    def displacement(self, t: Array) -> tuple[Array, Array, Array]:
        """Return d [m], its rate [m/s] and acceleration [m/s²] at full strength, (k,) each.

        t : times [s], (k,).
        """
        omega = 2.0 * math.pi * FREQUENCY / self.vehicle.froude_time
        d, rate, acceleration = (np.zeros_like(t) for _ in range(3))
        for share, w in zip(SHARES, (omega, RATIO * omega), strict=True):
            size = share * self.amplitude
            d += size * np.sin(w * t)
            rate += size * w * np.cos(w * t)
            acceleration -= size * w**2 * np.sin(w * t)
        return d, rate, acceleration

    @property
    def acceleration(self) -> float:
        """Largest lateral acceleration of the weave at full strength [m/s²]."""
        omega = 2.0 * math.pi * FREQUENCY / self.vehicle.froude_time
        return self.amplitude * omega**2 * (SHARES[0] + SHARES[1] * RATIO**2)

    def displaced(self, given: Measurement, t: float, times: Array, period: float) -> Measurement:
        """Return what the tracker is given in place of a measurement.

        t : now [s].   times : after which the road ahead is given [s], (k,).
        period : since the last one [s].
        """
        bends = float(np.abs(given.kappa * given.v_x**2).max())
        free = (USED * self.grip - bends) / self.acceleration
        wanted = min(1.0 if self.need is None else self.need(), max(free, 0.0), 1.0)
        self.strength += min(period / FOLLOWS, 1.0) * (wanted - self.strength)
        d, rate, acceleration = (self.strength * one for one in self.displacement(t + times))
        v_x = np.maximum(given.v_x, 1e-3)
        return given._replace(
            e_y=given.e_y - float(d[0]),
            e_psi=given.e_psi - math.atan(float(rate[0] / v_x[0])),
            kappa=given.kappa + acceleration / v_x**2,
        )
