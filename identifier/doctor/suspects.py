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
from models.vehicle import Vehicle

_DEGREES = math.degrees(1.0)  # in a rad
_INERTIA = (0.5, 1.6)  # of I_z/(m l_f l_r); cars on the road have 0.9 to 1.1
_SMALL = 1.0  # [m] wheelbase, below which a model car may have as little
_SMALL_INERTIA = 0.3  # of I_z/(m l_f l_r), the least of such a model car
_OVERHANG = 0.5  # wheelbases that a car, and what is mounted to it, reach beyond its axles
_BODY = 0.2  # wheelbases that its body, in which an accelerometer is, reaches beyond its axles
_CENTER = (0.25, 0.75)  # l_f over the wheelbase: a load that an axle of a car can have

_OPPOSITES = {  # of what a size says, where it is negative
    " late ": " early ",
    "too much": "too little",
    " ahead of ": " behind ",
    " to the left": " to the right",
    "too far back": "too far forward",
    "grow with speed, as by a downforce": "shrink with speed, as by a lift",
}
_POWERS: Mapping[str, float] = {"": 0.0, "length": 2.0, "speed": 1.0, "rate": -1.0}  # of the scale
NOTES = ("center_of_gravity", "yaw_inertia", "downforce")  # of the car: never an alarm, never sure


def usual_inertia(vehicle: Vehicle) -> tuple[float, float]:
    """Return from what to what I_z/(m l_f l_r) of cars of a size goes."""
    return (_SMALL_INERTIA if vehicle.wheelbase < _SMALL else _INERTIA[0]), _INERTIA[1]


def similar_inertia(vehicle: Vehicle) -> float:
    """Return m l_f l_r, the yaw inertia of two points on the axles [kg m^2]."""
    return vehicle.mass * vehicle.l_f * vehicle.l_r


class Suspect(NamedTuple):
    """A number that may be wrong.

    parameter : of `motion.parameters` that tells it, or "a_y." and what an accelerometer has.
    code, channel, unit : as in `Finding`.   wide : standard deviation of what it may be, of the
    parameter, of a sedan.   least : what nobody need mend, and what no model of this size tells
    from a tire.   grows : both with the size of a car.   text : with {size} in `text_unit`, and
    {origin} of a number of the car.   per_unit : unit of the text per SI unit.
    """

    parameter: str
    code: str
    channel: str
    unit: str
    wide: float
    least: float
    grows: str
    text: str
    text_unit: str = ""
    per_unit: float = 1.0

    @property
    def name(self) -> str:
        return f"{self.code.replace('_', ' ')} {self.channel}".strip()

    @property
    def parameters(self) -> tuple[str, ...]:
        """Parameters of the model that it moves; none of an accelerometer."""
        if self.channel == "a_y":
            return ()
        pair = self.code == "downforce"
        return ("downforce_f", "downforce_r") if pair else (self.parameter,)

    def scaled(self, value: float, vehicle: Vehicle) -> float:
        return float(value * vehicle.scale ** _POWERS[self.grows])

    def size(self, value: float) -> float:
        match self.code:
            case "factor" if self.channel != "a_y":
                return 1.0 / (1.0 + value)
            case "factor":
                return 1.0 + value
            case "yaw_inertia":
                return math.exp(-value)
            case "velocity_sensor_angle":
                return -math.atan(value)
            case "bank":
                return math.asin(min(max(value, -1.0), 1.0))
        return -value if self.parameter == "steering_zero" else value

    def repair(self, size: float, vehicle: Vehicle) -> Repair | None:
        """Return what takes a size out, None for what no repair does."""
        numbers: dict[str, Any] = {self.code: size}
        match self.code:
            case "bank" | "downforce" | "play":
                return None
            case "factor":
                numbers = {"factor": {self.channel: 1.0 / size}}
            case "offset" | "delay" | "lag":
                if self.code == "lag" and not size > 0.0:
                    return None
                numbers = {self.code: dict.fromkeys(self.channel.split("+"), size)}
            case "yaw_inertia":
                numbers = {"vehicle": {"yaw_inertia": vehicle.yaw_inertia / size}}
            case "center_of_gravity":
                right = {"l_f": vehicle.l_f - size, "l_r": vehicle.l_r + size}
                numbers = {"vehicle": right}
        return Repair(**numbers)

    def plausible(self, size: float, vehicle: Vehicle) -> bool:
        """Return whether a device can have such a size, and the car without it be a car."""
        match self.code:
            case "lag" | "play":
                return size > 0.0
            case "center_of_gravity":
                return _CENTER[0] < (vehicle.l_f - size) / vehicle.wheelbase < _CENTER[1]
            case "velocity_sensor_x" | "acceleration_sensor_x":
                beyond = vehicle.wheelbase * (_BODY if self.channel == "a_y" else _OVERHANG)
                return -vehicle.l_r - beyond < size < vehicle.l_f + beyond
            case "yaw_inertia":
                least, most = usual_inertia(vehicle)
                return least < vehicle.yaw_inertia / size / similar_inertia(vehicle) < most
        return True

    def words(self, size: float, deviation: float, vehicle: Vehicle) -> str:
        text = self.text
        if self.code == "center_of_gravity":
            swapped = abs(vehicle.l_f - vehicle.l_r - size) < 1.5 * abs(deviation)
            text += ", as if they were swapped" * swapped
        if size < 0.0 and (words := next((one for one in _OPPOSITES if one in text), None)):
            size, text = -size, text.replace(words, _OPPOSITES[words])
        said = f"{with_doubt(size * self.per_unit, abs(deviation) * self.per_unit)}{self.text_unit}"
        return text.format(size=said, origin=vehicle.origin(self.code))


