"""Design the other way round: from what the car does to gains with a wanted phase margin.

1. a = λ = Ω / tan(22.5°): the filter chain 1/((s + a)(s + λ)) lags 45° at the bandwidth Ω, and the
   drift frequency sqrt(a λ) is 2.4 Ω. a dt <= 0.2, so that a step of Euler resolves the poles.
2. The loop gain g gives the sampled loop its phase margin (unlimited time: for a = λ and the
   integral law g = a⁴ x (1 + x²), x = tan((90° - PM)/2); 0.287 a⁴ for 60°, 0.485 a⁴ for 45°).
3. η_W = g/n_h: the margin holds at the worst regressor |s|² = n_h.
4. ρ_W: the force that W can hold against its leakage is `capacity` times the expected residual at
   |s|² = n_h (so that 4 leaves all of it at half-open units, s_i = 1/2).
5. η_V = η_W/(x_bar_max W_max)², where V costs no margin, or less, where |V| would pass V_max;
   ρ_V keeps |V| <= V_max. W_max is the proven bound on |W|.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from codegen.errors import TireidError
from identifier.paper.laws import DrivingError, Gains, diagonal
from identifier.stability.bounds import small_gain
from identifier.stability.chosen import CHOSEN
from identifier.stability.loop import root
from identifier.stability.operation import Operation
from identifier.stability.sampled_bound import (
    Disturbance,
    Learning,
    by_leakage,
    error_gains,
    output_layer,
)
from models.rules import require_positive


class DesignError(TireidError, ValueError):
    """What is asked of the gains cannot be had at this sampling interval."""


def _gain_for_phase_margin(
    *, a: float, lam: float, law: DrivingError, phase_margin: float, dt: float | None = None
) -> float:
    """Loop gain g that gives the scalar loop (A_d = -a I, no leakage) its phase margin, exactly.

    The loop is (g/a) (c_ξ + c_z/(s + λ))/((s + a) s); the frequency where its phase is PM - 180° is
    found by bisection, g is the inverse of its magnitude there.
    a : decay rate [1/s].   lam : forgetting factor λ [1/s].
    phase_margin : wanted [deg], above 0 and below 90.
    dt : step of explicit Euler [s]; None for continuous time (RK4 at a dt <= 0.2 comes to it).
    """
    require_positive(ValueError, a=a, lam=lam)
    if not 0.0 < phase_margin < 90.0:
        raise DesignError(f"the phase margin must be in (0, 90) deg, it is {phase_margin}")
    c_z, c_xi = law

    def factors(frequency: float) -> tuple[complex, complex, complex, complex]:
        s = 1j * frequency if dt is None else (np.exp(1j * frequency * dt) - 1.0) / dt
        if c_z == 0.0:
            return s, s + a, 1.0 + 0.0j, c_xi + 0.0j
        return s, s + a, s + lam, c_z + c_xi * (s + lam)

    def excess(frequency: float) -> float:
        """Phase above PM - 180°, summed by factors so that it never wraps."""
        first, second, third, zero = factors(frequency)
        lag = sum(math.atan2(pole.imag, pole.real) for pole in (first, second, third))
        return math.pi - math.radians(phase_margin) - lag + math.atan2(zero.imag, zero.real)

    highest = 1e6 * (a + lam) if dt is None else math.pi / dt * (1.0 - 1e-9)
    if not excess(highest) < 0.0:
        raise DesignError(f"every gain has a phase margin above {phase_margin} deg")
    crossing = root(excess, 1e-9 * a, highest, xtol=1e-14 * a, rtol=1e-14)
    first, second, third, zero = factors(crossing)
    return float(a * abs(first * second * third / zero))


def decay_rate(bandwidth: float, minimal_decay: float = 0.0) -> float:
    """Return a = λ of rule 1 [1/s].
    bandwidth : highest frequency of steering that matters [Hz].
    minimal_decay : smallest a that the network's input allows [1/s]; a keeps 1.5 times it.
    """
    return max(CHOSEN.lag_rule * 2.0 * math.pi * bandwidth, 1.5 * minimal_decay)


def design_gains(
    *,
    law: DrivingError,
    bandwidth: float,
    dt: float,
    n_h: int,
    x_bar_max: float,
    disturbance: Disturbance,
    needed_force: float,
    V_max: float,
    phase_margin: float = 60.0,
    capacity: float = 4.0,
    integrator: str = "euler",
    minimal_decay: float = 0.0,
) -> Gains:
    """Gains for a maneuver bandwidth and a wanted phase margin; the rules are those of the module.
    bandwidth : highest frequency of steering that matters [Hz].   dt : sampling interval T_s [s].
    needed_force : that the network is expected to hold [U].
    phase_margin : wanted phase margin of the sampled loop at the worst regressor [deg].
    capacity : force that W can hold at |s|² = n_h, in units of needed_force.
    integrator : "euler" or "rk4", as in the step.
    minimal_decay : smallest a that the network's input allows [1/s]; a keeps 1.5 times it.
    """
    require_positive(
        ValueError, bandwidth=bandwidth, dt=dt, x_bar_max=x_bar_max, needed_force=needed_force,
        V_max=V_max, capacity=capacity,
    )  # fmt: skip
    a = decay_rate(bandwidth, minimal_decay)
    if not a * dt <= CHOSEN.fastest:
        raise DesignError(
            f"a dt must not pass {CHOSEN.fastest}, it is {a * dt:.3g}: sample every "
            f"{1e3 * CHOSEN.fastest / a:.3g} ms, or ask for a bandwidth of "
            f"{CHOSEN.fastest / (CHOSEN.lag_rule * 2.0 * math.pi * dt):.3g} Hz"
        )
    lam, A_d = a, diagonal(a)
    g = _gain_for_phase_margin(
        a=a, lam=lam, law=law, phase_margin=phase_margin, dt=dt if integrator == "euler" else None
    )
    eta_W = g / n_h
    theta = small_gain(A_d, law=law, forgetting=lam, eta_W=eta_W, n_h=n_h)
    if not theta < 1.0:
        raise DesignError(f"ask for a larger phase margin: at {phase_margin} deg θ = {theta:.3g}")
    c_z, c_xi = law
    drive = c_z / lam + c_xi
    rho_W = g * drive / (a * capacity * needed_force)
    free = Gains(A_d=A_d, forgetting=lam, eta_W=eta_W, eta_V=0.0, rho_W=rho_W, rho_V=0.0)
    D = np.eye(2) / a  # of every law for A_d = -a I
    learning = output_layer(free, law, D, n_h=n_h, integrator=integrator, dt=dt)
    error = error_gains(free.matrix, integrator, dt)
    bounds = by_leakage(error, learning, free.matrix, disturbance, n_h)
    if bounds is None:
        raise DesignError(
            f"nothing is proven of these gains: at {phase_margin} deg θ = {theta:.3g}, and "
            f"rho_W = {rho_W:.3g} leaks too much in {1e3 * dt:g} ms"
        )
    widest = bounds.W + max(learning.beyond(bounds.stage))  # at the inner stages of RK4
    layer = replace(learning, drive=widest * x_bar_max / a)  # g2/η_V
    memory = c_z * layer.drive * bounds.stage / lam**2  # what z alone can move V by, per η_V
    eta_V = eta_W / (x_bar_max * bounds.W) ** 2
    if memory > 0.0:
        eta_V = min(eta_V, 0.5 * V_max / memory)
    rho_V = _leakage_of_V(replace(layer, drive=eta_V * layer.drive), V_max, bounds.stage)
    return Gains(
        A_d=A_d,
        forgetting=lam,
        eta_W=eta_W,
        eta_V=eta_V,
        rho_W=rho_W,
        rho_V=rho_V,
        lead=c_xi if c_z > 0.0 else 0.0,
    )


def _leakage_of_V(layer: Learning, V_max: float, X: float) -> float:
    """ρ_V that keeps |V| <= V_max."""
    if not layer.staged:
        unit = replace(layer, leakage=1.0, dt=0.0)
        memory = unit.kept(X) - unit.kept(0.0)
        return unit.kept(0.0) / (V_max - memory)
    most = 1.0 / (layer.dt * X)

    def excess(rho_V: float) -> float:
        return replace(layer, leakage=rho_V).kept(X) - V_max

    weakest = _leakage_of_V(replace(layer, staged=False), V_max, X)
    strongest = min(2.0 * weakest, 0.5 * (weakest + most))
    if excess(strongest) > 0.0:
        raise DesignError(f"no leakage keeps |V| below {V_max:.3g} at this sampling interval")
    return root(excess, weakest, strongest, xtol=1e-14 * weakest, rtol=1e-14)


# What keeps the weights of the paper's network over hours of driving, by name.
#
# "leakage" is the paper's (11)-(12): it never rests, so that sensor noise, and every error that the
# network cannot learn, takes the weights to zero in hours of calm driving. "dead_zone" lets only
# that leak which lies beyond a ball; "projection" has no leakage, and keeps the weights in the same
# ball.
#
# The ball of W has twice the smallest weights that hold the force which the linear tire is expected
# to miss, every unit saturated: those of units that are half open. That of V has twice the norm
# that random first weights are expected to have. Neither reads anything but the car and its
# driving.

KEEPINGS: Mapping[str, Callable[[Gains, Operation], Gains]] = {
    "leakage": lambda gains, _: gains,
    "dead_zone": lambda gains, known: replace(gains, W_free=known.W_large, V_free=known.V_start),
    "projection": lambda gains, known: replace(
        gains, rho_W=0.0, rho_V=0.0, W_max=known.W_large, V_max=known.V_start
    ),
}
DEFAULT_KEEPING = "projection"  # of designs that are found
