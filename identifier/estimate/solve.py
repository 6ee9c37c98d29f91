"""The estimate: maximum a posteriori of all parameters over whole logs.

What the balance misses, e (n, 2), every 0.05 s, over its size b = sqrt(0.02² + (0.04 v_x r/g)²):
J(p) = Σ w/T_i (ν + 1)/2 ln(1 + e²/(ν b² S_i²)) + prior,   ν = 4 (Student),
w: seconds of a residual, T_i: integrated autocorrelation time of the axle's residual, so that a
second of it counts 1/T_i times; S_i: its scale, by expectation maximization in each iteration.
Gauss-Newton with Levenberg's damping and active bounds.
"""

import itertools
from collections.abc import Iterator, Sequence
from copy import copy
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from codegen import Scan
from codegen.arrays import Array
from identifier.axle.slip import Sway
from identifier.estimate.drive import Drive
from identifier.estimate.posterior import Posterior
from identifier.estimate.priors import OF_CAR, Priors
from identifier.motion.model import CarNumbers, motion_scan
from identifier.motion.parameters import INDEX, NAMES, SLIPS
from models.vehicle import GRAVITY, Vehicle

STRIDE = 0.05  # [s] between residuals
ERROR_SIZE = 0.02, 0.04  # b: of a static load, and of the lateral acceleration in g
NU = 4.0  # degrees of freedom of the loss: a tenth of the residuals may be far off
_LEAST_SCALE = 0.25  # S: a model is never believed to be better than that
_SHORTEST_MEMORY = 0.25  # least T [s]
# Independent residuals that drives count for at most: errors of a model do not average out. On the
# recordings and random cars of a minute or two 80 to no limit are within 0.1 % of the force.
MOST_COUNT = 200.0
_LONGEST_MEMORY = 8.0  # largest T [s]
_LEAST_STIFF = 0.9  # of C: slope at zero; 0.25 leaves a third of a planted play to the curve
_STIFF_SD = 0.1  # of C: how firmly that is believed, chosen on random cars and CommonRoad's
_ITERATIONS = 25  # of a descent, at most
ENOUGH = 0.02  # [nats] of improvement, below which it ends
_COARSE = 0.045  # [s] of a sedan, between samples of the problem that starts are tried in
_COARSELY = 0.2  # [nats] of improvement, below which a descent there ends
_SAME_SLOPES = 0.2  # of what steps on slopes gained, that another on them must gain
_SETTLED_MEMORY = 0.1  # |ln| by which T changes where the descent may end
_SETTLING = 60  # iterations at most where no drive is looked at
_SETTLED = 1e-4  # [nats] of improvement, below which these end

_SOME = 0.1  # of what a step on new slopes promised, that it must gain; else it is damped more
_GOOD = 0.5  # of what a step promised, that it gains where the next is damped less
_LEAST_USE = 0.002  # of the ellipse, down to which a descent goes: at none there is no slope
_USES = [INDEX[f"{use}_{axle}"] for use in ("braking", "driving") for axle in "fr"]
DELAYS = [INDEX[name] for name in ("v_y_delay", "r_delay", "steering_delay")]


Labels: TypeAlias = Sequence[NDArray[np.intp]]


class _Residuals(NamedTuple):
    """e over b (m, 2), and its slopes (m, 2, n) at p over those of its entries `moved` (n,)."""

    e: Array
    slopes: Array
    p: Array
    moved: NDArray[np.intp]


