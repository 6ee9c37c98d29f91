"""Bounds of the identifier as it runs, sample by sample, with Euler or RK4 and noisy sensors.

e = ξ - ξ_hat with the true ξ, n the sensors' error of it: the identifier sees ξ̃ = e + n.
Euler: e⁺ = (I + Z) e + dt (f - f_hat + A_d n), Z = dt A_d.
RK4, inputs held: e⁺ = R e + dt φ (f + A_d n) + dt (I - φ) ξ' - dt ∑ M_i f_hat_i over its stages,
R = I + Z φ, φ = I + Z/2 + Z²/6 + Z³/24 = ∑ M_i.
So |e| <= τ |n| + γ_f (sup|f| + |A_d| |n|) + γ_ξ sup|ξ'| + ∑ γ_i √n_h |W_i|, γ = dt ∑ |R^k .|.

Weights: with q = ρ dt |ξ̃| <= 1 and μ = λ dt <= 1 the leakage of a step is a weighted mean, and
the argument of `state_bound.py` goes through: |W_hat| stays below
g' [c_z (1 + κ)/λ + c_ξ]/(ρ (1 - ε)) + c_z g' X/λ², κ = ε = 0 for Euler. RK4 has κ = μ² (z of an
inner stage), ε = q (the leakage of one stage acts on the slope of another). Its second stage is a
step of Euler and keeps the bound; with p = dt g' X c_z μ/λ and w = dt g' X (c_z (1 + μ²)/λ + c_ξ)
the third sees up to p/2 + w q/4 more and the fourth p (1 + μ/2) + w (q/2 + q²/4), unless a
projection keeps them. X bounds |ξ̃| at every stage. The same holds for V_hat.

A dead zone, in which nothing leaks, adds its radius W_free to that, and nothing else. With Π the
nearest point of the ball and q the share of stage i, all that leaks of a step is
∑ θ_i (W_hat_i - Π_i): linear in the W_hat and the Π. Where W_hat, the slopes d_i and the Π were all
the same C there would be no step, so that the weights of a full step, W_hat⁺ = (1 - ∑ θ_i) W_hat +
∑ θ_i (Π_i + d_i/ρ_i |ξ̃_i|), sum to one; none is negative while q <= 1, for RK4 too (d_1 has
(1 - q_2 + q_2 q_3/2 - q_2 q_3 q_4/4)/6). So |W_hat⁺| - W_free <= (1 - ∑ θ_i) (|W_hat| - W_free) +
∑ θ_i |d_i|/ρ_i |ξ̃_i|: the recursion of the leakage without a dead zone, for what is beyond W_free.
The inner stages go beyond the sample as far as before, since |W_hat - Π| = max(0, |W_hat| - W_free)
never grows faster than |W_hat|.

The start: ξ_hat at the first measurement, z = 0, |W_hat(0)| within the bound on W_hat: so weights
that were learnt within the declared conditions may be resumed.
"""

import math
from dataclasses import dataclass

import numpy as np

from codegen.arrays import Array
from identifier.paper.laws import DrivingError, Gains
from identifier.stability.bounds import transient_peak
from identifier.stability.lyapunov import peak_gain, power_norms
from models.rules import require_positive

# What acts on the error dynamics from outside: bounds that hold on every declared drive.


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """Bounds of the residual, of the noise, and of what a held input leaves out.
    residual : sup|f|, the force the linear tire misses as the samples show it, with what sensors
        add to A_ξ ξ + B_ξ u [U].
    noise : sup of the sensors' error of ξ, which is in every measured ξ̃ [U s].
    rate : sup|ξ'| of the car [U]; RK4 adds dt (1 - φ) ξ' to the error.
    known : sup|A_ξ ξ + B_ξ u| as measured, which the observer is given [U].
    """

    residual: float
    noise: float = 0.0
    rate: float = 0.0
    known: float = 0.0

    def __post_init__(self) -> None:
        require_positive(ValueError, residual=self.residual)
        for name in ("noise", "rate", "known"):
            value = getattr(self, name)
            if not 0.0 <= value < float("inf"):
                raise ValueError(f"{name} must not be negative, it is {value}")


