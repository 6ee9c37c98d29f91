"""Channels of several rates on one uniform clock, without a look at later samples.

The clock is that of the channel whose rate is nearest to the wanted one: its samples keep their
values, and a channel that is sampled at the same instants keeps its own too. At an instant between
its samples a slower channel goes on along its last two samples, by at most one of its intervals and
hardly beyond the range of its recent samples: a jump does not go on. A faster one is the mean since
the instant before. With v_y at 10 Hz the error of models identified from it grows by 20 %; with
repeated values it doubles (random cars, CarMaker).

A gap is where a channel has no sample for longer than 0.1 s, or than 2.5 of its own intervals: a
car can build up or lose all its lateral force meanwhile. It ends a segment.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import LONG, Array, blocks, filled, large
from models.logs.can import CALENDAR
from models.logs.log import Channel
from models.logs.stamps import since

GAP_INTERVALS = 2.5  # own intervals of a channel, more of which without a sample are a gap
_SLOWER = 0.4  # share of empty cells from which a channel is taken to be slower than its rows
_FAR = 5.0  # largest steps between samples, beyond which an extreme is no value of the signal
_ROUND = 5e-5  # by which two digits, or a power of two, are missed
_NONE = 1e30  # that no sensor gives
# Words of a bus whose largest number means "no value", or nines; a scale of two digits or a power
# of two makes them a signal, which may have been in km/h, degrees or g.
_WORDS = np.array([2.0**k - less for k in range(7, 33) for less in (0, 1, 2)] + [999, 9999, 99999])
_UNITS = np.array([1.0, 3.6, 180.0 / np.pi, 1.0 / 9.81])
ON_STEP = 0.01  # share of a step within which an instant is that of a sample
FASTER = 1.5  # samples a step, of which more are averaged
RECENT = 256  # samples, a power of two, whose range a signal leaves a little on its way to the next
BEYOND = 0.05  # share of it: 20 samples of a line let it go on, models of random cars stay as good


class Segment(NamedTuple):
    """Signals on one clock without a gap: t (n,) and by name (n,)."""

    t: Array
    signals: dict[str, Array]


class Raw(NamedTuple):
    """A signal in SI on the clock of its channel: t (n,), values (n,), and where they stand.
    holes : how many cells without a value were cut out.   codes : numbers that meant so.
    """

    t: Array
    values: Array
    place: str
    rows: NDArray[np.int64]
    holes: int = 0
    codes: str = ""


def holes(channel: Channel) -> NDArray[np.intp]:
    """Return which samples of a channel are empty cells where its sensor should have given one.

    Where 40 % are empty, or all, there are none: it is a slower channel in a table, or nothing.
    """
    empty = np.flatnonzero(np.isnan(channel.values))
    return empty if empty.size < _SLOWER * channel.values.size else empty[:0]


def without_empty(channel: Channel, *, cut: bool = False) -> Channel:
    """Return a channel without the empty cells that a slower channel has in a table.
    cut : whether `holes` are left out too; else they stay, and are refused.
    """
    there = ~np.isnan(channel.values)
    if not there.any() or (not cut and holes(channel).size):
        return channel
    return kept(channel, there)


def kept(channel: Channel, some: NDArray[np.bool_]) -> Channel:
    if some.all():
        return channel
    t, values, rows = channel.t[some], channel.values[some], channel.rows[some]
    return replace(channel, t=t, values=values, rows=rows)


@np.errstate(all="ignore")
def without_codes(channel: Channel) -> tuple[Channel, str]:
    """Return a channel without samples that mean "no value", and the numbers that do, in words.

    Such a number is a code, and farther from all others than these ever step; of zeros the doctor
    says more.
    """
    values = channel.values
    extremes = [one.reduce(values, initial=0.0) for one in (np.fmin, np.fmax)]
    if not _are_codes(np.array(extremes)).any():
        return channel, ""
    ends = np.unique(values[~np.isnan(values)])
    ends = np.concatenate([ends[:2], ends[2:][-2:]])
    ends = ends[_are_codes(ends)]
    rest = np.where(np.isin(values, ends), np.nan, values)
    step = np.fmax.reduce(np.abs(np.diff(rest)), initial=0.0)
    codes = [one for one in ends if np.fmin.reduce(np.abs(rest - one)) > _FAR * step > 0.0]
    said = ", ".join(f"{one:.9g}" for one in codes)
    return kept(channel, ~np.isin(values, codes)), said


def _are_codes(numbers: Array) -> NDArray[np.bool_]:
    """Return which numbers are codes, (n,)."""
    scale = np.abs(numbers)[:, None, None] / _WORDS[:, None] * _UNITS
    digits = np.stack([scale * 10.0 ** (1.0 - np.floor(np.log10(scale))), np.log2(scale)])
    exact = (np.abs(digits - np.rint(digits)) < _ROUND).any(axis=(0, 2, 3))
    return np.asarray(exact | (np.abs(numbers) > _NONE))


def gaps(t: Array, longest: float) -> NDArray[np.intp]:
    """Return the index of each sample that comes after a gap.
    t : rising time stamps [s], (n,).   longest : time without a sample that is none yet [s].
    """
    limit = max(longest * (1.0 + 1e-6), GAP_INTERVALS * typical_step(t))
    found = [
        part.start + 1 + np.flatnonzero(np.diff(t[part.start : part.stop + 1]) > limit)
        for part in blocks(max(t.size - 1, 0))
    ]
    return np.concatenate([np.zeros(0, dtype=np.intp), *found])


def typical_step(t: Array) -> float:
    """Return the median time between samples [s], of all of them; NaN of one.
    t : rising time stamps [s], (n,).
    """
    if t.size < 2:
        return np.nan
    steps = large((t.size - 1,))
    for part in blocks(steps.size):
        steps[part] = np.diff(t[part.start : part.stop + 1])
    middle = [(steps.size - 1) // 2, steps.size // 2]
    steps.partition(middle)  # where it lies, which of a long log is on disk
    return float(np.mean(steps[middle]))


def on_one_clock(raws: Mapping[str, Raw], dt: float, longest: float) -> list[Segment]:
    """Return signals of several clocks on one, in the segments in which all of them are there.

    Clocks of the calendar are compared since their first instant, to the microsecond.
    raws : by signal; times rise.   dt : step of the clock [s].
    longest : time without a sample that is no gap yet [s].
    """
    zero = min(float(raw.t[0]) for raw in raws.values())
    if zero > CALENDAR:
        times = {id(raw.t): since(raw.t, zero) for raw in raws.values()}
        near = {name: raw._replace(t=times[id(raw.t)]) for name, raw in raws.items()}
        return [_later(one, zero) for one in on_one_clock(near, dt, longest)]
    base = min(raws.values(), key=lambda raw: abs(np.log(_interval(raw.t) / dt)))
    found = []
    for begin, end in _covered([raw.t for raw in raws.values()], longest):
        inside = base.t[(base.t >= begin - 1e-9) & (base.t <= end + 1e-9)]
        if not inside.size:
            continue
        grid = inside[0] + dt * np.arange(int((end - inside[0]) / dt + 1e-6) + 1)
        times_inside = inside[: grid.size]
        if times_inside.size == grid.size and np.abs(times_inside - grid).max() <= 1e-6 * dt:
            grid = times_inside  # its very numbers, where they are the clock
        found.append(Segment(grid, {name: sampled(raw, grid, dt) for name, raw in raws.items()}))
    return found


def _later(segment: Segment, zero: float) -> Segment:
    t = segment.t
    return segment._replace(t=filled(t.size, lambda part: t[part] + zero))


def _interval(t: Array) -> float:
    """Return the typical time between samples [s], of the first ones of a long channel."""
    return float(np.median(np.diff(t[: LONG + 1])))


def _covered(times: Sequence[Array], longest: float) -> list[tuple[float, float]]:
    """Return the spans of time in which every channel has samples: first and last instant.

    A channel speaks for one interval after each of its samples, but not into a gap.
    """
    begins, ends = [], []
    for t in times:
        cuts = gaps(t, longest)
        begins.append(t[np.concatenate([[0], cuts])])
        ends.append(t[np.concatenate([cuts - 1, [t.size - 1]])] + (1.0 - ON_STEP) * _interval(t))
    edges = np.concatenate(begins + ends)
    order = np.argsort(edges, kind="stable")
    there = np.cumsum(np.where(order < edges.size // 2, 1, -1))
    k, edges = np.flatnonzero(there == len(times)), edges[order]
    spans = zip(edges[k].tolist(), edges[k + 1].tolist(), strict=True)
    return [(begin, end) for begin, end in spans if begin < end]


def sampled(raw: Raw, grid: Array, dt: float) -> Array:
    """Return a signal at the instants of a clock, of samples that were there by then.
    raw : the signal; a sample lies at or before the first instant.   grid : instants [s], (m,).
    dt : step of the clock [s].
    """
    interval = _interval(raw.t)
    return filled(grid.size, lambda part: _sampled(raw, grid[part], dt, interval))


def _sampled(raw: Raw, grid: Array, dt: float, interval: float) -> Array:
    """Return the same at some instants, of a signal with a typical interval [s]."""
    last = np.searchsorted(raw.t, grid + ON_STEP * dt, side="right") - 1
    if interval < dt / FASTER:
        first = np.searchsorted(raw.t, grid - dt + ON_STEP * dt, side="right")
        first, begin = np.minimum(first, last), min(int(first[0]), int(last[0]))
        total = np.concatenate([[0.0], np.cumsum(raw.values[begin : int(last[-1]) + 1])])
        return np.asarray((total[last + 1 - begin] - total[first - begin]) / (last + 1 - first))
    before = np.maximum(last - 1, 0)
    now, step = raw.values[last], raw.t[last] - raw.t[before]
    ahead = np.maximum(grid - raw.t[last], 0.0)
    goes_on = (last > 0) & (step <= GAP_INTERVALS * interval) & (ahead > ON_STEP * dt)
    share = np.minimum(ahead, step) / np.where(step > 0.0, step, 1.0)
    begin = max(int(last[0]) + 1 - RECENT, 0)
    low = high = raw.values[begin : int(last[-1]) + 1]
    for k in 2 ** np.arange(RECENT.bit_length() - 1):  # over twice as many samples each time
        low = np.minimum(low, np.concatenate([low[:k], low[:-k]]))
        high = np.maximum(high, np.concatenate([high[:k], high[:-k]]))
    low, high = low[last - begin], high[last - begin]
    room = BEYOND * (high - low)
    change = np.clip(now - raw.values[before], low - room - now, high + room - now)
    return np.where(goes_on, now + share * change, now)
