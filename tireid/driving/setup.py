"""What is driven: a path, a car on its road, and how fast.

How fast it is follows from what is known of its tires or is given, never from the road.
"""

import logging
import math
import textwrap
from collections.abc import Callable
from dataclasses import replace
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.speed_limits import SpeedLimits, speed_limits
from identifier.tire_model import TireModel
from models.friction import Friction, FrictionChange
from models.rules import require_within
from models.tires import MagicFormula, Tire
from models.vehicle import GRAVITY, Vehicle, sedan
from mpc.cars import BRAKES, DoubleTrackCar
from mpc.path import Path, PathError, SpeedProfile, speed_profile, steady_speed
from mpc.path.speed import SHARE
from mpc.problem import Guards, Limits, size_of
from mpc.tires import PredictionTire, oracle_tire
from mpc.tires.ladder import cornering_force

_WIDEST = 2.0  # deviation at which a full-size car is off the path [m]
_FASTEST = 30.0  # m/s, of a full-size car
_OVERSHOOT = 0.95  # of the radius of a turn, which a spline passes for a moment
# Share of a given lateral acceleration to drive and brake with: 2 and 3 m/s² on a dry road.
_DRIVES, _BRAKES = 0.22, 0.33
PERIOD = 0.01  # control period [s]
_BEYOND = 2.0  # identified slips, up to which the grip of a tire is read, as `speed_limits` does
_SLIPS = np.linspace(1e-3, 0.4, 81)  # rad, within which a tire has its peak
_LIKE = "the sedan's tires, scaled to the identified stiffness and grip"
_WIDTH = 116  # characters of a line that is logged
_ROUNDS = 4  # after which stiffness and grip are those of the identified tire to 1 %

PLANT = "double-track"
_log = logging.getLogger("tireid")


_oracle: Callable[..., PredictionTire] = cache(oracle_tire)


class SpeedWish(NamedTuple):
    """How fast to drive; one of the first four is not None.

    share : of what the identified tires allow [-].   a_y : in the tightest bend [m/s²].
    speed : [m/s].   profile : along the path.   most : largest speed of a plan [m/s].
    """

    share: float | None = None
    a_y: float | None = None
    speed: float | None = None
    profile: SpeedProfile | None = None
    most: float = math.inf

    @classmethod
    def of(
        cls, speeds: SpeedProfile | float | None, tire: TireModel | None, vehicle: Vehicle
    ) -> "SpeedWish":
        """Return the wish for a profile, for a speed [m/s], or for what a tire allows."""
        if isinstance(speeds, SpeedProfile):
            return cls(profile=speeds)
        if speeds is not None:
            name = "speeds in m/s, or a profile of speed_profile,"
            plans = Guards.of(vehicle)
            require_within(ValueError, plans.min_speed, plans.max_speed, **{name: speeds})
            return cls(speed=speeds)
        if tire is None:
            raise ValueError("no tire is given that tells the speed: give speeds, such as 15.0 m/s")
        return BY_TIRES

    def limits(self, tire: TireModel | None) -> SpeedLimits | None:
        """Return what the tires allow where the wish is a share of it."""
        if tire is None or self.share is None:
            return None
        try:
            return speed_limits(tire)
        except ValueError as error:
            remedy = "say how fast instead: --speed 0.4g, speeds=15.0"
            raise ValueError(f"no speed follows from these tires: {error}; {remedy}") from None

    @property
    def words(self) -> str:
        """What is not seen of the speeds themselves."""
        if self.share is not None:
            return f", {100.0 * self.share:.0f} % of what the identified tires allow"
        return "" if self.a_y is None else f", up to {self.a_y / GRAVITY:.3g} g in bends"


BY_TIRES = SpeedWish(share=SHARE)


def simulated(vehicle: Vehicle, tire: TireModel | None) -> tuple[Vehicle, tuple[Tire, Tire] | None]:
    """Return a car that can be simulated, and its front and rear tire where its file names none.

    Without a chassis it has a typical one; without a tire file it has those of the sedan, scaled to
    the stiffness and the grip of the identified tires. Without these the car is as it was.
    What is assumed is logged.
    """
    if tire is None or (vehicle.chassis and vehicle.chassis.tire):
        return vehicle, None
    vehicle = vehicle.with_chassis()
    front, rear = (_scaled_tire(vehicle, tire, axle) for axle in (0, 1))
    for line in textwrap.wrap(f"simulated on {_LIKE}; {vehicle.assumed}".rstrip("; "), _WIDTH):
        _log.info(line)
    return vehicle, (front, rear)


def _scaled_tire(vehicle: Vehicle, like: TireModel, axle: int) -> Tire:
    """Return the tire that in steady cornering has stiffness and grip of an identified axle."""
    known = like.known_slip
    alpha = np.linspace(0.0, _SLIPS[-1] if known is None else _BEYOND * float(known[axle]), 61)[1:]
    grip = float(like.force(alpha)[:, axle].max())
    tire = MagicFormula.from_tir(str(sedan().require_chassis().tire))
    c = replace(tire.coefficients, FNOMIN=0.5 * vehicle.axle_loads[axle])
    for _ in range(_ROUNDS):  # roll, camber and load depend on what they change
        tire = replace(tire, coefficients=c, name=_LIKE)
        force = cornering_force(vehicle, tire, axle, _SLIPS, 1.0)
        stiffer, firmer = like.stiffness[axle] * _SLIPS[0] / force[0], grip / force.max()
        scales = {"LKY": stiffer, "LMUX": firmer, "LMUY": firmer}
        c = replace(c, **{name: getattr(c, name) * float(x) for name, x in scales.items()})
    return replace(tire, coefficients=c)


