"""What a certificate must know besides the gains, and the worst loop that follows from it."""

import math
from dataclasses import dataclass, replace

import numpy as np

from identifier.gains import Gains
from identifier.stability.disturbance import Disturbance
from identifier.stability.gain_limit import require_positive
from identifier.stability.loop import INTEGRATORS, Integrator, Law, Loop, spectral_radius
from identifier.stability.lyapunov import Matrix
from identifier.stability.regressor_gain import worst_gain
from identifier.stability.sampled_bound import (
    ErrorGains,
    Learning,
    SampledBounds,
    by_leakage,
    by_projection,
    error_gains,
    output_layer,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Operation:
    """Where and how the identifier runs: what the certificate must know besides the gains.

    Parameters
    ----------
    n_h : hidden units.
    dt : sampling interval T_s [s].
    integrator : "euler", "rk4" or "exact".
    bandwidth : highest frequency of steering that matters [Hz].
    disturbance : sup|f|, noise and rates that act on the error.
    needed_force : that the network should be able to hold against its leakage [U].
    x_bar_max : bound on |x_bar| [-], without what the error adds where the network reads x_hat.
    input_feedback : (2, 2) J_f K [1/s] where the network reads x_hat; None where it reads x.
    W_M : bound on the ideal weights (Frobenius) [U], for (14).
    w_bar : bound on the approximation error [U], for (14).
    V_start : largest |V_hat| to begin with (Frobenius) [-].
    W_large : where the margins do not hold up to the proven |W_hat|, they are judged up to this
        one (Frobenius) [U]; the V layer's share of the loop gain grows with it.
    input_per_error : what an error adds to |x_bar| where the network reads x_hat [1/(U s)].
    """

    n_h: int
    dt: float
    integrator: str
    bandwidth: float
    disturbance: Disturbance
    needed_force: float
    x_bar_max: float
    input_feedback: Matrix | None
    W_M: float
    w_bar: float
    V_start: float = 0.0
    W_large: float = math.inf
    input_per_error: float = 0.0

    def __post_init__(self) -> None:
        require_positive(
            n_h=self.n_h,
            dt=self.dt,
            bandwidth=self.bandwidth,
            needed_force=self.needed_force,
            x_bar_max=self.x_bar_max,
        )
        if self.integrator not in INTEGRATORS:
            raise ValueError(
                f"integrator must be one of {list(INTEGRATORS)}, not {self.integrator!r}"
            )
        if not self.W_large > 0.0:
            raise ValueError(f"W_large must be positive, it is {self.W_large}")
        for name in ("W_M", "w_bar", "V_start", "input_per_error"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} must not be negative, it is {getattr(self, name)}")

    @property
    def step(self) -> Integrator:
        """The integrator as a function of eigenvalues."""
        return INTEGRATORS[self.integrator]

    def resolves(self, A_d: Matrix) -> bool:
        """Whether the step keeps the error dynamics stable.

        Parameters
        ----------
        A_d : (2, 2) error dynamics [1/s].
        """
        return bool(spectral_radius(A_d, self.step, self.dt) < 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Proven:
    """What is proven of a design; None and inf where nothing is.

    Parameters
    ----------
    leakage : bounds that the leakage of W gives.
    projection : bounds that the projection of W gives.
    V : bound on |V_hat| [-].
    leakage_step : largest share of W that one sample leaks, ρ_W dt |ξ̃|; an estimate where no
        bound is proven.
    leakage_step_V : the same of V.
    """

    leakage: SampledBounds | None
    projection: SampledBounds | None
    V: float
    leakage_step: float
    leakage_step_V: float

    @property
    def xi_tilde(self) -> float:
        """Smallest bound on |ξ̃| [U s]."""
        return min((found.xi_tilde for found in self._found), default=math.inf)

    @property
    def stage(self) -> float:
        """Smallest bound on |ξ̃| that holds at the inner stages too [U s]."""
        return min((found.stage for found in self._found), default=math.inf)

    @property
    def W(self) -> float:
        """Smallest bound on |W_hat| [U]."""
        return min((found.W for found in self._found), default=math.inf)

    @property
    def _found(self) -> list[SampledBounds]:
        return [found for found in (self.leakage, self.projection) if found is not None]


NOTHING = Proven(leakage=None, projection=None, V=math.inf, leakage_step=0.0, leakage_step_V=0.0)


def proven_bounds(gains: Gains, law: Law, operation: Operation, direction: Matrix) -> Proven:
    """Return all bounds that are proven, for the start of `sampled_bound.py`.

    Parameters
    ----------
    gains : of (8) to (12).
    law : coefficients of z and ξ̃ in the driving error.
    operation : where it runs.
    direction : (2, 2) D [s], of `direction_matrix`.
    """
    A_d, dt, n_h = gains.matrix, operation.dt, operation.n_h
    if not operation.resolves(A_d):
        return NOTHING
    error = error_gains(A_d, operation.integrator, dt)
    learning = output_layer(gains, law, direction, n_h=n_h, integrator=operation.integrator, dt=dt)
    acting = operation.disturbance
    projection = None
    if math.isfinite(gains.W_max):
        projection = by_projection(error, A_d, acting, n_h=n_h, W_max=gains.W_max)
    leakage = by_leakage(error, learning, A_d, acting, n_h)
    if leakage is not None and leakage.W + max(learning.beyond(leakage.stage)) > gains.W_max:
        leakage = leakage if operation.integrator != "rk4" else None  # a stage would be projected
    found = Proven(
        leakage=leakage, projection=projection, V=math.inf, leakage_step=0.0, leakage_step_V=0.0
    )
    X = found.stage if math.isfinite(found.stage) else _unleaked(error, learning, operation, A_d)
    return replace(
        found,
        V=_kept_V(gains, learning, found, operation, direction),
        leakage_step=gains.rho_W * dt * X,
        leakage_step_V=gains.rho_V * dt * X,
    )


def _unleaked(error: ErrorGains, learning: Learning, operation: Operation, A_d: Matrix) -> float:
    """Estimate |ξ̃| where nothing is proven: leakage of small steps, in continuous time."""
    smooth = replace(learning, dt=0.0)
    found = by_leakage(error, smooth, A_d, operation.disturbance, operation.n_h)
    return error.force * operation.disturbance.residual if found is None else found.stage


def _kept_V(
    gains: Gains, learning: Learning, found: Proven, operation: Operation, direction: Matrix
) -> float:
    """Bound on |V_hat|: |x_bar| and |W_hat| drive it; its leakage or projection keep it [-]."""
    X, W = found.stage, found.W
    if not math.isfinite(X):
        return gains.V_max
    if found.leakage is not None:  # inner stages go beyond, as far as the projection lets them
        W = min(found.leakage.W + max(learning.beyond(X)), gains.W_max)
    x_bar = operation.x_bar_max + operation.input_per_error * X
    drive = gains.eta_V * float(np.linalg.norm(direction, 2)) * W * x_bar
    if drive == 0.0 and gains.rho_V == 0.0:
        return min(operation.V_start, gains.V_max)
    kept = replace(learning, leakage=gains.rho_V, drive=drive, free=gains.V_free).kept(X)
    return min(max(operation.V_start, kept), gains.V_max)


def worst_loop(gains: Gains, law: Law, operation: Operation, direction: Matrix, W: float) -> Loop:
    """Return the loop at the worst regressor, and |W_hat| up to W.

    Where W is infinite, the V layer cannot be counted and is left out.

    Parameters
    ----------
    gains : of (8) to (12).
    law : coefficients of z and ξ̃ in the driving error.
    operation : where it runs.
    direction : (2, 2) D [s], of `direction_matrix`.
    W : largest |W_hat| that is counted [U].
    """
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
        direction=direction,
    )
