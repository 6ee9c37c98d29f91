"""Our own exp, atan and sin, for the same reason as our own tanh: the same bits on every machine.

exp(y) = ((Q + z P)/(Q - z P))^32 with z = y/64 and the Padé approximant of order [8/8], for
|y| <= 85, where float still has numbers; it saturates beyond. Relative error 1e-10, below |y| = 40
4e-15, in float 4e-6. atan(x) ≈ x P(x²)/Q(x²) on [-1, 1] and from 1/x beyond; error 7e-13.
sin(x) ≈ x S(x²) on [-π, π], where whole turns are taken off before; error 8e-14, in float 6e-7,
and what rounding leaves of the turns.
"""

import math
from typing import Any

import casadi as ca
import numpy as np

# Our own tanh, one rational expression that gives the same bits wherever it is computed.
#
# The tanh of C libraries differs in the last bit from machine to machine and takes most of the time
# of a small network. tanh(x) ≈ x P(x²)/Q(x²) for |x| <= LIMIT and constant beyond; coefficients by
# iteratively reweighted least squares on the largest error, which is 2.6e-13 below LIMIT, 1.9e-11
# above, and in float 5e-7. It is odd and lets NaN pass.

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
    """Return tanh of a CasADi expression, array or number, entry by entry."""
    x = _where(x > LIMIT, LIMIT, x)
    x = _where(x < -LIMIT, -LIMIT, x)
    s = x * x
    return x * _polynomial(P, s) / _polynomial(Q, s)


def _polynomial(coefficients: tuple[float, ...], s: Any) -> Any:
    """Return Σ c_k s^k by Horner's rule.
    coefficients : c_0 first.
    """
    *lower, value = coefficients
    for c in reversed(lower):
        value = value * s + c
    return value


def _where(condition: Any, a: Any, b: Any) -> Any:
    """Return a where the condition holds, else b: expressions, arrays or numbers."""
    symbolic = isinstance(condition, ca.SX | ca.MX | ca.DM)
    return ca.if_else(condition, a, b) if symbolic else np.where(condition, a, b)


def _floor(x: Any) -> Any:
    """Return the largest whole number that is not above x, entry by entry; exact everywhere."""
    return ca.floor(x) if isinstance(x, ca.SX | ca.MX | ca.DM) else np.floor(x)


_EXP_LIMIT = 85.0
_SQUARINGS = 5
# exp(t) ≈ (E + O)/(E - O) with E + O = Σ c_k t^k, c_k = (16 - k)! 8!/(16! k! (8 - k)!)
PADE = tuple(
    math.factorial(16 - k)
    * math.factorial(8)
    / (math.factorial(16) * math.factorial(k) * math.factorial(8 - k))
    for k in range(9)
)
_ATAN_P = (
    0.9999999999847872,
    1.5782164853325558,
    0.7302374508348184,
    0.0981935092083521,
    0.0017761824201668725,
)
_ATAN_Q = (
    1.0,
    1.9115498173824181,
    1.1674207547775888,
    0.24788058455755405,
    0.012888591378789574,
)
_SIN_S = (
    0.9999999999995306,
    -0.16666666666381078,
    0.008333333328228587,
    -0.00019841269426248295,
    2.755730093326202e-06,
    -2.505163430443832e-08,
    1.6051601295843795e-10,
    -7.577426071532666e-13,
    2.4501966591725994e-15,
)
TURN = 2.0 * math.pi


def exp(y: Any) -> Any:
    """Return e^y of a CasADi expression, array or number, entry by entry."""
    y = _where(y > _EXP_LIMIT, _EXP_LIMIT, y)
    y = _where(y < -_EXP_LIMIT, -_EXP_LIMIT, y)
    t = y * (1.0 / 2**_SQUARINGS)
    s = t * t
    even, odd = _polynomial(PADE[0::2], s), t * _polynomial(PADE[1::2], s)
    result = (even + odd) / (even - odd)
    for _ in range(_SQUARINGS):
        result = result * result
    return result


def atan(x: Any) -> Any:
    """Return the arc tangent [rad] of a CasADi expression, array or number, entry by entry."""
    steep = x * x > 1.0
    y = _where(steep, -1.0 / _where(steep, x, 1.0), x)
    s = y * y
    value = y * _polynomial(_ATAN_P, s) / _polynomial(_ATAN_Q, s)
    quarter = _where(x > 0.0, 0.5 * math.pi, -0.5 * math.pi)
    return value + _where(steep, quarter, 0.0)


def sin(x: Any) -> Any:
    """Return the sine of a CasADi expression, array or number [rad], entry by entry."""
    y = x - TURN * _floor(x * (1.0 / TURN) + 0.5)
    return y * _polynomial(_SIN_S, y * y)
