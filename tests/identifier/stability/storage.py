"""The PI-lead law: z + τ ξ̃ in place of z makes the learning loop positive real.

For A_d = -a I, (1/a)(τ + 1/(s + λ))/(s + a) is positive real if and only if τ >= 1/a; then no gain
and no regressor destabilizes it. With e = W_t s and the states (ξ̃, z) of one channel, the storage
S = [ξ̃ z] P [ξ̃ z]ᵀ / 2 gives S' = y e - [ξ̃ z] Q [ξ̃ z]ᵀ / 2, y = (z + τ ξ̃)/a, with
P = [[τ/a, 1/a], [1/a, (a + λ)/a]] and Q = diag(2 (τ - 1/a), 2 λ (a + λ)/a).

Any Hurwitz A_d: the printed direction -A_d⁻ᵀ is not enough (its high-frequency gain is not
symmetric), so the law runs along P of `identifier.paper.laws.lyapunov_direction` in its place.
With A_dᵀ P + P A_d = -Q and W_hat' = η P (z + τ ξ̃) sᵀ, the storage
M = [[τ P, P], [P, R]], R = λ P + Q/2, leaves the dissipation
N = [[τ Q - 2 P, -Sᵀ], [-S, 2 λ R]], S = (P A_d - A_dᵀ P)/2, positive for τ above `lead_time`.
A_d symmetric and Q = 2 I give P = -A_d⁻¹, S = 0, and the law as printed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from codegen.arrays import Array
from identifier.paper.laws import DrivingError
from identifier.stability.lyapunov import LyapunovPair
from models.rules import require_positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Storage:
    """A quadratic storage function [ξ̃; z]ᵀ M [ξ̃; z] / 2 and its dissipation.

    Parameters
    ----------
    M : (2k, 2k) storage matrix.
    N : (2k, 2k) dissipation matrix, both positive semidefinite where the law is passive.
    """

    M: Array
    N: Array

    @property
    def proves_passivity(self) -> bool:
        """M positive definite and N positive semidefinite, to round-off."""
        return bool(
            np.linalg.eigvalsh(self.M)[0] > 0.0
            and np.linalg.eigvalsh(self.N)[0] >= -1e-12 * np.linalg.norm(self.N, 2)
        )


def pi_lead(tau: float) -> DrivingError:
    """Return the law z + τ ξ̃.

    Parameters
    ----------
    tau : lead time τ [s]; at least 1/a for a positive real loop.
    """
    require_positive(ValueError, tau=tau)
    return DrivingError(1.0, tau)


def scalar_storage(*, a: float, lam: float, tau: float) -> Storage:
    """Return P and Q of one channel for A_d = -a I.

    Parameters
    ----------
    a : decay rate [1/s].
    lam : forgetting factor λ [1/s].
    tau : lead time τ [s].
    """
    require_positive(ValueError, a=a, lam=lam, tau=tau)
    P = np.array([[tau / a, 1.0 / a], [1.0 / a, (a + lam) / a]])
    Q = np.diag([2.0 * (tau - 1.0 / a), 2.0 * lam * (a + lam) / a])
    return Storage(M=P, N=Q)


def storage(pair: LyapunovPair, *, forgetting: float, tau: float) -> Storage:
    """Return M and N for any Hurwitz A_d, where the law moves W along P (z + τ ξ̃) sᵀ.

    Parameters
    ----------
    pair : A_d, P and Q of A_dᵀ P + P A_d = -Q.
    forgetting : λ [1/s].
    tau : lead time τ [s].
    """
    require_positive(ValueError, forgetting=forgetting, tau=tau)
    A_d, P, Q = pair.A_d, pair.P, pair.Q
    R = forgetting * P + Q / 2.0
    S = P @ A_d + Q / 2.0  # skew: (P A_d - A_dᵀ P)/2
    M = np.block([[tau * P, P], [P, R]])
    N = np.block([[tau * Q - 2.0 * P, -S.T], [-S, 2.0 * forgetting * R]])
    return Storage(M=M, N=N)


def storage_residual(
    stored: Storage, *, A_d: ArrayLike, forgetting: float, output: ArrayLike
) -> float:
    """Substitute: |Fᵀ M + M F + N| and |M B - Cᵀ| against the size of M F.

    F = [[A_d, 0], [I, -λ I]] are the dynamics of (ξ̃, z), B = [I; 0] the entry of W_t s, C the
    signal that moves the weights: the two equations of the positive real lemma.

    Parameters
    ----------
    stored : M and N.
    A_d : (k, k) error dynamics [1/s]; 1x1 for one channel.
    forgetting : λ [1/s].
    output : (k, 2k) C.
    """
    A_d, C = np.atleast_2d(np.asarray(A_d)), np.asarray(output, dtype=np.float64)
    k = A_d.shape[0]
    eye = np.eye(k)
    F = np.block([[A_d, np.zeros((k, k))], [eye, -forgetting * eye]])
    B = np.vstack([eye, np.zeros((k, k))])
    M, N = stored.M, stored.N
    dissipation = np.linalg.norm(F.T @ M + M @ F + N, 2) / np.linalg.norm(M @ F, 2)
    coupling = np.linalg.norm(M @ B - C.T, 2) / np.linalg.norm(C, 2)
    return float(max(dissipation, coupling))


def lead_time(pair: LyapunovPair, *, forgetting: float) -> float:
    """Smallest τ [s] with N >= 0: λ_max(Q⁻¹ (2 P + S (2 λ R)⁻¹ Sᵀ)); 1/a for A_d = -a I.

    Parameters
    ----------
    pair : A_d, P and Q of A_dᵀ P + P A_d = -Q.
    forgetting : λ [1/s].
    """
    require_positive(ValueError, forgetting=forgetting)
    P, Q = pair.P, pair.Q
    S = P @ pair.A_d + Q / 2.0
    R = forgetting * P + Q / 2.0
    need = 2.0 * P + S.T @ np.linalg.solve(2.0 * forgetting * R, S)
    root = np.linalg.inv(np.linalg.cholesky(Q))
    return float(np.linalg.eigvalsh(root @ need @ root.T)[-1])
