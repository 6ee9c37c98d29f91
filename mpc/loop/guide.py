"""Steering along a path: where the car is, the road ahead of it, and a step of the tracker."""

import math
from typing import NamedTuple, Protocol

from codegen.arrays import Array
from models.sensors import is_measured
from mpc.loop.sensing import Measured
from mpc.path.path import Path, Projection
from mpc.path.speed import Preview, SpeedProfile
from mpc.realtime.instance import Command, Measurement

GUIDES = ("X", "Y", "psi", "v_x")  # without which a car does not know where it is, for long


class Steers(Protocol):
    """What a guide asks: a `mpc.realtime.Tracker`, or what stands in for it."""

    @property
    def times(self) -> Array: ...

    def step(self, measurement: Measurement, /) -> Command: ...


class Place(NamedTuple):
    """Where the car is taken to be, [m, rad], and how it moves, [m/s, rad/s].

    silent : for how long each of `GUIDES` has shown no number [s].
    """

    X: float
    Y: float
    psi: float
    v_x: float
    v_y: float = 0.0
    r: float = 0.0
    silent: tuple[float, ...] = (0.0,) * len(GUIDES)

    def just_lost(self, dt: float) -> tuple[str, ...]:
        """Return the guides that show no number since this sample.

        dt : period [s].
        """
        pairs = zip(GUIDES, self.silent, strict=True)
        return tuple(channel for channel, time in pairs if 0.0 < time < 1.5 * dt)

    def complaint(self, blind: float) -> str:
        """Return which guide has been silent for too long, or nothing.

        blind : longest time [s].
        """
        pairs = zip(GUIDES, self.silent, strict=True)
        lost = ", ".join(channel for channel, time in pairs if time >= blind * (1.0 - 1e-9))
        return f"no number of {lost} for {blind:g} s" if lost else ""

    def next(self, measured: Measured, dt: float) -> "Place":
        """Return the measured place; what shows no number goes on by dead reckoning.

        dt : period [s].
        """

        def value_of(channel: str, otherwise: float) -> float:
            value: float = getattr(measured, channel)
            return value if is_measured(channel, value) else otherwise

        v_x, v_y, r = value_of("v_x", self.v_x), value_of("v_y", self.v_y), value_of("r", self.r)
        psi = value_of("psi", self.psi + dt * r)
        cos_psi, sin_psi = math.cos(psi), math.sin(psi)
        X = value_of("X", self.X + dt * (v_x * cos_psi - v_y * sin_psi))
        Y = value_of("Y", self.Y + dt * (v_x * sin_psi + v_y * cos_psi))
        silent = tuple(
            0.0 if is_measured(channel, getattr(measured, channel)) else time + dt
            for channel, time in zip(GUIDES, self.silent, strict=True)
        )
        return Place(X, Y, psi, v_x, v_y, r, silent)


class Guide:
    """Places a car on its path, sample by sample, and asks a tracker how to steer there.

    Attributes: place, and here, the point of the path that the car is at.

    tracker : which steers.   gain : acceleration that the driver asks for, per error of the
    speed [1/s].   place : at the start.   here : the same along the path.
    """

    def __init__(
        self, path: Path, tracker: Steers, gain: float, place: Place, here: Projection
    ) -> None:
        self._path, self._tracker, self._gain = path, tracker, gain
        self.place, self.here = place, here

    def locate(self, measured: Measured, dt: float) -> None:
        """Take a sample, a period [s] after the last one."""
        self.place = self.place.next(measured, dt)
        self.here = self._path.project(self.place.X, self.place.Y, self.here.s)

    def ahead(self, profile: SpeedProfile, t: Array) -> Preview:
        """Return the road at some times from now.   t : [s], (k,)."""
        return profile.ahead(self.here.s, self.place.v_x, t, self._gain)

    def steer(self, measured: Measured, profile: SpeedProfile) -> Command:
        """Return what the tracker does at the place that was located last."""
        road, r, v_y = self.ahead(profile, self._tracker.times), measured.r, measured.v_y
        return self._tracker.step(
            Measurement(
                e_y=self.here.e_y,
                e_psi=self.here.heading_error(self.place.psi),
                v_y=v_y if is_measured("v_y", v_y) else math.nan,
                r=r if is_measured("r", r) else math.nan,
                kappa=road.kappa,
                v_x=road.v_x,
            )
        )
