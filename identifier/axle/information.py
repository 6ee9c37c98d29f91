"""What a drive tells of the tires as numbers that add up: information matrix and vector.

The regression y = h'θ + e, θ = [w, s, k, offset] per axle, is that of learning, taken at a
reference θ₀ that stays (`build_evidence`): slip, its lag and the variances R of e then do not
depend on what is learnt, and over the samples of a drive, without forgetting,

    Λ = Σ h h'/R,   η = Σ h y/R,   c = Σ y²/R,   n = Σ 1

say all there is to say of θ (Fisher's sufficient statistics; the information filter of D. Simon,
Optimal State Estimation, 2006, section 6.2). They add up: those of many drives are the sum of
theirs, whoever computed them and in whatever order. In w, at the lag of the reference, that is
exact; in s, k and the offsets y is replaced by its tangent at θ₀ (Gauss-Newton), so that a
reference close to the tires matters: a merged model is the next one.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.axle.bank import SlopeState
from identifier.axle.car import car_numbers, downforce_numbers
from identifier.axle.curve import EDGES, doublings
from identifier.axle.design import AxleIdentifier
from identifier.axle.gate import GateState
from identifier.axle.model import AxleModel
from identifier.axle.prior import friction_direction
from identifier.axle.slip import SensitivityState, SwayState
from identifier.axle.step import EVIDENCE_CARRY, LEARNING_OVER, build_evidence
from identifier.setup import Setup
from models.recordings import Recording
from models.vehicle import Vehicle

STEP = 0.05  # s between samples that are added: a fifth of the filter's time constant loses nothing
CHUNK = 4000  # added samples that are held at once
TOGETHER = 64  # drives whose sum is held as they are


@dataclass(frozen=True, slots=True, kw_only=True)
class Information:
    """What drives tell of an axle model at a reference, rows front and rear.

    Parameters
    ----------
    matrix : Λ [1/θ²], (2, q, q).
    vector : η [1/θ], (2, q).
    square : c [-], (2,).
    samples : n, those that count once their errors are alike over a correlation time [-].
    seconds : time of learning [s].

    Raises
    ------
    ValueError
        Where shapes do not fit or a number is not finite.
    """

    matrix: Array
    vector: Array
    square: Array
    samples: float
    seconds: float

    def __post_init__(self) -> None:
        q = self.vector.shape[-1]
        for name, shape in (("matrix", (2, q, q)), ("vector", (2, q)), ("square", (2,))):
            value = getattr(self, name)
            if value.shape != shape:
                raise ValueError(f"{name} must have shape {shape}, it has {value.shape}")
            if not np.isfinite(value).all():
                raise ValueError(f"{name} holds a number that is not finite")
        for name in ("samples", "seconds"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise ValueError(f"{name} must not be negative, it is {value}")

    @classmethod
    def nothing(cls, q: int) -> "Information":
        """Return what no drive tells.

        Parameters
        ----------
        q : parameters of an axle.
        """
        return cls(
            matrix=np.zeros((2, q, q)),
            vector=np.zeros((2, q)),
            square=np.zeros(2),
            samples=0.0,
            seconds=0.0,
        )

    def __add__(self, other: "Information") -> "Information":
        """Return what both tell together."""
        return Information(
            matrix=self.matrix + other.matrix,
            vector=self.vector + other.vector,
            square=self.square + other.square,
            samples=self.samples + other.samples,
            seconds=self.seconds + other.seconds,
        )

    def misfit(self, theta: Array) -> Array:
        """Return the mean squared error over what is told of it, (2,) [-]; 1 as told.

        Parameters
        ----------
        theta : parameters, (2, q).
        """
        squares = (
            self.square
            - 2.0 * np.einsum("ai,ai->a", theta, self.vector)
            + np.einsum("ai,aij,aj->a", theta, self.matrix, theta)
        )
        return np.asarray(np.maximum(squares, 0.0) / max(self.samples, 1.0))


def total(parts: Iterable[Information], q: int) -> Information:
    """Return what many tell together; sums are exact to the last bit in any order.

    Parameters
    ----------
    q : parameters of an axle.
    """
    sums = Total(q)
    for one in parts:
        sums.add(one)
    return sums.information


class Total:
    """What many tell together, in the room of a few: sums are exact to the last bit in any order.

    Each sum is a few numbers of falling size whose exact sum it is (J. R. Shewchuk, Discrete &
    Computational Geometry 18, 1997).

    Parameters
    ----------
    q : parameters of an axle.
    """

    def __init__(self, q: int) -> None:
        self._shapes = [(2, q, q), (2, q), (2,), (1,), (1,)]
        self._rows = [np.zeros(sum(map(math.prod, self._shapes)))]

    def add(self, one: Information) -> None:
        """Add what a drive tells."""
        values = (one.matrix, one.vector, one.square, one.samples, one.seconds)
        self._rows.append(np.concatenate([np.ravel(value) for value in values]))
        if len(self._rows) > TOGETHER:
            self._rows = list(_exact(np.array(self._rows)))

    @property
    def information(self) -> Information:
        """The sum."""
        ends = np.cumsum([math.prod(shape) for shape in self._shapes])[:-1]
        pieces = np.split(_exact(np.array(self._rows))[0], ends)
        matrix, vector, square, samples, seconds = (
            piece.reshape(shape) for piece, shape in zip(pieces, self._shapes, strict=True)
        )
        return Information(
            matrix=matrix,
            vector=vector,
            square=square,
            samples=float(samples[0]),
            seconds=float(seconds[0]),
        )


def _exact(rows: Array) -> Array:
    """Return few rows of the same exact sum, column by column; the first is it, rounded."""
    found: list[Array] = []
    while not found or found[-1].any():
        left = np.vstack([rows, *(-one[None] for one in found)])
        found.append(np.array([math.fsum(column) for column in left.T.tolist()]))
    return np.array(found[:-1] or found)


def reference_of(design: AxleIdentifier, vehicle: Vehicle) -> AxleModel:
    """Return the model that nothing was learnt of: the brush tire of what is told of the car."""
    W, own = design.prior.means(vehicle, design.ladder)
    P = design.prior.covariance(vehicle, design.ladder)
    return _model(design, vehicle, np.hstack([W, own]), P, P, np.zeros((2, 1 + len(EDGES))))


def _model(
    design: AxleIdentifier,
    vehicle: Vehicle,
    theta: Array,
    P: Array,
    prior: Array,
    excitation: Array,
) -> AxleModel:
    """Return the model of parameters (2, n + 3) and their covariance, within bounds."""
    n = len(design.ladder)
    W, own = design.within_bounds(theta[:, :n], theta[:, n:], P)
    return AxleModel(
        vehicle=vehicle,
        ladder=design.ladder,
        sway=design.sway,
        plausibility=design.plausibility,
        W=W,
        own=own,
        covariance=P,
        prior_covariance=prior,
        excitation=excitation,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Adds up what drives tell at a reference.

    Parameters
    ----------
    reference : the model θ₀ that lag, slip and variances are taken at.

    Raises
    ------
    ValueError
        Where the reference has other units than the design.
    """

    design: AxleIdentifier
    reference: AxleModel
    _setup: Setup = field(init=False, repr=False)

    def __post_init__(self) -> None:
        design, model = self.design, self.reference
        if model.ladder != design.ladder:
            raise ValueError(
                f"the reference's units are at {model.ladder} rad, the design's at {design.ladder}"
            )
        n = len(design.ladder)
        setup = Setup(
            scan=_scan(doublings(design.ladder), pressed=model.vehicle.has_downforce),
            carry={
                "gate": np.zeros(len(GateState._fields)),
                "sway": np.zeros(len(SwayState._fields)),
                "slip": np.tile([0.0, 0.0, 1.0, 0.0], (2, 1)),
                "sensitivity": np.zeros((2, len(SensitivityState._fields))),
                "filters": np.zeros((2, n + 5)),
                "peak": np.zeros(2),
                "bank": np.zeros(len(SlopeState._fields)),
            },
            constants={
                "W": model.W,
                "own": model.own,
                "dt": np.array(design.dt),
                "car": car_numbers(model.vehicle),
                "scales": 1.0 / np.array(design.ladder)[None],
                "plausibility": np.array(design.plausibility.numbers()),
                "roll": np.array(design.sway.numbers()),
                "regression": np.array(design.regression.at(design.dt)),
                "road": np.array(design.road.at(design.dt)),
                **downforce_numbers(model.vehicle),
            },
            ends_run=design.plausibility.rest(design.dt),
        )
        object.__setattr__(self, "_setup", setup)

    def of(self, recording: Recording) -> Information:
        """Return what a drive tells; each of its stretches begins anew.

        Raises
        ------
        RecordingError
            Where it has no v_y.
        """
        told = [one for _, one in self.parts(recording, math.inf)]
        return total(told, len(self.design.ladder) + 3)

    def parts(self, recording: Recording, longest: float) -> list[tuple[float, Information]]:
        """Return when the parts of a drive begin, from its first sample [s], and what they tell.

        Parameters
        ----------
        longest : time that a part may last [s]; stretches make parts of their own.
        """
        recording.needed("v_y")
        told: list[tuple[float, Information]] = []
        for piece in recording.stretches:
            begin = float(recording.t[piece.start] - recording.t[0])
            parts = self._of_stretch(recording.taken(piece), longest)
            told += [(begin + after, one) for after, one in parts]
        return told

    def _of_stretch(self, stretch: Recording, longest: float) -> list[tuple[float, Information]]:
        every = max(round(STEP / self.design.dt), 1)
        count = len(stretch)
        size = every * max(min(round(min(longest, 1e6) / self.design.dt / every), count), 1)
        carry = dict(self._setup.carry)
        told = []
        for begin in range(0, count, size):
            sums = []
            for first in range(begin, min(begin + size, count), every * CHUNK):
                part = slice(first, min(first + every * CHUNK, begin + size, count))
                shown = self._setup.shown(stretch, part)
                values = {**carry, **shown.signals, **self._setup.constants}
                record = self._setup.scan(shown.samples, values, every=every)
                carry = {port: record[f"{port}_final"] for port in EVIDENCE_CARRY}
                sums.append(_added(record, every, self.design.dt))
            told.append((begin * self.design.dt, total(sums, len(self.design.ladder) + 3)))
        return told


