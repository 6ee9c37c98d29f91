"""How badly a tire explains what the car did: forces against impulses, without a derivative.

ξ_i = v_y/g ± I_z r/(L F_z,i) [s], the impulse of axle i over its static load, obeys
dξ_i/dt = F_i/F_z,i - v_x r/g exactly. So the slope over a stretch of time of
    ξ - ∫ (F/F_z - v_x r/g) dt,
by least squares, is the mean error e of the force that a tire tells from the measured motion, in
static axle loads: 0.1 at both axles are 1 m/s². (The slope has two thirds of the noise of a
difference of two samples.) The chi-square Σ (e/σ)² is -2 ln of the likelihood, up to a constant.
"""

from collections.abc import Hashable, Sequence
from functools import cache
from typing import Any, NamedTuple, cast

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.axle.car import car_numbers, step_function, symbols
from models.vehicle import GRAVITY
from mpc.tires import PredictionTire
from mpc.tires.tire import Car, Point

COLUMNS = ("v_x", "v_y", "r", "delta")  # m/s, m/s, rad/s, rad


class Window:
    """The last samples in the order of `COLUMNS`, oldest first, always in one piece of memory.
    seconds : longest time that can be looked back on [s].
    dt : sampling interval [s].
    """

    def __init__(self, seconds: float, dt: float) -> None:
        n = round(seconds / dt)
        if not n >= 2:
            raise ValueError(f"a window of {seconds:g} s holds no two samples every {dt:g} s")
        self.dt = dt
        self._n = n
        self._rows = np.zeros((3 * n, len(COLUMNS)))
        self._end = 0
        self._kept = 0

    def add(self, sample: Sequence[float]) -> None:
        if self._end == len(self._rows):
            self._rows[: self._n] = self._rows[-self._n :]
            self._end = self._n
        self._rows[self._end] = sample
        self._end += 1
        self._kept = min(self._kept + 1, self._n)

    def __len__(self) -> int:
        """Return the number of samples at hand."""
        return self._kept

    @property
    def duration(self) -> float:
        """Time that can be looked back on [s]."""
        return self._kept * self.dt

    def last(self, seconds: float) -> Array:
        """Return the last samples (n, 4), a view; all of them where there are fewer.

        seconds : time to look back [s].
        """
        n = min(round(seconds / self.dt), self._kept)
        return self._rows[self._end - n : self._end]

    def clear(self) -> None:
        """Forget everything."""
        self._kept = 0


_SHORTEST_LAG = 1e-3  # m


def axle_forces(tire: PredictionTire, weights: Array, samples: Array, dt: float) -> Array:
    """Return the axle forces (k, n, 2) [N] of k tires, frame of the body; a lag begins settled.

    tire : structure and car; its weights are not read.   weights : of k tires (k, n_weights).
    samples : rows of `window.COLUMNS`, (n, 4).   dt : sampling interval [s].
    """
    k = len(weights)
    run = axle_scan(cast(Hashable, tire.structure), k)(
        len(samples),
        {
            "lagged": np.zeros((2, k)),
            "begun": np.zeros(1),
            "sample": samples,
            "dt": np.array(dt),
            "car": tire.car,
            "w": weights.T,
        },
    )
    return run["axle_force"].reshape(len(samples), k, 2).swapaxes(0, 1)


@cache
def axle_scan(structure: Any, k: int) -> Scan:
    """Return the compiled loop: slip, its lag held exactly over a sample, force of k tires."""
    ports, s = symbols(
        lagged=(2, k), begun=1, sample=len(COLUMNS), dt=1, car=Car, w=(structure.n_weights, k)
    )
    slips, forces = [], []
    for i in range(k):
        v_x, v_y, r, delta = ca.vertsplit(s.sample)
        at = Point(v_y, r, delta, v_x, s.car, s.w[:, i])
        slip: Any = ca.vertcat(*structure.slip(at))
        if structure.lagged:
            sigma = ca.vertcat(*structure.lag_length((s.lagged[0, i], s.lagged[1, i]), at))
            share = 1 - ca.exp(-v_x * s.dt / ca.fmax(sigma, _SHORTEST_LAG))
            last = s.lagged[:, i]
            slip = ca.if_else(s.begun > 0, last + share * (slip - last), slip)
        slips.append(slip)
        forces.append(ca.vertcat(*structure.force((slip[0], slip[1]), at)))
    carried = {"lagged": ca.densify(ca.horzcat(*slips)), "begun": ca.SX(1)}
    outputs = {"axle_force": ca.densify(ca.vertcat(*forces))}
    step = step_function(f"axle_forces_{k}", ports, carried, outputs)
    return Scan(step, carry=("lagged", "begun"), over=("sample",))


