"""The estimate: maximum a posteriori of all parameters over whole logs.

What the balance misses, e (n, 2), every 0.05 s, over its size b = sqrt(0.02² + (0.04 v_x r/g)²):
J(p) = Σ w/T_i (ν + 1)/2 ln(1 + e²/(ν b² S_i²)) + prior,   ν = 4 (Student),
w: seconds of a residual, T_i: integrated autocorrelation time of the axle's residual, so that a
second of it counts 1/T_i times; S_i: its scale, by expectation maximization in each iteration.
Gauss-Newton with Levenberg's damping and active bounds.
"""

from collections.abc import Sequence
from copy import copy
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from identifier.estimate.drive import Drive
from identifier.estimate.posterior import Posterior
from identifier.estimate.priors import OF_CAR, SEDAN, Priors
from identifier.motion.model import CARRIED, CarNumbers, motion_scan
from identifier.motion.parameters import INDEX, NAMES
from models.vehicle import GRAVITY, Vehicle

STRIDE = 0.05  # [s] between residuals
ERROR, RELATIVE = 0.02, 0.04  # b: of a static load, and of the lateral acceleration in g
NU = 4.0  # degrees of freedom of the loss: a tenth of the residuals may be far off
LEAST_SCALE = 0.25  # S: a model is never believed to be better than that
SHORTEST_MEMORY, LONGEST_MEMORY = 0.25, 8.0  # T [s]
ITERATIONS = 25
DELAYS = [INDEX[name] for name in ("v_y_delay", "r_delay", "steering_delay")]
ENOUGH = 0.02  # [nats] of improvement, below which it ends


class Residuals(NamedTuple):
    """e over b (m, 2), and its slopes over the parameters that move (m, 2, n)."""

    e: Array
    slopes: Array


