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
from numpy.lib.stride_tricks import sliding_window_view

from codegen import Scan
from codegen.arrays import Array
from identifier.axle.car import car_numbers, step_function, symbols
from models.vehicle import GRAVITY
from mpc.tires import PredictionTire
from mpc.tires.tire import Car, Point, curves_at

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
_SLIPS = np.linspace(0.02, 0.4, 20)  # [rad] among which the grip of an axle is looked for
_LEAST_GRIP = 0.05  # static axle loads


def axle_forces(tire: PredictionTire, weights: Array, samples: Array, dt: float) -> Array:
    """Return the axle forces (k, n, 2) [N] of k tires, frame of the body; a lag begins settled.

    tire : structure and car; its weights are not read.   weights : of k tires (k, n_weights).
    samples : rows of `window.COLUMNS`, (n, 4).   dt : sampling interval [s].
    """
    return _forces(tire, weights, samples, dt)[0]


def _forces(tire: PredictionTire, weights: Array, samples: Array, dt: float) -> tuple[Array, Array]:
    """Return the forces of `axle_forces`, and what they would be without a lag."""
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
    lagged, settled = (
        run[name].reshape(len(samples), k, 2).swapaxes(0, 1) for name in ("axle_force", "settled")
    )
    return lagged, settled


@cache
def axle_scan(structure: Any, k: int) -> Scan:
    """Return the compiled loop: slip, its lag held exactly over a sample, force of k tires."""
    ports, s = symbols(
        lagged=(2, k), begun=1, sample=len(COLUMNS), dt=1, car=Car, w=(structure.n_weights, k)
    )
    slips, forces, settled = [], [], []
    for i in range(k):
        v_x, v_y, r, delta = ca.vertsplit(s.sample)
        at = Point(v_y, r, delta, v_x, s.car, s.w[:, i])
        slip: Any = ca.vertcat(*structure.slip(at))
        settled.append(ca.vertcat(*structure.force((slip[0], slip[1]), at)))
        if structure.lagged:
            sigma = ca.vertcat(*structure.lag_length((s.lagged[0, i], s.lagged[1, i]), at))
            share = 1 - ca.exp(-v_x * s.dt / ca.fmax(sigma, _SHORTEST_LAG))
            last = s.lagged[:, i]
            slip = ca.if_else(s.begun > 0, last + share * (slip - last), slip)
        slips.append(slip)
        forces.append(ca.vertcat(*structure.force((slip[0], slip[1]), at)))
    carried = {"lagged": ca.densify(ca.horzcat(*slips)), "begun": ca.SX(1)}
    found = {"axle_force": forces, "settled": settled}
    outputs = {name: ca.densify(ca.vertcat(*both)) for name, both in found.items()}
    step = step_function(f"axle_forces_{k}", ports, carried, outputs)
    return Scan(step, carry=("lagged", "begun"), over=("sample",))


# What errors are expected of a good tire.
STRETCH = 0.12  # [s] over which forces are averaged
SETTLE = 0.1  # [s] before the first judged stretch, for the lag of the tire
# Chosen on fast laps of 79 random cars on tires of three shapes, confirmed on 109 laps of others.
# Curves miss most at small slip, whatever the force; near the grip they miss little.
ERROR = 0.04  # standard deviation [static axle loads]: 0.4 m/s²
RELATIVE_ERROR = 0.03  # the same, as a share of the force [-]
TAKEN_ERROR = 0.4  # the same, as a share of the force that pushing lengthwise takes [-]
LAG_ERROR = 0.5  # the same, as a share of what the force lags behind by: a body sways on [-]
# Part of its grip that an axle uses lengthwise, over push/grip: 0.8 fits best. Load that shifts is
# left out: at one slip the side force follows it little, and taking it in fits worse.
USE = 0.8
LEAST_LEFT = 0.05  # of the square of the side force, however hard an axle pushes lengthwise [-]
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
        e, sigma = self._errors(tire, weights, samples)
        size = np.minimum(np.abs(e) / sigma, LARGEST)
        size = np.where(np.isfinite(size), size, LARGEST)
        mean = np.mean(size**2, axis=(1, 2))
        rms = np.sqrt(np.mean(e**2, axis=1))
        independent = 2.0 * (1.0 + (e.shape[1] - 1) / self._h)
        return [
            ChiSquare(float(one) * independent, independent, error)
            for one, error in zip(mean, rms, strict=True)
        ]

    def _left(self, tire: PredictionTire, weights: Array, samples: Array) -> Array:
        """Return the share of the side force that pushing lengthwise leaves, (k, m, 2) [-].

        The friction ellipse of an axle: its share of the push, over its grip. Axles of a car that
        does not tell their shares push in proportion to their loads.
        """
        v_x, v_y, r = samples[:, :3].T
        push = _along(v_x[:, None], self._slope) - _along((v_y * r)[:, None], self._mean)
        push /= GRAVITY  # of the car, over its weight
        car = tire.vehicle
        loads = np.array(car.axle_loads) / car.weight
        shares = []
        for name in ("brake_front_share", "drive_front_share"):
            front = car.lengthwise(name)
            shares.append(loads if front is None else np.array([front, 1.0 - front]))
        pushes = push * np.where(push > 0.0, shares[1], shares[0]) / loads
        curves = [curves_at(tire._replace(weights=w), _SLIPS) for w in weights]
        grip = np.max(curves, axis=2) / np.array(car.axle_loads)
        use = USE * pushes / np.maximum(grip, _LEAST_GRIP)[:, None]
        return np.sqrt(np.maximum(1.0 - use**2, LEAST_LEFT))

    def _errors(self, tire: PredictionTire, weights: Array, samples: Array) -> tuple[Array, Array]:
        """Return e and σ of k tires (k, m, 2) [static axle loads]."""
        n, least = len(samples), self._settle + self._h
        if n <= least:
            raise ValueError(f"to judge a tire takes more than {least} samples, there are {n}")
        inertia, load = car_numbers(tire.vehicle)[:, 2:].T
        phi, settled = (one / load for one in _forces(tire, weights, samples, self.dt))
        lag = np.abs(_along(settled - phi, self._mean))
        lag = sliding_window_view(lag, self._settle + 1, axis=1).max(axis=-1)  # and just before
        phi = phi[:, self._settle :]
        samples = samples[self._settle :]
        v_x, v_y, r = samples[:, :3].T
        xi = v_y[:, None] / GRAVITY + inertia * r[:, None]
        rate = phi - (v_x * r / GRAVITY)[:, None]
        integral = np.cumsum(0.5 * (rate[:, 1:] + rate[:, :-1]), axis=1) * self.dt  # trapezoidal
        gap = xi - xi[0] - np.concatenate([np.zeros((len(phi), 1, 2)), integral], axis=1)
        left = self._left(tire, weights, samples)
        force = _along(phi, self._mean)
        e = _along(gap, self._slope) + (1.0 - left) * force
        share = RELATIVE_ERROR * left + TAKEN_ERROR * (1.0 - left)
        return e, ERROR + share * np.abs(force) + LAG_ERROR * lag


def _along(signals: Array, kernel: Array) -> Array:
    """Return Σ_j kernel_j s(i + j) along the samples of signals (..., n, 2): (..., m, 2)."""
    stretches = sliding_window_view(signals, len(kernel), axis=-2)
    return np.asarray(stretches @ kernel, dtype=np.float64)
