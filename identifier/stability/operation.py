"""What a certificate must know besides the gains, and the worst loop that follows from it."""

import math
from dataclasses import dataclass

import numpy as np

from identifier.gains import Gains
from identifier.stability.gain_limit import require_positive
from identifier.stability.loop import INTEGRATORS, Integrator, Law, Loop, spectral_radius
from identifier.stability.lyapunov import Matrix
from identifier.stability.regressor_gain import worst_gain
from identifier.stability.state_bound import NoBoundError, StateBounds, state_bounds


@dataclass(frozen=True, slots=True, kw_only=True)
class Operation:
    """Where and how the identifier runs: what the certificate must know besides the gains.

    Parameters
    ----------
    n_h : hidden units.
    dt : sampling interval T_s [s].
    integrator : "euler", "rk4" or "exact".
    bandwidth : highest frequency of steering that matters [Hz].
    residual_bound : sup|f|, the force the linear tire misses [U].
    x_bar_max : bound on |x_bar| [-].
    input_feedback : (2, 2) J_f K [1/s] where the network reads x_hat; None where it reads x.
    W_M : bound on the ideal weights (Frobenius) [U], for (14).
    w_bar : bound on the approximation error [U], for (14).
    W_large : margins are judged up to this |W_hat| (Frobenius) [U], which the V layer's share of
        the loop gain grows with; inf judges them up to the proven bound.
    """

    n_h: int
    dt: float
    integrator: str
    bandwidth: float
    residual_bound: float
    x_bar_max: float
    input_feedback: Matrix | None
    W_M: float
    w_bar: float
    W_large: float = math.inf

    def __post_init__(self) -> None:
        require_positive(
            n_h=self.n_h,
            dt=self.dt,
            bandwidth=self.bandwidth,
            residual_bound=self.residual_bound,
            x_bar_max=self.x_bar_max,
        )
        if self.integrator not in INTEGRATORS:
            raise ValueError(
                f"integrator must be one of {list(INTEGRATORS)}, not {self.integrator!r}"
            )
        if not self.W_large > 0.0:
            raise ValueError(f"W_large must be positive, it is {self.W_large}")
        if not (self.W_M >= 0.0 and self.w_bar >= 0.0):
            raise ValueError(f"W_M and w_bar must not be negative: {self.W_M}, {self.w_bar}")

    @property
    def step(self) -> Integrator:
        """The integrator as a function of eigenvalues."""
        return INTEGRATORS[self.integrator]

    @property
    def euler_step(self) -> float | None:
        """The step for sampled bounds: dt of Euler; None, as good as continuous, otherwise."""
        return self.dt if self.integrator == "euler" else None

    def resolves(self, A_d: Matrix) -> bool:
        """Whether the step keeps the error dynamics stable.

        Parameters
        ----------
        A_d : (2, 2) error dynamics [1/s].
        """
        return bool(spectral_radius(A_d, self.step, self.dt) < 1.0)


def kept_weights(gains: Gains, law: Law, operation: Operation) -> float:
    """Largest |W_hat| that projection or leakage allow, proven [U]; inf where nothing is proven.

    Parameters
    ----------
    gains : of (8) to (12).
    law : coefficients of z and ξ̃ in the driving error.
    operation : where it runs.
    """
    bounds = proven_bounds(gains, law, operation)
    return min(gains.W_max, math.inf if bounds is None else bounds.W)


def worst_loop(gains: Gains, law: Law, operation: Operation) -> Loop:
    """Return the loop at the worst regressor, and |W_hat| up to W_large or what is proven of it.

    Where nothing is proven and W_large is infinite, the V layer cannot be counted and is left out.

    Parameters
    ----------
    gains : of (8) to (12).
    law : coefficients of z and ξ̃ in the driving error.
    operation : where it runs.
    """
    W = min(kept_weights(gains, law, operation), operation.W_large)
    g = worst_gain(
        eta_W=gains.eta_W,
        eta_V=gains.eta_V if math.isfinite(W) else 0.0,
        n_h=operation.n_h,
        x_bar_max=operation.x_bar_max,
        W_max=W,
    )
    return Loop(
        A_d=gains.matrix,
        forgetting=gains.forgetting,
        law=law,
        G=g * np.eye(2),
        input_feedback=operation.input_feedback,
    )


def proven_bounds(gains: Gains, law: Law, operation: Operation) -> StateBounds | None:
    """Bounds of |ξ̃| and |W_hat| from rest by the leakage, or None where there is no proof.

    Parameters
    ----------
    gains : of (8) to (12).
    law : coefficients of z and ξ̃ in the driving error.
    operation : where it runs.
    """
    if not (gains.rho_W > 0.0 and operation.resolves(gains.matrix)):
        return None
    try:
        return state_bounds(
            gains.matrix,
            law=law,
            forgetting=gains.forgetting,
            eta_W=gains.eta_W,
            rho_W=gains.rho_W,
            n_h=operation.n_h,
            residual_bound=operation.residual_bound,
            dt=operation.euler_step,
        )
    except NoBoundError:
        return None