def _added(record: dict[str, Array], every: int, dt: float) -> Information:
    """Return the sums over recorded samples; each stands for `every` of them."""
    learns = record["learns"].ravel() > 0.5
    h, y, R = record["h"][learns], record["y"][learns], record["R"][learns]
    weighted = every * h / R[:, :, None]
    return Information(
        matrix=np.stack([weighted[:, i].T @ h[:, i] for i in (0, 1)]),
        vector=np.einsum("kai,ka->ai", weighted, y),
        square=(every * y**2 / R).sum(axis=0),
        samples=float(every * learns.sum()),
        seconds=float(every * learns.sum() * dt),
    )


def merged(
    design: AxleIdentifier, reference: AxleModel, told: Information, excitation: Array
) -> AxleModel:
    """Return the model of all that was told, with the prior: θ = (Λ₀ + Λ)⁻¹ (Λ₀ θ_p + η).

    Parameters
    ----------
    reference : that the information was taken at; its car is the model's.
    excitation : largest slip and times of learning of all drives together, (2, 9).
    """
    vehicle = reference.vehicle
    W, own = design.prior.means(vehicle, design.ladder)
    P0 = design.prior.covariance(vehicle, design.ladder)
    theta, P = posterior(told, np.hstack([W, own]), P0)
    return _model(design, vehicle, theta, P, P0, excitation)


