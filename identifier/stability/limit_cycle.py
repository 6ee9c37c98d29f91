"""Beyond the gain limit: the leakage ρ |ξ̃| stops the growth, and a limit cycle remains.

For A_d = -a I there are two orbits. An error that goes round a circle has a constant |ξ̃| and the
leakage rate l = ρ |ξ̃| = m:

    (s + a)(s + λ)(s + m) + g/a = 0, s = jω: a (m + a)(m + λ)(a + λ) = g, ω² = aλ + m (a + λ).

One that swings along a line, ξ̃ ~ cos ωt, has p = f_hat ~ the same turned by ψ = arg(s + a) + π.
Harmonic balance of the leakage |ξ̃| p, whose mean and second harmonic both act on the first, turns
the leakage rate into m (1 + exp(-2jψ)/3), m = ρ mean|ξ̃|:

    s (s + a)(s + λ) + m (s + λ)[(s + a) + conj(s + a)/3] + g/a = 0,

ω² = aλ + m (4a + 2λ)/3, and m solves a quadratic. The orbit with the larger mean |ξ̃| is the stable
one, as simulation shows: the circle while λ < 0.36 a or so, the line beyond; where they meet the
orbits are ellipses between the two, which differ by 1 % there. The formulas hold while the residual
|f| is small against the capacity g/(a λ ρ): an offset |f|/capacity of the amplitude is neglected.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from codegen.errors import TireidError
from identifier.stability.limits import integral_euler_limit, integral_limit
from identifier.stability.loop import root
from models.rules import require_positive


class NoLimitCycleError(TireidError, ValueError):
    """The gain is within its limit, or no leakage can hold it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitCycle:
    """A limit cycle of the integral law.

    Parameters
    ----------
    leakage : mean leakage rate m [1/s].
    amplitude : mean |ξ̃| [U s].
    frequency : ω [rad/s].
    """

    leakage: float
    amplitude: float
    frequency: float


def limit_cycle(*, a: float, lam: float, g: float, rho_W: float) -> LimitCycle:
    """Amplitude and frequency of the limit cycle in continuous time, A_d = -a I.

    Parameters
    ----------
    a : decay rate of A_d = -a I [1/s].
    lam : forgetting factor λ [1/s].
    g : loop gain λ_max(G) [1/s⁴].
    rho_W : leakage gain of (11) [1/(U s²)].

    Raises
    ------
    NoLimitCycleError
        If g is not above the limit.
    """
    _require_beyond(g, integral_limit(a, lam), rho_W)
    return max(
        (_line(a, lam, g, rho_W), _circle(a, lam, g, rho_W)), key=lambda orbit: orbit.amplitude
    )


def _line(a: float, lam: float, g: float, rho_W: float) -> LimitCycle:
    """Return the orbit along a line, in continuous time."""
    square, linear = (8.0 * a + 4.0 * lam) / 9.0, (4.0 * a**2 + 4.0 * a * lam + 2.0 * lam**2) / 3.0
    constant = a * lam * (a + lam) - g / a  # negative beyond the limit
    m = (-linear + math.sqrt(linear**2 - 4.0 * square * constant)) / (2.0 * square)
    frequency = math.sqrt(a * lam + m * (4.0 * a + 2.0 * lam) / 3.0)
    return LimitCycle(leakage=m, amplitude=m / rho_W, frequency=frequency)


def _circle(a: float, lam: float, g: float, rho_W: float) -> LimitCycle:
    """Return the orbit round a circle, in continuous time."""
    constant = a * lam - g / (a * (a + lam))  # of m² + m (a + λ) + constant, negative
    m = (-(a + lam) + math.sqrt((a + lam) ** 2 - 4.0 * constant)) / 2.0
    return LimitCycle(leakage=m, amplitude=m / rho_W, frequency=math.sqrt(a * lam + m * (a + lam)))


def sampled_limit_cycle(*, a: float, lam: float, g: float, rho_W: float, dt: float) -> LimitCycle:
    """Amplitude and frequency of the limit cycle when the identifier is stepped with Euler.

    The same balances with s = (exp(jω dt) - 1)/dt: the imaginary part gives m, the real part ω.

    Parameters
    ----------
    a : decay rate of A_d = -a I [1/s].
    lam : forgetting factor λ [1/s].
    g : loop gain λ_max(G) [1/s⁴].
    rho_W : leakage gain of (11) [1/(U s²)].
    dt : step [s].

    Raises
    ------
    NoLimitCycleError
        If g is not above the sampled limit, or so large that no leakage holds it.
    """
    limit = integral_euler_limit(a, lam, dt)
    _require_beyond(g, limit, rho_W)

    found = [
        orbit
        for kind in (_line_leak, _circle_leak)
        if (orbit := _sampled(kind, a, lam, g, rho_W, dt))
    ]
    if not found:
        raise NoLimitCycleError(f"g = {g:.4g} is more than leakage can hold at dt = {dt} s")
    return max(found, key=lambda orbit: orbit.amplitude)


def _line_leak(s: complex, a: float, lam: float) -> complex:
    """What m multiplies on a line."""
    return (s + lam) * ((s + a) + (s + a).conjugate() / 3.0)


def _circle_leak(s: complex, a: float, lam: float) -> complex:
    """What m multiplies on a circle."""
    return (s + lam) * (s + a)


def _sampled(
    leak: Callable[[complex, float, float], complex],
    a: float,
    lam: float,
    g: float,
    rho_W: float,
    dt: float,
) -> LimitCycle | None:
    """Return an orbit of the Euler step, or None where the leakage has none."""

    def balance(frequency: float) -> tuple[float, float]:
        """Return m, and the real part that is left over."""
        s = complex(np.expm1(1j * frequency * dt)) / dt
        free, leaked = s * (s + a) * (s + lam), leak(s, a, lam)
        m = -free.imag / leaked.imag
        return m, (free + m * leaked).real + g / a

    frequencies = np.geomspace(0.1 * math.sqrt(a * lam), 0.9 * math.pi / dt, 2000)
    found = [balance(float(w)) for w in frequencies]
    for low, high, here, ahead in zip(
        frequencies[:-1], frequencies[1:], found[:-1], found[1:], strict=True
    ):
        if ahead[0] > 0.0 and here[1] > 0.0 >= ahead[1]:
            frequency = root(lambda w: balance(w)[1], low, high)
            m = balance(frequency)[0]
            return LimitCycle(leakage=m, amplitude=m / rho_W, frequency=frequency)
    return None


def _require_beyond(g: float, limit: float, rho_W: float) -> None:
    """Check that there is a cycle to find."""
    require_positive(ValueError, g=g, rho_W=rho_W)
    if not g > limit:
        raise NoLimitCycleError(f"g = {g:.6g} is within the limit {limit:.6g}: no limit cycle")
