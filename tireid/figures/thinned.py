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


def drawn_samples(t: Array, ends: tuple[float, float], *signals: Array) -> _Samples:
    """Return which samples within the ends of a time axis are drawn.

    t : times of the samples (n,) [s].   ends : first and last time [s].
    signals : (n,) or (n, m) each.
    """
    first = int(np.searchsorted(t, ends[0], side="left"))
    last = int(np.searchsorted(t, ends[1], side="right"))
    if last - first <= LONG:
        return np.arange(first, last)
    outermost = _outermost([signal[first:last] for signal in signals], last - first)
    return np.unique(np.concatenate([[first, last - 1], first + outermost]))


def drawn_times(recording: Recording, t: Array) -> Array:
    """Return times as a line is drawn over them: none where a segment begins, so that it has a gap.

    t : times of some of its samples, rising (k,) [s].
    """
    segment = np.searchsorted(recording.t[list(recording.breaks)], t, side="right")
    return np.where(np.diff(segment, prepend=segment[:1]) > 0, np.nan, t)


def _outermost(signals: Iterable[Array], of: int) -> _Samples:
    """Return the samples that are lowest or highest in a column of pixels, rising.

    signals : (k,) or (k, m) each.   of : samples that are drawn over all columns.
    """
    found = []
    for signal in signals:
        width = -(-of // COLUMNS)
        for first in range(0, len(signal), width):
            values = signal[first : first + width]
            found += [first + values.argmin(axis=0), first + values.argmax(axis=0)]
    return np.unique(np.hstack(found))


def drawn_of_run(
    history: History, tell: Callable[[Block], Sequence[Array]]
) -> tuple[Array, list[Array]]:
    """Return times and values as they are drawn of what a run recorded: (k,) and (k, ...) each.

    tell : returns the values of a block.
    """
    recording, n, found = history.recording, len(history.recording), []
    for block in history.blocks():
        values = [recording.t[block.part], *tell(block)]
        rows = [one.reshape(len(one), -1) for one in values]
        part: Any = slice(None) if n <= LONG else _outermost(rows, n)
        found.append([one[part] for one in values])
    t, *joined = (np.concatenate(one) for one in zip(*found, strict=True))
    return drawn_times(recording, t), joined


def cloud(t: Array, *signals: Array) -> _Samples:
    """Return which samples a cloud of points shows: some at even distances, and the outermost.

    t : times of the samples (n,) [s].   signals : across and up.
    """
    every = np.arange(0, len(t), thinning(len(t)))
    outermost = drawn_samples(t, (float(t[0]), float(t[-1])), *signals)
    return every if len(t) <= LONG else np.union1d(every, outermost)
