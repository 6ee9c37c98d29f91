"""What the samples of signals are like: noise, steps, values that repeat, what was lost, copies.

Facts alone, of arrays: what a fact means for a log, `identifier.doctor.samples` and
`models.recordings.checks` say. Every rule compares a signal with its own noise or with the other
signals of the log; none knows a car or a unit.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array

_NORMAL_MEDIAN = 0.6745  # of |x|, for x normal with variance one
COPY = 1e-4  # of a signal, rms, that is left of it beside another one which it copies
_ALTERNATE = -0.35  # correlation of neighboring second differences, below which they are noise
_NO_STEP = 1e-9  # of a signal's peak: values that differ by less are equal
_ON_GRID = 0.99  # share of the steps of a rounded signal that are multiples of the smallest
_SPARSE = 40  # steps, by which values of a rounded signal differ at least
_SAMPLED = 200  # differences of values that tell most steps wrong
_ON_GRID_REPEATED = 0.9  # the same of values that repeat
FAR = 1.5  # steps of a rounded signal that rounding alone does not make
_ROUNDING = 0.3  # steps², variance that rounding may add where a signal moves; 1/12 if white
_ROUNDED_JUMP = 0.5  # of a step, in which rounding lets both sides of an instant disagree
_FEW = 5  # steps that tell the rounding of values that repeat
_GOES_ON = 0.6  # of a step after a rest, that the next but one has where a signal begins to move
_SPIKE = 12.0  # times the noise beyond its neighbors
_OUTLIER = 16.0  # times the variance that is expected of a difference, and not more
_BLOCK = 5  # samples in a row that were logged before, of all signals
_ALIKE = 2  # samples at its ends that rounding may make alike
_SIDE = 12  # samples on each side of a jump
_JUMP = 5.5  # of the usual disagreement of both sides of a jump, in two signals
_ALSO = 2.5  # of the same disagreement, in a third signal
_SMOOTH = frozenset(("v_y", "r", "v_x"))  # that no car can change at once, as it can its steering
_SHORTEST_JUMP = 4.0  # samples that a jump has at least: less is a late sample


def swing(signal: Array) -> float:
    """Return the range of 98 % of the samples (n,)."""
    return float(np.percentile(signal, 99) - np.percentile(signal, 1))


def multiple(a: Array, b: Array) -> float | None:
    """Return the factor of which b is that multiple of a but for rounding, None where it is none.
    a, b : of the same instants (n,).
    """
    factor = float(a @ b) / max(float(a @ a), 1e-300)
    rest = b - factor * a
    return factor if float(rest @ rest) < COPY**2 * float(b @ b) else None


# Noise.


def white_noise(signal: Array) -> float:
    """Return the standard deviation of the white part of a signal, by its second differences.
    Their median is taken: steps and outliers are not noise.
    signal : samples (n,).
    """
    bend = signal[2:] - 2.0 * signal[1:-1] + signal[:-2]
    return _deviation(bend)


def _deviation(bend: Array) -> float:
    return float(np.median(np.abs(bend)) / (_NORMAL_MEDIAN * np.sqrt(6.0)))


def noise(signal: Array) -> float:
    """Return the same where a signal moves, 0 where it is smooth.

    Second differences of noise alternate, neighbors correlate by -2/3; those of a motion do not.
    """
    bend = np.diff(signal, 2)
    moves = np.flatnonzero((bend[1:] != 0.0) & (bend[:-1] != 0.0))
    if moves.size < max(0.05 * bend.size, 20):
        return 0.0
    a, b = bend[moves], bend[moves + 1]
    kept = np.maximum(np.abs(a), np.abs(b)) < 6.0 * float(np.median(np.abs(a)))
    together = float(a[kept] @ b[kept]) / (float(a[kept] @ a[kept]) + 1e-300)
    return _deviation(a) if together < _ALTERNATE else 0.0


# Resolution, and values that repeat.


def _step(values: Array, on_grid: float) -> float:
    """Return the step of which differences of rising values are multiples, 0: there is none."""
    steps = np.diff(values)
    steps = steps[steps > _NO_STEP * float(np.abs(values).max(initial=0.0))]
    if steps.size < 2:
        return 0.0
    least = float(steps.min())
    usual = float(np.median(steps[steps < 1.5 * least]))

    def fit(step: float, some: Array) -> bool:
        count = some / step
        return float(np.mean(np.abs(count - np.round(count)) < 0.05)) > on_grid

    # Values may be so few that none differ by one step.
    tried = (usual, *(least / np.arange(2, _SPARSE + 1)).tolist())
    few = steps[:: 1 + steps.size // _SAMPLED]
    return next((step for step in tried if fit(step, few) and fit(step, steps)), 0.0)


def resolution(signal: Array) -> float:
    """Return the step to which a signal was rounded, 0 where its samples tell none."""
    return _step(np.unique(signal), _ON_GRID)


class Runs(NamedTuple):
    """Runs of equal neighbors: index of the first sample, and length, (k,)."""

    first: NDArray[np.intp]
    length: NDArray[np.intp]

    @classmethod
    def of(cls, signal: Array) -> "Runs":
        starts = np.flatnonzero(np.concatenate([[True], np.diff(signal) != 0.0]))
        return cls(starts, np.diff(np.append(starts, signal.size)))

    def far(self, signal: Array, step: float) -> NDArray[np.bool_]:
        """Return between which runs a signal moves by more than its step, (k - 1,)."""
        return np.abs(np.diff(signal[self.first])) > FAR * step

    def stairs(self, signal: Array, step: float) -> int | None:
        """Return how many samples each value of a slow signal lasts, None where it is not slow.

        Where a signal moves by less than its step in a sample, rounding makes stairs of any.
        """
        every, far = self.length[1:-1], self.far(signal, step)
        inner = every[far[:-1] & far[1:]]
        if inner.size < 10:
            return None
        typical = int(np.median(inner))
        same = np.abs(inner - typical) <= max(1, round(0.1 * typical))
        regular = inner[same].sum() > (0.9 if step else 0.7) * inner.sum()
        return typical if typical >= 2 and regular and np.mean(every >= 2) > 0.8 else None

    def resolution(self, signal: Array) -> float:
        """Return the step to which values are rounded that a signal keeps for a while.

        Between them a signal that was brought to another clock has any value, so that all of its
        values say nothing.
        """
        kept = np.unique(signal[self.first[self.length > 2]])
        return _step(kept, _ON_GRID_REPEATED) if kept.size > _FEW else 0.0

    def lost(self, signal: Array, step: float) -> tuple[NDArray[np.bool_], float]:
        """Return which runs may be samples that were lost, and how many are by chance.

        A rest of a rounded signal is none: it ends by one step of the rounding, or as the signal
        begins to move: by a step that others follow. After a loss the signal catches up at once,
        brought to another clock by two steps; that of a rest then may overshoot.

        By chance neighbors differ by k steps so often that ln(share of k) falls with k², as of
        noise: those of ±1 and ±2 tell how many are 0.
        """
        change = np.concatenate([np.diff(signal), [0.0, 0.0, 0.0]])
        now, after, later = change[:-2], change[1:-1], change[2:]
        far = np.minimum(np.abs(now), np.abs(now + after)) > FAR * step
        far &= ~((now * later > _GOES_ON * now**2) & (step > 0.0))
        may: NDArray[np.bool_] = (self.length > 1) & far[self.first + self.length - 1]
        before = np.abs(change[:-3][far[1:]])
        one, two = (float(np.sum(np.abs(before - k * step) < 0.05 * step)) for k in (1, 2))
        return may, 0.5 * one * (one / max(two, 0.5)) ** (1.0 / 3.0)


# Samples that are off.


def dropouts(signal: Array, white: float) -> NDArray[np.intp]:
    """Return the samples that are exactly zero far from what stands before and after them.

    None are at the beginning or at the end.
    white : its noise.
    """
    zero = signal == 0.0
    if not 0.0 < zero.mean() <= 0.3:
        return np.empty(0, dtype=np.intp)
    kept = np.abs(np.concatenate([[0.0], signal[~zero], [0.0]]))
    place = np.cumsum(~zero)
    beside = np.minimum(kept[place], kept[place + 1])
    steps = np.abs(np.diff(signal[~zero]))
    step = float(np.percentile(steps[steps > 0.0], 90)) if steps.any() else math.inf
    found = np.flatnonzero(zero & (beside > 10.0 * max(white, step)))
    return found if found.size >= 2 else found[:0]


def spikes(signal: Array, white: float) -> NDArray[np.intp]:
    """Return single samples far off both neighbors, which agree with each other.
    white : its noise.
    """
    if not white > 0.0 or signal.size < 8:
        return np.empty(0, dtype=np.intp)
    beside = np.stack([signal[:-4], signal[1:-3], signal[3:-1], signal[4:]])
    off = np.abs(signal[2:-2] - np.median(beside, axis=0))
    around = np.maximum(0.05 * swing(signal), 3.0 * np.ptp(beside, axis=0))
    return np.flatnonzero(off > np.maximum(_SPIKE * white, around)) + 2


def lateness(signal: Array, dt: float, step: float) -> tuple[float, float] | None:
    """Return how late samples are at most, and in how many deviations: noise that grows with slope.
    step : to which it is rounded, which is noise too where the signal moves.

    Samples late by u, uniform from 0 to J, are off by slope times u: third differences then have
    the variance 20 (σ^2 + J^2 slope^2/12).
    """
    if signal.size < 200:
        return None
    width = max(3, round(0.05 / dt))
    smooth = np.convolve(signal, np.ones(width) / width, "same")
    inner = slice(width, -width)
    y = np.diff(signal, 3)[inner] ** 2 / 20.0
    x = np.gradient(smooth, dt)[1:-2][inner] ** 2
    size_x, size_y = float(np.mean(x)), float(np.mean(y))
    if not (size_x > 0.0 and size_y > 0.0):
        return None
    x, y = x / size_x, y / size_y
    X = np.column_stack([np.ones(x.size), x])
    y = np.minimum(y, _OUTLIER * _variance(X, y))
    variance = _variance(X, y)
    weighted = X / variance[:, None]
    normal = weighted.T @ weighted
    if not np.linalg.cond(normal) < 1e12:
        return None
    still, moved = np.linalg.solve(normal, weighted.T @ (y / variance))
    if moved <= 0.0:
        return None
    z = float(moved) / math.sqrt(float(np.linalg.inv(normal)[1, 1]) * 2.0 * 1.8)
    size = math.sqrt(12.0 * float(moved) * size_y / size_x)
    rounding = _ROUNDING * step**2 / size_y
    grows = moved * float(np.percentile(x, 90)) > max(0.5 * float(still), rounding)
    return (size, 2.0 * z) if z > 8.0 and grows and size > 0.3 * dt else None


def _variance(X: Array, y: Array) -> Array:
    """Return the variance that a first fit says each sample has."""
    theta, *_ = np.linalg.lstsq(X, y, rcond=None)
    return np.maximum(X @ theta, 0.1 * float(np.mean(y)))


# The clock: all signals at once.


def logged_again(signals: Mapping[str, Array]) -> tuple[int, int] | None:
    """Return where samples begin that were logged before, and how many samples before.

    After them the log goes on: what repeats for longer, or for less, is a motion that does.
    signals : that move (n,); fewer than three say nothing.
    """
    if len(signals) < 3:
        return None
    table = np.column_stack(list(signals.values()))
    _, code = np.unique(table, axis=0, return_inverse=True)
    code = code.reshape(-1)
    order = np.argsort(code, kind="stable")
    same = np.flatnonzero(np.diff(code[order]) == 0)
    back = order[same + 1] - order[same]
    lags, count = np.unique(back[back > _BLOCK], return_counts=True)
    for lag in lags[count >= np.maximum(_BLOCK, 0.5 * lags)]:
        runs = Runs.of((code[lag:] != code[:-lag]).astype(np.float64))
        for first in runs.first[(runs.length >= lag) & (runs.length <= lag + _ALIKE)]:
            block = table[first : first + lag]
            if code[first] == code[first + lag] and np.all(np.ptp(block, axis=0) > 0.0):
                return int(first + lag), int(lag)
    return None


def tears(signals: Mapping[str, Array]) -> list[tuple[int, float]]:
    """Return where both sides of an instant disagree in several signals, and by how many samples.

    The clearest is first; none is nearer to a clearer one than both sides are long.
    signals : that move (n,), by name.
    """
    names = list(signals)
    if len(names) < 3 or not _SMOOTH & set(names) or signals[names[0]].size <= 20 * _SIDE:
        return []
    # Of a parabola through each side: its value and its slope between both.
    value, slope = np.linalg.pinv(np.vander(np.arange(_SIDE) + 0.5, 3, increasing=True))[:2]
    jumps, scores = [], []
    for signal in signals.values():
        jump = np.convolve(signal, np.concatenate([value[::-1], -value]), "valid")
        size = np.abs(jump)
        usual = max(np.median(size) / _NORMAL_MEDIAN, _ROUNDED_JUMP * resolution(signal))
        busy = np.convolve(size, np.full(8 * _SIDE, 1.0 / (8 * _SIDE)), "same")
        scores.append(size / np.maximum(np.maximum(usual, 0.8 * busy), 1e-300))
        jumps.append(jump)
    third, second = np.sort(np.stack(scores), axis=0)[[-3, -2]]
    surest = np.max([scores[k] for k, name in enumerate(names) if name in _SMOOTH], axis=0)
    clear = np.flatnonzero((np.minimum(second, surest) >= _JUMP) & (third >= _ALSO))
    scale = np.array([np.std(signal) for signal in signals.values()])
    found: list[tuple[int, float]] = []
    for at in clear[np.argsort(-second[clear], kind="stable")].tolist():
        if any(abs(at + _SIDE - other) <= 2 * _SIDE for other, _ in found):
            continue
        sides = np.stack([signal[at : at + 2 * _SIDE] for signal in signals.values()])
        rates = 0.5 * (sides[:, _SIDE:] @ slope - sides[:, :_SIDE] @ slope[::-1])
        a, b = rates / scale, np.stack(jumps)[:, at] / scale
        found.append((at + _SIDE, float(a @ b / (a @ a + 1e-300))))
    return [one for one in found if abs(one[1]) >= _SHORTEST_JUMP]
