"""What may be tuned about a method: by field of its dataclass, the range that designs come from.

A method that can be tuned has a class attribute `tunables`, a mapping from the names of its fields
to ranges.
"""

import math
from typing import NamedTuple


class Range(NamedTuple):
    """A range of a number, in its own unit.

    Parameters
    ----------
    low : smallest value.
    high : largest value.
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
