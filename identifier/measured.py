"""A value and its standard deviation as people read them: three digits, ± and one unit.

Files keep SI; what is printed is kN/rad where they have N/rad.
"""

import math

DIGITS = 3  # of a value, or of its standard deviation where that is larger
_PRINTED = {"N/rad": (1e-3, "kN/rad")}  # factor and unit of what is printed
NOT_IDENTIFIABLE = "not identifiable from this drive"


def with_doubt(value: float, sd: float | None = None) -> str:
    """Return a value with its standard deviation, as in "0.886 ± 0.060", "127 ± 5".

    Of the larger of both three digits are given, of the standard deviation one or two.
    sd : in the unit of the value; None where it is not known.
    """
    if not math.isfinite(value):
        return f"{value:g}"
    known = sd if sd is not None and math.isfinite(sd) and sd > 0.0 else 0.0
    places = _places(max(abs(value), known), DIGITS)
    if known:
        places = min(max(places, _places(known, 1)), _places(known, 2))
    given = [value, known] if known else [value]
    return " ± ".join(f"{round(one, places) + 0.0:.{max(places, 0)}f}" for one in given)


def _places(size: float, digits: int) -> int:
    """Return the decimals with which a size has so many digits, once it is rounded to them."""
    if size == 0.0:
        return 0
    return digits - 1 - math.floor(math.log10(float(f"{size:.{digits - 1}e}")))


def printed_value(value: float, sd: float | None, unit: str) -> str:
    """Return a value with its standard deviation in the unit that is printed.
    unit : of both; "N/rad" is printed as kN/rad.
    """
    scale = printed_scale(unit)
    return with_doubt(scale * value, None if sd is None else scale * sd)


def printed_scale(unit: str) -> float:
    return _PRINTED.get(unit, (1.0, unit))[0]


def printed_unit(unit: str) -> str:
    return _PRINTED.get(unit, (1.0, unit))[1]
