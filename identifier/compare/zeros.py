"""Every method on the same terms: a log's own sensors for models that do not find them.

Gauss-Newton with Student's loss on what the forces miss of the motion in windows of 0.3 s, over
the numbers of `identifier.day`, so that a comparison is one of tires.
"""

import numpy as np

from codegen.arrays import Array
from identifier.day import ENOUGH, NUMBERS, WHERE, Day, corrected
from identifier.estimate.priors import Priors
from identifier.evidence import brisk_from, brisk_windows, measured_force
from identifier.tire_model import TireModel
from models.recordings import Recording
from models.recordings.portion import portion
from models.vehicle import GRAVITY

_ITERATIONS, _STEP = 4, 0.1  # of Gauss-Newton; prior deviations of a difference
_NU = 4.0  # degrees of freedom of the loss
_SIZE = 0.02, 0.04  # of what a good model misses: of a static load, of the force
_MEMORY = 1.0  # [s] for which it is alike


def replayed(model: TireModel, recording: Recording) -> Array:
    """Return the axle forces of a log, errors of its sensors taken off (n, 2) [N]."""
    if model.days(recording):
        return model.predict(recording)
    return model.predict(zeros(model, recording).corrected(recording))


def zeros(model: TireModel, recording: Recording) -> Day:
    """Return the errors of a log's sensors with which tires explain its motion best."""
    part, vehicle, slowest = portion(recording).recording, model.vehicle, brisk_from(model)
    priors = Priors.of(vehicle)
    prior = priors.information[np.ix_(WHERE, WHERE)]
    sd = priors.sd[WHERE]
    windows = brisk_windows(part, slowest)
    value = np.zeros(len(NUMBERS))
    P = np.asarray(np.linalg.inv(prior), np.float64)
    enough = len(windows) * windows.duration / 2.0 >= ENOUGH and part.logged_v_y is not None
    if enough:
        measured = measured_force(part, vehicle, windows)
        turning = np.abs(windows.mean(part.v_x * part.r)) / GRAVITY
        size = np.hypot(_SIZE[0], _SIZE[1] * turning)[:, None]
        weight = 0.5 * windows.duration / _MEMORY

        def missed(of: Array) -> Array:
            force = windows.mean(model.predict(corrected(part, of)) / vehicle.axle_loads)
            return np.nan_to_num((measured - force) / size, nan=1e3)

        e = missed(value)
        for _ in range(_ITERATIONS):
            J = np.stack(
                [
                    (missed(value + _STEP * sd * one) - e) / (_STEP * s)
                    for one, s in zip(np.eye(len(NUMBERS)), sd, strict=True)
                ],
                axis=2,
            ).reshape(-1, len(NUMBERS))
            scale = np.maximum(np.median(np.abs(e)) / 0.6745, 0.25) ** 2
            w = weight * (_NU + 1.0) / (_NU * scale + e.ravel() ** 2)
            P = np.asarray(np.linalg.inv(J.T @ (w[:, None] * J) + prior), np.float64)
            step = -P @ (J.T @ (w * e.ravel()) + prior @ value)
            value = value + step
            e = missed(value)
            if (np.abs(step) < 0.02 * sd).all():
                break
    driven = part.v_x[part.v_x >= slowest]
    return Day.of(value, P, (np.zeros(len(NUMBERS)), sd), driven, anew=enough)
