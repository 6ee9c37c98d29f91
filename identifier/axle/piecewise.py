"""Larger, smaller, within: as comparisons, since fmin and fmax of C are calls that cost more."""

from typing import Any

import casadi as ca


def larger(a: Any, b: Any) -> Any:
    """Return the larger of two, where neither is NaN.

    Parameters
    ----------
    a : expression.
    b : expression of the same shape, or a number.
    """
    return ca.if_else(a > b, a, b)


def smaller(a: Any, b: Any) -> Any:
    """Return the smaller of two, where neither is NaN.

    Parameters
    ----------
    a : expression.
    b : expression of the same shape, or a number.
    """
    return ca.if_else(a < b, a, b)


def within(a: Any, least: Any, most: Any) -> Any:
    """Return a number clipped to a range.

    Parameters
    ----------
    a : expression.
    least : lower end.
    most : upper end.
    """
    return smaller(larger(a, least), most)
