"""Which pieces of a drive the doctor looks at: all of a short one, some of a long one.

The screen takes pieces from all over a drive, the search for sizes its liveliest segments. None
runs across a gap. Pieces are slices of the drive: nothing is copied.
"""

from itertools import pairwise

import numpy as np

from codegen.arrays import blocks, large
from identifier.evidence import BRISK
from models.recordings import Recording
from models.recordings.evidence import Windows
from models.vehicle import Vehicle

_WINDOW = 0.2  # [s]
SLOWEST = 0.3  # of the 95th percentile of speed, below which a window does not count
PIECE = 60.0  # s of a piece that is looked at, of a drive of hours
PIECES = 10  # of such a drive that are looked at
_SHORTEST_PIECE = 200  # samples of such a piece
_SHORTEST_SEGMENT = 2.0  # s, below which a segment between two gaps is not looked at


def looked_at(recording: Recording) -> tuple[Recording, ...]:
    """Return the pieces of a drive that the screen looks at: all of a short one, some of a long."""
    n = max(round(PIECE / recording.dt), _SHORTEST_PIECE)
    places = list(recording.segments)
    if len(recording) > PIECES * n:
        cut = [
            slice(k, min(k + n, one.stop))
            for one in places
            for k in range(one.start, max(one.stop - n, one.start) + 1, n)
        ]
        some = np.unique(np.linspace(0, len(cut) - 1, PIECES).astype(int))
        places = [cut[k] for k in some]
    return _taken(recording, places)


def driven_pieces(recording: Recording) -> tuple[Recording, ...]:
    """Return the pieces that are looked at in which the car drives, all where it never does."""
    pieces = looked_at(recording)
    fast = SLOWEST * usual_speed(pieces)
    return tuple(one for one in pieces if len(driven_windows(one, fast))) or pieces


def usual_speed(pieces: tuple[Recording, ...]) -> float:
    """Return the 95th percentile of the speed, forward or backward, in the unit of the log."""
    return float(np.percentile(np.concatenate([np.abs(one.v_x) for one in pieces]), 95))


def driven_windows(recording: Recording, fast: float) -> Windows:
    """Return the windows in which a car is never slower than a speed, forward or backward."""
    return Windows.where(np.abs(recording.v_x) >= fast, recording, _WINDOW)


def segments_of(
    recording: Recording, vehicle: Vehicle, *, longest: float, pieces: int
) -> tuple[Recording, ...]:
    """Return the recording, or of a long one the liveliest segment of each of its parts.
    longest : that is looked at as a whole [s]; the segments have it together.
    """
    n, dt = len(recording), recording.dt
    if recording.duration <= longest:
        return _taken(recording, _unbroken(recording, slice(0, n)))
    length = int(longest / pieces / dt)
    total, brisk = large((n + 1,)), BRISK * vehicle.froude_speed
    total[0] = 0.0
    for part in blocks(n):
        lively = np.where(recording.v_x[part] > brisk, recording.r[part] ** 2, 0.0)
        so_far = total[part.start : part.start + 1]
        total[part.start + 1 : part.stop + 1] = np.cumsum(np.concatenate([so_far, lively]))[1:]
    bounds = np.linspace(0, n, pieces + 1).astype(np.intp)
    places: list[slice] = []
    for first, last in pairwise(bounds):
        starts = np.arange(first, last - length + 1, max(1, length // 10))
        best = int(starts[np.argmax(total[starts + length] - total[starts])])
        places += _unbroken(recording, slice(best, best + length))
    return _taken(recording, places)


def _unbroken(recording: Recording, part: slice) -> list[slice]:
    """Return the segments of a part of a recording that no gap breaks, the longest at least."""
    edges = [part.start, *(k for k in recording.breaks if part.start < k < part.stop), part.stop]
    pieces = sorted((slice(a, b) for a, b in pairwise(edges)), key=lambda one: one.start - one.stop)
    least = int(_SHORTEST_SEGMENT / recording.dt)
    kept = [one for one in pieces if one.stop - one.start >= least] or pieces[:1]
    return sorted(kept, key=lambda one: one.start)


def _taken(recording: Recording, places: list[slice]) -> tuple[Recording, ...]:
    if places == [slice(0, len(recording))]:
        return (recording,)
    return tuple(recording.taken(place) for place in places)