# What errors are expected of a good tire.
STRETCH = 0.12  # [s] over which forces are averaged
SETTLE = 0.1  # [s] before the first judged stretch, for the lag of the tire
ERROR = 0.02  # standard deviation [static axle loads]: 0.2 m/s²
RELATIVE_ERROR = 0.05  # the same, as a share of the force [-]
# Added to that share for each g of acceleration or braking, which shifts load and takes grip [-].
ACCELERATING = 0.3
LARGEST = 5.0  # error that counts in full [standard deviations]: one fault alone proves nothing


class ChiSquare(NamedTuple):
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
    """Chi-squares of tires over samples that come at one interval.
    dt : sampling interval [s].
    """

    def __init__(self, dt: float) -> None:
        self.dt = dt
        self._h, self._settle = round(STRETCH / dt), round(SETTLE / dt)
        if self._h < 2:
            raise ValueError(f"a segment of {STRETCH:g} s has no three samples")
        centered = np.arange(self._h + 1) - 0.5 * self._h
        self._slope = centered / (dt * np.sum(centered**2))
        self._mean = np.full(self._h + 1, 1.0 / (self._h + 1))

    def lookback(self, seconds: float) -> float:
        """Return how far back samples must go to judge the last seconds [s].

        seconds : in which the judged stretches end [s].
        """
        return seconds + (self._settle + self._h + 1) * self.dt

    def chi_square(self, tire: PredictionTire, samples: Array) -> ChiSquare:
        """Return how badly a tire explains samples."""
        return self.chi_squares(tire, tire.weights[None], samples)[0]

    def chi_squares(self, tire: PredictionTire, weights: Array, samples: Array) -> list[ChiSquare]:
        """Return how badly k tires explain samples.

        tire : structure and car; its weights are not read.   weights : of k tires (k, n_weights).
        """
        e, force = self._errors(tire, weights, samples)
        a_x = _along(samples[self._settle :, :1], self._slope) / GRAVITY
        sigma = ERROR + (RELATIVE_ERROR + ACCELERATING * np.abs(a_x)) * np.abs(force)
        size = np.minimum(np.abs(e) / sigma, LARGEST)
        size = np.where(np.isfinite(size), size, LARGEST)
        mean = np.mean(size**2, axis=(1, 2))
        rms = np.sqrt(np.mean(e**2, axis=1))
        independent = 2.0 * (1.0 + (e.shape[1] - 1) / self._h)
        return [
            ChiSquare(float(one) * independent, independent, error)
            for one, error in zip(mean, rms, strict=True)
        ]

    def _errors(self, tire: PredictionTire, weights: Array, samples: Array) -> tuple[Array, Array]:
        """Return e and forces of k tires (k, m, 2) [static axle loads]."""
        n, least = len(samples), self._settle + self._h
        if n <= least:
            raise ValueError(f"to judge a tire takes more than {least} samples, there are {n}")
        inertia, load = car_numbers(tire.vehicle)[:, 2:].T
        phi = axle_forces(tire, weights, samples, self.dt)[:, self._settle :] / load
        v_x, v_y, r = samples[self._settle :, :3].T
        xi = v_y[:, None] / GRAVITY + inertia * r[:, None]
        rate = phi - (v_x * r / GRAVITY)[:, None]
        integral = np.cumsum(0.5 * (rate[:, 1:] + rate[:, :-1]), axis=1) * self.dt  # trapezoidal
        gap = xi - xi[0] - np.concatenate([np.zeros((len(phi), 1, 2)), integral], axis=1)
        return _along(gap, self._slope), _along(phi, self._mean)


def _along(signals: Array, kernel: Array) -> Array:
    """Return Σ_j kernel_j s(i + j) along the samples of signals (..., n, 2): (..., m, 2)."""
    stretches = np.lib.stride_tricks.sliding_window_view(signals, len(kernel), axis=-2)
    return np.asarray(stretches @ kernel, dtype=np.float64)
