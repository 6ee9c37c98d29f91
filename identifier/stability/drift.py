"""Slow drift under a moving regressor: where the learning loop stops being positive real.

With W_t = W - W_hat and W_t' = -η D H(s)[W_t s] sᵀ, the path from the force error W_t s to the
signal that moves the weights is H(s) = D (c_ξ + c_z/(s + λ)) (s I - A_d)⁻¹, D = -A_d⁻ᵀ. Averaging
over a regressor of frequency ω leaves -η He H(jω): a direction in which the Hermitian part is
negative drifts away, at any η. For A_d = -a I the integral law has
Re H ∝ (a λ - ω²): it drifts where the maneuver is faster than sqrt(a λ).
A constant leakage s0 > η |s|² max(-λ_min He H) stops it for every s(t) (shortage of passivity).
"""

import math

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq, minimize_scalar

from identifier.stability.gain_limit import require_positive
from identifier.stability.loop import Law
from identifier.stability.lyapunov import Matrix, require_hurwitz


def passivity(
    frequency: npt.ArrayLike,
    *,
    A_d: npt.ArrayLike,
    forgetting: float,
    law: Law,
    direction: Matrix | None = None,
) -> Matrix:
    """λ_min of the Hermitian part of H(jω), (n,): negative where a regressor drifts.

    Parameters
    ----------
    frequency : (n,) ω [rad/s].
    A_d : (2, 2) Hurwitz error dynamics [1/s].
    forgetting : λ [1/s].
    law : coefficients of z and ξ̃ in the driving error.
    direction : (2, 2) D, None for -A_d⁻ᵀ.
    """
    dynamics = require_hurwitz(A_d)
    c_z, c_xi = law
    s = 1j * np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    D = -np.linalg.inv(dynamics).T if direction is None else direction
    resolvent = np.linalg.inv(s[:, None, None] * np.eye(2) - dynamics)
    scalar = c_xi + c_z / (s + forgetting)
    H = np.asarray(scalar[:, None, None] * (D @ resolvent), dtype=np.complex128)
    hermitian = (H + H.conj().transpose(0, 2, 1)) / 2.0
    return np.asarray(np.linalg.eigvalsh(hermitian)[:, 0], dtype=np.float64)


def drift_frequency(
    *, A_d: npt.ArrayLike, forgetting: float, law: Law, direction: Matrix | None = None
) -> float:
    """Lowest frequency from which a regressor drifts [rad/s]; inf where H is positive real.

    For A_d = -a I: sqrt(a λ) for the integral law, inf for the instantaneous law and for the
    PI-lead law with τ >= 1/a.

    Parameters
    ----------
    A_d : (2, 2) Hurwitz error dynamics [1/s].
    forgetting : λ [1/s].
    law : coefficients of z and ξ̃ in the driving error.
    direction : (2, 2) D, None for -A_d⁻ᵀ.
    """

    def relative(frequency: npt.ArrayLike) -> Matrix:
        """λ_min He H with the decay of H taken out, so that round-off is told from a sign."""
        lowest = passivity(frequency, A_d=A_d, forgetting=forgetting, law=law, direction=direction)
        return lowest * (size + np.atleast_1d(np.asarray(frequency))) / reference

    size = float(np.linalg.norm(require_hurwitz(A_d), 2)) + forgetting
    reference = 1.0
    reference = float(abs(relative(0.0)[0]))
    grid = size * np.geomspace(1e-4, 1e3, 2801)
    negative = np.flatnonzero(relative(grid) < -1e-11)
    if negative.size == 0:
        return math.inf
    first = int(negative[0])
    if first == 0:
        return 0.0
    low, high = float(grid[first - 1]), float(grid[first])
    if relative(low)[0] <= 0.0:
        return low
    return float(brentq(lambda w: float(relative(w)[0]), low, high, xtol=1e-13 * size))


def passivity_shortage(
    *, A_d: npt.ArrayLike, forgetting: float, law: Law, direction: Matrix | None = None
) -> float:
    """Max over ω of -λ_min He H(jω), zero where H is positive real.

    For A_d = -a I and the integral law: 1/(a (a + λ) (√a + √λ)²), `shortage_formula`.

    Parameters
    ----------
    A_d : (2, 2) Hurwitz error dynamics [1/s].
    forgetting : λ [1/s].
    law : coefficients of z and ξ̃ in the driving error.
    direction : (2, 2) D, None for -A_d⁻ᵀ.
    """

    def lowest(log_frequency: npt.ArrayLike) -> Matrix:
        return passivity(
            np.exp(log_frequency), A_d=A_d, forgetting=forgetting, law=law, direction=direction
        )

    size = float(np.linalg.norm(require_hurwitz(A_d), 2)) + forgetting
    grid = np.log(size * np.geomspace(1e-4, 1e3, 1401))
    worst = int(np.argmin(lowest(grid)))
    around = (grid[max(worst - 1, 0)], grid[min(worst + 1, grid.size - 1)])
    found = minimize_scalar(
        lambda x: float(lowest(x)[0]), bounds=around, method="bounded", options={"xatol": 1e-10}
    )
    shortage = -min(float(found.fun), float(lowest(grid)[worst]))
    return shortage if shortage > 1e-12 * float(np.max(np.abs(lowest(grid)))) else 0.0


def shortage_formula(a: float, lam: float) -> float:
    """1/(a (a + λ) (√a + √λ)²): shortage of passivity of the integral law with A_d = -a I.

    Parameters
    ----------
    a : decay rate of A_d = -a I [1/s].
    lam : forgetting factor λ [1/s].
    """
    require_positive(a=a, lam=lam)
    return 1.0 / (a * (a + lam) * (math.sqrt(a) + math.sqrt(lam)) ** 2)


def sufficient_leakage(
    *,
    A_d: npt.ArrayLike,
    forgetting: float,
    law: Law,
    eta_W: float,
    n_h: int,
    direction: Matrix | None = None,
) -> float:
    """Constant leakage rate s0 [1/s] above which no regressor can drift, η |s|²_max shortage.

    The leakage ρ |ξ̃| of (11) reaches it where |ξ̃| = s0/ρ: about the error at which a drift ends.

    Parameters
    ----------
    A_d : (2, 2) Hurwitz error dynamics [1/s].
    forgetting : λ [1/s].
    law : coefficients of z and ξ̃ in the driving error.
    eta_W : learning rate of (11).
    n_h : hidden units; |s|² <= n_h.
    direction : (2, 2) D, None for -A_d⁻ᵀ.
    """
    shortage = passivity_shortage(A_d=A_d, forgetting=forgetting, law=law, direction=direction)
    return eta_W * n_h * shortage
