"""A portion of a long recording that stands for all of it, where something is asked many times."""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import LONG, Array, blocks
from models.recordings.record import Recording
from models.vehicle import GRAVITY

_SEGMENT = 20.0  # s of one, where a quarter of the samples are enough for that
_STEPS = 4  # beginnings that a segment may have in the time of one
_FEWEST_SEGMENTS = 4  # segments, so that there are some on both sides of a middle
_REST = 0.6  # s that the car stands at the end of a segment: a delay of that leaves the next alone

_HARDEST = 2.0 * GRAVITY  # m/s² that count: what is beyond is a sensor, not a drive


class Portion(NamedTuple):
    """Segments of a recording, joined.
    recording : of them; at the end of each segment the car stands, so that a signal that is moved
    in time leaves the next alone.   samples : which samples of the whole they are (k,).
    """

    recording: Recording
    samples: NDArray[np.intp]

    def place(self, index: int) -> int:
        """Return how many of its samples lie before a sample of the whole.
        index : of the sample; as many as there are is the end.
        """
        return int(np.searchsorted(self.samples, index))


def portion(recording: Recording, middle: int | None = None) -> Portion:
    """Return a recording of at most `LONG` samples itself, of a longer one segments of it.

    The recording is divided into parts of one length, and of each the segment is taken in which the
    car is turned hardest: by the sum of (v_x r)².
    middle : sample before which half of the segments shall lie; None spreads them over all.
    """
    n = len(recording)
    if n <= LONG:
        return Portion(recording, np.arange(n))
    step = min(round(_SEGMENT / recording.dt), LONG // _FEWEST_SEGMENTS) // _STEPS
    power = np.zeros(-(-n // step))  # sum of (v_x r)² over each `step` samples
    for part in blocks(n):
        turning = np.clip(recording.v_x[part] * recording.r[part], -_HARDEST, _HARDEST) ** 2
        np.add.at(power, np.arange(part.start, part.stop) // step, turning)
    count = LONG // (_STEPS * step)
    if middle is None or not 0 < middle < n:
        sides = [(0, n, count)]
    else:
        sides = [(0, middle, count // 2), (middle, n, count // 2)]
    begins = [begin for side in sides for begin in _hardest(power, step, *side)]
    samples = np.unique(np.add.outer(begins, np.arange(_STEPS * step)))
    taken = recording.taken(samples[samples < n])
    ends = np.array([piece.stop for piece in taken.segments])
    v_x = taken.v_x.copy()
    v_x[np.maximum(ends[:, None] - 1 - np.arange(round(_REST / recording.dt)), 0)] = 0.0
    samples = np.searchsorted(recording.t, taken.t)
    return Portion(replace(taken, v_x=v_x, notes=recording.notes), samples)


def _hardest(power: Array, step: int, first: int, last: int, count: int) -> list[int]:
    """Return where the hardest segment begins of each of `count` parts of samples."""
    length = _STEPS * step
    if last - first <= count * length:
        return list(range(first, last, length))
    begins = []
    for low, high in pairwise(np.linspace(first, last, count + 1).astype(int) // step):
        # Each beginning's.
        turned = np.convolve(power[low:high], np.ones(_STEPS), mode="valid")
        begins.append(step * (int(low) + int(np.argmax(turned))))
    return begins
