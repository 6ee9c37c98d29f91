"""The learning loop at a frozen regressor: one 6x6 matrix for every law that is linear in (z, ξ̃).

With f_hat = p = W s and s = tanh(V x_bar) held, the identifier (8) and the laws (11), (12) are

    ξ̃' = (A_d + J_f K) ξ̃ - p          J_f K: only where the network reads x_hat (else 0)
    z'  = -λ z + ξ̃                     (10)
    p'  = G D (c_z z + c_ξ ξ̃) - l p     D = -A_d⁻ᵀ in (11), (12)

G = η_W |s|² I + η_V |x_bar|² W (I - Λ)² Wᵀ is the loop gain [1/s⁴, 1/s³ for the instantaneous
law], l the leakage rate ρ |ξ̃| [1/s]. (c_z, c_ξ) is the law: (1, 0) the integral law, (0, 1) the
instantaneous one, (1, τ) the PI-lead law. l = 0 is the worst case.
A step dt of explicit Euler acts on the eigenvalues μ of this matrix as 1 + μ dt, so that continuous
time and the sampled loop share one eigenvalue computation.
"""

from collections.abc import Callable
from typing import NamedTuple

import casadi as ca
import numpy as np
import numpy.typing as npt
from numpy.typing import ArrayLike

from codegen.arrays import Array
from identifier.paper.laws import DrivingError, Law

ComplexArray = npt.NDArray[np.complex128]
INTEGRAL = DrivingError(1.0, 0.0)
INSTANTANEOUS = DrivingError(0.0, 1.0)


def direction_matrix(law: Law, A_d: ArrayLike) -> Array:
    """Return D of the law, (2, 2) [s]: -A_d⁻ᵀ as printed, P for the PI-lead law.
    law : of `identifier.paper.laws.LAWS`.   A_d : (2, 2) Hurwitz error dynamics [1/s].
    """
    return -np.array(ca.DM(law.direction(ca.DM(np.asarray(A_d)), ca.DM.eye(2))))


class Loop(NamedTuple):
    """The loop at one frozen regressor.
    A_d : (2, 2) error dynamics [1/s].   forgetting : λ of (9) and (10) [1/s].
    law : coefficients of z and ξ̃ in the driving error.
    G : (2, 2) loop gain, symmetric positive semidefinite.   leakage : l = ρ |ξ̃| [1/s].
    input_feedback : (2, 2) J_f K [1/s], None where the network reads the measured x.
    direction : (2, 2) matrix D that replaces -A_d⁻ᵀ [s], None for (11) and (12) as printed.
    """

    A_d: Array
    forgetting: float
    law: DrivingError
    G: Array
    leakage: float = 0.0
    input_feedback: Array | None = None
    direction: Array | None = None

    def matrix(self) -> Array:
        """Return the (6, 6) matrix of the states (ξ̃, z, p)."""
        eye, zero = np.eye(2), np.zeros((2, 2))
        c_z, c_xi = self.law
        printed = -np.linalg.inv(self.A_d).T  # (zᵀ A_d⁻¹)ᵀ = A_d⁻ᵀ z
        drive = self.G @ (printed if self.direction is None else self.direction)
        feedback = zero if self.input_feedback is None else self.input_feedback
        return np.block(
            [
                [self.A_d + feedback, zero, -eye],
                [eye, -self.forgetting * eye, zero],
                [c_xi * drive, c_z * drive, -self.leakage * eye],
            ]
        )

    def scaled(self, factor: float) -> "Loop":
        """Return the same loop with eta_W and eta_V multiplied by the factor.
        factor : multiplier of the loop gain [-].
        """
        return self._replace(G=factor * self.G)


def scaled_matrices(loop: Loop, factors: ArrayLike) -> ComplexArray:
    """Stack the loop's matrices for many (complex) factors on the loop gain, (n, 6, 6).
    factors : (n,) multipliers of G; complex ones turn the phase.
    """
    base = loop.matrix().astype(np.complex128)
    stack = np.repeat(base[None], np.size(factors), axis=0)
    stack[:, 4:, :4] *= np.ravel(factors)[:, None, None]
    return stack


def eigenvalues(matrices: ArrayLike) -> ComplexArray:
    """Eigenvalues as complex numbers, (..., n) [1/s].   matrices : (..., n, n)."""
    return np.asarray(np.linalg.eigvals(np.asarray(matrices)), dtype=np.complex128)


def root_locus(loop: Loop, factors: ArrayLike) -> ComplexArray:
    """Eigenvalues of the loop for many factors on the gain, (n, 6) [1/s], unsorted.
    factors : (n,) multipliers of G.
    """
    return eigenvalues(scaled_matrices(loop, factors))


def growth_rate(matrices: ArrayLike, dt: float | None = None) -> Array:
    """Log max|1 + μ dt| / dt, or max Re μ in continuous time [1/s]: negative is stable.
    matrices : (..., n, n) loop matrices.   dt : step of Euler [s]; None for continuous time.
    """
    mu = eigenvalues(matrices)
    growth = np.max(mu.real, axis=-1)
    if dt is not None:
        growth = np.log(np.max(np.abs(1.0 + mu * dt), axis=-1)) / dt
    return np.asarray(growth, dtype=np.float64)


# How large the loop gain G is at the worst regressor.
#
# G = η_W |s|² I + η_V |x_bar|² W (I - Λ)² Wᵀ, with s = tanh(V x_bar), Λ = diag(s²) of (13):
# what one unit of A_d⁻ᵀ z moves the network's output p per second through (11) and (12).
# Units: with the force unit U, z in U s² and A_d⁻¹ in s, p' in U/s asks for G and eta_W in 1/s⁴ for
# the integral law (1/s³ for the instantaneous one) and for eta_V in 1/(U² s⁴) (1/(U² s³)).


def worst_gain(*, eta_W: float, eta_V: float, n_h: int, x_bar_max: float, W_max: float) -> float:
    """(n_h - 1) η_W + max(η_W, η_V x_bar_max² W_max²): no regressor, no |W| <= W_max exceeds it.

    A unit i adds η_W u + η_V |x_bar|² |W_i|² (1 - u)² with u = s_i² in [0, 1], convex in u and in
    W: the worst is at a corner, where every unit is saturated but perhaps the one that holds all
    of W. So V learns at no cost in margin while η_V x_bar_max² W_max² <= η_W.
    eta_W : learning rate of (11).   eta_V : learning rate of (12).
    n_h : hidden units; |s|² <= n_h.   W_max : bound on |W| (Frobenius) [U]; needed where V learns.
    """
    through_V = eta_V * x_bar_max**2 * W_max**2 if eta_V > 0.0 else 0.0
    return (n_h - 1) * eta_W + max(eta_W, through_V)


FINEST = 2.0**-50  # share of x, SciPy's own


def root(
    f: Callable[[float], float],
    low: float,
    high: float,
    *,
    xtol: float = 2e-12,
    rtol: float = FINEST,
) -> float:
    """Return x between two ends at which f is zero, by Brent's method.
    xtol, rtol : how near it must be, absolute and over its size.
    """
    from scipy.optimize import brentq  # takes longer to import than a log of a minute to learn from

    return float(brentq(f, low, high, xtol=xtol, rtol=rtol))
