"""Gains of the identifier, with their units.

With the force unit U (kN for a car) the axle impulse ξ is in U s, the filtered error z in U s².
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.rules import require_within

LEAST, LARGEST = 1e-15, 1e12  # of a gain that is not 0, in its unit, whatever U is


class NotHurwitzError(ValueError):
    """A_d has an eigenvalue whose real part is not negative."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """Gains of the observer (8), the filter (10) and the laws (11)-(12).

    Parameters
    ----------
    A_d : Hurwitz matrix of the prescribed error dynamics (2x2), by rows [1/s].
    forgetting : λ of (9)-(10) [1/s].
    eta_W : learning rate of W: η1 [1/s⁴], or [1/s³] for the instantaneous law.
    eta_V : learning rate of V: η2 [1/(U² s⁴)], or [1/(U² s³)] for the instantaneous law.
    rho_W : leakage of W, ρ1 [1/(U s²)]; 0 where a projection bounds W.
    rho_V : leakage of V, ρ2 [1/(U s²)]; 0 where a projection bounds V.
    W_max : radius of the projection of W, Frobenius norm [U]; infinite: no projection.
    V_max : radius of the projection of V, Frobenius norm [-]; infinite: no projection.
    W_free : radius of the dead zone of the leakage of W, Frobenius norm [U]: within it nothing
        leaks, beyond it what lies beyond; 0, the paper's: all of W leaks.
    V_free : radius of the dead zone of the leakage of V, Frobenius norm [-]; 0, the paper's.
    lead : τ of the PI-lead law z + τ ξ̃ [s]; the other laws do not read it.

    Raises
    ------
    NotHurwitzError
        Where A_d is not Hurwitz.
    ValueError
        Where a gain is negative, not a number, above `LARGEST` or below `LEAST`, λ or a radius not
        positive, a dead zone without a leakage, or A_d not 2x2.
    """

    A_d: tuple[tuple[float, float], tuple[float, float]]
    forgetting: float
    eta_W: float
    eta_V: float
    rho_W: float
    rho_V: float
    W_max: float = np.inf
    V_max: float = np.inf
    W_free: float = 0.0
    V_free: float = 0.0
    lead: float = 0.0

    def __post_init__(self) -> None:
        A_d = np.array(self.A_d, dtype=np.float64)
        if A_d.shape != (2, 2) or not np.isfinite(A_d).all():
            raise ValueError(f"A_d must be a 2x2 matrix of finite numbers, it is {self.A_d}")
        require_within(ValueError, 0.0, LARGEST, **{"|A_d|": np.abs(A_d).max()})
        poles = np.linalg.eigvals(A_d)
        if not poles.real.max() < 0.0:
            raise NotHurwitzError(f"A_d must be Hurwitz, its eigenvalues are {poles}")
        for name in ("eta_W", "eta_V", "rho_W", "rho_V", "W_free", "V_free", "lead"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} must not be negative, it is {getattr(self, name)}")
        if not 0.0 < self.forgetting < np.inf:
            raise ValueError(f"forgetting must be positive, it is {self.forgetting}")
        for name in ("forgetting", "eta_W", "eta_V", "rho_W", "rho_V", "W_free", "V_free", "lead"):
            if getattr(self, name) != 0.0:
                require_within(ValueError, LEAST, LARGEST, **{name: getattr(self, name)})
        for name in ("W_max", "V_max"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, it is {getattr(self, name)}")
            if getattr(self, name) != np.inf:
                require_within(ValueError, LEAST, LARGEST, **{name: getattr(self, name)})
        for free, rho in (("W_free", "rho_W"), ("V_free", "rho_V")):
            if getattr(self, free) > 0.0 and getattr(self, rho) == 0.0:
                raise ValueError(
                    f"{free} is the dead zone of a leakage, and {rho} is 0: it must be positive"
                )

    @property
    def matrix(self) -> NDArray[np.float64]:
        """A_d as an array (2, 2) [1/s]."""
        return np.array(self.A_d, dtype=np.float64)

    def scaled_by_forgetting(self) -> "Gains":
        """Return these gains with η/λ in place of η.

        Below the frequency λ the filtered error is z ≈ ξ̃/λ, so that the integral law at η acts as
        the instantaneous law at η/λ: the control of every comparison of the two.
        """
        return replace(self, eta_W=self.eta_W / self.forgetting, eta_V=self.eta_V / self.forgetting)


def diagonal(a: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return A_d = -a I by rows.

    Parameters
    ----------
    a : rate of the error dynamics [1/s].
    """
    return ((-a, 0.0), (0.0, -a))
