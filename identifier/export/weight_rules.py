"""What weights must be to be taken over, in C: covariances and amounts that are not negative."""

from collections.abc import Sequence
from math import isqrt

from identifier.export.layout import Member
from identifier.export.signals import COVARIANCE, FACTORS, NOT_NEGATIVE

# What a variance may miss to zero by rounding, as a share of its own: float keeps seven digits, and
# both precisions accept what they have learnt themselves.
SLACK = "1e-3"


def ruled(members: Sequence[Member]) -> list[Member]:
    """Return the members that have a rule.

    Parameters
    ----------
    members : of the weights.
    """
    return [member for member in members if member.signal.rule]


def conditions(members: Sequence[Member], prefix: str) -> str:
    """Return C expressions, each behind `&&`, that hold where weights keep their rules.

    Parameters
    ----------
    members : of the weights.
    prefix : of the functions.
    """
    calls = []
    for member in ruled(members):
        place, (rows, columns) = f"weights->{member.signal.name}", member.shape
        if member.signal.rule == NOT_NEGATIVE:
            size = f"{rows * columns}U"
            calls.append(f"{prefix}_are_not_negative(&{place}{member.first}, {size})")
        elif member.signal.rule == FACTORS:
            calls += [f"{prefix}_are_factors({place}[{row}])" for row in range(rows)]
        elif rows == columns:
            calls.append(f"{prefix}_is_covariance(&{place}{member.first})")
        else:
            calls += [f"{prefix}_is_covariance({place}[{row}])" for row in range(rows)]
    return "".join(f"\n            && {call}" for call in calls)


def covariance_values(members: Sequence[Member]) -> dict[str, str] | None:
    """Return order and layout of the covariances of a method for the template; None for none.

    Parameters
    ----------
    members : of the weights.
    """
    shapes = {member.shape for member in members if member.signal.rule == COVARIANCE}
    if not shapes:
        return None
    ((rows, columns),) = shapes
    square = rows == columns
    return {
        "order": str(rows if square else _order(columns)),
        "skip": "i" if square else "0U",
        "layout": "It lies in the whole matrix." if square else "It lies alone.",
        "slack": SLACK,
    }


def factor_values(members: Sequence[Member]) -> dict[str, str] | None:
    """Return the order of the factored covariances of a method for the template; None for none.

    Parameters
    ----------
    members : of the weights.
    """
    orders = {_order(member.shape[1]) for member in members if member.signal.rule == FACTORS}
    return {"order": str(*orders)} if orders else None


def _order(size: int) -> int:
    """Return the rows of a matrix whose upper triangle has so many numbers."""
    return (isqrt(8 * size + 1) - 1) // 2


def has_amounts(members: Sequence[Member]) -> bool:
    """Tell whether numbers of a method must not be negative.

    Parameters
    ----------
    members : of the weights.
    """
    return any(member.signal.rule == NOT_NEGATIVE for member in members)
