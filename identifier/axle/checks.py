"""The check that every record of design numbers makes."""

from dataclasses import fields
from typing import Any


def require_positive(record: Any) -> None:
    """Refuse numbers that are not positive and finite.

    Parameters
    ----------
    record : a dataclass whose fields are all numbers.

    Raises
    ------
    ValueError
        With the name and the value.
    """
    for field in fields(record):
        value = getattr(record, field.name)
        if not 0.0 < value < float("inf"):
            raise ValueError(f"{field.name} must be positive and finite, it is {value}")
