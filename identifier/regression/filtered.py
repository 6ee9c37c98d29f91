"""The filtered regression y = W s of dξ/dt = b + W σ: the residual force without a derivative.

ξ (2,) [U s]: axle impulse.   b = A_ξ ξ + B_ξ u (2,) [U]: its rate without the network.
σ (n_h,) [-]: hidden layer.   κ [1/s]: rate of the filters.   U: force unit.
In the Laplace domain y = κ/(s + κ) (s ξ - b) and s = κ/(s + κ) σ, so that y = W s for a constant W;
s ξ is never formed, since κ s/(s + κ) ξ = κ (ξ - ξ_f).

Sampled at T, with e = exp(-κ T) and the mean of b and σ over a step by the trapezoidal rule,
    s⁺ = e s + (1 - e) (σ + σ⁺)/2,     y⁺ = e y + (1 - e) [(ξ⁺ - ξ)/T - (b + b⁺)/2].
The mean of dξ/dt over a step is (ξ⁺ - ξ)/T whatever it does in between: only the trapezoidal rule
is approximate (T²), and where it holds, y = W s holds to round-off. `target_lag` and
`regressor_lag` are what both recursions carry, chosen such that no difference of samples is taken.
"""

from typing import Any, NamedTuple

import casadi as ca


class Pair(NamedTuple):
    """One sample of y = W s + error: regressor s (n_h,) [-] and target y (2,) [U]."""

    s: Any
    y: Any


class Lags(NamedTuple):
    """What the filters carry: target_lag (2,) [U] and regressor_lag (n_h,) [-]."""

    target_lag: Any
    regressor_lag: Any


def filtered_pair(
    lags: Lags, fresh: Any, *, xi: Any, b: Any, sigma: Any, filter_rate: Any, dt: Any
) -> tuple[Pair, Lags]:
    """Return the pair of this sample and the lags of the next.

    Parameters
    ----------
    lags : carried from the sample before.
    fresh : not zero where nothing was carried: the filters then begin here, at y = 0 and s = 0.
    xi : axle impulse (2,) [U s].
    b : rate of ξ that is known, A_ξ ξ + B_ξ u (2,) [U].
    sigma : hidden layer (n_h,).
    filter_rate : κ [1/s].
    dt : sampling interval T [s].
    """
    e = ca.exp(-filter_rate * dt)
    c, half = (1 - e) / dt, (1 - e) / 2
    p = ca.if_else(fresh, c * xi - half * b, lags.target_lag)
    q = ca.if_else(fresh, -half * sigma, lags.regressor_lag)
    pair = Pair(s=q + half * sigma, y=c * xi - p - half * b)
    carried = Lags(
        target_lag=e * p + c * (1 - e) * xi + (1 + e) * half * b,
        regressor_lag=e * q + (1 + e) * half * sigma,
    )
    return pair, carried
