"""The band of a fit: by its covariance, and by its error on the identification drives."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.band import LARGEST_SD, Band, BandSpread
from identifier.estimate.priors import Priors
from identifier.estimate.solve import ERROR_SIZE
from identifier.evidence import evidence, road_push
from identifier.motion.parameters import INDEX, curve_index
from identifier.tire_model import brisk_speed
from models.recordings import Recording
from models.recordings.portion import portion
from models.vehicle import Vehicle

# times what the drives that taught miss, on others; chosen on recordings of three real cars and
# two simulated ones, since the errors of a plant that one draws are those that one thought of
_ELSEWHERE = 2.25
_SURE_MASS = 0.03  # sd of a given mass, of it
_SURE_CENTER = 0.01  # sd of a center of gravity whose source the car does not tell [wheelbases]
# sd of the curve near zero slip over the prior's, above which a drive decided a point of it, not a
# range: constant steering for 30 s leaves 0.51 and more of 24 random cars, slaloms, steps and ramps
# 0.40 and less (seeds 200 to 205)
_LARGEST_SLOPE_SD = 0.45
_NEAR_ZERO = 4  # of the grid of `_known_slip`: 5 % of the driven slip
# sd of a steering ratio that somebody typed, for the ± of the stiffness: the prior of 0.04 that the
# estimate needs hides a wrong one on a gentle drive
_TYPED_RATIO = 0.25
_TYPICAL = 0.5  # static loads, at which an error is given as a share of the force

# times what the verdict misses of the log that is asked, of its rms force: a part that is there
# without a force, and one that goes with it. What the log that taught misses fits no two sources
# at once; this held on two simulators and three real cars.
_HERE, _STILL, _WITH_FORCE = 1.1, 0.8, 0.6

_OFFSETS = [INDEX["steering_zero"], INDEX["v_y_bias"], INDEX["v_y_angle"]]


@lru_cache(maxsize=4)
def _prior_covariance(vehicle: Vehicle) -> Array:
    return Priors.of(vehicle).covariance


@lru_cache(maxsize=4)
def _known_slip(model: Any) -> Array:
    """Return `FittedBand.known_slip`, for which a verdict asks many times."""
    grid, driven = np.linspace(0.0, 1.0, 101)[1:], model.reach.slip
    sd, prior = model.band.of_phi(np.outer(grid, driven))
    sure = sd <= LARGEST_SD * np.maximum(prior, 1e-12)
    begun = sd[_NEAR_ZERO] <= _LARGEST_SLOPE_SD * prior[_NEAR_ZERO]
    return driven * begun * np.max(grid[:, None] * sure, axis=0)


class _Here(NamedTuple):
    """A log: covariance of its sensors' zeros with the tires held (3, 3); error of the model on it
    that is there without a force [static loads], and over the force, (2,).
    """

    zeros: Array
    floor: Array
    share: Array


@dataclass(frozen=True, slots=True)
class FittedBand(Band):
    """How unsure a `FittedModel` is.
    here : on a log; None of no log, where its error is that on the identification drives.
    """

    here: _Here | None = None

    calibrated = True  # its width is more than noise of the sensors, always

    @property
    def origin(self) -> str:
        front, rear = 100.0 * self._error_at(_TYPICAL)
        return (
            f"parameter uncertainty plus a model error of {front:.0f} / {rear:.0f} % at "
            f"{_TYPICAL:g} static loads, estimated from the residuals and a mass known to "
            f"{100.0 * _SURE_MASS:.0f} %"
        )

    @property
    def speed(self) -> float:
        return brisk_speed(self.model.vehicle, self.model.min_speed)

    @property
    def prior_covariance(self) -> Array:
        """Covariance of what is believed of the car before any drive, (p, p)."""
        return _prior_covariance(self.model.vehicle)

    @property
    def load_doubt(self) -> Array:
        """Relative standard deviation of the static loads: mass and center of gravity, (2,)."""
        car = self.model.vehicle
        arms, sd = np.array([car.l_r, car.l_f]), car.center_of_gravity_sd
        center = (_SURE_CENTER if sd is None else sd) * car.wheelbase
        return np.hypot(_SURE_MASS, center / arms)

    @property
    def error_share(self) -> Array:
        """Standard deviation of the model's own error, the part that goes with the force, (2,)."""
        return np.hypot(self.load_doubt, self._missed[1])

    @property
    def error_floor(self) -> Array:
        """The part of it that is there without a force [static loads], (2,)."""
        return self._missed[0]

    @property
    def _missed(self) -> tuple[Array, Array]:
        """Return what is missed without a force [static loads], and over the force, (2,) each."""
        if self.here is not None:
            return self.here.floor, self.here.share
        floor, share = (_ELSEWHERE * size * self.model.reach.unexplained for size in ERROR_SIZE)
        return floor, share

    def on(self, recording: Recording) -> "FittedBand":
        """Return the band on a log: by the doubt of its sensors, and by what is missed of it."""
        part, days = portion(recording), self.model.days(recording)
        zeros = np.mean([day.covariance[:3, :3] for _, day in days], axis=0)
        model = self.model.held_on(recording, part)
        found = evidence(model, part.recording, road_push(part.recording, model))
        if found is None or not (found.peak > 0.0).all():
            return replace(self, here=_Here(zeros, *self._missed))
        error = _HERE * found.model_error
        return replace(self, here=_Here(zeros, _STILL * error * found.force, _WITH_FORCE * error))

    def _error_at(self, force: float) -> Array:
        """Return that error over a force [static loads], (2,)."""
        return np.hypot(self.error_share, self.error_floor / force)

    def spread(self, slip: Array, v_x: Array, pressed: Array) -> BandSpread:
        """Return the variances of the steady forces, (n, 2): of curve, zeros and the own error."""
        phi, slope, J = self.model.curve_at(slip)
        variance = np.empty_like(phi)
        for i, axle in enumerate("fr"):
            index = [*curve_index(axle), *_OFFSETS]
            steered = np.full(len(phi), 1.0 if i == 0 else 0.0)
            zeros = np.column_stack([steered, 1.0 / v_x, np.ones(len(phi))])
            h = np.hstack([J[i], slope[:, i, None] * zeros])
            P = self.model.covariance[np.ix_(index, index)]
            if self.here is not None:  # tires, their own day integrated out, and this day
                P[:, -3:] = P[-3:] = 0.0
                P[-3:, -3:] = self.here.zeros
            variance[:, i] = np.einsum("ki,ij,kj->k", h, P, h)
        model_variance = self.error_floor**2 + (self.error_share * phi) ** 2
        total = (np.maximum(variance, 0.0) + model_variance) * pressed**2
        return BandSpread(total, np.zeros_like(total))

    def of_phi(self, slip: Array) -> tuple[Array, Array]:
        """Return the standard deviation of φ at slips (n, 2), and that before learning."""
        _, _, J = self.model.curve_at(slip)
        sd = []
        for P in (self.model.covariance, self.prior_covariance):
            found = [
                np.einsum("ki,ij,kj->k", J[i], P[np.ix_(index, index)], J[i])
                for i, index in enumerate(map(curve_index, "fr"))
            ]
            sd.append(np.sqrt(np.maximum(np.column_stack(found), 0.0)))
        return sd[0], sd[1]

    @property
    def ratio_open(self) -> "tuple[FittedBand, Array]":
        """The band of a car whose steering ratio may be off by a quarter, and by what its prior
        holds the parameters, (p,): they are not estimated again.

        The information of the prior is exchanged in the covariance (Sherman and Morrison).
        """
        k, P = INDEX["steering_gain"], self.model.covariance
        _, prior = Priors.of(self.model.vehicle).around(self.model.p)
        less = prior[k, k] - 1.0 / _TYPED_RATIO**2
        left = max(1.0 - less * P[k, k], P[k, k] / _TYPED_RATIO**2)
        opened = P + np.outer(P[k], P[k]) * less / left
        held = opened[k] * less * self.model.p[k]
        return FittedBand(replace(self.model, covariance=opened)), held

    def known_slip(self) -> Array:
        """Return the largest slip [rad] that was reached and where the doubt is small, (2,)."""
        return _known_slip(self.model).copy()

    def relative_sd(self, alpha: Array) -> Array:
        sd, prior = self.of_phi(np.column_stack([alpha, alpha]))
        return sd / np.maximum(prior, 1e-12)

    def calibrated_by(self, calibration: Any, model_error: Array | None = None) -> Any:
        """Return the model with what it misses of the drives that taught."""
        del calibration
        return replace(self.model, model_error=model_error)

    def _opened(self, sd_friction: float) -> Any:
        covariance, k = self.model.covariance.copy(), INDEX["ln_road"]
        covariance[k, k] += sd_friction**2
        return replace(self.model, covariance=covariance)

    def _samples(self, n: int, rng: np.random.Generator) -> tuple[Any, ...]:
        model, priors = self.model, Priors.of(self.model.vehicle)
        share = self._error_at(_TYPICAL)
        values, vectors = np.linalg.eigh(model.covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        drawn = []
        for _ in range(n):
            p = model.p + root @ rng.standard_normal(len(model.p))
            for i, axle in enumerate("fr"):
                p[INDEX[f"ln_stiffness_{axle}"]] += share[i] * rng.standard_normal()
                p[INDEX[f"ln_grip_{axle}"]] += share[i] * rng.standard_normal()
            drawn.append(replace(model, p=np.clip(p, priors.low, priors.high)))
        return tuple(drawn)
