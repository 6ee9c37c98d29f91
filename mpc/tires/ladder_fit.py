"""A force curve, tabulated over slip, as a ladder of tanh: a linear least-squares fit."""

from typing import NamedTuple

import numpy as np

from mpc.tires.structure import Array

UNITS = 6
NARROWEST = 0.25  # α_1 over the slip F_max/C at which the linear tire would reach the peak force
WORST = 0.02  # largest error of a fit over the largest force
SAMPLES = 400
SMALL = 1e-3  # rad; the slope at zero is read here, well above rounding


class CurveFitError(ValueError):
    """A force curve is not one that a ladder of tanh can follow."""


class Fit(NamedTuple):
    """w_j [N] of an axle, (n,), and the largest error over the largest force [-]."""

    W: Array
    error: float


def slip_grid(largest: float) -> Array:
    """Return slips from near 0 to the largest [rad], dense where the curve bends, (k,).

    Parameters
    ----------
    largest : end of the grid [rad].
    """
    grid: Array = largest * (np.arange(1, SAMPLES + 1) / SAMPLES) ** 2
    return grid


def fitted_ladder(alpha: Array, force: Array) -> tuple[Array, Array]:
    """Return slip scales α_j (n,) for curves of both axles, and w_j [N] (2, n).

    Parameters
    ----------
    alpha : slips [rad], positive and rising, (k,).
    force : of the axles at these slips [N], (2, k).

    Raises
    ------
    CurveFitError
        Where the largest error is above 2 % of the largest force.
    """
    first = min(int(np.searchsorted(alpha, SMALL)), alpha.size - 1)
    stiffness, peak = force[:, first] / alpha[first], np.abs(force).max(axis=1)
    if not (stiffness > 0.0).all():
        raise CurveFitError(f"force must rise with slip at zero, its slope is {stiffness} N/rad")
    narrowest = NARROWEST * float((peak / stiffness).min())
    ladder = np.array([narrowest * 2.0**j for j in range(UNITS)])
    fits = [fitted(alpha, curve, ladder) for curve in force]
    for name, fit in zip(("front", "rear"), fits, strict=True):
        if not fit.error <= WORST:
            raise CurveFitError(
                f"the {name} force curve is fitted to {100 * fit.error:.2g} % of its peak only"
            )
    return ladder, np.stack([fit.W for fit in fits])


def fitted(alpha: Array, force: Array, ladder: Array) -> Fit:
    """Return the weights of one curve.

    Parameters
    ----------
    alpha : slips [rad], (k,).
    force : at these slips [N], (k,).
    ladder : slip scales [rad], (n,).
    """
    T = np.tanh(alpha[:, None] / ladder)
    W = np.asarray(np.linalg.lstsq(T, force, rcond=None)[0], dtype=np.float64)
    return Fit(W, float(np.abs(T @ W - force).max() / np.abs(force).max()))
