"""A value and its standard deviation as people read them: three digits, ± and one unit.

Files keep SI; what is printed is kN and kN/rad where a value reaches 1000 of it.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from codegen.arrays import Array

DIGITS = 3  # of a value, or of its standard deviation where that is larger
_KILO = 1000.0  # N, N/rad: from here on of a car, below of a model of one
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


def printed_unit(unit: str, values: Array | Sequence[float]) -> tuple[str, float]:
    """Return the unit in which values of SI are printed beside one another, and its size.

    values : any shape; what is not finite does not count.
    """
    size = np.abs(values)
    large = size[np.isfinite(size)].max(initial=0.0) >= _KILO and unit in ("N", "N/rad")
    return (f"k{unit}", _KILO) if large else (unit, 1.0)


def as_printed(numbers: Iterable[Any]) -> list[Any]:
    """Return numbers of axles (value, sd, unit) in the units that are printed, one for both."""
    numbers = list(numbers)
    found = []
    for one in numbers:
        unit, size = printed_unit(one.unit, [o.value for o in numbers if o.unit == one.unit])
        sd = None if one.sd is None else one.sd / size
        found.append(one._replace(value=one.value / size, sd=sd, unit=unit))
    return found


def stiffness_words(both: Array, sd: Array | None = None) -> str:
    """Return the stiffness of front and rear [N/rad], as in "127 ± 5 / 110 ± 4 kN/rad"."""
    unit, size = printed_unit("N/rad", both)
    doubt = [None] * len(both) if sd is None else sd / size
    return f"{' / '.join(map(with_doubt, both / size, doubt))} {unit}"
