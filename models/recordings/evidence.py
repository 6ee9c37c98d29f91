"""What a recording says about itself, in window means that noise and lag do not upset.

Over a window of length T the lateral kinematics hold without differentiating a signal:
mean(a_y) = (v_y(t + T) - v_y(t))/T + mean(v_x r).
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import LONG, Array, filled, root_mean_square, thinning
from models.recordings.record import Recording
from models.vehicle import GRAVITY

WINDOW = 0.2  # [s]: keeps maneuvers up to 2 Hz, averages 20 samples of noise at 100 Hz
# [s], longer where a recording is: evenly over it, as many as of `codegen.arrays.LONG` samples
STRIDE = 0.05
_SLOWEST = 0.5  # [m/s]: below it slip and curvature are noise, for scale cars too
_TURNS = 0.2  # of what a channel reaches, beyond which the car turns
_ALIKE = 0.7  # least correlation of a sign
_BEYOND_CHANCE = 16.0  # least square of its t, of a sign
_LEAST = 0.1  # [m/s^2], rms, below which nothing turns
_LONGEST = 8.0  # [m], wheelbase by which steering says how much it turns at least
_TAIL_OUT = 0.15  # [rad]: sideslip against the turn beyond which a driver may countersteer
# A v_y that was computed. Chosen on 24 random cars, gentle, slow and lively, with each fault of the
# doctor's and without, beside computed ones; 0 of 720 clean logs of 80 others were one.
_LOADS_PER_RAD = np.geomspace(4.0, 40.0, 7)  # stiffness of a rear axle: none is stiffer
_BEHIND = 0.6  # [s], the slowest low pass that it may be behind
_FORGOTTEN = 8.0  # time constants after which it has forgotten
_COMPUTED = 0.25  # of what the best tire misses of v_y, that a formula misses at most,
_AT_RANDOM = 0.2  # and of what is then left, that goes with the motion at most,
_EXACTLY = 0.01  # unless so little of both is left
_FEWEST = 200  # windows that tell a formula
_LARGEST_TURN = 30.0  # [m/s^2] of v_x r, and slope of a_y on it: else a unit is wrong
_SLOPE = (0.5, 2.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows:
    """Where means are taken: windows of n steps in one segment.
    starts : index of the first sample of each window (m,).   duration : T [s].
    """

    starts: NDArray[np.intp]
    n: int
    duration: float

    @classmethod
    def where(
        cls,
        counts: NDArray[np.bool_],
        recording: Recording,
        length: float,
        every: int | None = None,
    ) -> "Windows":
        """Return the windows of a length in one segment of which every sample counts.
        counts : which samples do (n,).   length : of a window [s].
        every : steps from one window to the next; None lets them overlap by half.
        """
        n = max(2, round(length / recording.dt))
        starts = np.arange(0, max(len(recording) - n, 0), every or max(1, n // 2))
        windows = cls(starts=starts, n=n, duration=n * recording.dt)
        whole = (windows.mean(~counts) == 0.0) & recording.within_a_segment(starts, n)
        return replace(windows, starts=starts[whole])

    def __len__(self) -> int:
        return int(self.starts.size)

    def mean(self, signal: NDArray[Any], by: Array | None = None) -> Array:
        """Return means over the windows by the trapezoidal rule, (m,) or (m, k).
        signal : samples (n,) or (n, k).   by : what they are multiplied by, of the same shape.
        """
        if len(signal) > LONG and len(self) * self.n < len(signal):  # far apart: these alone
            total = np.zeros((len(self), *signal.shape[1:]))
            for k in range(self.n + 1):
                at = self.starts + k
                weight = 1.0 if 0 < k < self.n else 0.5
                total += weight * (signal[at] if by is None else signal[at] * by[at])
            return total / self.n
        signal = signal if by is None else signal * by
        steps = 0.5 * (signal[1:] + signal[:-1])
        total = np.concatenate([np.zeros((1, *steps.shape[1:])), np.cumsum(steps, axis=0)])
        return (total[self.starts + self.n] - total[self.starts]) / self.n

    def rate(self, signal: Array) -> Array:
        """Return rates of change over the windows, (m,) or (m, k).
        signal : samples (n,) or (n, k).
        """
        change: Array = signal[self.starts + self.n] - signal[self.starts]
        return change / self.duration


class Means(NamedTuple):
    """Window means of the moving part of a recording, each of shape (k,).

    v_x [m/s], v_y [m/s], r [rad/s], delta_f and delta_r [rad]; v_y_dot [m/s^2] and r_dot [rad/s^2]
    are differences over the window; v_x_r = mean(v_x r) [m/s^2]; v_y and v_y_dot, a_y [m/s^2] and
    force (k, 2) [N] may be None.
    """

    v_x: Array
    v_y: Array | None
    r: Array
    delta_f: Array
    delta_r: Array
    v_y_dot: Array | None
    r_dot: Array
    v_x_r: Array
    a_y: Array | None
    force: Array | None

    @property
    def delta(self) -> Array:
        """Steering that turns the car, delta_f - delta_r [rad]."""
        return self.delta_f - self.delta_r

    @property
    def grips(self) -> NDArray[np.bool_]:
        """Where the tail is not out, so that steering and turn go together, (k,)."""
        if self.v_y is None:
            return np.ones(self.r.size, dtype=np.bool_)
        return ~((self.v_y * self.r < 0.0) & (np.abs(self.v_y) > _TAIL_OUT * self.v_x))

    @property
    def acceleration(self) -> Array:
        """v̇_y + v_x r [m/s^2]; without a v_y what the accelerometer shows, or v_x r alone."""
        if self.v_y_dot is not None:
            return self.v_x_r + self.v_y_dot
        return self.v_x_r if self.a_y is None else self.a_y


class Fit(NamedTuple):
    """Least squares y = X theta: estimates, their standard errors, share of y explained."""

    theta: Array
    error: Array
    r_squared: float


class Steering(NamedTuple):
    """Path curvature against steering: effective wheelbase L = v_x delta/r and correlation."""

    wheelbase: float
    correlation: float


class Pair(NamedTuple):
    """How two channels that follow the same bends go together.
    correlation : from -1 to 1.   sign : 1 or -1 where that is beyond chance, else 0.   seconds : of
    windows that turn.   ratio : of the second's size there to the first's.
    """

    correlation: float
    sign: int
    seconds: float
    ratio: float = 1.0


def moving(speed: Array) -> float:
    """Return the speed from which a car moves [m/s]: 30 % of what is usual, its 95th percentile.
    speed : of samples (n,).
    """
    usual = np.percentile(speed[:: thinning(speed.size)], 95) if speed.size else 0.0
    return max(_SLOWEST, 0.3 * float(usual))


def windows(recording: Recording) -> Means:
    """Average a recording over windows of 0.2 s in which the car moves forward all the time.

    No window reaches from one segment into the next.
    """
    w, v_y = _windows(recording), recording.logged_v_y

    def mean(signal: Array | None) -> Array | None:
        return None if signal is None else w.mean(signal)

    return Means(
        v_x=w.mean(recording.v_x),
        v_y=mean(v_y),
        r=w.mean(recording.r),
        delta_f=w.mean(recording.delta_f),
        delta_r=w.mean(recording.delta_r),
        v_y_dot=None if v_y is None else w.rate(v_y),
        r_dot=w.rate(recording.r),
        v_x_r=w.mean(recording.v_x, recording.r),
        a_y=mean(recording.a_y),
        force=mean(recording.axle_force),
    )


def _windows(recording: Recording) -> Windows:
    every = max(round(STRIDE / recording.dt), 1) * thinning(len(recording))
    return Windows.where(recording.v_x >= moving(recording.v_x), recording, WINDOW, every)


def least_squares(X: Array, y: Array) -> Fit:
    """Fit y = X theta; standard errors count overlapping windows once.
    X : regressors, shape (k, p).   y : response, shape (k,).
    """
    size = np.sqrt(np.mean(X**2, axis=0)) + 1e-300
    theta, *_ = np.linalg.lstsq(X / size, y, rcond=None)
    rest = y - (X / size) @ theta
    independent = max(y.size * STRIDE / WINDOW - X.shape[1], 1.0)
    covariance = np.linalg.pinv((X / size).T @ (X / size) / y.size) * np.mean(rest**2) / independent
    total = float(np.sum((y - y.mean()) ** 2)) + 1e-300
    return Fit(
        theta / size,
        np.sqrt(np.maximum(np.diag(covariance), 0.0)) / size,
        1 - float(rest @ rest) / total,
    )


def correlation(a: Array, b: Array) -> float:
    """Correlation about zero, from -1 to 1; 0 where one is zero throughout.
    a, b : samples of two signals, shape (k,).
    """
    return float(a @ b) / (float(np.sqrt((a @ a) * (b @ b))) + 1e-300)


def turning(a: Array, b: Array) -> NDArray[np.bool_]:
    """Return the windows where one of two measures is beyond a fifth of what it reaches, (k,).

    So neither a long straight nor a channel that holds noise hides the other.
    a, b : of each window, in any unit (k,).
    """
    some: NDArray[np.bool_] = np.zeros(a.size, dtype=np.bool_)
    for one in (a, b):
        some |= np.abs(one) > _TURNS * np.percentile(np.abs(one), 99)
    return some


def pair(a: Array, b: Array, keep: NDArray[np.bool_] | None = None) -> Pair:
    """Return how two measures of the same bends go together, in the windows where either turns.
    a, b : of each window, in any unit (k,).   keep : windows that may count (k,).
    """
    some = turning(a, b)
    if keep is not None:
        some &= keep
    seconds = float(np.count_nonzero(some)) * STRIDE
    if seconds < 2.0:
        return Pair(0.0, 0, seconds)
    x, y = (_less_offset(one, some) for one in (a, b))
    rho = correlation(x, y)
    chance = rho**2 * max(seconds - 2.0, 0.5) / max(1.0 - rho**2, 1e-9)
    sure = abs(rho) > _ALIKE and chance > _BEYOND_CHANCE
    ratio = float(np.sqrt(float(y @ y) / (float(x @ x) + 1e-300)))
    return Pair(rho, int(np.sign(rho)) if sure else 0, seconds, ratio)


def _less_offset(signal: Array, some: NDArray[np.bool_]) -> Array:
    """Return a signal where the car turns, less its offset where it goes to both sides."""
    part = signal[some]
    both = float(np.std(part)) >= 0.5 * abs(float(np.mean(part)))
    return part - np.mean(part) if both else part


def course_rate(recording: Recording) -> tuple[Array, Array] | None:
    """Return how fast the direction of (v_x, v_y) turns, and the yaw rate, [rad/s], (k,) each.

    From one window of 0.2 s to the next; None without a v_y, or with less than 2 s.
    """
    v_x, v_y = recording.v_x, recording.logged_v_y
    if v_y is None:
        return None
    speed = filled(len(recording), lambda part: np.hypot(v_x[part], v_y[part]))
    n = max(round(WINDOW / recording.dt), 1)
    both = Windows.where(
        speed >= moving(speed), recording, 2 * n * recording.dt, n * thinning(len(recording))
    )
    before = replace(both, n=n)
    first, second = (
        w.mean(v_x) + 1j * w.mean(v_y) for w in (before, replace(before, starts=both.starts + n))
    )
    turned: Array = np.angle(second * np.conj(first)) / (n * recording.dt)
    enough = turned.size * WINDOW >= 2.0
    return (turned, both.mean(recording.r)) if enough else None


def steering(w: Means, keep: NDArray[np.bool_] | bool = True) -> Steering | None:
    """Effective wheelbase sqrt(sum (v_x delta)^2 / sum r^2), or None when nothing turns.

    It is the wheelbase L of a neutral car; understeer adds K v_x^2. Samples with the tail out,
    where a driver may countersteer, do not count. Needs 2 s of turning, in which r and the steering
    go together beyond chance.
    keep : which windows count (k,).
    """
    keep = keep & w.grips
    r, kinematic = w.r, w.v_x * w.delta
    if not keep.any():
        return None
    together = pair(r[keep], kinematic[keep])
    felt = 0.0 if w.a_y is None else float(np.std(w.a_y))
    turned, steered = (root_mean_square(w.v_x * one) for one in (r, kinematic))
    moving = max(turned, felt, steered / _LONGEST)
    if together.sign == 0 or moving < _LEAST:
        return None
    return Steering(together.ratio, together.correlation)


def proportional(w: Means) -> bool:
    """Whether the car turns the more, the more it is steered: it does not slide over its front.

    Large steering, beyond 0.7 of what is usual at most, is compared with 0.3 to 0.7 of that.
    """
    size = np.abs(w.v_x * w.delta)
    most = float(np.percentile(size, 95))
    large, middle = size > 0.7 * most, (size > 0.3 * most) & (size <= 0.7 * most)
    if min(np.count_nonzero(large), np.count_nonzero(middle)) * STRIDE < 0.5:
        return False
    steered, turned = (
        float(np.sqrt(np.mean(one[large] ** 2) / max(np.mean(one[middle] ** 2), 1e-300)))
        for one in (size, w.r)
    )
    return turned > 0.75 * steered


def shortest_wheelbase(w: Means, turn: Steering) -> float:
    """Return the shorter of the effective wheelbases of all windows and of small steering [m].

    A car that slides over its front wheels reads long at large steering, and normal where it is
    steered by less than half the usual peak.
    """
    size = np.abs(w.delta)
    small = steering(w, size < 0.5 * np.percentile(size, 95))
    return turn.wheelbase if small is None else min(turn.wheelbase, small.wheelbase)


def computed_v_y(recording: Recording) -> str | None:
    """Return what v_y was computed from, in words; None where it was measured or nobody can tell.

    The rear axle of a car that corners slips: v_y = k r + v_x delta_r - s, s + T s' = T v_x r,
    T = v_x/(g c), with any k (where the sensor sits) and a stiffness c of all tires. No car follows
    a formula without s far better than every one with it, unless it is so slow that s is lost in
    noise. What the formula leaves then goes with nothing that moves: else v_y has another unit, or
    is an angle.
    """
    w, y, a_y = _windows(recording), recording.logged_v_y, recording.a_y
    v_x, r, dt = recording.v_x, recording.r, recording.dt
    if y is None or len(w) < _FEWEST or not np.ptp(r) > 0.0:
        return None

    def behind(x: Array, tau: float) -> Array:
        kernel = (tau / (tau + dt)) ** np.arange(1 + round(_FORGOTTEN * tau / dt))
        before = np.full(kernel.size - 1, x[0])
        return np.convolve(np.append(before, x), kernel / kernel.sum(), mode="valid")

    def rest(of: Array, *beside: Array) -> Array:
        q, _ = np.linalg.qr(np.column_stack([np.ones(len(w)), *map(w.mean, (v_x, *beside))]))
        return w.mean(of) - q @ (q.T @ w.mean(of))

    def left(*signals: Array) -> float:
        return float(np.std(rest(*signals)))

    turn = w.mean(v_x, r)
    slope = 1.0 if a_y is None else float(w.mean(a_y) @ turn / (turn @ turn))
    if np.percentile(np.abs(turn), 95) > _LARGEST_TURN or not _SLOPE[0] < slope < _SLOPE[1]:
        return None  # units
    usual = root_mean_square(v_x)
    slips = [
        v_x * (behind(v_x * r, usual / push) / push - recording.delta_r)
        for push in GRAVITY * _LOADS_PER_RAD
    ]
    needed = min(left(y + one, r) for one in slips)
    tau, taus = 0.0, np.linspace(0.0, _BEHIND, 13)
    for _ in range(4):
        misses = [left(y, behind(r, one)) for one in taus]
        tau = float(taus[np.argmin(misses)])
        if min(*misses, left(y), left(y, v_x * recording.delta_f)) > needed:
            return None
        taus = np.abs(tau + (taus[1] - taus[0]) * np.linspace(-1.0, 1.0, 7))
    formulas = ("r", r), ("r", behind(r, tau)), ("vx delta_f", v_x * recording.delta_f)
    of, x = min(formulas, key=lambda one: left(y, one[1]))
    beside = [x] if left(y) > _COMPUTED * needed else []
    missed = left(y, *beside)
    moved = [*slips[::3], v_x * slips[3], behind(r, 0.2), behind(r, 0.4)]
    moved += beside or [r, v_x * recording.delta_f]  # else not r: its own noise
    random = left(y, *moved) ** 2 > (1.0 - _AT_RANDOM) * missed**2
    exact = missed < _EXACTLY * min(needed, left(y))
    angle = min(left(v_x * y + one, v_x * r) for one in slips)
    if missed > _COMPUTED * needed or not (random or exact) or left(v_x * y, v_x * x) > angle:
        return None
    how = f"is held near zero, within {missed:.1g} m/s, as by a filter"
    if beside:
        along = rest(x)
        factor = float(along @ w.mean(y) / (along @ along))
        how = f"is computed from {of} (v_y = {factor:#.3g} {of})"
    remedy = "and give ay" if a_y is None else "of the log: ay is there"
    return f"v_y {how}: it is not measured, the rear axle slips; leave the column vy out {remedy}"