_NEWTON_STEPS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledBounds:
    """What the state of the running identifier never exceeds.
    xi_tilde : bound on |ξ̃| at every sample [U s].
    stage : bound on |ξ̃| at the inner stages too [U s]; leakage acts with it.
    W : bound on |W_hat| [U].
    """

    xi_tilde: float
    stage: float
    W: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorGains:
    """How large an error what acts on it can hold.
    start : τ, largest growth of an error that is left alone [-].   force : γ_f of the residual [s].
    rate : γ_ξ of ξ' [s].   weights : γ_i of the force of the network at each stage [s].
    inner : for stages 2 to 4, the factors on |ξ̃|, and on |A_ξ ξ + B_ξ u| and each f_hat before.
    """

    start: float
    force: float
    rate: float
    weights: tuple[float, ...]
    inner: tuple[tuple[float, float, tuple[float, ...]], ...] = ()


def error_gains(A_d: Array, integrator: str, dt: float) -> ErrorGains:
    """Return the gains of the error dynamics.
    A_d : (2, 2) error dynamics [1/s], which the step keeps stable.
    integrator : "euler", "rk4" or "exact" (continuous time).   dt : sampling interval [s].
    """
    if integrator == "exact":
        gamma = peak_gain(A_d)
        return ErrorGains(start=transient_peak(A_d), force=gamma, rate=0.0, weights=(gamma,))
    eye, Z = np.eye(2), dt * A_d
    if integrator == "euler":
        start, gamma = power_norms(eye + Z, eye)
        return ErrorGains(start=start, force=dt * gamma, rate=0.0, weights=(dt * gamma,))
    Z2, Z3 = Z @ Z, Z @ Z @ Z
    phi = eye + Z / 2.0 + Z2 / 6.0 + Z3 / 24.0
    R = eye + Z @ phi
    stages = (  # what f_hat of each stage adds to the step, over -dt
        (eye + Z + Z2 / 2.0 + Z3 / 4.0) / 6.0,
        (2.0 * eye + Z + Z2 / 2.0) / 6.0,
        (2.0 * eye + Z) / 6.0,
        eye / 6.0,
    )
    inner = (  # ξ̃ of each stage = first ξ̃ - second dt known - third dt f_hat
        (eye + Z / 2.0, eye / 2.0, (eye / 2.0,)),
        (eye + Z / 2.0 + Z2 / 4.0, eye / 2.0 + Z / 4.0, (Z / 4.0, eye / 2.0)),
        (eye + Z + Z2 / 2.0 + Z3 / 4.0, eye + Z / 2.0 + Z2 / 4.0, (Z2 / 4.0, Z / 2.0, eye)),
    )
    return ErrorGains(
        start=power_norms(R, eye)[0],
        force=dt * power_norms(R, phi)[1],
        rate=dt * power_norms(R, eye - phi)[1],
        weights=tuple(dt * power_norms(R, M)[1] for M in stages),
        inner=tuple(
            (_norm(a), dt * _norm(b), tuple(dt * _norm(c) for c in cs)) for a, b, cs in inner
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Learning:
    """How the weights of one layer are driven and leak.
    law : coefficients of z and ξ̃ in the driving error.   forgetting : λ [1/s].
    leakage : ρ [1/(U s²)].   drive : g', what |driving error| moves the weights by.
    dt : sampling interval [s]; 0 in continuous time.
    staged : whether the step has inner stages (RK4).
    free : radius of the dead zone of the leakage, in the unit of the weights.
    """

    law: DrivingError
    forgetting: float
    leakage: float
    drive: float
    dt: float
    staged: bool
    free: float = 0.0

    def kept(self, X: float) -> float:
        """Bound on the weights while |ξ̃| <= X; inf where the leakage of a step is too large.
        X : bound on |ξ̃| at every stage [U s].
        """
        (c_z, c_xi), lam = self.law, self.forgetting
        if self.drive == 0.0:
            return self.free if self.leakage * self.dt * X <= 1.0 else math.inf
        q, mu = self.leakage * self.dt * X, lam * self.dt
        if self.leakage == 0.0 or q > 1.0 or mu > 1.0 or (self.staged and q == 1.0):
            return math.inf
        late, weak = (mu**2, q) if self.staged else (0.0, 0.0)
        balance = self.drive * (c_z * (1.0 + late) / lam + c_xi) / (self.leakage * (1.0 - weak))
        reached: float = self.free + balance + c_z * self.drive * X / lam**2
        return reached

    def beyond(self, X: float) -> tuple[float, ...]:
        """What inner stages may lie beyond the weights of the sample, one for each stage.
        X : bound on |ξ̃| at every stage [U s].
        """
        if not self.staged:
            return (0.0,)
        (c_z, c_xi), mu = self.law, self.forgetting * self.dt
        q, moved = self.leakage * self.dt * X, self.dt * self.drive * X
        late = moved * c_z * mu / self.forgetting  # z of an inner stage
        weak = moved * (c_z * (1.0 + mu**2) / self.forgetting + c_xi)  # leakage acting on slopes
        third = late / 2.0 + weak * q / 4.0
        return (0.0, 0.0, third, late * (1.0 + mu / 2.0) + weak * (q / 2.0 + q**2 / 4.0))


def output_layer(
    gains: Gains, law: DrivingError, direction: Array, *, n_h: int, integrator: str, dt: float
) -> Learning:
    """Return how W is driven: g' = η_W |D| √n_h.
    gains : of (8) to (12).   direction : (2, 2) D [s].   integrator : "euler", "rk4" or "exact".
    dt : sampling interval [s].
    """
    return Learning(
        law=law,
        forgetting=gains.forgetting,
        leakage=gains.rho_W,
        drive=gains.eta_W * _norm(direction) * math.sqrt(n_h),
        dt=0.0 if integrator == "exact" else dt,
        staged=integrator == "rk4",
        free=gains.W_free,
    )


def by_leakage(
    error: ErrorGains, learning: Learning, A_d: Array, acting: Disturbance, n_h: int
) -> SampledBounds | None:
    """Return the bounds that leakage gives, or None where the circle does not close.

    The smallest X >= F(X), F increasing and convex, by Newton from below.
    error : of `error_gains`.   learning : of `output_layer`.   A_d : (2, 2) error dynamics [1/s].
    """

    def around(X: float) -> tuple[float, float, float]:
        """Return what follows from |ξ̃| <= X: at samples, at stages, and of W."""
        W = learning.kept(X)
        forces = tuple(math.sqrt(n_h) * (W + more) for more in learning.beyond(X))
        return *_error(error, A_d, acting, forces), W

    X = around(0.0)[1]
    for _ in range(_NEWTON_STEPS):
        if not math.isfinite(X):
            return None
        here, ahead = around(X)[1], around(X * (1.0 + 1e-7))[1]
        if not math.isfinite(ahead):
            return None
        slope = (ahead - here) / (1e-7 * X)
        if not slope < 1.0:
            return None
        if here <= X * (1.0 + 1e-12):
            break
        X += (here - X) / (1.0 - slope)
    X *= 1.0 + 1e-9
    at_samples, at_stages, W = around(X)
    if not at_stages <= X:
        return None
    return SampledBounds(xi_tilde=min(at_samples, X), stage=X, W=W)


def by_projection(
    error: ErrorGains, A_d: Array, acting: Disturbance, *, n_h: int, W_max: float
) -> SampledBounds:
    """Return the bounds while |W_hat| <= W_max at every stage: for any law and any gain.
    error : of `error_gains`.   A_d : (2, 2) error dynamics [1/s].
    W_max : radius of the projection (Frobenius) [U].
    """
    forces = (math.sqrt(n_h) * W_max,) * len(error.weights)
    at_samples, at_stages = _error(error, A_d, acting, forces)
    return SampledBounds(xi_tilde=at_samples, stage=at_stages, W=W_max)


def _error(
    error: ErrorGains, A_d: Array, acting: Disturbance, forces: tuple[float, ...]
) -> tuple[float, float]:
    """Bound |ξ̃| at the samples and at every stage, from |f_hat| of each stage."""
    e = error.start * acting.noise + error.force * (acting.residual + _norm(A_d) * acting.noise)
    e += error.rate * acting.rate
    e += sum(gamma * force for gamma, force in zip(error.weights, forces, strict=True))
    measured = e + acting.noise
    stages = [
        grown * measured
        + held * acting.known
        + sum(c * f for c, f in zip(cs, forces, strict=False))
        for grown, held, cs in error.inner
    ]
    return measured, max([measured, *stages])


def _norm(matrix: Array) -> float:
    return float(np.linalg.norm(matrix, 2))