class Problem:
    """Residuals of drives of one car as a function of the parameters.

    Parameters
    ----------
    drives : of one car, with the same sensors.
    vehicle : the car.
    priors : which parameters move.
    every : whether slopes over all parameters are at hand, for `under` other priors.
    """

    def __init__(
        self,
        drives: Sequence[Drive],
        vehicle: Vehicle,
        priors: Priors,
        *,
        every: bool = False,
    ) -> None:
        self.drives, self.vehicle, self.priors = drives, vehicle, priors
        self.index = np.flatnonzero(priors.moves)
        columns = np.arange(len(NAMES)) if every else self.index
        self._columns = np.searchsorted(columns, self.index)
        self._scan = motion_scan(tuple(NAMES[k] for k in columns))
        self._car = car_numbers(vehicle)
        self._strides = [max(1, round(STRIDE / one.dt)) for one in drives]
        self._kept = [
            np.flatnonzero(one.counts[::stride])
            for one, stride in zip(drives, self._strides, strict=True)
        ]
        self.lengths = [kept.size for kept in self._kept]
        sizes, weights, forces = [], [], []
        for one, stride, kept in zip(drives, self._strides, self._kept, strict=True):
            v_x, r = one.signals[::stride][kept][:, [0, 2]].T
            forces.append(np.abs(v_x * r) / GRAVITY)
            sizes.append(np.hypot(ERROR, RELATIVE * forces[-1]))
            weights.append(np.full(kept.size, one.dt * stride))
        self.size = np.concatenate(sizes)
        self.weight = np.concatenate(weights)
        self.force = np.concatenate(forces)  # of an axle in steady cornering [static loads]

    def under(self, priors: Priors) -> "Problem":
        """Return the same under other priors, of a problem with slopes over `every` parameter."""
        other = copy(self)
        other.priors, other.index = priors, np.flatnonzero(priors.moves)
        other._columns = other.index
        return other

    def weighted(self, some: Array) -> "Problem":
        """Return the same with weights of the residuals, (m,)."""
        other = copy(self)
        other.weight = self.weight * some
        return other

    def halves(self) -> tuple[Array, Array]:
        """Return which residuals are of the first half of all force, and of the second, (m,)."""
        so_far = np.cumsum(self.force**2)
        first = (so_far <= 0.5 * so_far[-1]).astype(float)
        return first, 1.0 - first

    def missed(self, p: Array) -> Array:
        """Return the share of the force that the balance misses at each axle, (2,)."""
        e = self.residuals(p).e * self.size[:, None]
        share: Array = np.sqrt(self.weight @ e**2 / (self.weight @ self.force**2))
        return share

    def residuals(self, p: Array) -> Residuals:
        """Return what the balance misses, and its slopes."""
        e, slopes = [], []
        for one, stride, kept in zip(self.drives, self._strides, self._kept, strict=True):
            out = self._scan(
                len(one.signals),
                _arguments(one, p, self._car, self._scan.step.numel_in("tangent")),
                every=stride,
                ports=("missed", "missed_slopes"),
            )
            e.append(out["missed"][kept])
            slopes.append(out["missed_slopes"][kept][..., self._columns])
        size = self.size[:, None]
        with np.errstate(invalid="ignore", over="ignore"):
            return Residuals(
                np.nan_to_num(np.concatenate(e) / size, nan=1e3, posinf=1e3, neginf=-1e3),
                np.nan_to_num(np.concatenate(slopes) / size[..., None]),
            )

    def memory(self, e: Array) -> Array:
        """Return T of both axles [s], (2,), from the correlation of residuals (m, 2)."""
        found = np.empty(2)
        step = self.weight[0]
        lags = int(LONGEST_MEMORY / step) + 1
        for axle in range(2):
            total, begin = np.zeros(lags), 0
            for length in self.lengths:
                x = np.clip(e[begin : begin + length, axle], -4.0, 4.0)
                begin += length
                if length < 20:
                    continue
                size = 1 << (2 * length - 1).bit_length()
                spectrum = np.fft.rfft(x, size)
                correlation = np.fft.irfft(np.abs(spectrum) ** 2, size)
                few = max(min(length // 3, lags - 1), 1)
                total[:few] += correlation[:few]
            if not total[0] > 0.0:
                found[axle] = 2.0
                continue
            rho = total / total[0]
            fallen = rho < 0.05
            until = int(np.argmax(fallen)) if fallen.any() else lags
            found[axle] = step * (1.0 + 2.0 * rho[1 : max(until, 1)].sum())
        return np.maximum(found, SHORTEST_MEMORY)

    def scale(self, e: Array) -> Array:
        """Return S² of both axles, (2,), by expectation maximization."""
        S2 = np.maximum(np.median(np.abs(e), axis=0) / 0.6745, LEAST_SCALE) ** 2
        total = self.weight.sum()
        for _ in range(8):
            w = (NU + 1.0) / (NU + e**2 / S2)
            S2 = np.maximum(self.weight @ (w * e**2) / total, LEAST_SCALE**2)
        return S2

    def misfit(self, e: Array, S2: Array, T: Array) -> float:
        """Return Σ w/T ρ(e) [nats]."""
        loss = (NU + 1.0) / 2.0 * np.log1p(e**2 / (NU * S2))
        return float((self.weight @ loss / T).sum())


def car_numbers(vehicle: Vehicle) -> Array:
    """Return the numbers of `CarNumbers`, (6,)."""
    m, I_z, l_f, l_r = vehicle.bicycle[:4]
    omega = min(5.0 * np.sqrt(GRAVITY / vehicle.wheelbase), 60.0)
    return np.array(CarNumbers(l_f, l_r, I_z / (m * GRAVITY), omega, *vehicle.downforce))


def _arguments(one: Drive, p: Array, car: Array, tangent: int = 0) -> dict[str, Array]:
    """Return the ports of the model; late signals are read on time, the rest of a delay is 0."""
    late = p[DELAYS]
    if late.any():
        one, p = one.on_time(late), p.copy()
        p[DELAYS] = 0.0
    more = {"tangent": np.zeros(tangent)} if tangent else {}
    return {
        "state": np.zeros(len(CARRIED)),
        "was_on": np.zeros(1),
        "signals": one.signals,
        "rates": one.rates,
        "parameters": p,
        "car": car,
        "dt": np.array(one.dt),
        **more,
    }


def simulate(one: Drive, p: Array, vehicle: Vehicle) -> dict[str, Array]:
    """Return force [static loads], what is missed and slip of a drive, (n, 2) each, by port."""
    scan = motion_scan()
    return scan(
        len(one.signals),
        _arguments(one, p, car_numbers(vehicle)),
        ports=("force", "missed", "slip"),
    )


def estimate(
    drives: Sequence[Drive],
    vehicle: Vehicle,
    priors: Priors | None = None,
    begin: Array | None = None,
) -> Posterior:
    """Return the parameters that explain drives best, and how sure they are.

    Parameters
    ----------
    drives : of one car with the same sensors, in which it drives.
    vehicle : the car; its stiffnesses are not looked at.
    priors : beliefs; None takes those of the car.
    begin : parameters to begin with (p,); None begins with the prior's mean, and where straights
        show v_y or steering off zero, also from there.
    """
    priors = Priors.of(vehicle) if priors is None else priors
    problem = Problem(drives, vehicle, priors)
    begins = starts(problem) if begin is None else [begin]
    found = [descend(problem, start) for start in begins]
    return min(found, key=lambda one: one.cost)


def starts(problem: Problem) -> list[Array]:
    """Return the parameters to begin with: the prior's mean, and offsets that straights show."""
    mean = problem.priors.mean
    signals = np.concatenate([one.signals[one.counts] for one in problem.drives])
    v_x, v_y, r, delta = signals[:, :4].T
    straight = np.abs(v_x * r) < 0.03 * GRAVITY
    begins = [mean.copy()]
    if np.count_nonzero(straight) <= 50:
        return begins
    b, zero = float(np.median(v_y[straight])), float(np.median(delta[straight]))
    fast = float(np.median(v_x[straight]))
    usual = OF_CAR["v_y_bias"].sd * float(np.sqrt(problem.vehicle.wheelbase / SEDAN))
    if abs(b) > 0.4 * usual or abs(zero) > 0.4 * OF_CAR["steering_zero"].sd:
        for bias, angle in ((b, 0.0), (0.0, b / fast)):
            one = mean.copy()
            one[INDEX["steering_zero"]] = -zero
            one[INDEX["v_y_bias"]], one[INDEX["v_y_angle"]] = bias, angle
            begins.append(one)
    return [np.clip(one, problem.priors.low, problem.priors.high) for one in begins]


def descend(
    problem: Problem,
    start: Array,
    memory: Array | None = None,
    iterations: int = ITERATIONS,
    enough: float = ENOUGH,
) -> Posterior:
    """Return the optimum that is found from a start.

    Parameters
    ----------
    start : parameters to begin with (p,).
    memory : T [s], (2,), where it is held, so that costs can be compared; None estimates it.
    iterations : at most.
    enough : improvement below which it ends [nats].
    """
    priors, index = problem.priors, problem.index
    low, high = priors.low[index], priors.high[index]
    P = priors.information[np.ix_(index, index)]
    p, damping = start.copy(), 1e-3
    now = problem.residuals(p)
    T, count = problem.memory(now.e) if memory is None else memory, 0
    for count in range(1, iterations + 1):
        S2 = problem.scale(now.e)
        T = np.sqrt(T * problem.memory(now.e)) if count > 1 and memory is None else T
        cost = problem.misfit(now.e, S2, T) + priors.cost(p)
        H, gradient = normal(problem, now, S2, T)
        H = H + P
        gradient = gradient + (priors.information @ (p - priors.mean))[index]
        better = None
        for _ in range(8):
            step = _bounded(H + damping * np.diag(np.diag(H)), gradient, p[index], low, high)
            trial = p.copy()
            trial[index] = np.clip(p[index] + step, low, high)
            then = problem.residuals(trial)
            reached = problem.misfit(then.e, S2, T) + priors.cost(trial)
            if reached < cost:
                better = trial, then, cost - reached
                break
            damping = max(6.0 * damping, 1e-3)
        if better is None:
            break
        p, now, gained = better
        damping = max(damping / 5.0, 1e-6)
        if gained < enough and (count > 3 or memory is not None):
            break
    S2, T = problem.scale(now.e), problem.memory(now.e) if memory is None else memory
    data, _ = normal(problem, now, S2, T)
    cost = problem.misfit(now.e, S2, T) + priors.cost(p)
    cost += float((0.5 * np.log(S2) * problem.weight.sum() / T).sum())
    return Posterior(
        vehicle=problem.vehicle,
        p=p,
        index=index,
        information=data + P,
        data_information=data,
        scale=np.sqrt(S2),
        memory=T,
        cost=cost,
        iterations=count,
    )


def normal(problem: Problem, at: Residuals, S2: Array, T: Array) -> tuple[Array, Array]:
    """Return Gauss-Newton's matrix (n, n) and the gradient of the misfit (n,)."""
    n = at.slopes.shape[2]
    H, gradient = np.zeros((n, n)), np.zeros(n)
    for axle in range(2):
        e, J = at.e[:, axle], at.slopes[:, axle, :]
        w = problem.weight / T[axle] * (NU + 1.0) / (NU * S2[axle] + e**2)
        weighted = J * w[:, None]
        H += weighted.T @ J
        gradient += weighted.T @ e
    return H, gradient


def _bounded(H: Array, gradient: Array, p: Array, low: Array, high: Array) -> Array:
    """Return the step of a quadratic model; parameters at a bound that it would leave stay."""
    free = np.ones(p.size, dtype=bool)
    step = np.zeros(p.size)
    for _ in range(4):
        step[:] = 0.0
        step[free] = -np.linalg.solve(H[np.ix_(free, free)], gradient[free])
        aimed = p + step
        out = ((aimed < low - 1e-12) & (p <= low + 1e-9)) | (
            (aimed > high + 1e-12) & (p >= high - 1e-9)
        )
        if not (free & out).any():
            break
        free &= ~out
    return step
