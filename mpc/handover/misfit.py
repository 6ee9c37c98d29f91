"""How badly a tire explains what the car did: forces against impulses, without a derivative.

ξ_i = v_y/g ± I_z r/(L F_z,i) [s], the impulse of axle i over its static load, obeys
dξ_i/dt = F_i/F_z,i - v_x r/g exactly. So the slope over a stretch of time of
    ξ - ∫ (F/F_z - v_x r/g) dt,
by least squares, is the mean error e of the force that a tire tells from the measured motion, in
static axle loads: 0.1 at both axles are 1 m/s². (The slope has two thirds of the noise of a
difference of two samples.) The misfit Σ (e/σ)² is -2 ln of the likelihood, up to a constant.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identifier.axle.car import car_numbers
from identifier.axle.checks import require_positive
from models.vehicle import GRAVITY
from mpc.handover.axle_force import axle_forces
from mpc.tires import TireModel

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorModel:
    """What errors are expected of a good tire.

    Parameters
    ----------
    stretch : time over which forces are averaged [s].
    settle : time before the first judged stretch, for the lag of the tire [s].
    error : standard deviation [static axle loads]; 0.02 is 0.2 m/s².
    relative_error : the same, as a share of the force [-].
    accelerating : added to that share for each g of acceleration or braking, which shifts load
        between the axles and takes grip [-].
    largest : error that counts in full [standard deviations]: one fault alone proves nothing.

    Raises
    ------
    ValueError
        Where a number is not positive.
    """

    stretch: float = 0.12
    settle: float = 0.1
    error: float = 0.02
    relative_error: float = 0.05
    accelerating: float = 0.3
    largest: float = 5.0

    def __post_init__(self) -> None:
        require_positive(self)


class Misfit(NamedTuple):
    """Σ (e/σ)² over independent stretches and both axles [-], the number of those, rms of e (2,).

    The rms is in static axle loads, front and rear.
    """

    total: float
    independent: float
    rms: Array

    @property
    def mean(self) -> float:
        """Mean of (e/σ)² [-]: about 1 or less for a tire as good as is expected."""
        return self.total / self.independent


class Judge:
    """Misfits of tires over samples that come at one interval.

    Parameters
    ----------
    dt : sampling interval [s].
    expected : errors of a good tire; None takes the default.

    Raises
    ------
    ValueError
        Where a stretch has no three samples.
    """

    def __init__(self, dt: float, expected: ErrorModel | None = None) -> None:
        self.expected = expected or ErrorModel()
        self.dt = dt
        self._h = round(self.expected.stretch / dt)
        self._settle = round(self.expected.settle / dt)
        if self._h < 2:
            raise ValueError(f"a stretch of {self.expected.stretch:g} s has no three samples")
        centered = np.arange(self._h + 1) - 0.5 * self._h
        self._slope = centered / (dt * np.sum(centered**2))
        self._mean = np.full(self._h + 1, 1.0 / (self._h + 1))

    def reach(self, seconds: float) -> float:
        """Return how far back samples must go to judge the last seconds [s].

        Parameters
        ----------
        seconds : in which the judged stretches end [s].
        """
        return seconds + (self._settle + self._h + 1) * self.dt

    def errors(self, tire: TireModel, samples: Array) -> tuple[Array, Array]:
        """Return e (m, 2) and the forces that it is the error of (m, 2) [static axle loads].

        Parameters
        ----------
        tire : the model.
        samples : rows of `window.COLUMNS`, (n, 4); m = n - settle - stretch, in samples.

        Raises
        ------
        ValueError
            Where there are too few samples.
        """
        e, force = self._errors(tire, tire.weights[None], samples)
        return e[0], force[0]

    def misfit(self, tire: TireModel, samples: Array) -> Misfit:
        """Return how badly a tire explains samples.

        Parameters
        ----------
        tire : the model.
        samples : as for `errors`.

        Raises
        ------
        ValueError
            Where there are too few samples.
        """
        return self.misfits(tire, tire.weights[None], samples)[0]

    def misfits(self, tire: TireModel, weights: Array, samples: Array) -> list[Misfit]:
        """Return how badly k tires explain samples.

        Parameters
        ----------
        tire : structure and car; its weights are not read.
        weights : of k tires (k, n_weights).
        samples : as for `errors`.

        Raises
        ------
        ValueError
            Where there are too few samples.
        """
        e, force = self._errors(tire, weights, samples)
        expected = self.expected
        a_x = _along(samples[self._settle :, :1], self._slope) / GRAVITY
        share = expected.relative_error + expected.accelerating * np.abs(a_x)
        sigma = expected.error + share * np.abs(force)
        size = np.minimum(np.abs(e) / sigma, self.expected.largest)
        size = np.where(np.isfinite(size), size, self.expected.largest)
        mean = np.mean(size**2, axis=(1, 2))
        rms = np.sqrt(np.mean(e**2, axis=1))
        independent = 2.0 * (1.0 + (e.shape[1] - 1) / self._h)
        return [
            Misfit(float(one) * independent, independent, error)
            for one, error in zip(mean, rms, strict=True)
        ]

    def _errors(self, tire: TireModel, weights: Array, samples: Array) -> tuple[Array, Array]:
        """Return e and forces of k tires (k, m, 2) [static axle loads]."""
        n, least = len(samples), self._settle + self._h
        if n <= least:
            raise ValueError(f"to judge a tire takes more than {least} samples, there are {n}")
        inertia, load = car_numbers(tire.vehicle)[:, 2:].T
        phi = axle_forces(tire, weights, samples, self.dt)[:, self._settle :] / load
        v_x, v_y, r = samples[self._settle :, :3].T
        xi = v_y[:, None] / GRAVITY + inertia * r[:, None]
        rate = phi - (v_x * r / GRAVITY)[:, None]
        told = np.cumsum(0.5 * (rate[:, 1:] + rate[:, :-1]), axis=1) * self.dt  # trapezoidal
        gap = xi - xi[0] - np.concatenate([np.zeros((len(phi), 1, 2)), told], axis=1)
        return _along(gap, self._slope), _along(phi, self._mean)


def _along(signals: Array, kernel: Array) -> Array:
    """Return Σ_j kernel_j s(i + j) along the samples of signals (..., n, 2): (..., m, 2)."""
    stretches = np.lib.stride_tricks.sliding_window_view(signals, len(kernel), axis=-2)
    return np.asarray(stretches @ kernel, dtype=np.float64)
