"""The error dynamics xi_tilde' = A_d xi_tilde + (f - f_hat): poles, Lyapunov matrix, peak gain.

A_d: (2, 2) error dynamics [1/s].   P, Q: symmetric positive definite, A_dᵀ P + P A_d = -Q.
γ = ∫₀^∞ |exp(A_d t)| dt: the largest |xi_tilde| that a unit force error can hold [s].
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from codegen.arrays import Array
from codegen.errors import TireidError


class LyapunovError(TireidError, ValueError):
    """P does not solve the Lyapunov equation, or Q or P is not positive definite."""


class LyapunovPair(NamedTuple):
    """P and Q of A_dᵀ P + P A_d = -Q.
    A_d : (2, 2) error dynamics [1/s].   P : (2, 2) solution [s, for Q without unit].
    Q : (2, 2) right-hand side [-].
    """

    A_d: Array
    P: Array
    Q: Array


def lyapunov_residual(A_d: ArrayLike, P: ArrayLike, Q: ArrayLike) -> float:
    """Substitute P back: |A_dᵀ P + P A_d + Q| / |Q|.
    A_d : (2, 2) error dynamics [1/s].   P : (2, 2) candidate solution.
    Q : (2, 2) right-hand side.
    """
    A_d, P, Q = np.asarray(A_d), np.asarray(P), np.asarray(Q)
    return float(np.linalg.norm(A_d.T @ P + P @ A_d + Q, 2) / np.linalg.norm(Q, 2))


def lyapunov(A_d: ArrayLike, Q: ArrayLike) -> LyapunovPair:
    """Solve A_dᵀ P + P A_d = -Q (the P and Q of (14)) and check the answer by substitution.
    A_d : (2, 2) Hurwitz error dynamics [1/s].   Q : (2, 2) symmetric positive definite matrix.
    """
    A_d, Q = np.array(A_d, dtype=np.float64), np.array(Q, dtype=np.float64)
    import control  # takes a second to import, so only where it is needed

    P = np.asarray(control.lyap(A_d.T, Q), dtype=np.float64)  # lyap(A, Q): A X + X Aᵀ + Q = 0
    P = (P + P.T) / 2.0
    residual = lyapunov_residual(A_d, P, Q)
    if not residual < 1e-9 or not np.linalg.eigvalsh(P)[0] > 0.0:
        raise LyapunovError(f"P = {P.tolist()} leaves a relative residual of {residual:.2e}")
    return LyapunovPair(A_d=A_d, P=P, Q=Q)


def peak_gain(A_d: ArrayLike) -> float:
    """γ = ∫₀^∞ |exp(A_d t)| dt [s], so that |xi_tilde| <= γ sup|f - f_hat| from rest.

    1 / min|Re pole| where A_d is normal (symmetric, or a multiple of the identity plus a
    rotation); otherwise adaptive quadrature to 1e-10.
    With complex poles exp(A_d T) = -exp(m T) I after T = π/|Im|: one such period is enough.
    A_d : (2, 2) Hurwitz error dynamics [1/s].
    """
    A_d = np.array(A_d, dtype=np.float64)
    poles = np.linalg.eigvals(A_d)
    slowest, size = -float(poles.real.max()), float(np.linalg.norm(A_d, 2))
    if np.linalg.norm(A_d @ A_d.T - A_d.T @ A_d, 2) <= 1e-14 * size**2:
        return 1.0 / slowest
    end, repeats = 60.0 / slowest, 1.0
    turning = float(np.abs(poles.imag).max())
    if turning * end > np.pi:
        end = np.pi / turning
        repeats = 1.0 / -np.expm1(-slowest * end)
    from scipy.integrate import quad  # as `control`, only where it is needed
    from scipy.linalg import expm

    def norm(t: float) -> float:
        return float(np.linalg.norm(expm(A_d * t), 2))

    early = np.geomspace(min(1e-2 / size, end / 2.0), end, 12)
    total = sum(quad(norm, a, b, epsabs=0.0, epsrel=1e-11)[0] for a, b in pairwise([0.0, *early]))
    return float(repeats * total)


def power_norms(step: Array, entry: Array) -> tuple[float, float]:
    """Largest and sum of |step^k entry| over k = 0, 1, ...
    step : (2, 2) with every eigenvalue inside the unit circle.   entry : (2, 2).
    """
    radius, size = float(np.max(np.abs(np.linalg.eigvals(step)))), np.linalg.norm(entry, 2)
    scalar = np.linalg.norm(step - step[0, 0] * np.eye(2), 2) <= 1e-14
    normal = np.linalg.norm(step @ step.T - step.T @ step, 2) <= 1e-14
    if scalar or (normal and np.array_equal(entry, np.eye(2))):
        return float(size), float(size / (1.0 - radius))  # |step^k| = radius^k
    block, total, last, largest = np.eye(2)[None], 0.0, np.inf, 0.0
    while block.shape[0] < 1024:
        block = np.concatenate([block, block @ (block[-1] @ step)])
    leap, base = block[-1] @ step, entry
    while last > 1e-16 * (1.0 - radius) * total:
        norms = np.linalg.norm(block @ base, 2, axis=(1, 2))
        total, last, base = total + float(norms.sum()), float(norms[-1]), base @ leap
        largest = max(largest, float(norms.max()))
    return largest, total
