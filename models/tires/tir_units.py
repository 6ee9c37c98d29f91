"""Units of a tire property file: which keys have one, and what it is in SI.

Only the keys of `DIMENSIONS` are converted. The coefficients of the Magic Formula (P.., R.., Q..,
L..) are dimensionless or in radian whatever [UNITS] says: their equations are written in SI.
"""

from collections.abc import Mapping
from math import pi

DIMENSIONS: Mapping[str, Mapping[str, int]] = {
    "FNOMIN": {"FORCE": 1},
    "FZMIN": {"FORCE": 1},
    "FZMAX": {"FORCE": 1},
    "UNLOADED_RADIUS": {"LENGTH": 1},
    "WIDTH": {"LENGTH": 1},
    "RIM_RADIUS": {"LENGTH": 1},
    "RIM_WIDTH": {"LENGTH": 1},
    "ALPMIN": {"ANGLE": 1},
    "ALPMAX": {"ANGLE": 1},
    "CAMMIN": {"ANGLE": 1},
    "CAMMAX": {"ANGLE": 1},
    "LONGVL": {"LENGTH": 1, "TIME": -1},
    "VXLOW": {"LENGTH": 1, "TIME": -1},
    "VERTICAL_STIFFNESS": {"FORCE": 1, "LENGTH": -1},
    "VERTICAL_DAMPING": {"FORCE": 1, "TIME": 1, "LENGTH": -1},
    "MBELT": {"MASS": 1},
}

_POUND = 0.45359237  # kg
_GRAVITY = 9.80665  # m/s², standard
_INCH = 0.0254  # m

UNITS: Mapping[str, Mapping[str, float]] = {
    "LENGTH": {
        "m": 1.0, "meter": 1.0, "metre": 1.0,
        "mm": 1e-3, "millimeter": 1e-3, "millimetre": 1e-3,
        "cm": 1e-2, "centimeter": 1e-2, "centimetre": 1e-2,
        "km": 1e3, "kilometer": 1e3, "kilometre": 1e3,
        "in": _INCH, "inch": _INCH, "inche": _INCH,
        "ft": 12.0 * _INCH, "foot": 12.0 * _INCH, "feet": 12.0 * _INCH,
        "mile": 63360.0 * _INCH,
    },
    "FORCE": {
        "n": 1.0, "newton": 1.0,
        "kn": 1e3, "knewton": 1e3, "kilonewton": 1e3, "kilo_newton": 1e3,
        "mn": 1e-3, "millinewton": 1e-3, "cn": 1e-2, "centinewton": 1e-2,
        "kgf": _GRAVITY, "kilogram_force": _GRAVITY, "kg_force": _GRAVITY,
        "lbf": _POUND * _GRAVITY, "pound_force": _POUND * _GRAVITY,
        "klbf": 1e3 * _POUND * _GRAVITY, "kpound_force": 1e3 * _POUND * _GRAVITY,
        "ounce_force": _POUND * _GRAVITY / 16.0, "dyne": 1e-5,
    },
    "ANGLE": {"rad": 1.0, "radian": 1.0, "deg": pi / 180.0, "degree": pi / 180.0},
    "MASS": {
        "kg": 1.0, "kilogram": 1.0, "g": 1e-3, "gram": 1e-3,
        "tonne": 1e3, "megagram": 1e3,
        "lbm": _POUND, "pound_mass": _POUND, "kpound_mass": 1e3 * _POUND,
        "ounce_mass": _POUND / 16.0, "slug": _POUND * _GRAVITY / (12.0 * _INCH),
    },
    "TIME": {
        "s": 1.0, "sec": 1.0, "second": 1.0,
        "ms": 1e-3, "milli": 1e-3, "millisecond": 1e-3,
        "min": 60.0, "minute": 60.0, "h": 3600.0, "hour": 3600.0,
    },
}  # fmt: skip


def unit_in_si(dimension: str, unit: str) -> float:
    """One of the unit, in SI.

    Case and a plural s do not matter; from five letters on the beginning of a name will do,
    because some programs cut names after twelve letters.

    Parameters
    ----------
    dimension : "LENGTH", "FORCE", "ANGLE", "MASS" or "TIME".
    unit : as written in the file.

    Raises
    ------
    ValueError
        No such unit; the message lists the known ones.
    """
    known = UNITS[dimension]
    word = unit.strip().lower().replace(" ", "_").replace("-", "_")
    for candidate in (word, word.removesuffix("s")):
        if candidate in known:
            return known[candidate]
    begun = {factor for name, factor in known.items() if len(word) > 4 and name.startswith(word)}
    if len(begun) == 1:
        return begun.pop()
    raise ValueError(f"[UNITS] {dimension} = {unit!r} is not one of {', '.join(known)}")
