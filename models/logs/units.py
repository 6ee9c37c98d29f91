"""Units as loggers spell them, and what a number in them is in SI.

A spelling may mean two things ("kN" is a force, "kn" a speed): the quantity that is wanted decides.
"""

import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from codegen.escape import displayed
from models.logs.log import RecordingError

SPEED, ANGLE, RATE = "speed", "angle", "yaw rate"
ACCELERATION, FORCE, TIME, LENGTH = "acceleration", "force", "time", "length"
TURNS = "rate of turns"  # of wheels; in rad/s it is called a rate as that of yaw
SI = {
    SPEED: "m/s", ANGLE: "rad", RATE: "rad/s", ACCELERATION: "m/s^2", FORCE: "N", TIME: "s",
    LENGTH: "m",
}  # fmt: skip


def rows_of(name: str) -> dict[str, Any]:
    """Return the tables of a file beside this one."""
    return tomllib.loads(Path(__file__).with_name(name).read_text(encoding="utf-8"))


TABLES = rows_of("units.toml")
# By quantity, spelling -> factor to SI; spellings as `_plain` leaves them, in small letters.
FACTORS: Mapping[str, Mapping[str, float]] = {
    quantity: {spelling: factor for some, factor in rows for spelling in some.split()}
    for quantity, rows in TABLES["factors"].items()
}
_OTHERS = {name: tuple(some.split()) for name, some in TABLES["others"].items()}
_NO_UNIT = ("", *_OTHERS.pop("none"))
PER_SECOND = {  # exact
    unit: 1.0 / factor if factor > 1.0 else float(round(1.0 / factor))
    for unit, factor in FACTORS[TIME].items()
}
_SPELLED = {word: unit for unit, some in TABLES["spellings"].items() for word in some.split()}
_WORD = re.compile(
    "(?<![a-z'])(?:" + "|".join(sorted(_SPELLED, key=len, reverse=True)) + ")(?![a-z'])"
)
HAND_WHEEL = "angle of a hand wheel"
_SMALLEST_ACCELERATION = 2.5  # [m/s²]: a drive that does not reach it teaches no tire: it is in g


def _plain(unit: str) -> str:
    """Return a spelling without brackets, blanks and exponents' signs, in small letters."""
    text = unit.strip().strip("[](){}").strip().lower().rstrip(".")
    for old, new in TABLES["signs"].items():
        text = text.replace(old, new)
    text = _WORD.sub(lambda found: _SPELLED[found[0]], text)
    # A negative or dotted power.
    text = re.sub(r"(?:[*. ]s|/s)-?([12])(?!\d)|(?<=[a-z])s-([12])$", r"/s\1\2", text)
    return text.replace("/s1", "/s").replace(" ", "")


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
    return plain in _NO_UNIT or any(
        plain in known for known in (*FACTORS.values(), *_OTHERS.values())
    )


def time_unit(unit: str) -> str:
    """Return the unit of time, one of `PER_SECOND`, that a spelling is; "" where it is none."""
    plain = _plain(unit)
    return plain if plain in FACTORS[TIME] else ""


def are_same(one: str, other: str) -> bool:
    """Return whether two spellings are one unit, as "deg" and "°"."""
    first, second = _plain(one), _plain(other)
    return first == second or any(
        first in known and second in known and known[first] == known[second]
        for known in FACTORS.values()
    )


def is_given(unit: str) -> bool:
    """Whether a unit is written at all; "-" and the like tell none."""
    return _plain(unit) not in _NO_UNIT


def unit_of_range(quantity: str, largest: float) -> str:
    """Return the unit that numbers without one can have; "" where SI can be.
    quantity : one of `SI`, or `HAND_WHEEL`.   largest : how far the numbers go from zero.
    """
    if quantity == ACCELERATION:
        return "g" if largest < _SMALLEST_ACCELERATION else ""
    limit, unit = TABLES["farthest"].get(quantity, (math.inf, ""))
    return unit if largest > limit else ""


def to_si(unit: str, quantity: str, what: str) -> float:
    """Return the factor to SI.
    unit : as written; where it tells none, SI is meant.   quantity : of the signal, one of `SI`.
    """
    plain = _plain(unit)
    if plain in _NO_UNIT:
        return 1.0
    if plain in FACTORS[quantity]:
        return FACTORS[quantity][plain]
    known = ", ".join(TABLES["typical"][quantity].split())
    other = quantities(unit) or tuple(name for name, all_ in _OTHERS.items() if plain in all_)
    if other:
        raise RecordingError(
            f"{what} must be in a unit of {_named(quantity)} ({known}), "
            f"{displayed(unit.strip())} is one of {_named(other[0])}; another channel?"
        )
    raise RecordingError(
        f"{what} has the unit {displayed(unit.strip())}, which is not known; name one of "
        f"{_named(quantity)}: {known}"
    )


def _named(quantity: str) -> str:
    article = "an" if quantity[0] in "aeiou" else "a"
    return f"{article} {quantity}"
