"""A portion of a long recording that stands for all of it, where something is asked many times."""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import LONG, Array, blocks
from models.recordings.record import Recording
from models.vehicle import GRAVITY

STRETCH = 2000  # samples of one, 20 s at 100 Hz
STEP = 500  # samples between the beginnings that a stretch may have
REST = 0.6  # s that the car stands at the end of a stretch: a delay of that leaves the next alone
HARDEST = 2.0 * GRAVITY  # m/s² that count: what is beyond is a sensor, not a drive


class Portion(NamedTuple):
    """Stretches of a recording, joined.

    recording : of them; at the end of each stretch the car stands, so that a signal that is moved
    in time leaves the next alone.   samples : which samples of the whole they are (k,).
    """

    recording: Recording
    samples: NDArray[np.intp]

    def place(self, index: int) -> int:
        """Return how many of its samples lie before a sample of the whole.

        Parameters
        ----------
        index : of the sample; as many as there are is the end.
        """
        return int(np.searchsorted(self.samples, index))


def portion(recording: Recording, middle: int | None = None) -> Portion:
    """Return a recording of at most `LONG` samples itself, of a longer one stretches of it.

    The recording is divided into parts of one length, and of each the stretch is taken in which the
    car is turned hardest: by the sum of (v_x r)².

    Parameters
    ----------
    recording : the whole.
    middle : sample before which half of the stretches shall lie; None spreads them over all.
    """
    n = len(recording)
    if n <= LONG:
        return Portion(recording, np.arange(n))
    power = _power(recording)
    count = LONG // STRETCH
    if middle is None or not 0 < middle < n:
        begins = _hardest(power, 0, n, count)
    else:
        begins = _hardest(power, 0, middle, count // 2) + _hardest(power, middle, n, count // 2)
    samples = np.unique(np.add.outer(begins, np.arange(STRETCH)))
    samples = recording.without_scraps(samples[samples < n])
    taken = recording.taken(samples)
    ends = np.array([piece.stop for piece in taken.stretches])
    v_x = taken.v_x.copy()
    v_x[np.maximum(ends[:, None] - 1 - np.arange(round(REST / recording.dt)), 0)] = 0.0
    return Portion(replace(taken, v_x=v_x), samples)


def _power(recording: Recording) -> Array:
    """Return the sum of (v_x r)² over each `STEP` samples."""
    n = len(recording)
    power = np.zeros(-(-n // STEP))
    for part in blocks(n):
        turning = np.clip(recording.v_x[part] * recording.r[part], -HARDEST, HARDEST) ** 2
        np.add.at(power, np.arange(part.start, part.stop) // STEP, turning)
    return power


def _hardest(power: Array, first: int, last: int, count: int) -> list[int]:
    """Return where the hardest stretch begins of each of `count` parts of samples."""
    width = STRETCH // STEP
    if last - first <= count * STRETCH:
        return list(range(first, last, STRETCH))
    begins = []
    for low, high in pairwise(np.linspace(first, last, count + 1).astype(int) // STEP):
        turned = np.convolve(power[low:high], np.ones(width), mode="valid")  # each beginning's
        begins.append(STEP * (low + (int(np.argmax(turned)) if high - low >= width else 0)))
    return begins
