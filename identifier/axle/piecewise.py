"""Larger, smaller, within: as comparisons, since fmin and fmax of C are calls that cost more.

And one division for many quotients: CasADi writes x (1/y) as x/y, once for each x.
"""

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


def reciprocal(x: Any) -> Any:
    """Return 1/x, rounded once, as a number that products share; 1 where x is 1.

    Parameters
    ----------
    x : expression.
    """
    return 2 / (x + x)
