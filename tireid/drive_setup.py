"""What `tireid drive` drives: a path, a car on its road, and how fast.

Grip is that of the true tire in steady cornering on the friction of the start.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path as FilePath
from typing import cast

import numpy as np
from numpy.typing import NDArray

from models.friction import Friction, FrictionChange
from models.tires import Tire
from models.vehicle import Vehicle, sedan
from mpc.cars import Car, DoubleTrackCar
from mpc.loop import SpeedProfile
from mpc.loop.limit import cornering_limit
from mpc.path import BUILT_IN, Path, grip_speed, steady_speed
from mpc.tires import TireModel, oracle_tire
from tireid.drive_options import SpeedWish

PLANTS = ("double-track", "multi-body", "drift")
FASTEST = 30.0  # on a closed course [m/s]
ACCELERATION, BRAKING = 2.0, 3.0  # on a closed course at friction 1 [m/s²]
PERIOD = 0.01  # control period [s]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """A car at the start of a path.

    Parameters
    ----------
    path : to follow.
    vehicle : the car as its tracker is told of it.
    plant : which equations drive, of `PLANTS`.
    mu : friction of the road over that of the tire's measurement, before the first drop [-].
    drops : arc length [m] and friction from there on.
    wish : how fast.
    """

    path: Path
    vehicle: Vehicle
    plant: str
    mu: float
    drops: tuple[tuple[float, float], ...]
    wish: SpeedWish

    def car(self, *, open_field: bool = False) -> Car:
        """Return a car on the road, or on a field that has the friction of the start everywhere.

        Parameters
        ----------
        open_field : leave the drops out.
        """
        friction = Friction(scale=self.mu) if open_field else self.friction()
        if self.plant == "double-track":
            return DoubleTrackCar(self.vehicle, friction=friction, period=PERIOD)
        from mpc.cars.commonroad import drift_car, multi_body_car

        make: Callable[..., Car] = multi_body_car if self.plant == "multi-body" else drift_car
        return make(friction=friction, period=PERIOD)

    def oracle(self, mu: float | None = None) -> TireModel:
        """Return the true tire on a road.

        Parameters
        ----------
        mu : its friction; None is that of the start.
        """
        tire = cast(Hashable, self._tire())
        return _oracle(self.vehicle, tire, self.mu if mu is None else mu)

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
        if self._runs_along_x:
            changes = [
                FrictionChange(scale=mu, at_place=float(self.path.pose(s)[0]))
                for s, mu in self.drops
            ]
        else:
            changes = [FrictionChange(scale=mu, at_time=self.time_at(s)) for s, mu in self.drops]
        return Friction(scale=self.mu, changes=tuple(changes))

    def time_at(self, s: float) -> float:
        """Return when the car is expected at a place, at the wanted speed [s].

        Parameters
        ----------
        s : arc length [m]; a closed course counts laps.
        """
        v = self.speeds()
        pace = 0.5 * (1.0 / v[1:] + 1.0 / v[:-1]) * np.diff(self.path.s)
        t = np.concatenate([[0.0], np.cumsum(pace)])
        laps, within = divmod(s, self.path.length) if self.path.closed else (0.0, s)
        return float(laps * t[-1] + np.interp(within, self.path.s, t))

    @property
    def _runs_along_x(self) -> bool:
        return not self.path.closed and bool(np.all(np.cos(self.path.psi) > 0.2))


@cache
def _oracle(vehicle: Vehicle, tire: Hashable, mu: float) -> TireModel:
    return oracle_tire(vehicle, cast(Tire, tire), mu)


def named_path(name: str) -> Path:
    """Return a built-in path, or one from way-points in a file.

    Parameters
    ----------
    name : one of the built-in paths, or the name of a CSV file.

    Raises
    ------
    ValueError
        Where it is neither, or the file is no path.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]()
    if not FilePath(name).suffix:
        raise ValueError(f"--path: there is no path {name!r}; {', '.join(BUILT_IN)}, or FILE.csv")
    return Path.from_csv(FilePath(name))


def make_setup(
    path: Path,
    *,
    vehicle: FilePath | None,
    plant: str,
    mu: float,
    drops: Sequence[tuple[float, float]],
    wish: SpeedWish,
) -> Setup:
    """Return a car at the start of a path.

    Parameters
    ----------
    path : to follow.
    vehicle : TOML file of the car, None for the built-in sedan or the car of the plant.
    plant : of `PLANTS`.
    mu : friction before the first drop [-].
    drops : arc length [m] and friction from there on.
    wish : how fast.

    Raises
    ------
    ValueError
        Where the plant brings its own car, or a drop is beyond the path.
    """
    ordered = tuple(sorted(drops))
    for s, _ in ordered:
        if not path.closed and s >= path.length:
            raise ValueError(f"--mu-drop {s:g} is beyond the path, which is {path.length:.0f} m")
    if plant == "double-track":
        car = sedan() if vehicle is None else Vehicle.from_toml(vehicle)
        car.require_chassis()
    else:
        if vehicle is not None:
            raise ValueError(f"--plant {plant} brings a car of its own: give no --vehicle with it")
        from mpc.cars.commonroad import bmw

        car = bmw()
    return Setup(path=path, vehicle=car, plant=plant, mu=mu, drops=ordered, wish=wish)
