"""Our own tanh, one rational expression that gives the same bits wherever it is computed.

The tanh of C libraries differs in the last bit from machine to machine and takes most of the time
of a small network. tanh(x) ≈ x P(x²)/Q(x²) for |x| <= LIMIT and constant beyond, P and Q of degree
6, with coefficients by iteratively reweighted least squares on the largest error: 7.6e-12 in
double, 4e-7 in float. It is odd, and passes NaN on.
"""

from typing import Any

import casadi as ca
import numpy as np

LIMIT = 13.0  # beyond it tanh differs from 1 by 1e-11
P = (
    0.9999999999584718,
    0.1445260173334212,
    0.004915717257928057,
    5.679330101102692e-05,
    2.3245946869145373e-07,
    2.7682518388888946e-10,
    4.191356469439909e-14,
)
Q = (
    1.0,
    0.4778593504743515,
    0.03086883434146686,
    0.0006000784733792753,
    4.160378626836549e-06,
    9.602742159711671e-09,
    4.973845910204004e-12,
)


def tanh(x: Any) -> Any:
    """Return tanh, entry by entry.

    Parameters
    ----------
    x : CasADi expression, array or number.
    """
    x = where(x > LIMIT, LIMIT, x)
    x = where(x < -LIMIT, -LIMIT, x)
    s = x * x
    return x * polynomial(P, s) / polynomial(Q, s)


def polynomial(coefficients: tuple[float, ...], s: Any) -> Any:
    """Return Σ c_k s^k by Horner's rule.

    Parameters
    ----------
    coefficients : c_0 first.
    s : where.
    """
    *lower, value = coefficients
    for c in reversed(lower):
        value = value * s + c
    return value


def where(condition: Any, a: Any, b: Any) -> Any:
    """Return a where the condition holds, else b.

    Parameters
    ----------
    condition : entry by entry.
    a : expression, array or number.
    b : expression, array or number.
    """
    symbolic = isinstance(condition, ca.SX | ca.MX | ca.DM)
    return ca.if_else(condition, a, b) if symbolic else np.where(condition, a, b)
