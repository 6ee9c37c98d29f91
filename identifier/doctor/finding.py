"""What the doctor found: one fault, its size and what is known of it, and what takes it out."""

import math
from dataclasses import dataclass

from models.recordings.repair import Repair


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A fault of a log or of what is told of its car, or something that the log cannot tell.

    Parameters
    ----------
    code : for machines, as "delay" or "velocity_sensor_x".
    channel : that is concerned, "" where it is the car, the road or the whole log.
    size : of the fault in SI, NaN where it has none: an offset, a delay [s], a factor over the
        right value [-].
    deviation : standard deviation of the size, NaN where nobody knows it.
    unit : of both, "" for a pure number.
    confidence : from 0 to 1.
    text : one line for people: what, how much, and what else it may be.
    repair : what takes it out, None where nothing can.
    sure : whether the repair may be applied without being asked.

    Raises
    ------
    ValueError
        For a confidence beyond 0 to 1, or what is sure and has no repair.
    """

    code: str
    channel: str = ""
    size: float = math.nan
    deviation: float = math.nan
    unit: str = ""
    confidence: float = 0.0
    text: str = ""
    repair: Repair | None = None
    sure: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.confidence <= 1.0:
            raise ValueError(f"confidence must lie between 0 and 1, it is {self.confidence}")
        if self.sure and self.repair is None:
            raise ValueError(f"{self.code}: what is sure must have a repair")
