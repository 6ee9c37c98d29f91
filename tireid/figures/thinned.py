"""What is drawn of a long recording: of each column of pixels the lowest and the highest sample.

A drawing of millions of points takes minutes and looks like one of the few thousand that reach
farthest. Up to `LONG` samples all are drawn.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import LONG, Array, thinning
from identifier.run import History
from identifier.setup import Block
from models.recordings import Recording

COLUMNS = 1500  # of pixels, more than any panel has

_Samples = NDArray[np.intp]  # indices
Signal = Callable[[slice | _Samples], NDArray[Any]]  # values (k,) or (k, m) at some samples


def shown(t: Array, ends: tuple[float, float], *signals: Signal) -> _Samples:
    """Return which samples within the ends of a time axis are drawn.

    t : times of the samples (n,) [s].   ends : first and last time [s].
    """
    first = int(np.searchsorted(t, ends[0], side="left"))
    last = int(np.searchsorted(t, ends[1], side="right"))
    if last - first <= LONG:
        return np.arange(first, last)
    width = -(-(last - first) // COLUMNS)
    size = width * max(1, LONG // (4 * width))  # whole columns at once
    found = [np.array([first, last - 1])]
    for begin in range(first, last, size):
        part = slice(begin, min(begin + size, last))
        found.append(begin + _farthest([signal(part) for signal in signals], width))
    return np.unique(np.concatenate(found))


def drawn_times(recording: Recording, t: Array) -> Array:
    """Return times as a line is drawn over them: none where a segment begins, so that it has a gap.

    t : times of some of its samples, rising (k,) [s].
    """
    begins = recording.t[list(recording.breaks)]
    segment = np.searchsorted(begins, t, side="right")
    return np.where(np.diff(segment, prepend=segment[:1]) > 0, np.nan, t)


def _farthest(signals: Iterable[Array], width: int) -> NDArray[np.intp]:
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


def shown_of_run(
    history: History, tell: Callable[[Block], Sequence[Array]]
) -> tuple[Array, list[Array]]:
    """Return times and values as they are drawn of what a run recorded: (k,) and (k, ...) each.

    tell : returns the values of a block.
    """
    recording, n = history.recording, len(history.recording)
    times, found = [], []
    for block in history.blocks():
        values, here = tell(block), recording.t[block.part]
        part: Any = slice(None) if n <= LONG else _farthest(values, -(-n // COLUMNS))
        times.append(here[part])
        found.append([one[part] for one in values])
    joined = [np.concatenate(one) for one in zip(*found, strict=True)]
    return drawn_times(recording, np.concatenate(times)), joined


def cloud(t: Array, *signals: Signal) -> _Samples:
    """Return which samples a cloud of points shows: some at even distances, and the outermost.

    t : times of the samples (n,) [s].   signals : across and up.
    """
    every = np.arange(0, len(t), thinning(len(t)))
    outermost = shown(t, (float(t[0]), float(t[-1])), *signals)
    return every if len(t) <= LONG else np.union1d(every, outermost)
