"""Our own tanh, one rational expression that gives the same bits wherever it is computed.

The tanh of C libraries differs in the last bit from machine to machine and takes most of the time
of a small network. tanh(x) ≈ x P(x²)/Q(x²) for |x| <= LIMIT and constant beyond; coefficients by
iteratively reweighted least squares on the largest error, which is 2.6e-13 below LIMIT, 1.9e-11
above, and in float 5e-7. It is odd and lets NaN pass.
"""

from typing import Any

import casadi as ca
import numpy as np

LIMIT = 12.7  # beyond it tanh differs from 1 by 1.9e-11
P = (
    0.999999999998556,
    0.14649499840670127,
    0.005194847354751072,
    6.572298819766853e-05,
    3.224479725166911e-07,
    5.558451507317698e-10,
    2.2444167437914083e-13,
)
Q = (
    1.0,
    0.47982833173275036,
    0.03180429127631582,
    0.0006582964762723313,
    5.191172599506885e-06,
    1.5480056107175375e-08,
    1.4077027141943698e-11,
    1.6945688293228353e-15,
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


def floor(x: Any) -> Any:
    """Return the largest whole number that is not above x, entry by entry; exact everywhere.

    Parameters
    ----------
    x : expression, array or number.
    """
    return ca.floor(x) if isinstance(x, ca.SX | ca.MX | ca.DM) else np.floor(x)
