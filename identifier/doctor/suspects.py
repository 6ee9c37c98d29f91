"""Which numbers may be wrong, how wrong they plausibly are, and what takes each of them out.

Sizes are those of a sedan, 2.7 m between the axles; a car of another size has them by Froude's
similarity: lengths with L, speeds with sqrt(g L), angles as they are. Delays and lags are of
devices, not of cars.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from identifier.measured import with_doubt
from models.recordings import Repair
from models.vehicle import GRAVITY, Vehicle

SEDAN = 2.7  # m, wheelbase of whose size the numbers are
DEGREES = math.degrees(1.0)  # in a rad
INERTIA = (0.5, 1.6)  # of I_z/(m l_f l_r); cars on the road have 0.9 to 1.1
SMALL, SMALL_INERTIA = 1.0, 0.3  # [m] wheelbase, below which a model car may have as little
CENTER = (0.25, 0.75)  # l_f over the wheelbase: a load that an axle of a car can have
OPPOSITES = {  # of what a size says, where it is negative
    " late ": " early ",
    "too much": "too little",
    " ahead of ": " behind ",
    " swings out ": " swings in ",
    " to the left": " to the right",
    "too far back": "too far forward",
    "push more at speed, as by a downforce": "push less at speed, as by a lift",
}
POWERS: Mapping[str, float] = {"": 0.0, "length": 1.0, "speed": 0.5, "time": 0.5, "rate": -0.5}


def grown(grows: str, vehicle: Vehicle) -> float:
    """Return the size of something of a car over that of a sedan.

    Parameters
    ----------
    grows : with what: one of `POWERS`, by powers of the wheelbase.
    """
    return float((vehicle.wheelbase / SEDAN) ** POWERS[grows])


def usual_inertia(vehicle: Vehicle) -> tuple[float, float]:
    """Return from what to what I_z/(m l_f l_r) of cars of a size goes."""
    return (SMALL_INERTIA if vehicle.wheelbase < SMALL else INERTIA[0]), INERTIA[1]


def similar_inertia(vehicle: Vehicle) -> float:
    """Return m l_f l_r, the yaw inertia of two points on the axles [kg m^2]."""
    return vehicle.mass * vehicle.l_f * vehicle.l_r


class Suspect(NamedTuple):
    """A number that may be wrong.

    key : of its size in `balance.Sizes`.   code, channel, unit : as in `Finding`;
    channels of one device are joined by "+".
    plausible : standard deviation of what is believed [SI], of a sedan.   least : what nobody need
    mend, and what no model of this size tells from a tire.   grows : with the size of a car.
    signed : whether it may be negative.   text : with {size} and {deviation} in `shown`, {origin}
    of a number of the car.
    shown : unit of the text.   per_unit : of the text per SI unit.   price : gain of J that it must
    bring beside that of every suspect, where it easily explains what is none.
    """

    key: str
    code: str
    channel: str
    unit: str
    plausible: float
    least: float
    grows: str
    signed: bool
    text: str
    shown: str
    per_unit: float = 1.0
    price: float = 0.0

    def scale(self, vehicle: Vehicle) -> float:
        """Return what `plausible` and `least` are multiplied by for a car."""
        return grown(self.grows, vehicle)

    @property
    def is_factor(self) -> bool:
        """Whether its size in `Sizes` is the logarithm of a factor."""
        return self.code in ("factor", "yaw_inertia")

    def is_late_as(self, other: "Suspect") -> bool:
        """Return whether both say that the same channel is late, by a delay and by a low pass."""
        return self.channel == other.channel and {self.code, other.code} == {"delay", "lag"}

    def repair(self, size: float, vehicle: Vehicle) -> Repair | None:
        """Return what takes it out, None for what no repair does."""
        numbers: dict[str, Any] = {self.code: size}
        match self.code:
            case "bank" | "downforce" | "velocity_sensor_z":
                return None
            case "factor":
                numbers = {"factor": {self.channel: math.exp(-size)}}
            case "offset" | "delay" | "lag":
                numbers = {self.code: dict.fromkeys(self.channel.split("+"), size)}
            case "yaw_inertia":
                numbers = {"vehicle": {"yaw_inertia": vehicle.yaw_inertia * math.exp(-size)}}
            case "center_of_gravity":
                right = {"l_f": vehicle.l_f - size, "l_r": vehicle.l_r + size}
                numbers = {"vehicle": right}
        return Repair(**numbers)

    def leaves_a_car(self, size: float, vehicle: Vehicle) -> bool:
        """Return whether the car without the fault is one, be the told one or not.

        What no car has was not told wrongly: something else is wrong, or beyond the model.
        """
        match self.code:
            case "center_of_gravity":
                return CENTER[0] < (vehicle.l_f - size) / vehicle.wheelbase < CENTER[1]
            case "yaw_inertia":
                least, most = usual_inertia(vehicle)
                right = vehicle.yaw_inertia * math.exp(-size)
                return least < right / similar_inertia(vehicle) < most
        return True

    def words(self, size: float, deviation: float, vehicle: Vehicle) -> str:
        """Return it in words."""
        text = self.text
        if self.is_factor:
            size, deviation = math.exp(size), math.exp(size) * deviation
        elif size < 0.0 and (said := next((one for one in OPPOSITES if one in text), None)):
            size, text = -size, text.replace(said, OPPOSITES[said])
        shown = f"{with_doubt(size * self.per_unit, abs(deviation) * self.per_unit)}{self.shown}"
        return text.format(size=shown, origin=vehicle.origin(self.code))


def _channels() -> tuple[Suspect, ...]:
    offsets = (
        ("v_y", "m/s", 0.4, 0.02, "speed", "v_y reads {size} too much", " m/s", 1.0),
        ("r", "rad/s", 0.03, 0.002, "rate", "the yaw rate reads {size} too much", " rad/s", 1.0),
        ("a_y", "m/s^2", 0.7, 0.05, "", "the lateral acceleration reads {size} too much",
         " m/s²", 1.0),
        ("delta_f", "rad", 0.03, 0.0015, "", "the steering angle reads {size} too much",
         "°", DEGREES),
    )  # fmt: skip
    found = [
        Suspect(f"offset.{name}", "offset", name, unit, plausible, least, grows, True, text,
                shown, per_unit)
        for name, unit, plausible, least, grows, text, shown, per_unit in offsets
    ]  # fmt: skip
    words = {
        "v_x": "v_x",
        "v_y": "v_y",
        "r": "the yaw rate",
        "delta_f": "the steering angle",
        "a_y": "the lateral acceleration",
    }
    for name in ("v_y", "r", "delta_f", "a_y"):
        found.append(Suspect(
            f"delay.{name}", "delay", name, "s", 0.12, 0.004, "", True,
            f"{words[name]} is {{size}} late against the other channels", " ms", 1e3,
        ))  # fmt: skip
        found.append(Suspect(
            f"lag.{name}", "lag", name, "s", 0.15, 0.004, "", False,
            f"{words[name]} lags behind a low pass of {{size}}", " ms", 1e3,
        ))  # fmt: skip
    found.append(Suspect(
        "delay.r+a_y", "delay", "r+a_y", "s", 0.12, 0.004, "", True,
        "the yaw rate and the lateral acceleration, of one device, are {size} late against the "
        "other channels", " ms", 1e3,
    ))  # fmt: skip
    found += [
        Suspect(f"factor.{name}", "factor", name, "", plausible, least, "", True,
                f"{words[name]} reads {{size}} times the right value", "")
        for name, plausible, least in (
            ("v_x", 0.15, 0.01), ("v_y", 0.2, 0.015), ("r", 0.15, 0.01), ("delta_f", 0.2, 0.012),
            ("a_y", 0.15, 0.01),
        )
    ]  # fmt: skip
    return tuple(found)


SUSPECTS = (
    *_channels(),
    Suspect("velocity_sensor_angle", "velocity_sensor_angle", "v_y", "rad", 0.02, 0.0012, "", True,
            "the velocity sensor is turned by {size} to the left", "°", DEGREES),
    Suspect("velocity_sensor_x", "velocity_sensor_x", "v_y", "m", 0.8, 0.04, "length", True,
            "the velocity is measured {size} ahead of the center of gravity", " m"),
    Suspect("velocity_sensor_z", "velocity_sensor_z", "v_y", "m/(m/s^2)", 0.008, 0.001, "length",
            True, "v_y is measured where the body swings out by {size} for each g, as on a roof",
            " cm", 100.0 * GRAVITY, 6.0),
    Suspect("acceleration_sensor_x", "acceleration_sensor_x", "a_y", "m", 0.8, 0.04, "length",
            True, "the acceleration is measured {size} ahead of the center of gravity", " m"),
    Suspect("center_of_gravity", "center_of_gravity", "", "m", 0.2, 0.1, "length", True,
            "the center of gravity is told {size} too far back (l_f and l_r)", " m"),
    Suspect("yaw_inertia", "yaw_inertia", "", "", 0.5, 0.05, "", True,
            "the {origin} yaw inertia is {size} times the right one", ""),
    Suspect("bank", "bank", "", "rad", 0.03, 0.003, "", True,
            "the road falls by {size} to the left, or wind pushes so", "°", DEGREES),
    Suspect("downforce", "downforce", "", "s^2/m^2", 2e-4, 5e-5, "", True,
            "the tires push more at speed, as by a downforce of {size}",
            " % of the weight at 100 km/h", 100.0 * (100.0 / 3.6) ** 2),
)  # fmt: skip
NUISANCES = {  # mean, standard deviation, and what both grow with, of a sedan
    "relaxation.front": (0.17, 0.11, ""),  # wheelbases; cars on the road have up to 0.4
    "relaxation.rear": (0.17, 0.11, ""),
    "sway": (0.005, 0.004, "length"),  # m of contact patch per m/s² of acceleration
    "roll_delay": (0.06, 0.05, "time"),  # s, of the roll behind the acceleration
    "tilt": (0.0, 2.0, ""),  # of the roll of the body over its most, see `balance.tilted`
}
