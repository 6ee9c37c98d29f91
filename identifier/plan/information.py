"""What the axle identifier will know after a maneuver: covariance, and the error to be expected.

P⁻¹ = P₀⁻¹ + Σ h h'/R, with the regressor h and the variance R of `identifier.axle.learning`,
whose errors are taken to be alike for half a second, as those of a model are; none of it is
forgotten, as maneuvers are shorter than the memory. The figure that is made small is the
root mean square, over both axles and the slips that matter, of the standard deviation of the force
over the grip: sqrt(mean(t'P t + (φ' o)²))/μ (I-optimal design; V. V. Fedorov, Theory of Optimal
Experiments, 1972).
"""

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from codegen.arrays import Array
from identifier.axle.curve import unit_matrix
from identifier.plan.chosen import CHOSEN
from identifier.plan.motion import Motion, time_step
from identifier.plan.tires import PlausibleTires


def covariance_after(tires: PlausibleTires, motion: Motion, v_x: float) -> Array:
    """Return the covariance of all numbers of an axle after a maneuver, (m, k, 2, q, q).
    tires : k pairs of axles; their covariance is that before.   v_x : speed [m/s].
    """
    ladder, numbers = np.array(tires.method.ladder), tires.method.regression
    dt, n = CHOSEN.every * time_step(tires), ladder.size
    motion = Motion(*(one[:: CHOSEN.every] for one in motion))
    T, m, k = motion.v_y.shape
    g = np.empty((T, 2, m, k, n + 3))
    g[..., :n] = np.tanh(motion.slip[..., None] / ladder)
    g[..., n] = motion.slope * motion.of_compliance
    g[..., n + 1] = motion.slope * motion.of_share
    g[:, 0, ..., n + 2] = motion.slope[:, 0]
    g[:, 1, ..., n + 2] = motion.slope[:, 1] / v_x
    e = float(np.exp(-numbers.bandwidth * dt))
    half = 0.5 * (1.0 - e)
    h = lfilter([half, half], [1.0, -e], g, axis=0)
    y = np.einsum("taMkj,kaj->taMk", h[..., :n], tires.W)
    sigma = numbers.error + numbers.relative_error * np.abs(y)
    sigma += numbers.lateness * numbers.bandwidth * np.abs(motion.force - y)
    sigma += numbers.noise * np.maximum(motion.slope, 0.0) / v_x
    h /= (sigma * np.sqrt(CHOSEN.color * numbers.correlation_time / dt))[..., None]
    lanes = np.ascontiguousarray(h.transpose(2, 3, 1, 4, 0))
    information = lanes @ lanes.swapaxes(-1, -2)
    P: Array = np.linalg.inv(np.linalg.inv(tires.covariance) + information)
    return P


class _Doubt(NamedTuple):
    """Slips (s,) [rad] of an axle pair, (2, s), and their units t and slopes φ' per offset."""

    slips: Array
    units: Array
    zero: Array


def asked(tires: PlausibleTires, v_x: float) -> _Doubt:
    """Return where the curves are asked: evenly up to where the first one is flat.
    v_x : speed [m/s].
    """
    ladder = np.array(tires.method.ladder)
    slips = tires.slip_at(CHOSEN.flat)[0][:, None] * np.linspace(0.0, 1.0, CHOSEN.mattering + 1)[1:]
    units = np.stack([unit_matrix(one, tires.method.ladder) for one in slips])
    slope = np.einsum("asj,aj->as", (1.0 - units**2) / ladder, tires.W[0])
    return _Doubt(slips, units, slope * np.array([[1.0], [1.0 / v_x]]))


def deviation(doubt: _Doubt, P: Array) -> Array:
    """Return the standard deviation of the force at the slips asked [static loads], (..., 2, s).
    P : covariances (..., 2, q, q).
    """
    n = doubt.units.shape[-1]
    variance = np.einsum("asi,...aij,asj->...as", doubt.units, P[..., :n, :n], doubt.units)
    variance = variance + doubt.zero**2 * P[..., -1, -1, None]
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def expected_error(tires: PlausibleTires, doubt: _Doubt, P: Array) -> Array:
    """Return the expected root mean square error of the forces over the grip [-], (...,).
    P : covariances (..., 2, q, q).
    """
    relative = deviation(doubt, P) / tires.grip[0][:, None]
    return np.asarray(np.sqrt(np.mean(relative**2, axis=(-1, -2))))
