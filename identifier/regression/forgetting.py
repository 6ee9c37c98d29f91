"""How recursive least squares forgets: what becomes of P (n_h, n_h) [1/s] after each pair.

keep = exp(-λ T) <= 1. P is the inverse of the information; forgetting makes it larger.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca

Forgetting = Callable[[Any, Any, Any, Any], Any]


def exponential(P: Any, s: Any, keep: Any, bound: Any) -> Any:
    """Forget everything at one rate: P grows without bound where s does not excite; (n_h, n_h).

    Parameters
    ----------
    P : after the pair (n_h, n_h).
    s : not read.
    keep : exp(-λ T).
    bound : not read.
    """
    del s, bound
    return P / keep


def bounded_trace(P: Any, s: Any, keep: Any, bound: Any) -> Any:
    """Forget everything at one rate, as far as trace(P) stays within its bound; (n_h, n_h).

    Parameters
    ----------
    P : after the pair (n_h, n_h).
    s : not read.
    keep : exp(-λ T).
    bound : largest trace [1/s].
    """
    del s
    return P * ca.fmin(1 / keep, ca.fmax(1, bound / ca.trace(P)))


def directional(P: Any, s: Any, keep: Any, bound: Any) -> Any:
    """Forget only along s, what the new pair can replace, within the bound; (n_h, n_h).

    Kulhavý's P⁻¹ + β s sᵀ T, β = keep - (1 - keep)/(sᵀ P s T), with P before the pair, reads in P
    after it as a growth by 1/keep of what s sees, P s; what s does not see stays as it is.

    Parameters
    ----------
    P : after the pair (n_h, n_h).
    s : regressor (n_h,).
    keep : exp(-λ T).
    bound : largest trace [1/s].
    """
    seen = P @ s
    variance = ca.fmax(s.T @ seen, 1e-300)  # s = 0: nothing is seen, nothing grows
    room = ca.fmax(0, bound - ca.trace(P)) * variance / ca.fmax(ca.sumsqr(seen), 1e-300)
    return P + ca.fmin(1 / keep - 1, room) * (seen @ seen.T) / variance
