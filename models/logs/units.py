"""Units as loggers spell them, and what a number in them is in SI.

A spelling may mean two things ("kN" is a force, "kn" a speed): the quantity that is wanted decides.
"""

import math
import re

from codegen.escape import shown
from models.logs.log import RecordingError

SPEED, ANGLE, RATE = "speed", "angle", "yaw rate"
ACCELERATION, FORCE, TIME = "acceleration", "force", "time"
TURNS = "rate of turns"  # of wheels; in rad/s it is called a rate as that of yaw
SI = {SPEED: "m/s", ANGLE: "rad", RATE: "rad/s", ACCELERATION: "m/s^2", FORCE: "N", TIME: "s"}

REVOLUTION = 2.0 * math.pi
DEGREE, POUND, FOOT, MILE = math.pi / 180.0, 4.4482216152605, 0.3048, 1609.344
G = 9.80665  # standard acceleration of free fall, by which "g" and "kgf" are defined [m/s^2]
PER_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1.0 / 60.0, "h": 1.0 / 3600.0}
_TIMES = {  # by spelling
    spelling: unit
    for unit, words in {
        "s": "sec secs second seconds",
        "ms": "msec msecs millisecond milliseconds",
        "us": "usec usecs microsecond microseconds",
        "ns": "nsec nsecs nanosecond nanoseconds",
        "min": "mins minute minutes",
        "h": "hr hrs hour hours",
    }.items()
    for spelling in (unit, *words.split())
}
# By quantity, spelling -> factor to SI; spellings as `_plain` leaves them, in small letters.
FACTORS = {
    SPEED: {
        "m/s": 1.0,
        "mps": 1.0,
        "km/h": 1.0 / 3.6,
        "kmh": 1.0 / 3.6,
        "kph": 1.0 / 3.6,
        "kmph": 1.0 / 3.6,
        "km/hr": 1.0 / 3.6,
        "mph": MILE / 3600.0,
        "mi/h": MILE / 3600.0,
        "miles/h": MILE / 3600.0,
        "kn": 1852.0 / 3600.0,
        "kt": 1852.0 / 3600.0,
        "kts": 1852.0 / 3600.0,
        "knot": 1852.0 / 3600.0,
        "knots": 1852.0 / 3600.0,
        "mm/s": 1e-3,
        "cm/s": 1e-2,
        "ft/s": FOOT,
        "fps": FOOT,
    },
    ANGLE: {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "degs": DEGREE, "grad": DEGREE},
    RATE: {
        "rad/s": 1.0,
        "rads": 1.0,
        "1/s": 1.0,
        "mrad/s": 1e-3,
        "deg/s": DEGREE,
        "degs/s": DEGREE,
        "grad/s": DEGREE,
        "dps": DEGREE,
        "mdeg/s": 1e-3 * DEGREE,
        "deg/h": DEGREE / 3600.0,
    },
    ACCELERATION: {
        "m/s2": 1.0,
        "m/s/s": 1.0,
        "mps2": 1.0,
        "mm/s2": 1e-3,
        "cm/s2": 1e-2,
        "ft/s2": FOOT,
        "g": G,
        "gn": G,
        "g0": G,
        "mg": 1e-3 * G,
    },
    FORCE: {
        "n": 1.0,
        "newton": 1.0,
        "kn": 1e3,
        "dan": 10.0,
        "lbf": POUND,
        "lb": POUND,
        "lbs": POUND,
        "kgf": G,
        "kp": G,
    },
    TURNS: {
        "rpm": REVOLUTION / 60.0,
        "1/min": REVOLUTION / 60.0,
        "u/min": REVOLUTION / 60.0,
        "rev/min": REVOLUTION / 60.0,
        "rps": REVOLUTION,
        "rev/s": REVOLUTION,
        "u/s": REVOLUTION,
        "hz": REVOLUTION,
    },
    TIME: {spelling: 1.0 / PER_SECOND[unit] for spelling, unit in _TIMES.items()},
}
OTHERS = {  # what else loggers log, so that an error can say what a unit is of
    "length": ("m", "mm", "cm", "km", "ft", "in", "mi"),
    "torque": ("nm", "n*m", "lbft", "lb-ft", "ft-lb"),
    "pressure": ("bar", "mbar", "kpa", "pa", "psi", "hpa"),
    "temperature": ("c", "degc", "f", "degf", "k"),
    "voltage": ("v", "mv", "volt"),
    "current": ("a", "ma"),
    "share": ("%", "percent", "ratio"),
    "mass": ("kg", "t"),
    "frequency": ("khz",),
    "power": ("kw", "w", "hp"),
}
# Where nothing tells a unit: beyond which number it is no SI unit, and which it is then. A hand
# wheel goes further. No car turns faster than once in a second, or drives at 430 km/h.
HAND_WHEEL = "angle of a hand wheel"
FARTHEST = {
    SPEED: (120.0, "km/h"),
    ANGLE: (0.8, "deg"),
    HAND_WHEEL: (3.0 * math.pi, "deg"),
    RATE: (2.0 * math.pi, "deg/s"),
}
SMALLEST_ACCELERATION = 2.5  # [m/s²]: a drive that does not reach it teaches no tire, so it is in g
NO_UNIT = ("", "-", "none", "1", "unitless", "n/a", "si")
_WORDS = (
    ("²", "2"),
    ("µ", "u"),
    ("μ", "u"),
    ("°", "deg"),
    ("º", "deg"),
    ("degrees", "deg"),
    ("degree", "deg"),
    ("radians", "rad"),
    ("radian", "rad"),
    ("kilometers", "km"),
    ("kilometres", "km"),
    ("meters", "m"),
    ("metres", "m"),
    ("|", "/"),  # as dSPACE writes it: km|h, where a name may have no slash
    ("**", "^"),
    ("·", "*"),
    ("⋅", "*"),
    ("^", ""),
    (" per ", "/"),
    ("/hour", "/h"),
    ("/seconds", "/s"),
    ("/second", "/s"),
    ("/sec", "/s"),
)


