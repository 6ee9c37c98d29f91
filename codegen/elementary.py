"""Our own exp, atan and sin, for the same reason as our own tanh: the same bits on every machine.

exp(y) = ((Q + z P)/(Q - z P))^32 with z = y/64 and the Padé approximant of order [8/8], for
|y| <= 85, where float still has numbers; it saturates beyond. Relative error 1e-10, below |y| = 40
4e-15, in float 4e-6. atan(x) ≈ x P(x²)/Q(x²) on [-1, 1] and from 1/x beyond; error 7e-13.
sin(x) ≈ x S(x²) on [-π, π], where whole turns are taken off before; error 8e-14, in float 6e-7,
and what rounding leaves of the turns.
"""

import math
from typing import Any

from codegen.tanh import floor, polynomial, where

EXP_LIMIT = 85.0
SQUARINGS = 5
# exp(t) ≈ (E + O)/(E - O) with E + O = Σ c_k t^k, c_k = (16 - k)! 8!/(16! k! (8 - k)!)
PADE = tuple(
    math.factorial(16 - k)
    * math.factorial(8)
    / (math.factorial(16) * math.factorial(k) * math.factorial(8 - k))
    for k in range(9)
)
ATAN_P = (
    0.9999999999847872,
    1.5782164853325558,
    0.7302374508348184,
    0.0981935092083521,
    0.0017761824201668725,
)
ATAN_Q = (
    1.0,
    1.9115498173824181,
    1.1674207547775888,
    0.24788058455755405,
    0.012888591378789574,
)
SIN_S = (
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
    """Return e^y, entry by entry.

    Parameters
    ----------
    y : CasADi expression, array or number.
    """
    y = where(y > EXP_LIMIT, EXP_LIMIT, y)
    y = where(y < -EXP_LIMIT, -EXP_LIMIT, y)
    t = y * (1.0 / 2**SQUARINGS)
    s = t * t
    even, odd = polynomial(PADE[0::2], s), t * polynomial(PADE[1::2], s)
    result = (even + odd) / (even - odd)
    for _ in range(SQUARINGS):
        result = result * result
    return result


def atan(x: Any) -> Any:
    """Return the arc tangent [rad], entry by entry.

    Parameters
    ----------
    x : CasADi expression, array or number.
    """
    steep = x * x > 1.0
    y = where(steep, -1.0 / where(steep, x, 1.0), x)
    s = y * y
    value = y * polynomial(ATAN_P, s) / polynomial(ATAN_Q, s)
    quarter = where(x > 0.0, 0.5 * math.pi, -0.5 * math.pi)
    return value + where(steep, quarter, 0.0)


def sin(x: Any) -> Any:
    """Return the sine, entry by entry.

    Parameters
    ----------
    x : CasADi expression, array or number [rad].
    """
    y = x - TURN * floor(x * (1.0 / TURN) + 0.5)
    return y * polynomial(SIN_S, y * y)