class Problem:
    """Residuals of drives of one car as a function of the parameters.
    labels : by drive, which road each sample is on (n,), 0 that of the curves; None is one road.
    every : whether slopes over all parameters are at hand, for `under` other priors.
    """

    def __init__(
        self,
        drives: Sequence[Drive],
        vehicle: Vehicle,
        priors: Priors,
        labels: Labels | None = None,
        *,
        every: bool = False,
    ) -> None:
        self.drives, self.vehicle, self.labels = drives, vehicle, labels
        self.roads = 0 if labels is None else max(int(one.max()) for one in labels)
        self.priors = priors.with_roads(self.roads) if self.roads else priors
        self._of_one_road = priors
        self.index = np.flatnonzero(self.priors.moves)
        moving = self.index[self.index < len(NAMES)]
        self.tires = len(moving)  # columns of slopes that are not of roads
        self._columns = moving if every else np.arange(self.tires)
        moved = NAMES[:-1] if every else [NAMES[k] for k in moving]
        self._scan = motion_scan((*moved, "ln_road"))
        self._car = car_numbers(vehicle)
        self._strides = [max(1, round(STRIDE / one.dt)) for one in drives]
        self._kept, weights, forces = [], [], []
        for one, stride in zip(drives, self._strides, strict=True):
            kept = np.flatnonzero(one.counts[::stride])
            v_x, r = one.signals[::stride][kept][:, [0, 2]].T
            self._kept.append(kept)
            forces.append(np.abs(v_x * r) / GRAVITY)
            weights.append(np.full(kept.size, one.dt * stride))
        self.lengths = [kept.size for kept in self._kept]
        self.weight = np.concatenate(weights)
        self.force = np.concatenate(forces)  # of an axle in steady cornering [static loads]
        self.size = error_size(self.force)

    def under(self, priors: Priors) -> "Problem":
        """Return the same under other priors, of a problem with slopes over `every` parameter."""
        other = copy(self)
        other.priors = other._of_one_road = priors
        other.index = np.flatnonzero(priors.moves)
        other.tires, other._columns = other.index.size, other.index
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

    def model_error(self, p: Array) -> Array:
        """Return the share of the force that the balance misses at each axle, (2,)."""
        e = self.misses(p) * self.size[:, None]
        return np.sqrt(self.weight @ e**2 / (self.weight @ self.force**2))

    def times(self, k: int) -> Array:
        """Return when the residuals of a drive are [s]."""
        return self.drives[k].t[:: self._strides[k]][self._kept[k]]

    def thinned(self) -> "Problem":
        """Return the problem of one road with means of samples, for first guesses."""
        longest = _COARSE * min(self.vehicle.scale, 1.0)
        times = [max(1, int(longest / one.dt)) for one in self.drives]
        if max(times) == 1 and self.labels is None:
            return self
        drives = [one.thinned(every) for one, every in zip(self.drives, times, strict=True)]
        return Problem(drives, self.vehicle, self._of_one_road)

    def misses(self, p: Array, road: float = 0.0) -> Array:
        """Return what the balance misses over its size, (m, 2).
        p : as of `residuals`.   road : ln of the friction that is added to that of all samples.
        """
        found = []
        for k, (stride, kept) in enumerate(zip(self._strides, self._kept, strict=True)):
            driven = self._driven(k, p, road)
            e = _simulated(driven, p, self._car, motion_scan(), ("residual",), stride)[0]
            found.append(e[kept])
        return self._over_size(np.concatenate(found), p)

    def _driven(self, k: int, p: Array, road: float = 0.0) -> Drive:
        """Return a drive on its roads."""
        if self.labels is None:
            return self.drives[k].on(road) if road else self.drives[k]
        return self.drives[k].on(np.append(0.0, p[len(NAMES) :])[self.labels[k]] + road)

    def _over_size(self, e: Array, p: Array) -> Array:
        """Return e over its size, which shrinks with v_x: that shrinks what is missed, and
        explains nothing.
        """
        size = self.size[:, None] * min(1.0 + float(p[INDEX["v_x_factor"]]), 1.0)
        with np.errstate(invalid="ignore", over="ignore"):
            return np.nan_to_num(e / size, nan=1e3, posinf=1e3, neginf=-1e3)

    def residuals(self, p: Array) -> _Residuals:
        """Return what the balance misses, and its slopes.
        p : parameters, and behind them ln of the friction of other roads.
        """
        many, slopes = [], []
        ports = ("residual", "slopes")
        for k, (stride, kept) in enumerate(zip(self._strides, self._kept, strict=True)):
            residual, J = _simulated(self._driven(k, p), p, self._car, self._scan, ports, stride)
            many.append(residual[kept])
            of_road, J = J[kept][:, :, -1:], J[kept][:, :, self._columns]
            if self.roads and self.labels is not None:
                on = self.labels[k][::stride][kept][:, None] == np.arange(1, self.roads + 1)
                J = np.concatenate([J, of_road * on[:, None, :]], axis=2)
            slopes.append(J)
        e, slope = np.concatenate(many), np.concatenate(slopes)
        shrunk = min(1.0 + float(p[INDEX["v_x_factor"]]), 1.0)
        if shrunk < 1.0:
            slope[:, :, self.index == INDEX["v_x_factor"]] -= e[..., None] / shrunk
        with np.errstate(invalid="ignore", over="ignore"):
            slope = np.nan_to_num(slope / (self.size[:, None, None] * shrunk))
        return _Residuals(self._over_size(e, p), slope, p, self.index)

    def memory(self, e: Array) -> Array:
        """Return T of both axles [s], (2,), from the correlation of residuals (m, 2).
        e : over b [-], (m, 2).
        """
        step, x = float(self.weight[0]), np.clip(e, -4.0, 4.0)
        lags = int(_LONGEST_MEMORY / step) + 1
        edges = np.cumsum(self.lengths)[:-1]
        found = [autocorrelation_time(np.split(x[:, k], edges), step, lags) for k in range(2)]
        return np.maximum(found, max(_SHORTEST_MEMORY, float(self.weight.sum()) / MOST_COUNT))

    def scale(self, e: Array) -> Array:
        """Return S² of both axles, (2,), by expectation maximization.
        e : over b [-], (m, 2).
        """
        S2 = np.maximum(np.median(np.abs(e), axis=0) / 0.6745, _LEAST_SCALE) ** 2
        total = self.weight.sum()
        for _ in range(8):
            w = (NU + 1.0) / (NU + e**2 / S2)
            S2 = np.maximum(self.weight @ (w * e**2) / total, _LEAST_SCALE**2)
        return S2

    def cost(self, e: Array, p: Array, T: Array) -> float:
        """Return J of residuals at parameters when a second of them counts 1/T times [nats].
        e : over b [-], (m, 2).   p : (p,).   T : [s], (2,).
        """
        S2 = self.scale(e)
        scales = float((0.5 * np.log(S2) * self.weight.sum() / T).sum())
        return self.misfit(e, S2, T) + beliefs_cost(self.priors, p) + scales

    def misfit(self, e: Array, S2: Array, T: Array) -> float:
        """Return Σ w/T ρ(e) [nats].
        e : over b [-], (m, 2).   S2 : [-], (2,).   T : [s], (2,).
        """
        loss = (NU + 1.0) / 2.0 * np.log1p(e**2 / (NU * S2))
        return float((self.weight @ loss / T).sum())


