"""Gains of the paper's laws that follow from a car and how it is driven.

1. a = λ = Ω / tan(22.5°): the filter chain 1/((s + a)(s + λ)) lags 45° at the bandwidth Ω, and the
   drift frequency sqrt(a λ) is 2.4 Ω. a dt <= 0.2, so that a step of Euler resolves the poles.
2. The loop gain g gives the sampled loop a phase margin of 60°: for A_d = -a I the loop is
   (g/a) (c_ξ + c_z/(s + λ))/((s + a) s), s = (exp(jω dt) - 1)/dt.
3. η_W = g/n_h: the margin holds at the worst regressor |s|² = n_h.
4. ρ_W: the force that W can hold against its leakage is 4 times the expected residual at
   |s|² = n_h: all of it at half-open units, s_i = 1/2.
5. η_V = η_W/(x_bar_max W_max)², where V costs no margin, or less, where |V| would pass V_max;
   ρ_V keeps |V| <= V_max. W_max is the proven bound on |W|.
"""

import math
from cmath import phase
from dataclasses import replace

import numpy as np

from codegen.errors import TireidError
from identifier.paper.laws import DrivingError, Gains, Law, diagonal
from identifier.stability.loop import root
from identifier.stability.operation import Operation
from identifier.stability.sampled_bound import by_leakage, error_gains, output_layer

LAG_RULE = 1.0 / math.tan(math.radians(22.5))  # a/Ω for 45° of lag through two equal poles
FASTEST = 0.2  # largest a dt
PHASE_MARGIN = math.radians(60.0)
CAPACITY = 4.0  # of the leakage, over the expected residual


class DesignError(TireidError, ValueError):
    """A car's gains do not exist at this sampling interval."""


def gains_for(law: Law, known: Operation) -> Gains:
    """Return the gains of a law, which has the lead τ = 1/a where it uses one.
    known : where it runs; its network reads the measured state.
    """
    dt, n_h = known.dt, known.n_h
    a = LAG_RULE * 2.0 * math.pi * known.bandwidth
    if not a * dt <= FASTEST:
        raise DesignError(
            f"a dt must not pass {FASTEST}, it is {a * dt:.3g}: sample every "
            f"{1e3 * FASTEST / a:.3g} ms"
        )
    lead, A_d = law.lead / a, diagonal(a)
    error = law.error(lead)
    c_z, c_xi = error
    g = _loop_gain(a, error, dt)
    eta_W = g / n_h
    rho_W = g * (c_z / a + c_xi) / (a * CAPACITY * known.needed_force)
    free = Gains(A_d=A_d, forgetting=a, eta_W=eta_W, eta_V=0.0, rho_W=rho_W, rho_V=0.0)
    D = np.eye(2) / a  # of every law for A_d = -a I
    learning = output_layer(free, error, D, n_h=n_h, dt=dt)
    bounds = by_leakage(error_gains(free.matrix, dt), learning, free.matrix, known.disturbance, n_h)
    if bounds is None:
        raise DesignError(
            f"nothing is proven of these gains: rho_W = {rho_W:.3g} leaks too much in "
            f"{1e3 * dt:g} ms"
        )
    driven = bounds.W * known.x_bar_max / a  # what drives V, over η_V
    memory = c_z * driven * bounds.X / a**2  # what z alone can move V by, over η_V
    eta_V = eta_W / (known.x_bar_max * bounds.W) ** 2
    if memory > 0.0:
        eta_V = min(eta_V, 0.5 * known.V_start / memory)
    unit = learning._replace(drive=eta_V * driven, leakage=1.0, dt=0.0)
    by_memory = unit.kept(bounds.X) - unit.kept(0.0)
    rho_V = unit.kept(0.0) / (known.V_start - by_memory)
    return replace(free, eta_V=eta_V, rho_V=rho_V, lead=lead)


def _loop_gain(a: float, law: DrivingError, dt: float) -> float:
    """Return the loop gain g that gives the sampled loop of A_d = -a I, λ = a its phase margin.

    The frequency where its phase is PM - 180° is found, g is the inverse of its magnitude there.
    """
    c_z, c_xi = law

    def factors(frequency: float) -> tuple[complex, complex, complex, complex]:
        s = (np.exp(1j * frequency * dt) - 1.0) / dt
        if c_z == 0.0:
            return s, s + a, 1.0 + 0.0j, c_xi + 0.0j
        return s, s + a, s + a, c_z + c_xi * (s + a)

    def excess(frequency: float) -> float:
        """Phase above PM - 180°, summed by factors so that it never wraps."""
        first, second, third, zero = factors(frequency)
        lag = phase(first) + phase(second) + phase(third)
        return math.pi - PHASE_MARGIN - lag + phase(zero)

    highest = math.pi / dt * (1.0 - 1e-9)
    crossing = root(excess, 1e-9 * a, highest, xtol=1e-14 * a, rtol=1e-14)
    first, second, third, zero = factors(crossing)
    return float(a * abs(first * second * third / zero))
