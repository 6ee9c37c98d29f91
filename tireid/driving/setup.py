"""What is driven: a path, a car on its road, and how fast.

Grip is that of the true tire in steady cornering on the friction of the start.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from models.friction import Friction, FrictionChange
from models.tires import Tire
from models.vehicle import Vehicle
from mpc.cars import DoubleTrackCar
from mpc.loop.sensing import SpeedProfile, cornering_limit
from mpc.path import Path, grip_speed, steady_speed
from mpc.tires import PredictionTire, oracle_tire

WIDEST = 2.0  # deviation at which a car is off the path [m]
FASTEST = 30.0  # on a closed course [m/s]
ACCELERATION = 2.0  # on a closed course at friction 1 [m/s²]
BRAKING = 3.0  # on a closed course at friction 1 [m/s²]
PERIOD = 0.01  # control period [s]

PLANT = "double-track"


_oracle: Callable[..., PredictionTire] = cache(oracle_tire)


class SpeedWish(NamedTuple):
    """How fast to drive: a share of the grip, or a speed [m/s]; one of them is None."""

    share: float | None
    speed: float | None


class Setup(NamedTuple):
    """A car at the start of a path.

    Parameters
    ----------
    mu : friction of the road over that of the tire's measurement, before the first drop [-].
    drops : arc length [m] and friction from there on.
    """

    path: Path
    vehicle: Vehicle
    mu: float
    drops: tuple[tuple[float, float], ...]
    wish: SpeedWish

    def car(self, *, open_field: bool = False) -> DoubleTrackCar:
        """Return a car on the road, or on a field that has the friction of the start everywhere."""
        friction = Friction(scale=self.mu) if open_field else self.friction()
        return DoubleTrackCar(self.vehicle, friction=friction, period=PERIOD)

    def oracle(self, mu: float | None = None) -> PredictionTire:
        """Return the true tire on a road.

        mu : its friction; None is that of the start.
        """
        return _oracle(self.vehicle, self._tire(), self.mu if mu is None else mu)

    def _tire(self) -> Tire:
        return self.car(open_field=True).tire

    @property
    def grip(self) -> float:
        """Largest lateral acceleration on the road of the start [m/s²]."""
        return cornering_limit(self.vehicle, self._tire(), self.mu)

    def speeds(self) -> Array:
        """Return the wanted speed at the samples of the path, (n,) [m/s].

        On an open path it is constant; on a closed one it brakes for the bends and accelerates.
        """
        if self.wish.share is None:
            assert self.wish.speed is not None
            return np.full(self.path.s.size, self.wish.speed)
        a_y = self.wish.share * self.grip
        if not self.path.closed:
            return np.full(self.path.s.size, steady_speed(self.path, a_y_max=a_y))
        return grip_speed(
            self.path,
            a_y_max=a_y,
            v_max=FASTEST,
            a_accel=self.mu * ACCELERATION,
            a_brake=self.mu * BRAKING,
        )

    def profile(self) -> SpeedProfile:
        """Return the wanted speed along the path."""
        return SpeedProfile(self.path, self.speeds())

    def friction(self) -> Friction:
        """Return the road with its drops.

        On a path along X each wheel meets a drop at its place. Elsewhere all wheels meet it at the
        time at which the car is expected there.
        """
        if not self.drops:
            return Friction(scale=self.mu)
        if not self.path.closed and np.all(np.cos(self.path.psi) > 0.2):  # along X
            changes = [
                FrictionChange(scale=mu, at_place=float(self.path.pose(s)[0]))
                for s, mu in self.drops
            ]
        else:
            changes = [FrictionChange(scale=mu, at_time=self.time_at(s)) for s, mu in self.drops]
        return Friction(scale=self.mu, changes=tuple(changes))

    def time_at(self, s: float) -> float:
        """Return when the car is expected at a place, at the wanted speed [s].

        s : arc length [m]; a closed course counts laps.
        """
        return self.profile().time_at(s)
