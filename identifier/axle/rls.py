"""Recursive least squares with directional forgetting (R. Kulhavy, Automatica 23, 1987).

Only the direction that the regressor excites is forgotten: no wind-up while the rest is not
excited, and none that would make the covariance wider than its limit.
"""

from typing import Any, NamedTuple

import casadi as ca

from identifier.axle.covariance import Factors, Spread, Symmetric, excited, scaled, updated, width
from identifier.axle.piecewise import reciprocal


class Learnt(NamedTuple):
    """Parameters (q entries) and factors of the covariance after an update.

    uncertainty : h'Ph before it.   weights : block of the weights of P before it, by place.
    """

    theta: list[Any]
    P: Factors
    uncertainty: Any
    weights: Symmetric


def update(
    theta: list[Any],
    P: Factors,
    h: list[Any],
    *,
    error: Any,
    R: Any,
    forgetting: Any,
    spread: Spread,
    limits: list[Any],
    learns: Any,
) -> Learnt:
    """Return parameters and covariance after one sample.

    θ⁺ = θ + P h e/(R + a), a = h'Ph;  P⁺ = P - κ P h h'P/((R + a) a), κ = a - R (1 - λ)/λ, which
    keeps P positive definite for every a, also where κ < 0 and P grows: 1/h'P⁻¹h stays positive.

    Parameters
    ----------
    theta : parameters, q entries.
    P : factors of their covariance.
    h : regressor, q entries.
    error : e = y - h'θ, clipped.
    R : variance of the error.
    forgetting : (1 - λ)/λ.
    spread : of P, and of what is added to it otherwise in this step.
    limits : as in `width`; where P would grow beyond them it stays as it is.
    learns : whether to update at all.
    """
    seen = excited(P, h, 1e-12 * R)
    v, a = seen.v, seen.a
    kappa = a - forgetting * R
    share = reciprocal((R + a) * a)
    growth = -kappa * share  # of P along v v'
    n = len(v) - len(spread.others)
    trace = spread.trace + sum(growth * one * one for one in v[:n])
    others = [p + growth * one * one for p, one in zip(spread.others, v[n:], strict=True)]
    wide = width(trace, others, limits)
    moves = ca.logic_and(learns, ca.logic_or(kappa >= 0, wide <= 1))
    # β_q = 1 + c a = (R + a)/(R + R (1 - λ)/λ), so that c/β_q = κ/((R + a) a)
    c = ca.if_else(moves, kappa / (a * R * (1 + forgetting)), 0)
    gain = learns * error * a * share
    theta = [one + along * gain for one, along in zip(theta, v, strict=True)]
    after = scaled(updated(P, seen, c), moves * wide)
    return Learnt(theta, after, a, spread.weights)
