"""Bounds of the identifier as it runs, sample by sample, with explicit Euler and noisy sensors.

e = ξ - ξ_hat with the true ξ, n the sensors' error of it: the identifier sees ξ̃ = e + n, and
e⁺ = (I + Z) e + dt (f - f_hat + A_d n), Z = dt A_d.
So |e| <= τ |n| + γ (sup|f| + |A_d| |n| + √n_h |W|), γ = dt ∑ |(I + Z)^k|.

Weights: with q = ρ dt |ξ̃| <= 1 and μ = λ dt <= 1 the leakage of a step is a weighted mean, and
the argument of `bounds.py` goes through: |W_hat| stays below g' (c_z/λ + c_ξ)/ρ + c_z g' X/λ²
while |ξ̃| <= X. The same holds for V_hat.

The start: ξ_hat at the first measurement, z = 0, |W_hat(0)| within the bound on W_hat: so weights
that were learnt within the declared conditions may be resumed.
"""

import math
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.paper.laws import DrivingError, Gains
from identifier.stability.lyapunov import power_norms


class Disturbance(NamedTuple):
    """What acts on the error dynamics from outside, on every declared drive.
    residual : sup|f|, the force the linear tire misses as the samples show it, with what sensors
        add to A_ξ ξ + B_ξ u [U].
    noise : sup of the sensors' error of ξ, which is in every measured ξ̃ [U s].
    """

    residual: float
    noise: float = 0.0


_NEWTON_STEPS = 100


class SampledBounds(NamedTuple):
    """What the state of the running identifier never exceeds.
    xi_tilde : bound on |ξ̃| [U s].   X : the one from which that of W follows, hardly larger [U s].
    W : bound on |W_hat| [U].
    """

    xi_tilde: float
    X: float
    W: float


class ErrorGains(NamedTuple):
    """How large an error what acts on it can hold.
    start : τ, largest growth of an error that is left alone [-].   force : γ of a force [s], that
        of `peak_gain` for A_d = -a I, a dt <= 1.
    """

    start: float
    force: float


def error_gains(A_d: Array, dt: float) -> ErrorGains:
    """Return the gains of the error dynamics.
    A_d : (2, 2) error dynamics [1/s], which the step keeps stable.   dt : sampling interval [s].
    """
    eye = np.eye(2)
    start, gamma = power_norms(eye + dt * A_d, eye)
    return ErrorGains(start=start, force=dt * gamma)


class Learning(NamedTuple):
    """How the weights of one layer are driven and leak.
    law : coefficients of z and ξ̃ in the driving error.   forgetting : λ [1/s].
    leakage : ρ [1/(U s²)].   drive : g', what |driving error| moves the weights by.
    dt : sampling interval [s]; 0 in continuous time.
    """

    law: DrivingError
    forgetting: float
    leakage: float
    drive: float
    dt: float

    def kept(self, X: float) -> float:
        """Bound on the weights while |ξ̃| <= X; inf where the leakage of a step is too large.
        X : bound on |ξ̃| [U s].
        """
        (c_z, c_xi), lam = self.law, self.forgetting
        if self.drive == 0.0:
            return 0.0 if self.leakage * self.dt * X <= 1.0 else math.inf
        if self.leakage == 0.0 or self.leakage * self.dt * X > 1.0 or lam * self.dt > 1.0:
            return math.inf
        reached: float = (
            self.drive * (c_z / lam + c_xi) / self.leakage + c_z * self.drive * X / lam**2
        )
        return reached


def output_layer(
    gains: Gains, law: DrivingError, direction: Array, *, n_h: int, dt: float
) -> Learning:
    """Return how W is driven: g' = η_W |D| √n_h.
    gains : of (8) to (12).   direction : (2, 2) D [s].   dt : sampling interval [s].
    """
    return Learning(
        law=law,
        forgetting=gains.forgetting,
        leakage=gains.rho_W,
        drive=gains.eta_W * float(np.linalg.norm(direction, 2)) * math.sqrt(n_h),
        dt=dt,
    )


def by_leakage(
    error: ErrorGains, learning: Learning, A_d: Array, acting: Disturbance, n_h: int
) -> SampledBounds | None:
    """Return the bounds that leakage gives, or None where the circle does not close.

    The smallest X >= F(X), F increasing and convex, by Newton from below.
    error : of `error_gains`.   learning : of `output_layer`.   A_d : (2, 2) error dynamics [1/s].
    """
    noise = acting.noise
    alone = error.start * noise + error.force * (
        acting.residual + float(np.linalg.norm(A_d, 2)) * noise
    )

    def around(X: float) -> float:
        """Return the bound on |ξ̃| that follows from |ξ̃| <= X."""
        return alone + error.force * (math.sqrt(n_h) * learning.kept(X)) + noise

    X = around(0.0)
    for _ in range(_NEWTON_STEPS):
        if not math.isfinite(X):
            return None
        here, ahead = around(X), around(X * (1.0 + 1e-7))
        if not math.isfinite(ahead):
            return None
        slope = (ahead - here) / (1e-7 * X)
        if not slope < 1.0:
            return None
        if here <= X * (1.0 + 1e-12):
            break
        X += (here - X) / (1.0 - slope)
    X *= 1.0 + 1e-9
    found = around(X)
    return SampledBounds(xi_tilde=found, X=X, W=learning.kept(X)) if found <= X else None
