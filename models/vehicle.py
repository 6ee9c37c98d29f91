"""The car as data: six numbers for the linear bicycle and, where a plant is wanted, its chassis.

SI units, ISO axes. The cornering stiffness is per axle (both tires), in the paper's sign
F_y = +C alpha with alpha = delta - atan2(v_y +- l r, v_x), the negative of the ISO 8855 slip angle.
"""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from codegen.escape import displayed
from models.bicycle import BicycleParameters
from models.files import write_atomically
from models.rules import require_number, require_positive, require_within
from models.schema import Table, read_toml, require_name, toml_table

# What a car needs beyond the linear bicycle: roll, load transfer, tire lag and drive force.
#
# SI units, ISO axes (x forward, y left, z up). Numbers are checked when a `Chassis` is made, so a
# plant never starts from a value that is not physical.


_DATA = Path(__file__).resolve().parent / "data"  # cars and tires that are built in


class VehicleError(TireidError, ValueError):
    """A vehicle parameter breaks a rule; the message names the key, the rule and the value."""


# What the numbers of a chassis lie within, in their units.
_RANGES: Mapping[tuple[float, float], tuple[str, ...]] = {
    (1e-3, 30.0): ("track_front", "track_rear", "cg_height"),
    (1e-9, 1e12): ("roll_stiffness", "roll_damping", "roll_inertia"),
    (1e-4, 100.0): ("relaxation_length_front", "relaxation_length_rear", "steering_lag"),
    (0.0, 1.0): ("roll_stiffness_front_share", "drive_front_share", "brake_front_share"),
    (-1.0, 1.0): ("roll_camber_front", "roll_camber_rear"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Chassis:
    """Parameters of the double-track plant which the linear bicycle does not have.
    track_front, track_rear : distance between the wheels of an axle [m].
    cg_height : height of the center of gravity above the road [m].
    roll_center_height_front, roll_center_height_rear : height of the roll center of the axle above
        the road [m]; it carries the geometric part of the lateral load transfer.
    roll_stiffness : moment of both axles per roll angle, springs and bars, without gravity
        [N m/rad].
    roll_stiffness_front_share : share of the front axle in stiffness and damping [-].
    roll_damping : moment of both axles per roll rate [N m s/rad].
    roll_inertia : moment of inertia of the body about the x axis through the center of gravity
        [kg m^2].
    roll_camber_front, roll_camber_rear : camber of the wheel over roll of the body [-]; 1 leans
        with the body, 0 stays upright as on a rigid axle.
    relaxation_length_front, relaxation_length_rear : distance rolled until 63 % of a slip change
        has become force [m].
    steering_lag : time constant from commanded to actual road-wheel angle [s].
    drive_front_share : share of the front axle in the driving force [-].
    brake_front_share : the same of the braking force [-].
    tire : property file (.tir) of all four tires, or None where a tire object is handed over.
    estimated : names of the numbers that nobody stated, see `typical_chassis`; two that differ in
        it alone are equal.
    """

    track_front: float
    track_rear: float
    cg_height: float
    roll_center_height_front: float
    roll_center_height_rear: float
    roll_stiffness: float
    roll_stiffness_front_share: float
    roll_damping: float
    roll_inertia: float
    roll_camber_front: float
    roll_camber_rear: float
    relaxation_length_front: float
    relaxation_length_rear: float
    steering_lag: float
    drive_front_share: float
    brake_front_share: float = 0.62
    tire: Path | None = None
    estimated: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        if not set(self.estimated) <= {one.name for one in fields(self)}:
            raise VehicleError(f"estimated must name numbers of a chassis, not {self.estimated}")
        centers = ("roll_center_height_front", "roll_center_height_rear")
        for (low, high), names in (*_RANGES.items(), ((0.0, self.cg_height), centers)):
            values = {name: getattr(self, name) for name in names}
            if low > 0.0:
                require_positive(VehicleError, **values)
            require_within(VehicleError, low, high, **values)


# What is typical of a car of that size, where its file leaves out what a simulation needs.

_TRACK, _HEIGHT = 0.57, 0.2  # wheelbases; passenger cars have 0.53 to 0.62 and 0.18 to 0.25
_ROLL_CENTERS = 0.09, 0.18  # heights of the center of gravity: strut, multi-link
_ROLL = 0.09  # rad/g: 5.2 degrees of a passenger car on its springs
_DAMPING = 0.46  # of critical, of the body on its springs
_GYRATION = 0.39  # track widths, about the x axis: a third of the width of the body
_RELAXATION = 0.22, 0.185  # wheelbases: two rolling radii, less at the lower load behind
_LAG = 0.04  # s of a sedan: rack and power assistance, 4 Hz
_PLAIN = {"roll_stiffness_front_share": 0.58, "roll_camber_front": 0.8, "roll_camber_rear": 0.5}


def typical_chassis(car: "Vehicle", given: Mapping[str, Any]) -> Chassis:
    """Return a chassis of which some numbers are given, and the others typical of such a car.

    car : its size and what it declares of braking and driving.   given : by the names of `Chassis`.
    """
    L, values = car.wheelbase, dict(given)

    def default(**typical: float | None) -> None:
        values.update({k: x for k, x in typical.items() if x is not None and k not in given})

    default(track_front=_TRACK * L, track_rear=_TRACK * L, cg_height=_HEIGHT * L)
    default(drive_front_share=1.0, **_PLAIN)
    default(**{name: getattr(car, name) for name in _OF_CHASSIS})
    h, front, rear = values["cg_height"], *_ROLL_CENTERS
    default(roll_center_height_front=front * h, roll_center_height_rear=rear * h)
    front, rear = values["roll_center_height_front"], values["roll_center_height_rear"]
    tipping = car.weight * (h - (car.l_r * front + car.l_f * rear) / L)
    gyration = 0.5 * _GYRATION * (values["track_front"] + values["track_rear"])
    default(
        roll_stiffness=tipping * (1.0 + 1.0 / _ROLL), roll_inertia=car.mass * gyration * gyration
    )
    critical = 2.0 * math.sqrt(abs((values["roll_stiffness"] - tipping) * values["roll_inertia"]))
    default(
        roll_damping=_DAMPING * critical,
        relaxation_length_front=_RELAXATION[0] * L,
        relaxation_length_rear=_RELAXATION[1] * L,
        steering_lag=_LAG * car.scale,
    )
    return Chassis(**values, estimated=tuple(name for name in values if name not in given))


def _from_folder(value: Any, folder: Path) -> Any:
    """Return a path as it is named in a file of a folder; another value itself."""
    if not isinstance(value, Path):
        return value
    if value.parent == _DATA and not (folder / value.name).exists():
        return value.name
    try:
        return Path(os.path.relpath(value, folder)).as_posix()
    except ValueError:  # another drive
        return value.as_posix()


GRAVITY = 9.81  # standard acceleration of free fall, rounded as usual [m/s^2]

# What a vehicle file may leave out, and what is believed of a road car then.
#
# Inertia: a car that swings about one axle leaves the other at rest where I_z = m l_f l_r. The cars
# of CommonRoad (Ford Escort, BMW 320i, VW Vanagon) have 0.94, 1.00 and 1.10 of it, a sedan of
# CarMaker 0.99. A scale model has less: 0.41 and 0.46 for two of 1:10, 0.71 for one of 1:43.
# Stiffness: the middle of the 12 to 20 static loads per rad that passenger cars have, on the soft
# side, as on a road that is not of the best; 0.25 of the load a degree.

_MODEL_INERTIA = 0.5  # of m l_f l_r, of a car shorter than `FULL_SIZE`
_STIFFNESS_SHARE = 14.0  # of the static load of the axle [1/rad]
_OF_LOAD = ("N/rad", f"{_STIFFNESS_SHARE:g} static axle loads per rad")
_RULES = {  # unit and rule
    "yaw_inertia": ("kg m²", f"mass l_f l_r, {_MODEL_INERTIA:g} of it for a model car"),
    "cornering_stiffness_front": _OF_LOAD,
    "cornering_stiffness_rear": _OF_LOAD,
}

# Downforce of an axle grows with the square of speed, ½ ρ A v_x², and adds to its static load.
#
# What a car may have is given over its static axle load at a speed: Formula cars have 0.4 of it at
# 30 m/s, the lightest of Formula Student about 2; lift takes off a few hundredths on road cars.

_AIR_DENSITY = 1.2  # ρ [kg/m³]: dry air at 20 °C, 100 m above the sea
LIGHTEST = 0.2  # load of an axle that lifts, over the static one: a car that flies is not modelled
DOWNFORCE_SPEED = 30.0  # m/s
_LEAST_PRESS, _MOST_PRESS = -0.5, 5.0  # static axle loads of downforce there
AREAS = ("downforce_area_front", "downforce_area_rear")  # of a `Vehicle`

# What a car may tell of braking and driving: height of its center of gravity over the wheelbase,
# shares of the front axle, and drag area, ½ ρ A v_x² against the motion.

_OF_CHASSIS = ("cg_height", "drive_front_share", "brake_front_share")  # declared there as well
LENGTHWISE = (*_OF_CHASSIS, "drag_area")  # of a `Vehicle`
_MOST_HEIGHT = 0.6  # wheelbases: a van that is loaded high has 0.35
_DRAG_AREA, FULL_SIZE = 0.7, 1.0  # m² of a passenger car; wheelbase [m] below which it has none
_SEDAN = 2.7  # m, the wheelbase for which times and speeds are given; they go with its root
_MOST_CENTER_SD = 0.2  # wheelbases: half of where any car has its center of gravity
_MOST_DRAG = 1.0  # weights, at `DOWNFORCE_SPEED`: a Formula car has about 0.1


def load_ratio(downforce: Any, v_x: Any) -> Any:
    """Return λ = 1 + κ v_x^2, the load over the static one [-], as a CasADi expression.

    `Vehicle.load_ratio` is the same of numbers.
    downforce : κ of both axles (2,), or of one, as `Vehicle.downforce` has it [s^2/m^2].
    v_x : longitudinal speed [m/s].
    """
    pressed = 1 + downforce * v_x**2
    return ca.if_else(pressed > LIGHTEST, pressed, LIGHTEST)


__all__ = [
    "GRAVITY", "BicycleParameters", "Chassis", "Vehicle", "VehicleError", "estimate", "sedan",
    "vehicle_template",
]  # fmt: skip


def estimate(mass: float, l_f: float, l_r: float) -> dict[str, float]:
    """Return yaw inertia and cornering stiffnesses of a car of that size, by `_RULES`.
    mass : total mass [kg].
    l_f, l_r : distance from the center of gravity to the front and rear axle [m].
    """
    _require_size(mass, l_f, l_r)
    weight, wheelbase = mass * GRAVITY, l_f + l_r
    return {
        "yaw_inertia": mass * l_f * l_r * (_MODEL_INERTIA if wheelbase < FULL_SIZE else 1.0),
        "cornering_stiffness_front": _STIFFNESS_SHARE * weight * l_r / wheelbase,
        "cornering_stiffness_rear": _STIFFNESS_SHARE * weight * l_f / wheelbase,
    }


def _require_size(mass: float, l_f: float, l_r: float) -> None:
    require_positive(VehicleError, mass=mass, l_f=l_f, l_r=l_r)
    require_within(VehicleError, 1e-2, 1e6, mass=mass)  # a toy; a dump truck has 6e5
    require_within(VehicleError, 1e-3, 30.0, l_f=l_f, l_r=l_r)


BICYCLE = (
    "mass",
    "yaw_inertia",
    "l_f",
    "l_r",
    "cornering_stiffness_front",
    "cornering_stiffness_rear",
)  # the six numbers of the linear bicycle, of a `Vehicle`


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """A car; `chassis` may be None where only the linear bicycle is needed.

    Parameters
    ----------
    mass : total mass [kg].
    yaw_inertia : moment of inertia about the vertical axis [kg m^2]; estimated where left out.
    l_f, l_r : distance from the center of gravity to the front and rear axle [m].
    cornering_stiffness_front, cornering_stiffness_rear : slope of the lateral force of the axle
        (both tires) over its slip angle at zero, at its static load [N/rad]; estimated where left
        out.
    downforce_area_front, downforce_area_rear : coefficient of downforce times area of the axle
        [m^2]: it adds ½ ρ A v_x^2 to the static load; negative where the body lifts.
    cg_height : height of the center of gravity above the road [m]; None is that of the chassis, or
        not known.
    drive_front_share, brake_front_share : share of the front axle in the driving and the braking
        force [-]; None is that of the chassis, or not known.
    drag_area : coefficient of drag times frontal area [m^2]; None is not known.
    center_of_gravity_sd : standard deviation of l_f at a given wheelbase [wheelbases]: about 0.01
        where the axles were weighed, 0.04 of a data sheet; None is not known.
    chassis : what the double-track plant needs, or None.
    estimated : names of the values that nobody measured, but that follow from the others by a
        rule; two cars that differ in it alone are equal.
    """

    name: str = "car"
    mass: float
    yaw_inertia: float = None  # type: ignore[assignment]  # a number from `__post_init__` on
    l_f: float
    l_r: float
    cornering_stiffness_front: float = None  # type: ignore[assignment]  # as yaw_inertia
    cornering_stiffness_rear: float = None  # type: ignore[assignment]  # as yaw_inertia
    downforce_area_front: float = 0.0
    downforce_area_rear: float = 0.0
    cg_height: float | None = None
    drive_front_share: float | None = None
    brake_front_share: float | None = None
    drag_area: float | None = None
    center_of_gravity_sd: float | None = field(default=None, compare=False)
    chassis: Chassis | None = None
    estimated: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        require_name(VehicleError, "name", self.name)
        if missing := [name for name in _RULES if getattr(self, name) is None]:
            typical = estimate(self.mass, self.l_f, self.l_r)
            for name in missing:
                object.__setattr__(self, name, typical[name])
            object.__setattr__(self, "estimated", tuple(dict.fromkeys([*self.estimated, *missing])))
        for name in self.estimated:
            if name not in _RULES:
                raise VehicleError(
                    f"estimated must be of {', '.join(_RULES)}, not {displayed(name)}"
                )
        require_positive(VehicleError, **{name: getattr(self, name) for name in BICYCLE})
        self._require_plausible()
        if self.chassis is not None:
            tipping = self.weight * self.roll_arm
            if not self.chassis.roll_stiffness > tipping:
                raise VehicleError(
                    f"roll_stiffness must exceed mass * g * roll arm = {tipping:.6g} N m/rad or "
                    f"the body tips over at rest, it is {self.chassis.roll_stiffness}"
                )

    def _require_plausible(self) -> None:
        """Refuse values that no car of any size has: a wrong unit, or a digit too many."""
        _require_size(self.mass, self.l_f, self.l_r)
        typical = self.mass * self.l_f * self.l_r  # about that; 0.4 times it in models
        if not 0.05 < self.yaw_inertia / typical < 20.0:
            raise VehicleError(
                f"yaw_inertia in kg m² must be 0.05 to 20 times mass * l_f * l_r = {typical:.4g}, "
                f"it is {self.yaw_inertia:g}: check the units"
            )
        for name, load in zip(("front", "rear"), self.axle_loads, strict=True):
            stiffness = getattr(self, f"cornering_stiffness_{name}")
            if not 0.5 < stiffness / load < 500.0:  # about 16 for a passenger car, 4 for models
                raise VehicleError(
                    f"cornering_stiffness_{name} in N/rad must be 0.5 to 500 times the static load "
                    f"of the axle, {load:.4g} N, it is {stiffness:g}: check the units"
                )
        for name, load in zip(AREAS, self.axle_loads, strict=True):
            require_number(VehicleError, name, getattr(self, name))
            unit = 0.5 * _AIR_DENSITY * DOWNFORCE_SPEED**2 / load  # static loads per m^2
            if not _LEAST_PRESS <= getattr(self, name) * unit <= _MOST_PRESS:
                raise VehicleError(
                    f"{name} in m² must lie between {_LEAST_PRESS / unit:.3g} and "
                    f"{_MOST_PRESS / unit:.3g}, a downforce of {_LEAST_PRESS:g} to {_MOST_PRESS:g} "
                    f"static loads of the axle at {DOWNFORCE_SPEED:g} m/s, it is "
                    f"{getattr(self, name):g}: check the units"
                )
        if (sd := self.center_of_gravity_sd) is not None:
            require_within(VehicleError, 0.0, _MOST_CENTER_SD, center_of_gravity_sd=sd)
        most_drag = _MOST_DRAG * self.weight / (0.5 * _AIR_DENSITY * DOWNFORCE_SPEED**2)
        highest = {"cg_height": _MOST_HEIGHT * self.wheelbase, "drag_area": most_drag}
        for name in LENGTHWISE:
            if (value := getattr(self, name)) is None:
                continue
            require_number(VehicleError, name, value)
            require_within(VehicleError, 0.0, highest.get(name, 1.0), **{name: value})

    def lengthwise(self, name: str) -> float | None:
        """Return a number of `_OF_CHASSIS` as the car or else its chassis tells it, or None."""
        given: float | None = getattr(self, name)
        if given is None and self.chassis is not None and name not in self.chassis.estimated:
            given = getattr(self.chassis, name)
        return given

    def moves_as(self, other: "Vehicle") -> bool:
        """Return whether another file declares the same car: its bicycle and its downforce."""
        return self.bicycle == other.bicycle and self.downforce == other.downforce

    def without_chassis(self) -> "Vehicle":
        """Return the car alone, with the numbers of `_OF_CHASSIS` that its chassis tells."""
        given: dict[str, Any] = {name: self.lengthwise(name) for name in _OF_CHASSIS}
        return replace(self, chassis=None, **given)

    @property
    def drag(self) -> float:
        """Deceleration by the air over v_x^2 [1/m]; of a passenger car without a declared area."""
        area = self.drag_area
        if area is None:
            area = _DRAG_AREA if self.wheelbase >= FULL_SIZE else 0.0
        return 0.5 * _AIR_DENSITY * area / self.mass

    @property
    def wheelbase(self) -> float:
        """Distance between the axles, l_f + l_r [m]."""
        return self.l_f + self.l_r

    @property
    def inertia_is_estimate(self) -> bool:
        """Whether the yaw inertia is what `estimate` returns, so that nobody measured it."""
        guess = estimate(self.mass, self.l_f, self.l_r)["yaw_inertia"]
        return math.isclose(self.yaw_inertia, guess, rel_tol=1e-3)

    @property
    def weight(self) -> float:
        """Weight m g [N]."""
        return self.mass * GRAVITY

    @property
    def axle_loads(self) -> tuple[float, float]:
        """Static vertical load of the front and the rear axle [N]."""
        return (self.weight * self.l_r / self.wheelbase, self.weight * self.l_f / self.wheelbase)

    @property
    def downforce(self) -> tuple[float, float]:
        """Downforce of the front and the rear axle over static load and v_x^2, κ [s^2/m^2]."""
        front, rear = (
            0.5 * _AIR_DENSITY * getattr(self, name) / load
            for name, load in zip(AREAS, self.axle_loads, strict=True)
        )
        return front, rear

    @property
    def has_downforce(self) -> bool:
        """Whether the load of an axle changes with speed."""
        return any(getattr(self, name) != 0.0 for name in AREAS)

    def load_ratio(self, v_x: float | Array) -> Array:
        """Return the loads of the axles over the static ones, λ = 1 + κ v_x^2 [-], (..., 2).

        Parameters
        ----------
        v_x : longitudinal speed [m/s], of any shape.
        """
        pressed = 1.0 + np.asarray(v_x, dtype=np.float64)[..., None] ** 2 * self.downforce
        ratio: Array = np.maximum(pressed, LIGHTEST)
        return ratio

    @property
    def froude_speed(self) -> float:
        """Speed that scales with the size of a car, sqrt(g L) [m/s]: 5 for a sedan."""
        return math.sqrt(GRAVITY * self.wheelbase)

    @property
    def froude_time(self) -> float:
        """Time that scales with the size of a car, sqrt(L/g) [s], 0.5 for a sedan."""
        return math.sqrt(self.wheelbase / GRAVITY)

    @property
    def scale(self) -> float:
        """What times and speeds of a sedan are multiplied by, sqrt(L / 2.7 m) [-]."""
        return math.sqrt(self.wheelbase / _SEDAN)

    @property
    def lowest_speed(self) -> float:
        """Speed below which slip angles mean little, 0.2 sqrt(g L) [m/s]: 1 for a sedan."""
        return 0.2 * self.froude_speed

    @property
    def roll_arm(self) -> float:
        """Height of the center of gravity above the roll axis [m]."""
        chassis = self.require_chassis()
        front, rear = chassis.roll_center_height_front, chassis.roll_center_height_rear
        return chassis.cg_height - (self.l_r * front + self.l_f * rear) / self.wheelbase

    @property
    def bicycle(self) -> BicycleParameters:
        """The six numbers of the linear bicycle in the paper's letters."""
        return BicycleParameters(
            m=self.mass, I_z=self.yaw_inertia, l_f=self.l_f, l_r=self.l_r,
            C_f=self.cornering_stiffness_front, C_r=self.cornering_stiffness_rear,
        )  # fmt: skip

    def require_chassis(self) -> Chassis:
        """Return the chassis to who cannot do without."""
        if self.chassis is None:
            raise VehicleError(
                f"vehicle '{self.name}' has no [chassis] with tire = "
                '"my_tire.tir": add it, or drive with --weights'
            )
        return self.chassis

    def with_chassis(self) -> "Vehicle":
        """Return the car with its chassis, or with one that is typical of its size."""
        return self if self.chassis else replace(self, chassis=typical_chassis(self, {}))

    @property
    def assumed(self) -> str:
        """What of the chassis is typical of such a car, in one line; empty if nothing is."""
        names = self.chassis.estimated if self.chassis else ()
        values = ", ".join(f"{name} = {getattr(self.chassis, name):.3g}" for name in names)
        return f"assumed in [chassis] of {self.name}, SI units: {values}" if values else ""

    def origin(self, name: str) -> str:
        """Return where a value comes from: "declared", or "estimated" where left out."""
        return "estimated" if name in self.estimated else "declared"

    @property
    def estimates(self) -> str:
        """What of the car is estimated, with values and rules, in one line; empty if nothing is."""
        found = [
            f"{name} = {getattr(self, name):.4g} {unit} ({rule})"
            for name, (unit, rule) in _RULES.items()
            if name in self.estimated
        ]
        return f"estimated, as the vehicle file leaves it out: {'; '.join(found)}" if found else ""

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> "Vehicle":
        """Read a vehicle from a TOML file: mass, l_f, l_r and what else is known of it.

        Name, yaw inertia, cornering stiffnesses, areas of downforce, what `LENGTHWISE` names, the
        table [chassis] and any of its numbers may be left out; inertia, stiffnesses and numbers of
        the chassis are estimated then, and the axles carry their static loads at any speed.

        Parameters
        ----------
        path : the TOML file; a relative `tire` in [chassis] starts from its folder. One that is not
            there and has the name of a built-in tire, `sedan.tir`, is that one.
        """
        file = Path(path)
        if not file.exists():
            raise VehicleError(
                f"{file}: there is no such file; `tireid init` writes one to fill in"
            )
        data = read_toml(file, VehicleError)
        inner = data.pop("chassis", None)
        table, outside = Table(data, f"{file}: ", VehicleError), ("chassis", "estimated")
        table.only_fields(cls, skip=outside)  # before what is missing
        values = table.record(cls, skip=outside)
        parts: dict[str, Any] = {}
        if inner is not None:
            body = Table(inner, f"{file}: ", VehicleError, "chassis.")
            known = body.only_fields(Chassis, skip=("estimated",))
            parts = body.record(Chassis, skip=("estimated", *known.keys() - body.data.keys()))
        try:
            car = cls(**values)
            if "tire" in parts:
                named = (file.parent / parts["tire"]).resolve()
                built_in = _DATA / parts["tire"]
                bare = built_in.parent == _DATA and built_in.is_file()
                parts["tire"] = built_in if bare and not named.exists() else named
            return car if inner is None else replace(car, chassis=typical_chassis(car, parts))
        except (ValueError, RuntimeError) as error:  # RuntimeError: a link that leads to itself
            raise VehicleError(f"{file}: {error}") from None

    def to_toml(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the vehicle so that `from_toml` returns an equal one, bit for bit.

        What is estimated is left out, as it was in the file; so is a downforce of zero.

        Parameters
        ----------
        path : the file to write; a tire file is named relative to its folder, a built-in one by
            its name, so that the file may move.
        overwrite : replace a file that is already there.

        Raises
        ------
        FileExistsError
            When the file is there and `overwrite` is False.
        """
        file = Path(path)
        without = (name for name in AREAS if getattr(self, name) == 0.0)
        out = {"chassis", "estimated", *self.estimated, *without}
        inside = {"estimated", *(self.chassis.estimated if self.chassis else ())}
        tables = [
            toml_table(
                name,
                {
                    one.name: _from_folder(value, file.parent)
                    for one in fields(record)
                    if one.name not in skipped and (value := getattr(record, one.name)) is not None
                },
            )
            for name, record, skipped in (("", self, out), ("chassis", self.chassis, inside))
            if record is not None
        ]
        if not overwrite and file.exists():
            raise FileExistsError(f"{file} exists; overwrite=True replaces it")
        write_atomically(file, "\n".join(tables))


def sedan() -> Vehicle:
    """Return the documented mid-size sedan; its file says where each value comes from."""
    return Vehicle.from_toml(_DATA / "sedan.toml")


def vehicle_template() -> str:
    """Return the text of a vehicle file to fill in: units, where each number comes from, [chassis].

    It can be read as it is; its numbers are those of `sedan`.
    """
    return (_DATA / "template.toml").read_text(encoding="utf-8")
