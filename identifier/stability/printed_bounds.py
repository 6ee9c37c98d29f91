"""Statements about (14): as printed, by the tight route, with the V layer; the true bound.

They say how little (14) says: every one stands beside the bound of an identifier with no network.
(14) needs ideal weights and a bound w_bar on what they leave. Nothing but W = 0, w_bar = sup|f| is
known for sure before a drive, and that is what it is given: a smaller w_bar would be a claim.
P is scaled as suits (14) best: b depends on the scale, the loop does not.
"""

import math

import numpy as np

from identifier.gains import Gains
from identifier.stability.loop import Law
from identifier.stability.lyapunov import LyapunovError, LyapunovPair, lyapunov
from identifier.stability.operation import Operation
from identifier.stability.property import Property, statement
from identifier.stability.ultimate_bound import (
    bound_14,
    canceling_pair,
    k_b_with_V,
    printed_k_b,
    tight_k_b,
    ultimate_bound,
)


def printed_bounds(gains: Gains, law: Law, operation: Operation, trivial: float) -> list[Property]:
    """State b of (14) by the printed and the tight route, with the V layer, and b_UUB [U s].

    Parameters
    ----------
    gains : of (8) to (12), with leakage.
    law : coefficients of z and ξ̃ in the driving error.
    operation : where it runs.
    trivial : bound of an identifier without a network [U s].
    """
    pair, tight_pair = best_pair(gains, operation), _tight_pair(gains, operation)
    W_M, n_h, w_bar = operation.W_M, operation.n_h, operation.w_bar
    eta_W, rho_W = gains.eta_W, gains.rho_W
    k_b = printed_k_b(pair, W_M=W_M, n_h=n_h, eta_W=eta_W, rho_W=rho_W)
    tight = tight_k_b(tight_pair, W_M=W_M, n_h=n_h, eta_W=eta_W, rho_W=rho_W)
    entries = {
        "printed_bound": (
            "bound (14), printed route",
            bound_14(pair, w_bar=w_bar, k_b=k_b),
        ),
        "tight_bound": (
            "bound (14), tight route",
            bound_14(tight_pair, w_bar=w_bar, k_b=tight),
        ),
        "ultimate_bound": (
            "true ultimate bound behind (14)",
            ultimate_bound(pair, w_bar=w_bar, k_b=k_b, rho_W=rho_W).xi_tilde,
        ),
    }
    with_V = _with_V(gains, operation, pair, k_b)
    if with_V is not None:
        entries["printed_bound_V"] = ("bound (14), printed route, V layer in it", with_V)
    return [
        statement(name, title, value, "U s", _remark(law, value, trivial))
        for name, (title, value) in entries.items()
    ]


def best_pair(gains: Gains, operation: Operation) -> LyapunovPair:
    """Return P and Q = q I with |P| = W_M/√n_h + (η/ρ) |A_d⁻¹|, where the printed b is smallest.

    Parameters
    ----------
    gains : of (8) to (12), with leakage.
    operation : where it runs.
    """
    unit = lyapunov(gains.matrix, np.eye(2))
    inverse = float(np.linalg.norm(np.linalg.inv(gains.matrix), 2))
    size = operation.W_M / math.sqrt(operation.n_h) + gains.eta_W / gains.rho_W * inverse
    return lyapunov(gains.matrix, size / float(np.linalg.norm(unit.P, 2)) * np.eye(2))


def _tight_pair(gains: Gains, operation: Operation) -> LyapunovPair:
    try:
        return canceling_pair(gains.matrix, eta_W=gains.eta_W, rho_W=gains.rho_W)
    except LyapunovError:
        return best_pair(gains, operation)


def _with_V(gains: Gains, operation: Operation, pair: LyapunovPair, k_b: float) -> float | None:
    """B with tr V_tᵀ V_t/(2 ρ_V) in L at the weight that halves its own limit; V_M = √n_h."""
    if not (gains.rho_V > 0.0 and gains.eta_V > 0.0):
        return None
    inverse = float(np.linalg.norm(np.linalg.inv(gains.matrix), 2))
    l2 = gains.eta_V / gains.rho_V * inverse * operation.x_bar_max
    larger = k_b_with_V(
        k_b,
        A_d=gains.matrix,
        W_M=operation.W_M,
        V_M=math.sqrt(operation.n_h),
        x_bar_max=operation.x_bar_max,
        eta_V=gains.eta_V,
        rho_V=gains.rho_V,
        weight=2.0 / l2**2,
    )
    return bound_14(pair, w_bar=operation.w_bar, k_b=larger)


def _remark(law: Law, value: float, trivial: float) -> str:
    remarks = []
    if law.z > 0.0:
        remarks.append("its proof does not cover a law that reads z")
    if value >= trivial:
        remarks.append("above the trivial bound, it says nothing")
    return "; ".join(remarks)
