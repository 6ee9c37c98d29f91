"""Rules that numbers must keep wherever they come from: one wording for every record."""

import math
from dataclasses import fields
from typing import Any

from codegen.escape import displayed

LARGEST_FORCE = 1e7  # of an axle [N]: ten times that of the heaviest dump truck


def require_number(refusal: type[ValueError], name: str, value: Any) -> None:
    try:
        if not isinstance(value, str | bytes):
            float(value)
            return
    except (TypeError, ValueError):
        pass
    raise refusal(f"{name} must be a number, it is {displayed(value)}")


def require_positive(refusal: type[ValueError], /, **values: float) -> None:
    """Refuse every value that is not a finite number above zero."""
    for name, value in values.items():
        require_number(refusal, name, value)
        if not (value > 0.0 and math.isfinite(value)):
            raise refusal(f"{name} must be positive and finite, it is {value}")


def require_not_negative(refusal: type[ValueError], /, **values: float) -> None:
    """Refuse every value that is not a finite number, zero or above."""
    for name, value in values.items():
        require_number(refusal, name, value)
        if not 0.0 <= value < math.inf:
            raise refusal(f"{name} must not be negative or infinite, it is {value}")


def require_positive_fields(record: Any) -> None:
    """Refuse a record in which a number is not finite and above zero."""
    require_positive(ValueError, **{one.name: getattr(record, one.name) for one in fields(record)})


class Positive:
    """A record whose numbers are all finite and above zero."""

    __slots__ = ()

    def __post_init__(self) -> None:
        require_positive_fields(self)


def require_within(refusal: type[ValueError], low: float, high: float, /, **values: float) -> None:
    """Refuse every value outside the closed interval from `low` to `high`."""
    for name, value in values.items():
        require_number(refusal, name, value)
        if not low <= value <= high:
            raise refusal(f"{name} must lie between {low:g} and {high:g}, it is {value:.10g}")


def require_kind(kind: type, remedy: str, /, **values: Any) -> None:
    """Refuse every argument of another kind, at the doors that users call."""
    for name, value in values.items():
        if not isinstance(value, kind):
            raise TypeError(f"{name} must be a {kind.__name__}, {remedy}; it is {displayed(value)}")