def faster_than(v: Array, fastest: float, why: str, option: str = "--v-max") -> str:
    """Return which share of the way is faster than a log, why that matters, and the way out.

    Empty where none is.   v : along the way [m/s].   fastest : of the log [m/s].
    """
    share, slower = 100.0 * float(np.mean(v > fastest)), math.floor(10.0 * fastest) / 10.0
    said = f"{share:.0f} % of the way is faster than the log, {fastest:.1f} m/s: there {why}"
    return f"{said} {option} {slower:g}m/s" if share else ""


def require_drivable(path: Path, vehicle: Vehicle, steering: float = Limits().steering) -> None:
    """Refuse a path with a turn that the car cannot drive.

    steering : largest angle of the front road wheels [rad].
    """
    radius = 1.0 / max(path.peak_curvature, 1e-9)
    least = vehicle.wheelbase / math.tan(min(steering, 1.5))
    if radius < _OVERSHOOT * least:
        raise PathError(
            f"{path.name}: its tightest turn has a radius of {radius:.3g} m; {vehicle.name} turns "
            f"in {least:.3g} m at best, {steering:.3g} rad of the front wheels: widen the path"
        )


class Setup(NamedTuple):
    """A car at the start of a path.

    Parameters
    ----------
    mu : friction of the road over that of the tire's measurement, before the first drop [-].
    drops : arc length [m] and friction from there on.
    limits : of the identified tires, which a wish for a share of them needs.
    tires : of the front and the rear wheels; None reads the file named by the chassis.
    """

    path: Path
    vehicle: Vehicle
    mu: float
    drops: tuple[tuple[float, float], ...]
    wish: SpeedWish
    limits: SpeedLimits | None = None
    tires: tuple[Tire, Tire] | None = None

    def car(self, *, open_field: bool = False) -> DoubleTrackCar:
        """Return a car on the road, or on a field that has the friction of the start everywhere."""
        friction = Friction(scale=self.mu) if open_field else self.friction()
        front, rear = self.tires or (None, None)
        return DoubleTrackCar(self.vehicle, front, rear_tire=rear, friction=friction, period=PERIOD)

    def oracle(self, mu: float | None = None) -> PredictionTire:
        """Return the true tire on a road.

        mu : its friction; None is that of the start.
        """
        car = self.car(open_field=True)
        given = self.mu if mu is None else mu
        return _oracle(self.vehicle, car.tire, given, rear=self.tires and self.tires[1])

    @property
    def widest(self) -> float:
        """Deviation at which the car is off the path [m]."""
        return _WIDEST * size_of(self.vehicle)

    def profile(self) -> SpeedProfile:
        """Return the wanted speed along the path.

        Where a_y is given it is constant on an open path; a closed one brakes for the bends.
        """
        fastest = min(self.wish.most, _FASTEST * size_of(self.vehicle) ** 0.5)
        return _profile(self.path, self.wish, self.limits, fastest)

    @property
    def constant(self) -> bool:
        """Whether the wish is one speed all along the path."""
        return self.wish.speed is not None or not (self.wish.a_y is None or self.path.closed)

    def speeds(self) -> Array:
        """Return the wanted speed at the samples of the path, (n,) [m/s]."""
        return self.profile().v

    def friction(self) -> Friction:
        """Return the road with its drops.

        On a path along X each wheel meets a drop at its place. Elsewhere all wheels meet it at the
        time at which the car is expected there.
        """
        along = not self.path.closed and np.all(np.cos(self.path.psi) > 0.2)  # X
        changes = tuple(
            FrictionChange(scale=mu, at_place=float(self.path.pose(s)[0]))
            if along
            else FrictionChange(scale=mu, at_time=self.time_at(s))
            for s, mu in self.drops
        )
        return Friction(scale=self.mu, changes=changes)

    def time_at(self, s: float) -> float:
        """Return when the car is expected at a place, at the wanted speed [s].

        s : arc length [m]; a closed course counts laps.
        """
        return self.profile().time_at(s)


@lru_cache(maxsize=4)
def _profile(
    path: Path, wish: SpeedWish, limits: SpeedLimits | None, fastest: float
) -> SpeedProfile:
    if wish.profile is not None:
        theirs = wish.profile.path
        if not all(np.array_equal(*pair) for pair in ((theirs.X, path.X), (theirs.Y, path.Y))):
            raise ValueError(f"speeds are of the path {theirs.name}, not of {path.name}")
        return wish.profile
    if wish.speed is not None:
        return SpeedProfile(path, wish.speed)
    if wish.a_y is not None:
        if not path.closed:
            return SpeedProfile(path, steady_speed(path, a_y_max=wish.a_y))
        given = SpeedLimits.ellipse(wish.a_y, _DRIVES * wish.a_y, _BRAKES * wish.a_y)
        return speed_profile(path, given, share=1.0, v_max=fastest)
    if limits is None:
        raise ValueError("no tires were identified that tell how fast: say a speed")
    assert wish.share is not None
    return speed_profile(path, limits, share=wish.share, v_max=fastest, brakes=BRAKES)
