"""Bands that hold: calibrated on segments of the drive that did not teach, by the motion alone.

Each quarter of the drive is asked of a model that was taught without it. Over windows of 0.3 s the
impulse of an axle says which force it made, with no true force; what the model misses of it, noise
of the sensors taken off, gives by range of slip, then by range of speed, the factor with which a
band of 90 % would have held there (conformal prediction). Errors follow one another: how long they
stay alike says how many of them tell something new.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array, root_mean_square
from identifier.axle.band import (
    AT_SPEEDS,
    CENTERS,
    LEAST_FACTOR,
    MOST_COLOR,
    MOST_FACTOR,
    SPEEDS,
    BandCalibration,
    ranges_of,
    sensor_noise,
)
from identifier.axle.learning import Regression
from identifier.band import LEVEL, Band, BandSpread, normal_quantile
from identifier.evidence import Evidence, evidence, modelled_force
from identifier.run import History, learn, state_index
from identifier.tire_model import TireModel
from identifier.verdict.judging import judge
from identifier.verdict.verdict import Verdict
from models.recordings import Recording
from models.recordings.evidence import Windows
from models.recordings.portion import Portion, portion
from models.vehicle import Vehicle

_SHARED = 10.0  # windows of all ranges that count in each, so that few windows decide nothing
_INDEPENDENT = 0.5  # of the windows, which overlap by half
# of an instant of another drive, over a window of a part left out, by range of slip: means hide
# errors of quick passes through zero; chosen on 256 random cars, seeds 100 to 131 and 200 to
# 231
_ELSEWHERE = (1.65, 0.68, 0.93, 1.1, 1.22, 1.35)

PARTS = 4  # of the drive, each of which is left out once


def within_band(model: TireModel, recording: Recording, level: float = LEVEL) -> Array | None:
    """Return in which share of windows of a drive the band holds what the motion shows, (2,).

    White noise of the sensors is added to the band, nothing of what is missed of this drive, by
    which any band would hold. None where the model has none, or too little is driven.
    """
    part = portion(recording)
    model = model.held_on(recording, part)
    found = evidence(model, part.recording)
    if found is None or model.band is None:
        return None
    half = model.band.of_curves(part.recording, level) / model.vehicle.axle_loads
    noise = normal_quantile(level) ** 2 * found.noise
    wide = np.sqrt(found.windows.mean(half) ** 2 + noise)
    return np.mean(np.abs(found.measured - found.modelled) <= wide, axis=0)


class ModelErrors(NamedTuple):
    """What was missed where a model was not taught, window by window, axle by axle.

    error : [static axle loads], nan where no part was left out (m, 2).   share : of the window in
    which the slip was in each range (6, m, 2).   scaled, fixed : variances of the model that was
    asked, as `BandSpread` has them, at the mean of the slip there (6, m, 2).   within : range of
    speed of the window (m,).
    """

    error: Array
    share: Array
    scaled: Array
    fixed: Array
    within: NDArray[np.intp]


def calibrated(
    history: History, t: float | None = None, verdict: Verdict | None = None
) -> TireModel:
    """Return the model frozen at a time, its band calibrated; as frozen where that cannot be done.

    It cannot where the model has no band, or too little is driven.
    t : time of the freeze in the recording's own clock [s]; None is the end.
    verdict : what `judge` said of that time; None asks it where it is needed.
    """
    model = history.freeze(t)
    if (band := model.band) is None:
        return model
    if history.method.whole:
        share = (verdict or judge(history, t)).model_error
        whole_log: TireModel = band.calibrated_by(None, None if share is None else np.array(share))
        return whole_log
    whole, start = history.recording, history.start
    frozen = state_index(whole, float(whole.t[-1]) if t is None else t)
    part = portion(whole, frozen)
    recording, n = part.recording, part.place(frozen)
    until = None if n == len(recording) else float(recording.t[n])
    found = evidence(model, recording, _road_felt(history, part))
    if found is None:
        return model

    def teach(of_parts: Recording) -> TireModel:
        return learn(of_parts, history.vehicle, history.method, start, until)

    speed = root_mean_square(found.windows.mean(recording.v_x))
    given = BandCalibration.declared(speed)
    errors = _errors_elsewhere(teach, model.vehicle, recording, found, given)
    given = replace(given, noise=sensor_noise(recording, model.vehicle))
    judged, _ = found.but_a_segment()
    found_of = calibration(errors, found.noise, found.windows, given)
    tires: TireModel = band.calibrated_by(found_of, judged.model_error)
    return tires


def _errors_elsewhere(
    teach: Callable[[Recording], TireModel],
    vehicle: Vehicle,
    recording: Recording,
    found: Evidence,
    given: BandCalibration,
) -> ModelErrors:
    """Return the errors of models that are each taught without a part of the drive, in that part.

    The parts follow one another and hold equal shares of the force (squared); in the one that is
    left out the car is made to stand, so that learning rests. There is none where there is no
    force.
    """
    windows, shape = found.windows, found.measured.shape
    speeds = windows.mean(recording.v_x) / vehicle.froude_speed
    within = np.searchsorted(SPEEDS, speeds, side="right")
    share, scaled, fixed = np.zeros((3, len(CENTERS), *shape))
    errors = ModelErrors(np.full(shape, np.nan), share, scaled, fixed, within)
    power = np.cumsum(np.sum(found.measured**2, axis=1))
    part = np.minimum((PARTS * power / (power[-1] or 1.0)).astype(np.intp), PARTS - 1)
    for k in np.unique(part) if power[-1] > 0.0 else ():
        mine = part == k
        starts, halt = windows.starts[mine], np.array(recording.v_x)
        halt[starts[0] : starts[-1] + windows.n + 1] = 0.0
        try:
            model = teach(replace(recording, v_x=halt))
        except (ArithmeticError, ValueError):
            continue
        if model.band is None:
            continue
        model = model.band.calibrated_by(given)
        assert model.band is not None
        errors.error[mine] = (found.measured - modelled_force(model, recording, windows))[mine]
        spread = _spread_by_range(model.band, recording, windows)
        for into, values in zip(errors[1:-1], spread, strict=True):
            into[:, mine] = values[:, mine]
    return errors


def _spread_by_range(
    band: Band, recording: Recording, windows: Windows
) -> tuple[Array, Array, Array]:
    """Return share, scaled and fixed of `ModelErrors`, (6, m, 2) each."""
    size, count = np.abs(band.model.lagged_slip(recording)), len(CENTERS)
    within, v_x = ranges_of(size), np.tile(windows.mean(recording.v_x), count)
    share = np.array([windows.mean(1.0 * (within == k)) for k in range(count)])
    total = np.array([windows.mean(size * (within == k)) for k in range(count)])
    slip = np.divide(total, share, out=np.zeros_like(total), where=share > 0.0)
    spread = band.spread(slip.reshape(-1, 2), v_x, band.model.vehicle.load_ratio(v_x))
    return share, spread.scaled.reshape(slip.shape), spread.fixed.reshape(slip.shape)


def calibration(
    errors: ModelErrors, noise: Array, windows: Windows, given: BandCalibration
) -> BandCalibration | None:
    """Return factors and color of errors on segments that did not teach; None: too few windows.
    noise : variance of the sensors' white noise in them (2,).
    """
    factors, speeds = (
        np.ones((2, len(CENTERS))),
        np.ones((2, len(AT_SPEEDS))),
    )
    for i in range(2):
        known = np.isfinite(errors.error[:, i])
        share, *spread = (values[:, known, i] for values in errors[1:-1])
        needed = BandSpread(*spread).needed_factor(errors.error[known, i], noise[i])
        everywhere = quantile(needed.ravel(), share.ravel())
        if not np.isfinite(everywhere):
            continue
        squares = np.array([_shared(*pair, everywhere) for pair in zip(needed, share, strict=True)])
        factors[i] = _ELSEWHERE * np.sqrt(squares)
        needed = needed / np.maximum(squares[:, None], LEAST_FACTOR**2)
        for k in range(len(AT_SPEEDS)):
            mine = errors.within[known] == k
            speeds[i, k] = np.sqrt(_shared(needed[:, mine].ravel(), share[:, mine].ravel(), 1.0))
    if (factors == 1.0).all():
        return None
    color = [color_of(errors.error[:, i], windows) for i in range(2)]
    return replace(
        given,
        factors=np.clip(factors, LEAST_FACTOR, MOST_FACTOR),
        speeds=np.clip(speeds, LEAST_FACTOR, MOST_FACTOR),
        color=np.array(color),
    )


def _shared(values: Array, share: Array, everywhere: float) -> float:
    """Return the quantile of a range, `_SHARED` windows of all ranges counted in."""
    here, count = quantile(values, share), float(share.sum())
    return (
        (count * here + _SHARED * everywhere) / (count + _SHARED)
        if np.isfinite(here)
        else everywhere
    )


def quantile(values: Array, share: Array) -> float:
    """Return what the next value stays below in a share `LEVEL` of cases; inf: too few to tell.
    values : of windows that overlap by half (m,).   share : of each that counts (m,).
    """
    order = np.argsort(values)
    count = np.cumsum(share[order])
    total = float(count[-1]) if count.size else 0.0
    # As if one more window were farther out than all.
    needed = LEVEL * (total + 1.0 / _INDEPENDENT)
    at = int(np.searchsorted(count, needed))
    return float(values[order[at]]) if at < values.size else float("inf")


def color_of(error: Array, windows: Windows) -> float:
    """Return how much longer errors are correlated than learning is given, at least 1.

    The sum of their autocorrelation, over windows that do not overlap, until it is first not
    positive.
    error : of the windows, nan where nothing was asked (m,).
    """
    step = max(1, windows.n // 2)
    place = np.round(windows.starts / step).astype(np.intp)
    series = np.full(int(place.max()) + 1, np.nan)
    series[place] = error
    known = np.isfinite(series)
    value = np.where(known, series, 0.0)
    power, total = float(np.mean(value[known] ** 2)), 1.0
    for lag in range(2, len(series) // 4, 2):
        pairs = known[lag:] & known[:-lag]
        if not pairs.any():
            break
        alike = float(np.mean((value[lag:] * value[:-lag])[pairs])) / max(power, 1e-12)
        if alike <= 0.0:
            break
        total += 2.0 * alike
    return float(np.clip(total * windows.duration / Regression().correlation_time, 1.0, MOST_COLOR))


def _road_felt(history: History, part: Portion) -> Array | None:
    """Return what a banked road pushed over a portion of a run (k,) [weights]; None unknown."""
    method = history.method
    without = part.recording.logged_v_y is None
    if method.accelerometer is None or ("v_y" in method.needs) == without:
        return None  # it was learnt of another motion than that which is asked
    pushes = []
    for block in history.blocks(part.samples):
        first, last = np.searchsorted(part.samples, [block.part.start, block.part.stop])
        mine = part.samples[first:last] - block.part.start
        pushes.append(method.accelerometer.beside_force(block.state)[mine])
    return np.concatenate(pushes)