def posterior(told: Information, mean: Array, covariance: Array) -> tuple[Array, Array]:
    """Return mean (2, q) and covariance (2, q, q) of θ after the information.

    Errors that are larger than told widen the covariance.

    Parameters
    ----------
    mean : of the prior (2, q).
    covariance : of the prior (2, q, q).
    """
    theta, P = np.zeros_like(mean), np.zeros_like(covariance)
    for i in (0, 1):
        sd = np.sqrt(np.diag(covariance[i]))  # scaled, the sum is well conditioned
        correlation = covariance[i] / np.outer(sd, sd)
        before = np.linalg.inv(correlation)
        after = before + told.matrix[i] * np.outer(sd, sd)
        P[i] = np.linalg.inv(0.5 * (after + after.T))
        P[i] = 0.5 * (P[i] + P[i].T)
        away = told.vector[i] - told.matrix[i] @ mean[i]
        theta[i] = mean[i] + sd * (P[i] @ (sd * away))
        P[i] *= np.outer(sd, sd)
    return theta, P


# How tires differ from a model: stiffer or softer, more or less grip, with offsets of their own.

LARGEST_CHANGE = 0.5  # standard deviation of ln C and ln μ that is believed before


class Change(NamedTuple):
    """How tires differ from a model: ln of stiffness and of friction over it, rows front and rear.

    value (2, 2) [-].   covariance (2, 2, 2) [-], of the errors that were there.
    """

    value: Array
    covariance: Array


def change_from(
    told: Information, theta: Array, design: AxleIdentifier, vehicle: Vehicle
) -> Change:
    """Return how the tires that drives tell of differ from given curves.

    Along φ = μ φ₀(C α/μ) weights change by w - M w a ln C and by M w a ln μ. Sensors may be off
    otherwise than when the curves were learnt: offsets are estimated beside it, and left out.

    Parameters
    ----------
    theta : [W, own] of the curves, (2, q).
    """
    n = len(design.ladder)
    M = friction_direction(design.ladder)
    offsets = design.prior.covariance(vehicle, design.ladder)[:, -1, -1]
    value, covariance = np.zeros((2, 2)), np.zeros((2, 2, 2))
    for i in (0, 1):
        by_friction = M @ theta[i, :n]
        J = np.zeros((theta.shape[1], 3))
        J[:n, 0], J[:n, 1], J[-1, 2] = theta[i, :n] - by_friction, by_friction, 1.0
        before = np.diag([LARGEST_CHANGE**-2, LARGEST_CHANGE**-2, 1.0 / offsets[i]])
        P = np.linalg.inv(J.T @ told.matrix[i] @ J + before)
        value[i] = (P @ J.T @ (told.vector[i] - told.matrix[i] @ theta[i]))[:2]
        covariance[i] = P[:2, :2]
    return Change(value, covariance * told.misfit(theta)[:, None, None])


@cache
def _scan(steps: tuple[int, ...], *, pressed: bool) -> Scan:
    return Scan(build_evidence(steps, pressed=pressed), carry=EVIDENCE_CARRY, over=LEARNING_OVER)
