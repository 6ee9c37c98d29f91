"""What may be tuned about a method: by field of its dataclass, the range that designs come from.

A name "part.number" is a number of a part.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from typing import Any, NamedTuple, TypeVar

Record = TypeVar("Record")


class Range(NamedTuple):
    """A range of a number, in its own unit.

    Parameters
    ----------
    log : whether values are spread evenly on a logarithmic scale, both ends being positive.
    """

    low: float
    high: float
    log: bool = False

    def at(self, share: float) -> float:
        """Return the value at a share of the range.

        Parameters
        ----------
        share : from 0, the smallest value, to 1, the largest.
        """
        if self.log:
            low, high = math.log(self.low), math.log(self.high)
            return math.exp(low + share * (high - low))
        return self.low + share * (self.high - self.low)


def around(value: float, factor: float) -> Range:
    """Return the range from a number divided by a factor to the number times it.

    Parameters
    ----------
    value : the number, positive.
    factor : above one.
    """
    return Range(value / factor, value * factor, log=True)


def ranges_around(record: Any, factors: Mapping[str, float]) -> dict[str, Range]:
    """Return ranges around numbers of a record, by name.

    Parameters
    ----------
    factors : by name, what the number is multiplied and divided by.
    """
    return {
        name: around(reduce(getattr, name.split("."), record), factor)
        for name, factor in factors.items()
    }


def with_numbers(record: Record, values: Mapping[str, float]) -> Record:
    """Return a record with other numbers."""
    return reduce(lambda now, name: _set(now, name, values[name]), values, record)


def _set(record: Any, path: str, value: float) -> Any:
    """Return the record with one number of it, or of a part of it, replaced."""
    head, _, rest = path.partition(".")
    return replace(record, **{head: _set(getattr(record, head), rest, value) if rest else value})


# How many units a network has, as one of the numbers that are drawn.

SIZE = "size"
SIZES = (5, 10, 20)  # hidden units: each is one compilation
SIZE_RANGE = Range(0.0, 3.0, False)  # which of SIZES


def hidden_units(values: Mapping[str, float]) -> int:
    """Return the number of hidden units.

    Parameters
    ----------
    values : by name, `SIZE` among them.
    """
    return SIZES[min(math.floor(values[SIZE]), len(SIZES) - 1)]
