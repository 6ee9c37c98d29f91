"""Closed-form gain limits for A_d = -a I, where the loop splits into two equal scalar loops.

Integral law: (s + a)(s + λ)(s + l) + g/a = 0 (Routh).   Instantaneous: (s + a)(s + l) + g/a = 0.
Explicit Euler: the same with s = (w - 1)/T (Jury).   g = λ_max(G), l = leakage rate, all in 1/s.
"""

import math


def integral_limit(a: float, lam: float, leakage: float = 0.0) -> float:
    """G below which the integral law is stable: a (l + a)(l + λ)(a + λ); l = 0: a² λ (a + λ).

    Parameters
    ----------
    a : decay rate of A_d = -a I [1/s].
    lam : forgetting factor λ [1/s].
    leakage : l [1/s].
    """
    return a * (leakage + a) * (leakage + lam) * (a + lam)


def critical_frequency(a: float, lam: float, leakage: float = 0.0) -> float:
    """sqrt(l a + l λ + a λ) [rad/s], at which the integral law oscillates at its limit.

    Parameters
    ----------
    a : decay rate of A_d = -a I [1/s].
    lam : forgetting factor λ [1/s].
    leakage : l [1/s].
    """
    return math.sqrt(leakage * a + leakage * lam + a * lam)


def integral_euler_limit(a: float, lam: float, dt: float, leakage: float = 0.0) -> float:
    """G below which the integral law is stable when stepped with explicit Euler (exact).

    With α = 1 - aT, β = 1 - λT, γ = 1 - lT and k = T³ g/a the characteristic polynomial is
    (w - α)(w - β)(w - γ) + k; a complex pair reaches the unit circle at
    k = αβγ + [-(α+β+γ) + sqrt((α+β+γ)² - 4(αβ+αγ+βγ) + 4)]/2, a real root reaches -1 at
    k = (1+α)(1+β)(1+γ); the smaller one counts. The sampling costs 11-32 % of the limit at
    usual rates.

    Parameters
    ----------
    a : decay rate of A_d = -a I [1/s].
    lam : forgetting factor λ [1/s].
    dt : step T [s].
    leakage : l [1/s].
    """
    al, be, ga = 1.0 - a * dt, 1.0 - lam * dt, 1.0 - leakage * dt
    total, pairs = al + be + ga, al * be + al * ga + be * ga
    pair_on_circle = al * be * ga + (-total + math.sqrt(total**2 - 4.0 * pairs + 4.0)) / 2.0
    root_at_minus_one = (1.0 + al) * (1.0 + be) * (1.0 + ga)
    return min(pair_on_circle, root_at_minus_one) * a / dt**3


def instantaneous_damping(a: float, g: float, leakage: float = 0.0) -> float:
    """Damping ratio of the instantaneous law, (a + l) / (2 sqrt(a l + g/a)); l = 0: sqrt(a³/g)/2.

    It has no gain limit in continuous time (A_d symmetric), but its damping falls with g.

    Parameters
    ----------
    a : decay rate of A_d = -a I [1/s].
    g : loop gain λ_max(G).
    leakage : l [1/s].
    """
    return (a + leakage) / (2.0 * math.sqrt(a * leakage + g / a))


def instantaneous_euler_limit(a: float, dt: float, leakage: float = 0.0) -> float:
    """G below which the instantaneous law is stable with explicit Euler: a (a + l - a l T)/T.

    (w - α)(w - γ) + T² g/a has the product of its roots αγ + T² g/a < 1; l = 0: a²/T.

    Parameters
    ----------
    a : decay rate of A_d = -a I [1/s].
    dt : step T [s].
    leakage : l [1/s].
    """
    return a * (a + leakage - a * leakage * dt) / dt
