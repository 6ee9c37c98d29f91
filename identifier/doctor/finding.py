"""What the doctor found: one fault, its size and what is known of it, and what takes it out."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from models.recordings.repair import Repair

HARDLY, _MOST_CONFIDENCE = 0.01, 0.99  # confidence that is given
_MATTERS = 0.5  # confidence that something is wrong, from which it is given as such


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A fault of a log or of the declaration of its car, or something that the log cannot tell.

    code : for machines, as "delay" or "velocity_sensor_x".
    channel : that is concerned, "" where it is the car, the road or the whole log.
    size : of the fault in SI, NaN where it has none: an offset, a delay [s], a factor over the
        right value [-].
    deviation : standard deviation of the size, NaN where nobody knows it.
    unit : of both, "" for a pure number.   confidence : that it is this, from 0 to 1.
    group : confidence that it is this or one of those that are alike on this drive; 0 where there
        are none.
    text : one line for people: what, how much, and what else it may be.
    repair : what takes it out, None where nothing can.
    sure : whether the repair may be applied without being asked.

    Notes
    -----
    Whether something is wrong and which of several things it is are two questions: `alarm` and
    `matters` answer the first.
    """

    code: str
    channel: str = ""
    size: float = math.nan
    deviation: float = math.nan
    unit: str = ""
    confidence: float = 0.0
    group: float = 0.0
    text: str = ""
    repair: Repair | None = None
    sure: bool = False
    note: bool = False

    def __post_init__(self) -> None:
        for name in ("confidence", "group"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must lie between 0 and 1, it is {getattr(self, name)}")
        if self.sure and self.repair is None:
            raise ValueError(f"{self.code}: what is sure must have a repair")

    @property
    def alarm(self) -> float:
        """Confidence that something is wrong, be it this or what is alike."""
        return max(self.confidence, self.group)

    @property
    def matters(self) -> bool:
        """Whether it is more likely than not that something is wrong with the log."""
        return self.alarm >= _MATTERS and not self.note

    @property
    def percent(self) -> str:
        """The confidence as text; 1 to 99 %, as a log alone proves nothing."""
        if self.confidence < HARDLY:
            return f"<{100.0 * HARDLY:.0f} %"
        return f"{100.0 * min(self.confidence, _MOST_CONFIDENCE):.0f} %"

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and words, ready for JSON; None is what is not known."""

        def number(value: float) -> float | None:
            return value if math.isfinite(value) else None

        return {
            "code": self.code,
            "channel": self.channel,
            "size": number(self.size),
            "deviation": number(self.deviation),
            "unit": self.unit,
            "confidence": self.confidence,
            "alarm": self.alarm,
            "text": self.text,
            "sure": self.sure,
            "note": self.note,
            "repair": None if self.repair is None else self.repair.tables(),
        }


def first_of_each(findings: Iterable[Finding]) -> list[Finding]:
    """Return findings, of each code and channel the first."""
    kept: dict[tuple[str, str], Finding] = {}
    for one in findings:
        kept.setdefault((one.code, one.channel), one)
    return list(kept.values())