def error_size(force: Array) -> Array:
    """Return b, what a good model misses of a force, both in static loads."""
    floor, share = ERROR_SIZE
    return np.hypot(floor, share * force)


def autocorrelation_time(pieces: Sequence[Array], step: float, lags: int) -> float:
    """Return the integrated autocorrelation time of a signal [s]; 2 s where it is zero.
    pieces : of the signal; such below 20 samples do not count.   step : between samples [s].
    lags : of which at most a third of a piece is looked at.
    """
    total = np.zeros(lags)
    for x in pieces:
        if x.size < 20:
            continue
        size = 1 << (2 * x.size - 1).bit_length()
        correlation = np.fft.irfft(np.abs(np.fft.rfft(x, size)) ** 2, size)
        few = max(min(x.size // 3, lags - 1), 1)
        total[:few] += correlation[:few]
    if not total[0] > 0.0:
        return 2.0
    rho = total / total[0]
    fallen = rho < 0.05
    until = int(np.argmax(fallen)) if fallen.any() else lags
    return step * (1.0 + 2.0 * float(rho[1 : max(until, 1)].sum()))


def car_numbers(vehicle: Vehicle) -> Array:
    """Return the numbers of `CarNumbers`, (7,)."""
    m, I_z, l_f, l_r = vehicle.bicycle[:4]
    omega = Sway.for_vehicle(vehicle).frequency
    return np.array(
        CarNumbers(l_f, l_r, I_z / (m * GRAVITY), omega, *vehicle.downforce, vehicle.drag)
    )


def _simulated(
    one: Drive, p: Array, car: Array, scan: Scan, ports: tuple[str, ...], every: int = 1
) -> list[Array]:
    """Return what comes out of a compiled motion over a drive, by port.

    Late signals are read on time; the rest of a delay is 0.
    car : of `car_numbers`, (7,).   every : samples between what is returned.
    """
    p = p[: len(NAMES)]
    late = p[DELAYS]
    if late.any():
        one, p = one.on_time(late), p.copy()
        p[DELAYS] = 0.0
    signals = {"signals": one.signals, "rates": one.rates}
    given = {**scan.zeros(), **signals, "parameters": p, "car": car, "dt": np.array(one.dt)}
    out = scan(len(one.signals), given, every=every, ports=ports)
    return [out[port] for port in ports]


def simulate(one: Drive, p: Array, vehicle: Vehicle) -> dict[str, Array]:
    """Return force [static loads], what is missed and slip of a drive, (n, 2) each, by port."""
    ports = ("force", "residual", "slip")
    found = _simulated(one, p, car_numbers(vehicle), motion_scan(), ports)
    return dict(zip(ports, found, strict=True))


def estimate(
    drives: Sequence[Drive],
    vehicle: Vehicle,
    priors: Priors | None = None,
    begin: Array | None = None,
    *,
    labels: Labels | None = None,
    enough: float = ENOUGH,
) -> Posterior:
    """Return the parameters that explain drives best, and how sure they are.
    vehicle : the car; its stiffnesses are not looked at.
    priors : beliefs; None takes those of the car.
    begin : parameters to begin with (p,); None begins with the prior's mean, and where straights
        show v_y or steering off zero, also from there.
    labels : by drive, which road each sample is on (n,), 0 that of the curves; None is one road.
    enough : improvement of the cost, below which it ends [nats].
    """
    problem = Problem(drives, vehicle, priors or Priors.of(vehicle), labels)
    if begin is None:
        coarse = problem.thinned()
        each = enough if coarse is problem else _COARSELY
        tried = [descend(coarse, one, enough=each) for one in starts(problem)]
        best = min(tried, key=lambda one: one.cost)
        if coarse is problem:
            return best
        begin = best.p
    begin = np.concatenate([begin[: len(NAMES)], np.zeros(problem.roads)])
    return descend(problem, begin, enough=enough)


def starts(problem: Problem) -> list[Array]:
    """Return the parameters to begin with: the prior's mean, and offsets that straights show."""
    mean = problem.priors.mean[: len(NAMES)]
    signals = np.concatenate([one.signals[one.counts] for one in problem.drives])
    v_x, v_y, r, delta = signals[:, :4].T
    straight = np.abs(v_x * r) < 0.03 * GRAVITY
    begins = [mean.copy()]
    if np.count_nonzero(straight) <= 50:
        return begins
    b, zero = float(np.median(v_y[straight])), float(np.median(delta[straight]))
    fast = float(np.median(v_x[straight]))
    usual = OF_CAR["v_y_bias"].sd * problem.vehicle.scale
    if abs(b) > 0.4 * usual or abs(zero) > 0.4 * OF_CAR["steering_zero"].sd:
        for bias, angle in ((b, 0.0), (0.0, b / fast)):
            one = mean.copy()
            one[INDEX["steering_zero"]] = -zero
            one[INDEX["v_y_bias"]], one[INDEX["v_y_angle"]] = bias, angle
            begins.append(one)
    low, high = (bound[: len(NAMES)] for bound in (problem.priors.low, problem.priors.high))
    return [np.clip(one, low, high) for one in begins]


def descend(
    problem: Problem,
    start: Array,
    memory: Array | None = None,
    iterations: int = _ITERATIONS,
    enough: float = ENOUGH,
) -> Posterior:
    """Return the optimum that is found from a start.
    start : parameters to begin with (p,).
    memory : T [s], (2,), where it is held, so that costs can be compared; None estimates it.
    enough : improvement below which it ends [nats].
    """
    priors, index = problem.priors, problem.index
    p, damping = start.copy(), 1e-3 if memory is None else 1e-6  # then it is near
    # Far from the optimum all residuals are correlated: by their T they would count for nothing.
    T = np.full(2, _SHORTEST_MEMORY) if memory is None else memory
    settled, ended, moved, total = memory is not None, False, True, 0.0
    now, taken = problem.residuals(p), 1  # slopes; steps on them gained so much: `total`
    for look in itertools.count():
        S2 = problem.scale(now.e)
        if memory is None and look:
            found = problem.memory(now.e)
            before, T = T, np.sqrt(T * found) if moved else found
            settled = bool(np.abs(np.log(T / before)).max() < _SETTLED_MEMORY) or not moved
        p, e, damping, gained = _better(problem, now, p, (S2, T), damping, enough, once=total > 0.0)
        now = now._replace(e=e)
        if gained > max(_SAME_SLOPES * total, enough):
            total, moved = total + gained, True
        elif not (total or gained or settled):
            moved = False  # T alone does
        else:
            ended = not total and settled
            if not (ended and not gained):
                now = problem.residuals(p)
            if ended or taken == iterations:
                break
            taken, moved, total = taken + 1, True, 0.0
    S2, T = problem.scale(now.e), problem.memory(now.e) if memory is None else memory
    H, gradient = normal(problem, now, S2, T)
    slope, curvature = _of_drives(problem, H, gradient)
    H = H + around_beliefs(priors, p)[1][np.ix_(index, index)]
    cost = problem.cost(now.e, p, T)
    whole = np.zeros((len(p), len(p)))
    whole[np.ix_(index, index)] = np.linalg.inv(H)
    n = len(NAMES)
    return Posterior(
        p=p[:n],
        covariance=whole[:n, :n],
        slope=slope,
        curvature=curvature,
        seconds=float(problem.weight.sum()),
        roads=p[n:],
        road_sd=np.sqrt(np.diag(whole)[n:]),
        scale=np.sqrt(S2),
        memory=T,
        cost=cost,
        ended=ended,
    )


def _better(
    problem: Problem,
    now: _Residuals,
    p: Array,
    weight: tuple[Array, Array],
    damping: float,
    enough: float,
    *,
    once: bool,
) -> tuple[Array, Array, float, float]:
    """Return parameters that cost less, their e, the damping from there on and what was gained.
    weight : S² and T.   once : whether no more damping is tried, as where the slopes are old.
    """
    priors, index = problem.priors, problem.index
    cost = problem.misfit(now.e, *weight) + beliefs_cost(priors, p)
    H, gradient = normal(problem, now, *weight)
    of_beliefs, curvature = around_beliefs(priors, p)
    H, gradient = H + curvature[np.ix_(index, index)], gradient + of_beliefs[index]
    for trial, tried in _trials(H, gradient, p, priors, damping):
        step = (trial - p)[index]
        promised = float(-step @ (gradient + 0.5 * H @ step))
        if promised < enough:
            break
        e = problem.misses(trial)
        reached = problem.misfit(e, *weight) + beliefs_cost(priors, trial)
        if cost - reached > (0.0 if once else min(_SOME * promised, enough)):
            good = cost - reached > _GOOD * promised
            return trial, e, max(tried / 5.0, 1e-6) if good else max(tried, 1e-3), cost - reached
        if once:
            break
    return p, now.e, damping, 0.0


def _of_drives(problem: Problem, H: Array, gradient: Array) -> tuple[Array, Array]:
    """Return slope (p,) and curvature (p, p) of the misfit, roads of segments marginal."""
    n, tires = len(NAMES), problem.tires
    index, some, roads = problem.index[:tires], slice(0, tires), slice(tires, None)
    if problem.roads:
        before = problem.priors.information[n:, n:]
        gain = np.linalg.solve(before + H[roads, roads], H[roads, some]).T
        H, gradient = H[some, some] - gain @ H[roads, some], gradient[some]  # at the optimum
    slope, curvature = np.zeros(n), np.zeros((n, n))
    slope[index], curvature[np.ix_(index, index)] = gradient, 0.5 * (H + H.T)
    return slope, curvature


def settled(priors: Priors, begin: Array) -> tuple[Array, Array]:
    """Return the optimum (p,) of what is believed, and its covariance (p, p).

    With `Priors.after` these are the parameters of all drives together.
    begin : parameters to begin with (p,).
    """
    index, p = np.flatnonzero(priors.moves), begin.copy()
    where, cost, damping = np.ix_(index, index), beliefs_cost(priors, p), 1e-6
    for _ in range(_SETTLING):
        gradient, curvature = around_beliefs(priors, p)
        for trial, tried in _trials(curvature[where], gradient[index], p, priors, damping):
            reached = beliefs_cost(priors, trial)
            if reached < cost:
                p, damping = trial, max(tried / 5.0, 1e-6)
                break
        else:
            break
        gained, cost = cost - reached, reached
        if gained < _SETTLED:
            break
    covariance = np.zeros_like(priors.information)
    covariance[where] = np.linalg.inv(around_beliefs(priors, p)[1][where])
    return p, covariance


def _trials(
    H: Array, gradient: Array, p: Array, priors: Priors, damping: float
) -> Iterator[tuple[Array, float]]:
    """Yield where steps with more and more of Levenberg's damping end, and that damping."""
    index = np.flatnonzero(priors.moves)
    least = np.where(np.isin(index, _USES), _LEAST_USE, -np.inf)
    low, high = np.maximum(priors.low[index], least), priors.high[index]
    for _ in range(8):
        step = bounded_step(H + damping * np.diag(np.diag(H)), gradient, p[index], low, high)
        trial = p.copy()
        trial[index] = np.clip(p[index] + step, low, high)
        yield trial, damping
        damping = max(6.0 * damping, 1e-3)


def beliefs_cost(priors: Priors, p: Array) -> float:
    """Return what the priors cost, and tires that are too soft about zero slip [nats]."""
    soft, _ = softness(p)
    return priors.cost(p) + 0.5 * float(soft @ soft)


def around_beliefs(priors: Priors, p: Array) -> tuple[Array, Array]:
    """Return gradient (p,) and positive curvature (p, p) of `beliefs_cost`."""
    gradient, curvature = priors.around(p)
    soft, slopes = softness(p)
    return gradient + soft @ slopes, curvature + slopes.T @ slopes


def softness(p: Array) -> tuple[Array, Array]:
    """Return how far the slope of both axles at zero is outside what a tire can have, and its
    slopes over p (p,).

    No tire has much less than C there: play of the steering looks so. None has more: the stiffness
    is C's to tell, else a gentle drive puts it into a unit of the residual that is over before the
    corner. (2,), in standard deviations of a tenth of C, negative where it is soft, and (2, p);
    zero between.
    """
    found, slopes = np.zeros(2), np.zeros((2, p.size))
    for i, axle in enumerate("fr"):
        k = INDEX[f"ln_stiffness_{axle}"]
        q = [INDEX[f"residual{j}_{axle}"] for j in range(len(SLIPS))]
        C = float(np.exp(p[k]))
        added = float(np.sum(p[q] / np.array(SLIPS))) / C
        outside = added - min(max(added, _LEAST_STIFF - 1.0), 0.0)
        if outside:
            found[i] = outside / _STIFF_SD
            slopes[i, k] = -added / _STIFF_SD
            slopes[i, q] = 1.0 / (np.array(SLIPS) * C * _STIFF_SD)
    return found, slopes


def normal(problem: Problem, at: _Residuals, S2: Array, T: Array) -> tuple[Array, Array]:
    """Return Gauss-Newton's matrix (n, n) and the gradient of the misfit (n,).

    G is quadratic in a use of the ellipse, whose second slope is the first over it.
    """
    w = problem.weight[:, None] / T * (NU + 1.0) / (NU * S2 + at.e**2)
    J = at.slopes.reshape(-1, at.slopes.shape[2])
    weighted = J * w.reshape(-1, 1)
    H, gradient = weighted.T @ J, weighted.T @ at.e.ravel()
    uses = np.isin(at.moved, _USES)
    H[uses, uses] += np.maximum(gradient[uses] / np.maximum(at.p[at.moved[uses]], _LEAST_USE), 0.0)
    return H, gradient


def bounded_step(H: Array, gradient: Array, p: Array, low: Array, high: Array) -> Array:
    """Return the step to the least of a quadratic model within bounds, by an active set.
    H : positive definite (n, n).   gradient, p, low, high : (n,), p within its bounds.
    """
    least, most = low - p, high - p
    free, step = np.ones(p.size, dtype=bool), np.zeros(p.size)
    for _ in range(3 * p.size):
        held = ~free
        rest = gradient[free] + H[np.ix_(free, held)] @ step[held]
        step[free] = -np.linalg.solve(H[np.ix_(free, free)], rest)
        out = free & ((step < least) | (step > most))
        if out.any():
            step[out] = np.clip(step[out], least[out], most[out])
            free &= ~out
            continue
        slope = gradient + H @ step
        back = held & (((step <= least) & (slope < 0.0)) | ((step >= most) & (slope > 0.0)))
        if not back.any():
            break
        worst = np.argmax(np.where(back, np.abs(slope) / np.sqrt(np.diag(H)), 0.0))
        free[worst] = True
    return step
