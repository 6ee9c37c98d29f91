"""Bands that know how much of the force their model misses of the drive that taught.

Learning is told a share of the force by which models err. Where the motion shows that a larger one
is missed, noise of the sensors taken off, the band is wider by as much.
"""

from dataclasses import replace

import numpy as np

from codegen.arrays import Array
from identifier.axle.band import (
    LEVEL,
    MOST,
    RELATIVE,
    BandCalibration,
    normal_quantile,
    sensor_noise,
)
from identifier.run import History, state_index
from identifier.tire_model import TireModel
from identifier.verdict.judging import judge
from identifier.verdict.motion import brisk_from, evidence
from models.recordings import Recording
from models.recordings.portion import portion


def within_band(model: TireModel, recording: Recording, level: float = LEVEL) -> Array | None:
    """Return in which share of windows of a drive the band holds what the motion shows, (2,).

    White noise of the sensors is added to the band. None where the model has none, or too little
    is driven.
    """
    recording = portion(recording).recording
    half = model.half_band_of_curves(recording, level)
    if half is None:
        return None
    found = evidence(model, recording)
    if found is None:
        return None
    half = half / np.array(model.vehicle.axle_loads)
    noise = normal_quantile(level) ** 2 * found.noise
    wide = np.sqrt(found.windows.mean(half) ** 2 + noise)
    share: Array = np.mean(np.abs(found.measured - found.modelled) <= wide, axis=0)
    return share


def calibrated(history: History, t: float | None = None) -> TireModel:
    """Return the model frozen at a time, its band calibrated; as frozen where that cannot be done.

    It cannot where the model has no band, or too little is driven.

    Parameters
    ----------
    t : time of the freeze in the recording's own clock [s]; None is the end.

    Raises
    ------
    DivergedError
        Where the law had diverged by then.
    CannotFreezeError
        Where the method estimates a signal, not a model.
    ValueError
        Where the recording begins after that time.
    """
    model, share = history.freeze(t), judge(history, t).force_missed
    if not model.has_band or share is None:
        return model
    missed, whole = np.array(share), history.recording
    if history.design.whole:
        return model.with_calibration(None, missed)
    taught = portion(whole, len(whole) if t is None else state_index(whole, t)).recording
    brisk = taught.v_x[taught.v_x >= brisk_from(model)]
    factors = np.clip(missed / RELATIVE, 1.0, MOST)
    told = BandCalibration.told(float(np.sqrt(np.mean(brisk**2))))
    return model.with_calibration(
        replace(
            told,
            factors=factors[:, None] * told.factors,
            noise=sensor_noise(taught, model.vehicle),
        ),
        missed,
    )
