"""The ultimate bound b of (14) for the instantaneous law, what it leaves out, and what it is worth.

L = ξ̃ᵀ P ξ̃ / 2 + tr W_tᵀ W_t / (2 ρ_W) gives, with y = |W_t|,
L' <= |ξ̃| (-λ_min(Q) |ξ̃|/2 + |P| w_bar + 2 k_b y - y²), hence L' < 0 where |ξ̃| > b of (14).
w_bar bounds f - W tanh(V_hat x_bar): it includes W [tanh(V x_bar) - tanh(V_hat x_bar)].
|.| spectral, Frobenius for weights. Forces in U (kN), ξ̃ in U s. `residual_bound` is sup|f| [U].

(14) is proved for the instantaneous law. The integral law can exceed it; see `sampled_bound.py`.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from identifier.certificate import Property, statement
from identifier.paper.laws import DrivingError, Gains
from identifier.stability.lyapunov import (
    LyapunovError,
    LyapunovPair,
    lyapunov,
    peak_gain,
)
from identifier.stability.operation import Operation


def _printed_k_b(pair: LyapunovPair, *, W_M: float, n_h: int, eta_W: float, rho_W: float) -> float:
    """k_b = [W_M + √n_h (|P| + (η/ρ) |A_d⁻¹|)]/2, the one that gives (14) as printed [U].
    W_M : bound on the ideal weights (Frobenius) [U].   n_h : hidden units; |s| <= √n_h.
    eta_W : learning rate of (11).   rho_W : leakage gain of (11) [1/(U s²)].
    """
    inverse = float(np.linalg.norm(np.linalg.inv(pair.A_d), 2))
    coupling = float(np.linalg.norm(pair.P, 2)) + eta_W / rho_W * inverse
    return (W_M + math.sqrt(n_h) * coupling) / 2.0


def _tight_k_b(pair: LyapunovPair, *, W_M: float, n_h: int, eta_W: float, rho_W: float) -> float:
    """k_b = [W_M + √n_h |P + (η/ρ) A_d⁻¹|]/2: the two couplings cancel before the norm is taken.

    W_M/2 for a symmetric A_d and P = -(η/ρ) A_d⁻¹, the pair of `_canceling_pair`. Arguments are
    those of `_printed_k_b`.
    """
    coupling = float(np.linalg.norm(pair.P + eta_W / rho_W * np.linalg.inv(pair.A_d), 2))
    return (W_M + math.sqrt(n_h) * coupling) / 2.0


def _canceling_pair(A_d: ArrayLike, *, eta_W: float, rho_W: float) -> LyapunovPair:
    """P = -(η/ρ) sym(A_d⁻¹) and its Q: cancels the coupling where A_d is symmetric.
    A_d : (2, 2) Hurwitz error dynamics [1/s].   eta_W : learning rate of (11).
    rho_W : leakage gain of (11) [1/(U s²)].
    """
    matrix = np.asarray(A_d)
    inverse = np.linalg.inv(matrix)
    P = -eta_W / rho_W * (inverse + inverse.T) / 2.0
    Q = -(matrix.T @ P + P @ matrix)
    if not (np.linalg.eigvalsh(P)[0] > 0.0 and np.linalg.eigvalsh(Q)[0] > 0.0):
        raise LyapunovError("A_d is too far from symmetric for P = -(eta/rho) sym(inv(A_d))")
    return LyapunovPair(A_d=matrix, P=P, Q=Q)


def _bound_14(pair: LyapunovPair, *, w_bar: float, k_b: float) -> float:
    """B = 2 (|P| w_bar + k_b²)/λ_min(Q) of (14) [U s]: where L' < 0, not yet an ultimate bound.
    w_bar : bound on the approximation error [U].
    k_b : of `_printed_k_b` or `_tight_k_b` [U].
    """
    return float(2.0 * (np.linalg.norm(pair.P, 2) * w_bar + k_b**2) / np.linalg.eigvalsh(pair.Q)[0])


def trivial_bound(A_d: ArrayLike, residual_bound: float) -> float:
    """γ sup|f| [U s]: the ultimate bound of an identifier that has no network at all.

    A bound above this one says nothing about learning.
    A_d : (2, 2) Hurwitz error dynamics [1/s].   residual_bound : sup|f| [U].
    """
    return peak_gain(A_d) * residual_bound


def ultimate_bound(pair: LyapunovPair, *, w_bar: float, k_b: float, rho_W: float) -> float:
    """Return the true ultimate bound of the instantaneous law [U s], at least b of (14).

    b_UUB² = max over 0 <= y <= w_b of [λ_max(P) x(y)² + y²/ρ_W]/λ_min(P), with
    x(y) = max(0, b - (2/λ_min(Q)) (y - k_b)²) and w_b = k_b + sqrt(k_b² + |P| w_bar). The objective
    is a quartic where x > 0: its stationary points are roots of a cubic, none is missed.
    w_bar : bound on the approximation error [U].   k_b : of `_printed_k_b` or `_tight_k_b` [U].
    rho_W : leakage gain of (11) [1/(U s²)].
    """
    p = np.linalg.eigvalsh(pair.P)
    b, curve = _bound_14(pair, w_bar=w_bar, k_b=k_b), 2.0 / np.linalg.eigvalsh(pair.Q)[0]
    w_b = k_b + math.sqrt(k_b**2 + p[1] * w_bar)
    x = np.polynomial.Polynomial([b - curve * k_b**2, 2.0 * curve * k_b, -curve])
    level = p[1] * x * x + np.polynomial.Polynomial([0.0, 0.0, 1.0 / rho_W])
    roots = level.deriv().roots()
    inside = roots.real[(abs(roots.imag) <= 1e-7 * w_b) & (roots.real > 0.0) & (roots.real < w_b)]
    candidates = np.concatenate(([0.0, k_b, w_b], inside))
    candidates = candidates[x(candidates) >= -1e-12 * b]
    values = p[1] * np.maximum(x(candidates), 0.0) ** 2 + candidates**2 / rho_W
    return math.sqrt(float(values.max()) / p[0])


# Statements about (14): as printed, by the tight route; the true bound.
#
# They say how little (14) says: every one stands beside the bound of an identifier with no network.
# (14) needs ideal weights and a bound w_bar on what they leave. Nothing but W = 0, w_bar = sup|f|
# is known for sure before a drive, and that is what it is given: a smaller w_bar would be a claim.
# P is scaled as suits (14) best: b depends on the scale, the loop does not.


def printed_bounds(
    gains: Gains, law: DrivingError, operation: Operation, trivial: float
) -> list[Property]:
    """State b of (14) by the printed and the tight route, and b_UUB [U s].
    gains : of (8) to (12), with leakage.
    trivial : bound of an identifier without a network [U s].
    """
    pair, tight_pair = _best_pair(gains), _tight_pair(gains)
    w_bar, n_h = operation.disturbance.residual, operation.n_h
    eta_W, rho_W = gains.eta_W, gains.rho_W
    k_b = _printed_k_b(pair, W_M=0.0, n_h=n_h, eta_W=eta_W, rho_W=rho_W)
    tight = _tight_k_b(tight_pair, W_M=0.0, n_h=n_h, eta_W=eta_W, rho_W=rho_W)
    entries = {
        "printed_bound": ("bound (14), printed route", _bound_14(pair, w_bar=w_bar, k_b=k_b)),
        "tight_bound": ("bound (14), tight route", _bound_14(tight_pair, w_bar=w_bar, k_b=tight)),
        "ultimate_bound": (
            "true ultimate bound behind (14)",
            ultimate_bound(pair, w_bar=w_bar, k_b=k_b, rho_W=rho_W),
        ),
    }
    return [
        statement(name, title, value, "U s", _remark(law, value, trivial))
        for name, (title, value) in entries.items()
    ]


def _best_pair(gains: Gains) -> LyapunovPair:
    """Return P and Q = q I with |P| = (η/ρ) |A_d⁻¹|, where the printed b is smallest.
    gains : of (8) to (12), with leakage.
    """
    unit = lyapunov(gains.matrix, np.eye(2))
    inverse = float(np.linalg.norm(np.linalg.inv(gains.matrix), 2))
    size = gains.eta_W / gains.rho_W * inverse
    return lyapunov(gains.matrix, size / float(np.linalg.norm(unit.P, 2)) * np.eye(2))


def _tight_pair(gains: Gains) -> LyapunovPair:
    try:
        return _canceling_pair(gains.matrix, eta_W=gains.eta_W, rho_W=gains.rho_W)
    except LyapunovError:
        return _best_pair(gains)


def _remark(law: DrivingError, value: float, trivial: float) -> str:
    remarks = []
    if law.z > 0.0:
        remarks.append("its proof does not cover a law that reads z")
    if value >= trivial:
        remarks.append("above the trivial bound")
    return "; ".join(remarks)
