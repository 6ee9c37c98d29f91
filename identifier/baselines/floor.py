"""The floor: a structure fitted offline to the true forces. No method with it gets below.

minimize  Σ over recordings and axles of (RMSE/rms of the true force)²  over all parameters of the
frozen model, by nonlinear least squares from several random starts.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identifier.baselines.least_squares import least_squares
from identifier.method import FrozenModel
from identifier.reproducibility import axle_rms, counted_samples
from models.recordings import Recording

Array = NDArray[np.float64]
RIDGE = 1e-4  # of a parameter's distance to its start: 1 % of error for a hundred units of it


class Structure(NamedTuple):
    """A frozen model as a function of a vector of parameters, each of order one.

    start(rng) -> first parameters (k,).   model(parameters) -> frozen model.   lower, upper: bounds
    of the parameters (k,).
    """

    start: Callable[[np.random.Generator], Array]
    model: Callable[[Array], FrozenModel]
    lower: Array
    upper: Array


def fit_floor(
    structure: Structure,
    recordings: Sequence[Recording],
    *,
    rng: np.random.Generator,
    starts: int = 3,
    steps: int = 60,
) -> FrozenModel:
    """Return the frozen model of a structure nearest to the true forces.

    Parameters
    ----------
    structure : from `floor_structures.structure_of`.
    recordings : one or several, with true forces; each counts equally, each axle too.
    rng : source of the starts.
    starts : how many.
    steps : downhill, at most, in each start.

    Raises
    ------
    ValueError
        Where a recording has no true forces, there is no recording, or no start.
    """
    if not recordings:
        raise ValueError("a fit needs at least one recording")
    if starts < 1:
        raise ValueError(f"starts must be at least 1, it is {starts}")
    for recording in recordings:
        if recording.axle_force is None:
            raise ValueError(f"{recording.name}: a fit needs the true forces of the axles")
    fits = []
    for _ in range(starts):
        start = structure.start(rng)
        residual = partial(_residual, structure=structure, recordings=recordings, start=start)
        fits.append(least_squares(residual, start, structure.lower, structure.upper, steps=steps))
    return structure.model(min(fits, key=lambda fit: fit.cost).parameters)


def share_of_force(model: FrozenModel, recording: Recording) -> Array:
    """Return the error of a frozen model as a share of the rms true force, per axle (2,) [-].

    Parameters
    ----------
    model : the model; samples below its lowest speed do not count.
    recording : with true forces.

    Raises
    ------
    ValueError
        Where there is no true force, or no sample counts.
    """
    share: Array = np.sqrt(np.sum(_errors(model, recording) ** 2, axis=0))
    return share


def _errors(model: FrozenModel, recording: Recording) -> Array:
    """Errors whose sum of squares over samples is the squared share, (n, 2)."""
    truth = recording.axle_force
    if truth is None:
        raise ValueError(f"{recording.name}: there is no true force of the axles")
    counted = counted_samples(recording, model.min_speed)
    size = axle_rms(truth, counted)
    unit = np.array([size.front, size.rear]) * np.sqrt(np.count_nonzero(counted))
    errors: Array = (model.axle_force(recording) - truth)[counted] / unit
    return errors


def _residual(
    parameters: Array, structure: Structure, recordings: Sequence[Recording], start: Array
) -> Array:
    model = structure.model(parameters)
    errors = [_errors(model, recording).ravel() for recording in recordings]
    return np.concatenate([*errors, RIDGE * (parameters - start)])
