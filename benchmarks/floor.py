"""The floor: a structure fitted offline to the true forces. No method with it gets below.

minimize  Σ over recordings and axles of (RMSE/rms of the true force)²  over all parameters of the
frozen model, by nonlinear least squares from several random starts.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.axle import AxleIdentifier, AxleModel
from identifier.axle.curve import EDGES
from identifier.baselines import CurveEkf, CurveModel
from identifier.reproducibility import axle_rms, counted_samples
from identifier.tire_model import TireModel
from models.recordings import Recording
from models.vehicle import Vehicle

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

STEP = 1e-6  # of the one-sided differences, for parameters of order one
GAIN = 1e-7  # a step that lowers the cost by a smaller share is the last
RIDGE = 1e-4  # of a parameter's distance to its start: 1 % of error for a hundred units of it


class Structure(NamedTuple):
    """A frozen model as a function of a vector of parameters, each of order one.

    start(rng) -> first parameters (k,).   model(parameters) -> frozen model.   lower, upper: bounds
    of the parameters (k,).
    """

    start: Callable[[np.random.Generator], Array]
    model: Callable[[Array], TireModel]
    lower: Array
    upper: Array


def fit_floor(
    structure: Structure,
    recordings: Sequence[Recording],
    *,
    rng: np.random.Generator,
    starts: int = 3,
    steps: int = 60,
) -> TireModel:
    """Return the frozen model of a structure nearest to the true forces.

    Parameters
    ----------
    structure : of a method.
    recordings : one or several, with true forces; each counts equally, each axle too.
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
        fits.append(_fitted(residual, start, structure, steps))
    return structure.model(min(fits, key=lambda fit: fit.cost).x)


def _fitted(
    residual: Callable[[Array], Array], start: Array, structure: Structure, steps: int
) -> "OptimizeResult":
    """Return SciPy's solution, from a start that is moved into the bounds."""
    from scipy.optimize import least_squares  # takes as long to import as all the rest

    lower, upper = structure.lower, structure.upper
    bounded = np.isfinite([lower, upper]).any()
    # MINPACK, which knows no bounds, counts the evaluations of differences too.
    most = steps if bounded else steps * (start.size + 1)
    return least_squares(
        residual,
        np.clip(start, lower, upper),
        bounds=(lower, upper),
        method="trf" if bounded else "lm",
        x_scale="jac",
        diff_step=STEP,
        ftol=GAIN,
        max_nfev=most,
    )


def share_of_force(model: TireModel, recording: Recording) -> Array:
    """Return the error of a frozen model as a share of the rms true force, per axle (2,) [-].

    Parameters
    ----------
    model : the model; samples below its lowest speed do not count.

    Raises
    ------
    ValueError
        Where there is no true force, or no sample counts.
    """
    share: Array = np.sqrt(np.sum(_errors(model, recording) ** 2, axis=0))
    return share


def _errors(model: TireModel, recording: Recording) -> Array:
    """Errors whose sum of squares over samples is the squared share, (n, 2)."""
    truth = recording.axle_force
    if truth is None:
        raise ValueError(f"{recording.name}: there is no true force of the axles")
    counted = counted_samples(recording, model.min_speed)
    size = axle_rms(truth, counted)
    unit = np.array([size.front, size.rear]) * np.sqrt(np.count_nonzero(counted))
    errors: Array = (model.predict(recording) - truth)[counted] / unit
    return errors


def _residual(
    parameters: Array, structure: Structure, recordings: Sequence[Recording], start: Array
) -> Array:
    model = structure.model(parameters)
    errors = [_errors(model, recording).ravel() for recording in recordings]
    return np.concatenate([*errors, RIDGE * (parameters - start)])


SCATTER = 0.3  # of starts, in standard deviations of the method's own prior


def axle_structure(method: AxleIdentifier, vehicle: Vehicle) -> Structure:
    """Return the axle identifier's: weights, and compliance, sway and offsets over their bounds."""
    n, limits = len(method.ladder), method.bounds
    W, own = method.prior.means(vehicle, method.ladder)
    offsets = (limits.steering, limits.v_y)
    scale = np.array([[limits.compliance, 1.0, offset] for offset in offsets])
    prior = method.prior.covariance(vehicle, method.ladder)
    upper = np.concatenate([np.full(2 * n, limits.weight), np.ones(6)])
    lower = -upper
    lower[2 * n + np.array([0, 1, 3, 4])] = 0.0  # compliance and share of the sway

    def start(rng: np.random.Generator) -> Array:
        scattered = W + SCATTER * method.prior.sd_shape * rng.standard_normal(W.shape)
        return np.concatenate([scattered.ravel(), (own / scale).ravel()])

    def model(parameters: Array) -> AxleModel:
        compliance, share, offset = (parameters[2 * n :].reshape(2, 3) * scale).T
        return AxleModel(
            vehicle=vehicle,
            ladder=method.ladder,
            sway=method.sway,
            plausibility=method.plausibility,
            W=parameters[: 2 * n].reshape(2, n).copy(),
            compliance=compliance,
            sway_share=share,
            offset=offset,
            covariance=prior,
            prior_covariance=prior,
            excitation=np.zeros((2, 1 + len(EDGES))),
        )

    return Structure(start, model, lower, upper)


def curve_structure(method: CurveEkf, vehicle: Vehicle) -> Structure:
    """Return the filter's own coordinates of a Magic Formula, its lag and offsets."""

    def start(rng: np.random.Generator) -> Array:
        return SCATTER * method.spread * rng.standard_normal(method.spread.size)

    def model(parameters: Array) -> CurveModel:
        return method.model(vehicle, parameters)

    return Structure(start, model, -method.limit, method.limit)
