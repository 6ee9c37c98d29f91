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
_ON_GRID_REPEATED = 0.9  # the same of values that repeat
_FEW = 5  # steps that tell the rounding of values that repeat
_GOES_ON = 0.6  # of a step after a rest, that the next but one has where a signal begins to move
_SPIKE = 12.0  # times the noise beyond its neighbors
_OUTLIER = 16.0  # times the variance that is expected of a difference, and not more
_BLOCK = 5  # samples in a row that were logged before, of all signals
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


def _step(values: Array, on_grid: float) -> float | None:
    """Return the step of which differences of rising values are multiples, None: there is none."""
    steps = np.diff(values)
    steps = steps[steps > _NO_STEP * float(np.abs(values).max(initial=0.0))]
    if steps.size < 2:
        return None
    step = float(np.median(steps[steps < 1.5 * float(steps.min())]))
    count = steps / step
    return step if float(np.mean(np.abs(count - np.round(count)) < 0.05)) > on_grid else None


def resolution(signal: Array) -> float | None:
    """Return the step to which a signal was rounded, None where its samples do not tell one."""
    values = np.unique(signal)
    step = _step(values, _ON_GRID)
    few = step and values.size < min(0.5 * signal.size, 0.5 * np.ptp(signal) / step + 2e3)
    return step if few else None


class Runs(NamedTuple):
    """Runs of equal neighbors: index of the first sample, and length, (k,)."""

    first: NDArray[np.intp]
    length: NDArray[np.intp]

    @classmethod
    def of(cls, signal: Array) -> "Runs":
        starts = np.flatnonzero(np.concatenate([[True], np.diff(signal) != 0.0]))
        return cls(starts, np.diff(np.append(starts, signal.size)))

    def stairs(self, *, rounded: bool) -> int | None:
        """Return how many samples each value of a slow signal lasts, None where it is not slow."""
        inner = self.length[1:-1]
        if inner.size < 10:
            return None
        typical = int(np.median(inner))
        same = np.abs(inner - typical) <= max(1, round(0.1 * typical))
        regular = inner[same].sum() > (0.9 if rounded else 0.7) * self.length.sum()
        return typical if typical >= 2 and regular and np.mean(inner >= 2) > 0.8 else None

    def resolution(self, signal: Array) -> float | None:
        """Return the step to which values are rounded that a signal keeps for a while.

        Between them a signal that was brought to another clock has any value, so that all of its
        values say nothing.
        """
        kept = np.unique(signal[self.first[self.length > 2]])
        return _step(kept, _ON_GRID_REPEATED) if kept.size > _FEW else None

    def lost(self, signal: Array, rounded: float | None) -> NDArray[np.bool_]:
        """Return which runs may be samples that were lost: a rest of a rounded signal is none.

        A rest ends by one step of the rounding, or as the signal begins to move: by a step that
        others follow. After a loss the signal catches up at once, brought to another clock by two
        steps; that of a rest then may overshoot.
        """
        again = self.length > 1
        if rounded is None:
            return again
        change = np.concatenate([np.diff(signal), [0.0, 0.0, 0.0]])
        end = self.first + self.length - 1
        step, after, later = change[end], change[end + 1], change[end + 2]
        far = np.minimum(np.abs(step), np.abs(step + after)) > 1.5 * rounded
        may: NDArray[np.bool_] = again & far & ~(step * later > _GOES_ON * step**2)
        return may


def alike_by_rounding(signal: Array) -> float:
    """Return the share of neighbors that rounding alone makes equal; 0 where nothing was rounded.

    Differences of a rounded signal are multiples k of its last digit. Where noise makes them,
    ln(share of k) falls with k²: those of ±1 and ±2 tell how many are 0.
    """
    steps = np.abs(np.diff(signal))
    moved = steps[steps > _NO_STEP * float(np.abs(signal).max())]
    digits = np.round(moved / moved.min(initial=np.inf))
    one, two = (float(np.count_nonzero(digits == k)) / (2.0 * signal.size) for k in (1, 2))
    return one * (one / two) ** (1.0 / 3.0) if two > 0.0 else 0.0


# Samples that are off.


def dropouts(signal: Array, white: float) -> NDArray[np.intp]:
    """Return the samples that are exactly zero far from what stands before and after them.
    white : its noise.
    """
    zero = signal == 0.0
    if not 0.0 < zero.mean() <= 0.3:
        return np.empty(0, dtype=np.intp)
    kept = np.flatnonzero(~zero)
    between = np.interp(np.arange(signal.size), kept, signal[kept])
    step = float(np.percentile(np.abs(np.diff(signal[kept])), 90))
    found = np.flatnonzero(zero & (np.abs(between) > 10.0 * max(white, step)))
    return found if found.size >= 2 and found[-1] >= found.size else found[:0]


def spikes(signal: Array, white: float) -> NDArray[np.intp]:
    """Return single samples far off both neighbors, which agree with each other.
    white : its noise.
    """
    if not white > 0.0 or signal.size < 8:
        return np.empty(0, dtype=np.intp)
    beside = np.stack([signal[:-4], signal[1:-3], signal[3:-1], signal[4:]])
    off = np.abs(signal[2:-2] - np.median(beside, axis=0))
    around = np.maximum(0.05 * swing(signal), 3.0 * np.ptp(beside, axis=0))
    found: NDArray[np.intp] = np.flatnonzero(off > np.maximum(_SPIKE * white, around)) + 2
    return found


def lateness(signal: Array, dt: float) -> tuple[float, float] | None:
    """Return how late samples are at most, and in how many deviations: noise that grows with slope.

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
    if not np.linalg.cond(normal) < 1e15:
        return None
    still, moved = np.linalg.solve(normal, weighted.T @ (y / variance))
    if moved <= 0.0:
        return None
    z = float(moved) / math.sqrt(float(np.linalg.inv(normal)[1, 1]) * 2.0 * 1.8)
    size = math.sqrt(12.0 * float(moved) * size_y / size_x)
    grows = moved * float(np.percentile(x, 90)) > 0.5 * max(float(still), 0.0)
    return (size, 2.0 * z) if z > 8.0 and grows and size > 0.3 * dt else None


def _variance(X: Array, y: Array) -> Array:
    """Return the variance that a first fit says each sample has."""
    theta, *_ = np.linalg.lstsq(X, y, rcond=None)
    variance: Array = np.maximum(X @ theta, 0.1 * float(np.mean(y)))
    return variance


# The clock: all signals at once.


def logged_again(signals: Mapping[str, Array]) -> tuple[int, int] | None:
    """Return where samples begin that were logged before, and how many samples before.
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
    for lag in lags[count >= _BLOCK]:
        late = np.sort(order[same + 1][back == lag])
        block = late[: np.count_nonzero(np.diff(late) == 1) + 1]
        if np.all(np.ptp(table[block], axis=0) > 0.0) and block.size >= _BLOCK:
            return int(late[0]), int(lag)
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
        usual = np.median(size) / _NORMAL_MEDIAN
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