def _plain(unit: str) -> str:
    """Return a spelling without brackets, blanks and exponents' signs, in small letters."""
    text = unit.strip().strip("[](){}").strip().lower()
    for old, new in _WORDS:
        text = text.replace(old, new)
    text = re.sub(r"(?:[*. ]s|/s)-?([12])(?!\d)|(?<=[a-z])s-([12])$", _per_second, text)
    return text.replace(" ", "")


def _per_second(found: re.Match[str]) -> str:
    """Return "/s" or "/s2" for what a spelling has as a negative or dotted power."""
    power = found.group(1) or found.group(2)
    return "/s2" if power == "2" else "/s"


def quantities(unit: str) -> tuple[str, ...]:
    """Return what a unit may be of; empty where it is of nothing a car's motion has."""
    plain = _plain(unit)
    found = tuple(name for name, factors in FACTORS.items() if plain in factors)
    if len(found) > 1 and plain == "kn":  # the letters' size tells, where it is as it should be
        return (FORCE,) if "kN" in unit else (SPEED,) if "KN" not in unit else found
    return found


def is_known(unit: str) -> bool:
    """Return whether a spelling is a unit of anything that cars log, or stands for none."""
    plain = _plain(unit)
    return plain in NO_UNIT or any(
        plain in known for known in (*FACTORS.values(), *OTHERS.values())
    )


def time_unit(unit: str) -> str:
    """Return the unit of time, one of `PER_SECOND`, that a spelling is; "" where it is none."""
    return _TIMES.get(_plain(unit), "")


def are_same(one: str, other: str) -> bool:
    """Return whether two spellings are one unit, as "deg" and "°"."""
    first, second = _plain(one), _plain(other)
    return first == second or any(
        first in known and second in known and known[first] == known[second]
        for known in FACTORS.values()
    )


def is_told(unit: str) -> bool:
    """Whether a unit is written at all; "-" and the like tell none."""
    return _plain(unit) not in NO_UNIT


def unit_of_range(quantity: str, largest: float) -> str:
    """Return the unit that numbers without one can have; "" where SI can be.

    Parameters
    ----------
    quantity : one of `SI`, or `HAND_WHEEL`.
    largest : how far the numbers go from zero.
    """
    if quantity == ACCELERATION:
        return "g" if largest < SMALLEST_ACCELERATION else ""
    limit, unit = FARTHEST.get(quantity, (math.inf, ""))
    return unit if largest > limit else ""


def to_si(unit: str, quantity: str, what: str) -> float:
    """Return the factor to SI.

    Parameters
    ----------
    unit : as written; where it tells none, SI is meant.
    quantity : of the signal, one of `SI`.

    Raises
    ------
    RecordingError
        Where the unit is of something else, or not known.
    """
    plain = _plain(unit)
    if plain in NO_UNIT:
        return 1.0
    if plain in FACTORS[quantity]:
        return FACTORS[quantity][plain]
    known = ", ".join(dict.fromkeys(_typical(quantity)))
    other = quantities(unit) or tuple(name for name, all_ in OTHERS.items() if plain in all_)
    if other:
        raise RecordingError(
            f"{what} must be in a unit of {_named(quantity)} ({known}), {shown(unit.strip())} is "
            f"one of {_named(other[0])}; another channel?"
        )
    raise RecordingError(
        f"{what} has the unit {shown(unit.strip())}, which is not known; name one of "
        f"{_named(quantity)}: {known}"
    )


def _typical(quantity: str) -> tuple[str, ...]:
    return {
        SPEED: ("m/s", "km/h", "mph", "knots"),
        ANGLE: ("rad", "deg", "mrad"),
        RATE: ("rad/s", "deg/s"),
        ACCELERATION: ("m/s^2", "g"),
        FORCE: ("N", "kN", "lbf"),
        TIME: ("s", "ms", "us", "ns"),
        TURNS: ("rpm", "1/min", "Hz"),
    }[quantity]


def _named(quantity: str) -> str:
    article = "an" if quantity[0] in "aeiou" else "a"
    return f"{article} {quantity}"
