"""What is drawn of a long recording: of each column of pixels the lowest and the highest sample.

A drawing of millions of points takes minutes and looks like one of the few thousand that reach
farthest. Up to `LONG` samples all are drawn.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import LONG, Array, blocks
from identifier.run import History
from identifier.setup import Block
from models.recordings import Recording

COLUMNS = 1500  # of pixels, more than any panel has
CELLS = (400, 240)  # of a cloud, across and up: a dot covers several

Samples = NDArray[Any]  # indices, or whether each sample is meant
Signal = Callable[[slice | Samples], NDArray[Any]]  # values (k,) or (k, m) at some samples


def shown(t: Array, ends: tuple[float, float], *signals: Signal) -> Samples:
    """Return which samples within the ends of a time axis are drawn.

    t : times of the samples (n,) [s].   ends : first and last time [s].
    """
    if len(t) <= LONG:
        within: Samples = (t >= ends[0]) & (t <= ends[1])
        return within
    first = int(np.searchsorted(t, ends[0], side="left"))
    last = int(np.searchsorted(t, ends[1], side="right"))
    if last - first <= LONG:
        return np.arange(first, last)
    width = -(-(last - first) // COLUMNS)
    size = width * max(1, LONG // (4 * width))  # whole columns at once
    found = [np.array([first, last - 1])]
    for begin in range(first, last, size):
        part = slice(begin, min(begin + size, last))
        found.append(begin + farthest([signal(part) for signal in signals], width))
    return np.unique(np.concatenate(found))


def drawn_times(recording: Recording, t: Array) -> Array:
    """Return times as a line is drawn over them: none where a segment begins, so that it has a gap.

    t : times of some of its samples, rising (k,) [s].
    """
    begins = recording.t[list(recording.breaks)]
    segment = np.searchsorted(begins, t, side="right")
    return np.where(np.diff(segment, prepend=segment[:1]) > 0, np.nan, t)


def farthest(signals: Iterable[Array], width: int) -> NDArray[np.intp]:
    """Return the samples that are lowest or highest among `width` neighbors, rising.

    signals : (k,) or (k, m) each; the last neighbors may be fewer.
    """
    found = []
    for signal in signals:
        values = np.asarray(signal).reshape(len(signal), -1)
        missing = -len(values) % width
        columns = np.pad(values, ((0, missing), (0, 0)), mode="edge").reshape(
            -1, width, values.shape[1]
        )
        begins = width * np.arange(len(columns))[:, None]
        for ends in (columns.argmin(axis=1), columns.argmax(axis=1)):
            found.append(np.minimum(begins + ends, len(values) - 1).ravel())
    return np.unique(np.concatenate(found))


class DrawnRun:
    """What is drawn of what a run recorded, gathered block by block."""

    def __init__(self, history: History, tell: Callable[[Block], Sequence[Array]]) -> None:
        self._recording, self._tell = history.recording, tell
        n = len(self._recording)
        self._width = 1 if n <= LONG else -(-n // COLUMNS)
        self._times: list[Array] = []
        self._values: list[list[Array]] = []

    def take(self, block: Block) -> None:
        given, here = self._tell(block), self._recording.t[block.part]
        part: Any = slice(None) if self._width == 1 else farthest(given, self._width)
        self._times.append(here[part])
        self._values.append([one[part] for one in given])

    def curves(self) -> tuple[Array, list[Array]]:
        """Return times and values as they are drawn: (k,) and (k, ...) each.

        Times are those of `drawn_times`.
        """
        joined = [np.concatenate(one) for one in zip(*self._values, strict=True)]
        return drawn_times(self._recording, np.concatenate(self._times)), joined


def shown_of_run(
    history: History, tell: Callable[[Block], Sequence[Array]]
) -> tuple[Array, list[Array]]:
    """Return times and values of what a run recorded, as `DrawnRun` gathers them."""
    drawn = DrawnRun(history, tell)
    for block in history.blocks():
        drawn.take(block)
    return drawn.curves()


def cloud(n: int, slips: Signal, heights: Sequence[Signal], counts: Signal) -> Samples:
    """Return which samples a cloud of points shows: of those that look alike the first.

    slips : across (k, m).   heights : of each curve (k, m).
    counts : whether samples are drawn at all (k,).
    """
    if n <= LONG:
        everything: Samples = counts(slice(0, n))
        return everything
    signals = [slips, *heights]
    low = [np.full(2, np.inf) for _ in signals]
    high = [np.full(2, -np.inf) for _ in signals]
    for part in blocks(n):
        kept = counts(part)
        for k, signal in enumerate(signals):
            for axle, values in enumerate(signal(part)[kept].T.copy()):  # rows are looked at faster
                low[k][axle] = min(low[k][axle], values.min(initial=np.inf))
                high[k][axle] = max(high[k][axle], values.max(initial=-np.inf))
    seen = np.zeros((len(heights), 2, *CELLS), dtype=bool)
    first = np.zeros(CELLS[0] * CELLS[1], dtype=np.intp)
    found = []
    for part in blocks(n):
        kept = np.flatnonzero(counts(part))
        across = _cells(slips(part)[kept], low[0], high[0], CELLS[0])
        for k, signal in enumerate(heights):
            up = _cells(signal(part)[kept], low[1 + k], high[1 + k], CELLS[1])
            for axle in (0, 1):
                place = across[:, axle] * CELLS[1] + up[:, axle]
                first[place[::-1]] = kept[::-1]  # the last that is written is the first sample
                marks = seen[k, axle].reshape(-1)
                found.append(part.start + kept[~marks[place] & (first[place] == kept)])
                marks[place] = True
    return np.unique(np.concatenate(found))


def _cells(values: Array, low: Array, high: Array, count: int) -> NDArray[np.intp]:
    share = (values - low) / np.maximum(high - low, 1e-300)
    return np.clip(np.nan_to_num(share) * count, 0, count - 1).astype(np.intp)