WORDS = {  # of a channel, and the parameter of its factor
    "v_x": ("v_x", "v_x_factor"),
    "v_y": ("v_y", ""),  # to shrink it shrinks its noise, which looks like a better model
    "r": ("the yaw rate", ""),  # of gyroscopes within a percent, and like that of v_x
    "delta_f": ("the steering angle", "steering_gain"),
    "a_y": ("the lateral acceleration", "a_y.factor"),
}
_DEVICES = {"v_y": "v_y", "r": "r", "delta_f": "steering", "a_y": "a_y."}
TURNING = Suspect(
    "r_delay", "delay", "r+a_y", "s", 0.12, 0.004, "",
    "the yaw rate and the lateral acceleration, of one device, are {size} late against the "
    "other channels", " ms", 1e3,
)  # fmt: skip


def _of_channels() -> tuple[Suspect, ...]:
    offsets = (
        ("v_y_bias", "v_y", "m/s", 0.4, 0.02, "speed", " m/s", 1.0),
        ("r_bias", "r", "rad/s", 0.03, 0.002, "rate", " rad/s", 1.0),
        ("a_y.offset", "a_y", "m/s²", 0.7, 0.05, "", " m/s²", 1.0),
        ("steering_zero", "delta_f", "rad", 0.03, 0.0015, "", "°", _DEGREES),
    )
    found = [
        Suspect(parameter, "offset", name, unit, wide, least, grows,
                f"{WORDS[name][0]} reads {{size}} too much", text_unit, per_unit)
        for parameter, name, unit, wide, least, grows, text_unit, per_unit in offsets
    ]  # fmt: skip
    for name, device in _DEVICES.items():
        stem, words = device if device.endswith(".") else f"{device}_", WORDS[name][0]
        # Force follows steering by relaxation and sway: what is left of them is no delay.
        least, grows = (0.008, "speed") if name == "delta_f" else (0.004, "")
        found += [
            Suspect(f"{stem}delay", "delay", name, "s", 0.12, least, grows,
                    f"{words} is {{size}} late against the other channels", " ms", 1e3),
            Suspect(f"{stem}lag", "lag", name, "s", 0.15, least, grows,
                    f"{words} lags behind a low pass of {{size}}", " ms", 1e3),
        ]  # fmt: skip
    smallest = {"v_x": 0.01, "delta_f": 0.012, "a_y": 0.01}
    found += [
        Suspect(parameter, "factor", name, "", 0.2, smallest[name], "",
                f"{words} reads {{size}} times the right value")
        for name, (words, parameter) in WORDS.items()
        if parameter
    ]  # fmt: skip
    return tuple(found)


SUSPECTS = (
    *_of_channels(),
    Suspect("steering_play", "play", "delta_f", "rad", 0.02, 0.002, "",
            "the steering has {size} of play to each side, which the estimate allows for", "°",
            _DEGREES),
    Suspect("v_y_angle", "velocity_sensor_angle", "v_y", "rad", 0.03, 0.0012, "",
            "the velocity sensor is turned by {size} to the left", "°", _DEGREES),
    Suspect("v_y_lever", "velocity_sensor_x", "v_y", "m", 0.8, 0.04, "length",
            "the velocity is measured {size} ahead of the center of gravity", " m"),
    Suspect("a_y.place", "acceleration_sensor_x", "a_y", "m", 0.8, 0.04, "length",
            "the acceleration is measured {size} ahead of the center of gravity", " m"),
    Suspect("cg_shift", "center_of_gravity", "", "m", 0.2, 0.1, "length",
            "the center of gravity is declared {size} too far back (l_f and l_r)", " m"),
    Suspect("ln_inertia", "yaw_inertia", "", "", 0.5, 0.1, "",
            "the {origin} yaw inertia is {size} times the right one"),
    Suspect("bank", "bank", "", "rad", 0.03, 0.003, "",
            "the road falls by {size} to the left, or there is side wind", "°", _DEGREES),
    Suspect("downforce_f", "downforce", "", "s²/m²", 2e-4, 5e-5, "",
            "forces grow with speed, as by a downforce of {size}",
            " % of the weight at 100 km/h", 100.0 * (100.0 / 3.6) ** 2),
)  # fmt: skip
