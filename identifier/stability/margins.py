"""Gain and phase margin of the learning loop: through eigenvalues, and with python-control.

Gain margin: the factor on eta_W and eta_V at which the loop of `loop.py` turns unstable.
Phase margin: the phase lag in the learning path that does the same, in degrees.
For A_d = -a I both are those of the scalar loop (g/a) (c_ξ + c_z/(s + λ)) / ((s + a)(s + l)).

In functions:
dt : step of Euler [s]; None for continuous time.   A_d : (2, 2) Hurwitz error dynamics [1/s].
forgetting : λ [1/s].   direction : (2, 2) D, None for -A_d⁻ᵀ.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from codegen.arrays import Array
from identifier.paper.laws import DrivingError
from identifier.stability.loop import (
    Loop,
    eigenvalues,
    growth_rate,
    root,
    scaled_matrices,
)

_LARGEST_FACTOR = 1e6  # of gains at which a margin is looked for, either way
_AT_ONCE = 150  # points of a grid whose eigenvalues are found together


class _GainMargin(NamedTuple):
    """Where the loop turns unstable.
    factor : multiplier of the loop gain [-]; inf if none up to 1e6, 0 if unstable without gain.
    frequency : of the oscillation at the margin [rad/s]; nan if there is no margin to reach.
    """

    factor: float
    frequency: float


def gain_margin(loop: Loop, dt: float | None = None) -> _GainMargin:
    """Find the smallest factor on the gain at which the loop is unstable, with its frequency.

    Any A_d, any law, any input source: factors from 1e-6 to 1e6 are searched (150 a decade) for
    the first unstable one, and the crossing is refined to round-off.
    """

    def growth_at(log_factors: Array) -> Array:
        return growth_rate(scaled_matrices(loop, np.exp(log_factors)), dt)

    span = np.log(_LARGEST_FACTOR)
    crossing = _first_crossing(growth_at, np.linspace(-span, span, 1801), 1e-11 * _rate(loop))
    if crossing is None:
        return _GainMargin(factor=np.inf, frequency=np.nan)
    if crossing == -span:
        return _GainMargin(factor=0.0, frequency=np.nan)
    factor = float(np.exp(crossing))
    mu = eigenvalues(loop.scaled(factor).matrix())  # one of them lies on the boundary
    if dt is None:
        return _GainMargin(factor=factor, frequency=float(abs(mu[np.argmax(mu.real)].imag)))
    image = 1.0 + mu * dt
    turn = abs(np.angle(image[np.argmax(np.abs(image))]))
    return _GainMargin(factor=factor, frequency=float(turn / dt))


def phase_margin(loop: Loop, dt: float | None = None) -> float:
    """Return the smallest phase lag of the learning path that destabilizes the loop [deg].

    0 if the loop is already unstable, 180 if no lag below half a turn does it. Defined for any
    A_d: the gain G is turned to G exp(-jθ) on both channels at once.
    """

    def growth_at(angles: Array) -> Array:
        return growth_rate(scaled_matrices(loop, np.exp(-1j * angles)), dt)

    grid = np.linspace(0.0, np.pi, 721)
    crossing = _first_crossing(growth_at, grid, 1e-11 * _rate(loop))
    return 180.0 if crossing is None else float(np.degrees(crossing))


def _first_crossing(
    growth_at: Callable[[Array], Array], grid: Array, threshold: float
) -> float | None:
    """Where the growth rate first turns positive on the grid, refined; None if it never does.

    Rates within the threshold count as zero: the bracket starts at the last point below it. If
    the loop is marginal from the start (a direction that does not learn), the crossing of the
    threshold is returned instead.
    """
    growth = np.empty(0)
    while growth.size < grid.size and not np.any(growth > threshold):
        growth = np.append(growth, growth_at(grid[growth.size : growth.size + _AT_ONCE]))
    unstable = np.flatnonzero(growth > threshold)
    if unstable.size == 0:
        return None
    first = int(unstable[0])
    if first == 0:
        return float(grid[0])
    decaying = np.flatnonzero(growth[max(first - 2, 0) : first] < 0.0)
    low = grid[max(first - 2, 0) + decaying[-1]] if decaying.size else grid[first - 1]
    level = 0.0 if decaying.size else threshold

    def excess(x: float) -> float:
        return float(growth_at(np.array([x]))[0]) - level

    return root(excess, low, grid[first], xtol=1e-14, rtol=1e-14)


def _rate(loop: Loop) -> float:
    """Return the size of the loop's rates [1/s], against which a growth rate counts as zero."""
    return float(np.linalg.norm(loop.A_d, 2)) + loop.forgetting


# Slow drift under a moving regressor: where the learning loop stops being positive real.
#
# With W_t = W - W_hat and W_t' = -η D H(s)[W_t s] sᵀ, the path from the force error W_t s to the
# signal that moves the weights is H(s) = D (c_ξ + c_z/(s + λ)) (s I - A_d)⁻¹, D = -A_d⁻ᵀ. Averaging
# over a regressor of frequency ω leaves -η He H(jω): a direction in which the Hermitian part is
# negative drifts away, at any η. For A_d = -a I the integral law has
# Re H ∝ (a λ - ω²): it drifts where the maneuver is faster than sqrt(a λ).


def drift_frequency(
    *, A_d: ArrayLike, forgetting: float, law: DrivingError, direction: Array | None = None
) -> float:
    """Lowest frequency from which a regressor drifts [rad/s]; inf where H is positive real.

    For A_d = -a I: sqrt(a λ) for the integral law, inf for the instantaneous law and for the
    PI-lead law with τ >= 1/a.
    """
    A_d, (c_z, c_xi) = np.asarray(A_d), law
    D = -np.linalg.inv(A_d).T if direction is None else direction

    def relative(frequency: ArrayLike) -> Array:
        """λ_min He H with the decay of H taken out, so that round-off is no sign."""
        s = 1j * np.atleast_1d(frequency)
        resolvent = np.linalg.inv(s[:, None, None] * np.eye(2) - A_d)
        H = (c_xi + c_z / (s + forgetting))[:, None, None] * (D @ resolvent)
        hermitian = (H + H.conj().transpose(0, 2, 1)) / 2.0
        return np.linalg.eigvalsh(hermitian)[:, 0] * (size + s.imag) / reference

    size = float(np.linalg.norm(A_d, 2)) + forgetting
    reference = 1.0
    reference = float(abs(relative(0.0)[0]))
    grid = size * np.geomspace(1e-4, 1e3, 2801)
    negative = np.flatnonzero(relative(grid) < -1e-11)
    if negative.size == 0:
        return math.inf
    first = int(negative[0])
    if first == 0:
        return 0.0
    low, high = float(grid[first - 1]), float(grid[first])
    if relative(low)[0] <= 0.0:
        return low
    return root(lambda w: float(relative(w)[0]), low, high, xtol=1e-13 * size)
