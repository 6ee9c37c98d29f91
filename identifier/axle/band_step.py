"""The band as a part of the step: half its width around axle_force at every sample, for C.

The formula is that of `identifier.axle.band` at LEVEL, with P of the sample, as the step carries
it: the band narrows while the step learns, and stays over slip where it does not. Factors are those
of a calibration, numbers of the package; so is the white noise of the sensors, as it was where the
band was calibrated, of which the lag lets pass (1 - e)/(1 + e), e = exp(-v_x dt/σ).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.axle.band import (
    AT_SPEEDS,
    CENTERS,
    FLOOR,
    RELATIVE,
    STRETCH,
    UNKNOWN,
    BandCalibration,
)
from identifier.axle.car import larger, reciprocal, smaller, within
from identifier.axle.covariance import Factors, excited
from identifier.band import LEVEL, normal_quantile

LEAST_BEFORE = 1e-12  # static axle loads²: far below any prior's variance, and no zero in float


class BandNumbers(NamedTuple):
    """Columns (2,): c - 1; mean speed that taught [m/s]; variances of the noise of lateral velocity
    [m²/s²] and steering [rad²]; 1/sqrt(g L) [s/m].
    """

    color: Any
    speed: Any
    sideways: Any
    steering: Any
    per_froude: Any


def band_numbers(calibration: BandCalibration, froude_speed: float) -> BandNumbers:
    """Return the numbers of a step.
    froude_speed : sqrt(g L) [m/s].
    """
    return BandNumbers(
        color=calibration.color - 1.0,
        speed=np.full(2, calibration.speed),
        sideways=calibration.noise[:2] ** 2,
        steering=np.array([calibration.noise[2] ** 2, 0.0]),
        per_froude=np.full(2, 1.0 / froude_speed),
    )


def hinges(values: Array, at: Sequence[float]) -> Array:
    """Return [value at the first center, changes of slope at each but the last], (2, k).

    What is straight between centers is a sum of hinges: no table is searched.
    values : at the centers (2, k).   at : the centers (k,).
    """
    slopes = np.diff(values, axis=1) / np.diff(np.array(at))
    return np.column_stack([values[:, 0], np.diff(slopes, axis=1, prepend=0.0)])


def _hinged(numbers: list[Any], at: Sequence[float], x: Any) -> Any:
    """Return what `hinges` describe, level beyond the last center.
    numbers : of an axle, k entries.   at : the centers (k,).
    """
    x, value = smaller(x, at[-1]), numbers[0]
    for change, begin in zip(numbers[1:], at[:-1], strict=True):
        value = value + change * larger(x - begin, 0)
    return value


class AtSample(NamedTuple):
    """An axle at a sample.
    units : t, n entries.   slope : φ' [1/rad].   force : φ [static axle loads].   slip : |x| [rad].
    per_v_x : 1/v_x [s/m].   e : of the lag.   by_offset : of slip to its zero, 1 or 1/v_x.
    """

    units: list[Any]
    slope: Any
    force: Any
    slip: Any
    per_v_x: Any
    e: Any
    by_offset: Any


def half_band(
    at: AtSample,
    P: Factors,
    prior: Factors,
    numbers: BandNumbers,
    slips: list[Any],
    speeds: list[Any],
) -> Any:
    """Return half the width of the band of an axle [static axle loads].
    at : the axle at the sample.
    P, prior : factors of the covariance now and before the first sample.
    """
    h = [*at.units, ca.SX(0), ca.SX(0), at.slope * at.by_offset]
    left, before = excited(P, h, 0).a, excited(prior, h, LEAST_BEFORE).a
    per_before = reciprocal(before)
    share = smaller(left * per_before, 1)
    colored = before * share * (1 + numbers.color) * reciprocal(1 + share * numbers.color)
    left = larger(colored, left)
    stretch = within(numbers.speed * at.per_v_x, *STRETCH)
    total = ((RELATIVE * at.force) ** 2 + FLOOR**2) * stretch**2 + left
    unknown = smaller(left * per_before / UNKNOWN**2, 1)
    factor = _hinged(slips, CENTERS, at.slip)
    factor = factor * _hinged(speeds, AT_SPEEDS, numbers.per_froude * reciprocal(at.per_v_x))
    narrow, wide = factor**2, larger(factor, 1) ** 2
    slip_noise = numbers.sideways * at.per_v_x**2 + numbers.steering
    passed = at.slope**2 * slip_noise * (1 - at.e) * reciprocal(1 + at.e)
    variance = total * (narrow + unknown * (wide - narrow)) + passed
    return normal_quantile(LEVEL) * ca.sqrt(variance)
