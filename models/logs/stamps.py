"""The clock of a table: which column it is, in which unit, and what is wrong with its stamps.

Stamps that are rounded (ten samples of 0.01 s that share the stamp 0.1 s, 400 Hz in whole
milliseconds) are put back on the even clock that they were taken from, where one explains every
stamp; it is said. Times that decrease are no rounding: a clock that starts again, or a mixed order.
They are refused, or mended where that is asked for.

In functions:
values : (n,) as in the file.   rows : (n,) where each is in the file.   t : times [s], (n,).
"""

import datetime
import math
import re
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array, blocks, filled
from codegen.escape import displayed
from models.logs.growing import LONGEST_IN_MEMORY
from models.logs.log import Clock, RecordingError
from models.logs.spelling import unit_in_name
from models.logs.units import PER_SECOND, TABLES, time_unit

_FASTEST = 1e-5  # [s] between samples of a car's log, at least
_IMPLAUSIBLE = 5e-5  # [s] between samples, below which the header's unit is false: 20 kHz
_SLOWEST = 0.11  # [s] between samples of a car's log, at most
_COARSEST = 1.0  # [s] between stamps without a unit: more than that are no seconds
_WORTH = 0.05  # share of a step by which rounding must shift stamps to be taken out
_MOST_STEPS = 100_000  # samples that a rate is taken from
_SHARED = 1.2  # samples that share a stamp, on average: with fewer they are doubled, not rounded
_JITTER = 1.2  # steps that stamps of an even clock may lie apart
_AVERAGED = 50  # samples of a mean over such stamps
PAUSE = 10.0  # [s] before a clock that starts again: a gap, which cuts the log
_BACK = 1.0  # [s] that a clock goes back: less is a sample astray
_FEWEST = 10  # samples that go on from there: fewer are astray
_REPEATED = 0.2  # share of stamps of a column that repeat, of which another may be finer
_OTHER_RATE = 0.2  # share of a step by which that of another clock differs
_SAME_DRIVE = 60.0  # [s] between the beginnings of two clocks of one drive, at most

_ALIKE = 0.1  # of a step, by which those of two columns of one time differ
_INTERVAL = 0.5  # of the median, by which intervals between samples differ from it
_LATE = 2.5  # usual steps that may lie about the end of a counter
_FULL = 40.0  # usual steps, in four rounds, until a counter is full: fewer are samples astray
_RUN = 1.0  # [s]: a counter that begins again sooner is no run of its own

MISSING = -(2**63)  # an instant that is not there, in ns
_DAY = 86400.0
NAMES: tuple[str, ...] = tuple(TABLES["clock"]["names"].split())
_INTERVALS = tuple(TABLES["clock"]["intervals"].split())
_CALLED = (*NAMES, *_INTERVALS)
# [s] after which counters begin again: of ticks in words of bits; of decimals and of the clock.
_OF_BITS = [2.0**bits * tick for bits in (8, 16, 24, 32) for tick in (1e-3, 1e-4, 1e-6, 1e-9)]
_ROUND = [*(10.0**k for k in range(-2, 5)), 60.0, 3600.0]
_MICROSECONDS = 1e6
_TICKS = tuple(10.0**-k for k in range(10))  # [s]: what stamps may be rounded to

_WAYS = TABLES["clock"]["ways"].split()
_COUNTERS = tuple(TABLES["clock"]["counters"].split())

_MENDING = '--mend-clock (in Python LogMap(order="mend"))'


_DATES = tuple(map(re.compile, TABLES["clock"]["dates"]))
_TIME = re.compile(
    r"(?:(\d+):)?(\d{1,2}):(\d\d)(?:[.,](\d+))?(?: ?([AP])\.?M\.?)?"
    r"(?: ?(?:Z|UTC|GMT))?(?: ?([-+])(\d\d):?(\d\d))?",
    re.I,
)
_MONTHS = {
    word: 1 + k
    for k, some in enumerate(TABLES["clock"]["months"].split(","))
    for word in some.split()
}
_SHORT = re.compile(r"(\d\d)(\d\d)(\d\d)(?:[.,](\d+))?Z?")


_Head = Callable[[int], Sequence[str]]  # of a column, its first cells


class Stamps(NamedTuple):
    """Time of each sample [s], (n,), and what was mended, one sentence each.
    order : which rows they are of, (n,); None are all as they stand.
    """

    t: Array
    notes: tuple[str, ...]
    order: NDArray[np.intp] | None = None

    def of(self, column: NDArray[Any]) -> NDArray[Any]:
        return column if self.order is None else column[self.order]


# Which column, in which unit.


def find_clock(names: Sequence[str], units: Sequence[str], head: _Head) -> Clock | None:
    """Return the column that is the time, by its name or else as the one that rises evenly.

    Of several that are called so it is the first whose stamps hardly ever repeat, as one that is
    rounded to seconds does. One that counts samples, or the way, is none.
    """
    named = [k for k, name in enumerate(names) if _plain(name) in _CALLED]
    named.sort(key=lambda k: _CALLED.index(_plain(names[k])))
    for fits in (_moves, _rises):
        for k in named:
            if (clock := _clock(k, names[k], units[k], head(k), fits)) is not None:
                return clock
    even = _even(names, units, head, named)
    if even and (len(even) == 1 or time_unit(units[even[0].column])):
        return even[0]
    for k in named:  # which does not rise, and what is wrong with it will be said
        if not even and (clock := _clock(k, names[k], units[k], head(k), _is_any)) is not None:
            return clock
    return None


@np.errstate(all="ignore")
def alike_clocks(
    names: Sequence[str], units: Sequence[str], head: _Head, clock: Clock
) -> list[Clock]:
    """Return other columns that rise by the steps of a clock, as that of a drive by a lap's."""

    def step(one: Clock) -> float:
        return float(np.median(np.diff(_times(one, head(one.column)))))

    others = _even(names, units, head, [clock.column])
    return [one for one in others if abs(step(one) - step(clock)) < _ALIKE * step(clock)]


def no_clock(names: Sequence[str], units: Sequence[str], head: _Head) -> str:
    """Return why no column is the time, and what to do; arguments as of `find_clock`."""
    even = [one.name for one in _even(names, units, head, ())]
    if len(even) > 1:
        return (
            f"several columns rise evenly ({', '.join(even[:3])}): declare the time by "
            f'--columns "t={even[0]}"'
        )
    way = [name for name, unit in zip(names, units, strict=True) if _is_way(name, unit)]
    counted = [
        one for k, one in enumerate(names) if units[k] in ("", "-") and _counts(one, head(k))
    ]
    if way and not counted:
        return f"no column is a time: {displayed(way[0])} is a distance; export the log over time"
    counts = f", {displayed(counted[0])} counts samples" if counted else ""
    advice = "--rate HZ gives the samples per second, or --columns t=COLUMN the time"
    return f"no column is a time that rises{counts}; {advice}"


def _even(
    names: Sequence[str], units: Sequence[str], head: _Head, named: Sequence[int]
) -> list[Clock]:
    """Return the columns that rise evenly and count neither samples nor the way; a time first."""
    found = [
        clock
        for k, (name, unit) in enumerate(zip(names, units, strict=True))
        if k not in named and not _is_way(name, "")
        if (time_unit(unit) if unit else not _counts(name, head(k)))
        if (clock := _clock(k, name, unit, head(k), _rises_evenly))
    ]
    return sorted(found, key=lambda one: not time_unit(units[one.column]))


def _is_way(name: str, unit: str) -> bool:
    plain = _plain(name)
    far = plain.endswith(("distance", "dist")) and unit in ("", "m", "km", "ft")
    return plain in _WAYS or far


@np.errstate(all="ignore")
def _counts(name: str, cells: Sequence[str]) -> bool:
    """Whether a column numbers its rows: by ones, or in whole steps by a name that says so."""
    values = [_number(cell) for cell in cells if cell.strip()]
    if len(values) < 3 or None in values:
        return False
    steps = np.diff(np.array(values, dtype=np.float64))
    one = float(steps[0])
    word = re.sub("[^a-z]", "", name.lower())
    called = word.endswith(_COUNTERS) or not word
    return one > 0.0 and one.is_integer() and bool((steps == one).all()) and (one == 1.0 or called)


def clocks_of_channels(
    names: Sequence[str], units: Sequence[str], head: _Head, first: Clock
) -> dict[int, Clock]:
    """Return by column the clock of those that stand behind a time of their own; else nothing.
    So tables are written whose channels were sampled at rates of their own: "time_1, v_x, time_2,
    v_y". It is such a table where it begins with a time, a channel stands between any two, and one
    of the others, called alike or of another rate, rises without a rest from about the same instant
    on: what a receiver tells of the same rows has another name and the same steps. What stands
    behind a time that is none of its own has the first.
    """
    found = {
        k: clock
        for k, name in enumerate(names)
        if _plain(name) in NAMES and (clock := _clock(k, name, units[k], head(k), _rises))
    }
    if first.column != 0 or len(found) < 2 or any(k - 1 in found for k in found):
        return {}
    times = {
        k: clock if _is_beside(clock, head(k), first, head(0)) else first
        for k, clock in found.items()
    }
    clock_of, current = {}, first
    for k in range(len(names)):
        current = times.get(k, current)
        if current is not first:
            clock_of[k] = current
    return clock_of


def _is_beside(
    clock: Clock, cells: Sequence[str], first: Clock, first_cells: Sequence[str]
) -> bool:
    """Return whether a time is that of other samples than the first one's, of the same drive."""
    times = [_times(clock, cells), _times(first, first_cells)]
    if (
        min(t.size for t in times) < _FEWEST
        or any((np.diff(t) <= 0.0).any() for t in times)
        or abs(times[0][0] - times[1][0]) > _SAME_DRIVE
    ):
        return False
    if _plain(clock.name) == _plain(first.name):
        return not np.array_equal(times[0], times[1])
    steps = [float(np.median(np.diff(t))) for t in times]
    return abs(steps[0] / steps[1] - 1.0) > _OTHER_RATE


def _times(clock: Clock, cells: Sequence[str]) -> Array:
    """Return the numbers in some cells of a clock [s]; none of a clock of the calendar."""
    numbers = [value for cell in cells if (value := _number(cell)) is not None]
    there = numbers and clock.unit in PER_SECOND
    return in_seconds(clock, np.array(numbers)) if there else np.zeros(0)


def given_clock(column: int, name: str, unit: str, head: Sequence[str]) -> Clock | None:
    """Return a column that is said to be the time; None where its cells are none.
    column : from 0.
    """
    found = _clock(column, name, unit, head, _is_any)
    return found and found._replace(words=found.words.replace("by its name (sure)", "as given"))


def _plain(name: str) -> str:
    """Return a name in small letters without its unit and signs."""
    unit = unit_in_name(name)
    if unit and not name.endswith("_" + unit):
        name = re.split(r"[\[({:,/]", name)[0]
    name = name.removesuffix("_" + unit) if unit else name
    return re.sub(r"[^a-z]", "", name.lower())


@np.errstate(all="ignore")  # of numbers that are no times
def _clock(
    column: int, name: str, unit: str, cells: Sequence[str], fits: Callable[[Array], bool]
) -> Clock | None:
    """Return a column as the clock; None where its cells are no time whose steps fit."""
    filled = [cell for cell in cells if cell.strip()]
    words = "as it rises evenly (likely)" if fits is _rises_evenly else "by its name (sure)"
    values = [_number(cell) for cell in filled]
    kind = "hhmmss" if unit == "hhmmss" else ""
    few = len(filled) // 10  # cells that may be wrong, which will be said when they are read
    if values.count(None) > few:
        values = [nanoseconds(cell) for cell in filled]
        kind = "instant"
        if values.count(None) > few:
            return None
    t = np.array([value for value in values if value is not None], dtype=np.float64)
    advice, plain = time_unit(unit), _plain(name)
    summed = not kind and (fits is _is_any or plain in _CALLED)
    summed &= _are_intervals(t, advice, alike=plain in _INTERVALS)
    t = np.cumsum(t) if summed else t
    if not fits(np.diff(t)):
        return None
    if kind:
        form = "date or time of day" if kind == "instant" else kind
        return Clock(column, name, kind, f"{name!r} as {form}, {words}")
    found, epoch = _unit(t, advice)
    if fits is not _is_any and 0.0 < _step(t, found) < _IMPLAUSIBLE:
        found, epoch = _unit(t, "")
    since = " since 1970" if epoch else ""
    guessed = "" if advice else ", a unit that fits its steps (likely)"
    if advice and found != advice:
        guessed = f"; as its steps are too short for {unit.strip()} (likely)"
    guessed += "; it holds intervals, which are summed" * summed
    return Clock(column, name, found, f"{name!r} in {found}{since}, {words}{guessed}", summed)


def _are_intervals(t: Array, unit: str, *, alike: bool) -> bool:
    """Return whether a column holds the time since the sample before, which does not rise.
    unit : "" where none is told.   alike : whether all may be equal, which a clock that stands is.
    """
    steps, usual = np.diff(t), float(np.median(t)) if t.size else 0.0
    rises, falls = np.count_nonzero(steps > 0.0), np.count_nonzero(steps < 0.0)
    near = np.abs(t - usual) <= _INTERVAL * usual
    possible = 0.0 < usual <= _SLOWEST * PER_SECOND[unit or "ns"]
    return bool(
        possible
        and near.mean() > 0.9
        and t.min() >= 0.0
        and (rises or alike)
        and 0.5 * rises <= falls
    )


def _is_any(_: Array) -> bool:
    return True


def _moves(steps: Array) -> bool:
    """Return whether steps rise, and hardly any stands still."""
    return _rises(steps) and not (steps.size and float((steps == 0.0).mean()) > _REPEATED)


def _rises(steps: Array) -> bool:
    """Return whether hardly any step falls, and some rise; a header alone may be anything."""
    if steps.size == 0:
        return True
    return bool((steps >= 0.0).mean() > 0.9 and (steps > 0.0).any())


def _rises_evenly(steps: Array) -> bool:
    """Return whether most steps are alike, and none falls."""
    if steps.size < 3 or not (np.isfinite(steps).all() and (steps >= 0.0).all()):
        return False
    typical = float(np.median(steps))
    return typical > 0.0 and bool((np.abs(steps - typical) <= 0.5 * typical).mean() > 0.9)


def _unit(t: Array, advice: str) -> tuple[str, bool]:
    finite = t[np.isfinite(t)]
    largest = float(np.abs(finite).max()) if finite.size else 0.0
    for unit, (low, high) in TABLES["clock"]["epochs"].items():
        if low < largest < high and advice in ("", unit) and _step(finite, unit) <= 10.0:
            return unit, True
    if advice:
        return advice, False
    if not _step(finite, "s") < _COARSEST:
        for unit in ("ms", "us", "ns"):
            if _FASTEST <= _step(finite, unit) <= _SLOWEST:
                return unit, False
    return "s", False


def _step(t: Array, unit: str) -> float:
    """Return the mean step of times in a unit [s]; stamps may repeat, a counter begin again."""
    steps = np.diff(t)
    return float(np.mean(steps[steps >= 0.0])) / PER_SECOND[unit] if (steps >= 0.0).any() else 0.0


def _number(cell: str) -> float | None:
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None


def nanoseconds(cell: str) -> int | None:
    """Return a date and time (since 1970), or a time of day, in ns; None where it is neither.
    cell : ISO 8601, or with the day first, or hh:mm:ss, mm:ss, or "0.01 sec" as MATLAB writes a
        duration; "" gives `MISSING`.
    """
    text = cell.strip()
    if not text:
        return MISSING
    found = next(filter(None, (form.fullmatch(text) for form in _DATES)), None)
    if found is None:
        lasting = _DURATION.fullmatch(text)
        if lasting is None:
            return _of_day(text)
        lasts = float(lasting[1]) / PER_SECOND[time_unit(lasting[2])] * 1e9
        return round(lasts) if lasts < 2**62 else None
    word, year = found["month"].lower(), int(found["year"])
    month = int(word) if word.isdigit() else _MONTHS.get(word, _MONTHS.get(word[:3], 0))
    try:
        year += 2000 * (len(found["year"]) == 2)
        date = datetime.date(year, month, int(found["day"]))
    except ValueError:
        return None
    time = _of_day(found["time"]) if found["time"] else 0
    total = None if time is None else (date.toordinal() - _FIRST) * 86_400_000_000_000 + time
    return total if total is not None and abs(total) < 2**62 else None


_FIRST = datetime.date(1970, 1, 1).toordinal()
_DURATION = re.compile(r"(\d{1,15}(?:\.\d{0,15})?(?:e-?\d{1,2})?) (sec|min|hr)")


def _of_day(text: str) -> int | None:
    """Return a time of day [ns], less its time zone."""
    found = _TIME.fullmatch(text) or _SHORT.fullmatch(text)
    if found is None:
        return None
    hours, minutes, whole, part, *more = found.groups()
    half, sign, *away = more or (None, None)
    if half:
        if not hours or not 1 <= int(hours) <= 12:
            return None
        hours = str(int(hours) % 12 + 12 * (half in "pP"))
    zone = (int(away[0]) * 60 + int(away[1])) * (-1 if sign == "-" else 1) if sign else 0
    if len(hours or "") > 6 or int(minutes) > 59 or int(whole) > 60:
        return None
    seconds = int(hours or 0) * 3600 + (int(minutes) - zone) * 60 + int(whole)
    return seconds * 1_000_000_000 + int((part or "0")[:9].ljust(9, "0"))


# Seconds that rise.


@np.errstate(all="ignore")  # of numbers that are no times
def require_times(
    label: str, clock: Clock, values: NDArray[Any], rows: NDArray[np.int64], place: str
) -> None:
    """Refuse a row without a time.   values, rows : as of `seconds`, (n,) each."""
    missing = _first(values, lambda part: part == MISSING if part.dtype.kind == "i" else
                     ~np.isfinite(part))  # fmt: skip
    if missing is not None:
        raise RecordingError(
            f"{label}: {clock.name} must be a time in every row, {place} {rows[missing]} has none"
        )


def seconds(
    label: str,
    clock: Clock,
    values: NDArray[Any],
    rows: NDArray[np.int64],
    place: str,
    *,
    mend: bool = False,
    restarts: bool = True,
) -> Stamps:
    """Return stamps in seconds that rise, mended where they were rounded, and where it is asked.

    Dates and times of day count from the first of them; numbers stay as they stand, in seconds,
    those since 1970 too.
    mend : whether samples out of order are sorted, those that share a stamp with another left out,
        and what follows where the clock goes back for long is put after the rest; refused else.
    restarts : whether a clock that goes back for long is mended, too: not one of several.
    """
    if values.size == 0:
        return Stamps(np.empty(0), ())
    require_times(label, clock, values, rows, place)
    t = in_seconds(clock, values)
    said: tuple[str, ...] = ()
    if _first_step(t, np.less) is not None:
        t, over = _gone_on(t, calendar=clock.unit in ("instant", "hhmmss"))
        said = (f"{clock.name} {over}",) * bool(over)
    if _first_step(t, np.less) is None:
        if even := _even_clock(t):
            return even._replace(notes=(*said, f"{clock.name} {even.notes[0]}"))
        if _first_step(t, np.equal) is None:
            return Stamps(t, said)
    mended = _in_order(t, restarts=restarts) if mend else None
    if mended is None:
        wrong = not_rising(t, rows, place, restarts=restarts)
        raise RecordingError(f"{label}: {clock.name} {wrong}")
    return mended._replace(notes=(*said, *(f"{clock.name}: {note}" for note in mended.notes)))


@np.errstate(all="ignore")
def _gone_on(t: Array, *, calendar: bool) -> tuple[Array, str]:
    """Return stamps over midnight, or of a counter that is full, as if they went on; and a note.

    A run begins at zero, too, and may last a round number of seconds.
    """
    steps = np.diff(t)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else math.nan
    for period in [_DAY] if calendar else [*_OF_BITS, *_ROUND]:
        slack = 0.1 * _DAY if calendar else _LATE * usual
        falls = (steps < 0.0) & (np.abs(steps + period) < slack)
        times = int(np.count_nonzero(falls))
        is_run = period in _ROUND and t[0] < _LATE * usual and (period > _RUN or times < 2)
        if calendar or (min(times, 4) * period > _FULL * usual and not is_run):
            t = np.round(t + period * np.concatenate([[0.0], np.cumsum(falls)]), 9)
            said = f"begins again each {period:.9g} s, as a counter that is full: taken as going on"
            return t, "" if calendar else f"{said} ({times} times)"
    return t, ""


def _in_order(t: Array, *, restarts: bool) -> Stamps | None:
    """Return stamps that rise and the rows that they are of; None where that is no mending.
    t : stamps [s], some of which are not above the one before, (n,).
    restarts : whether a clock that goes back for long is mended: samples of two runs are not mixed.
    """
    falls = (np.flatnonzero(np.diff(t) < 0.0) + 1).tolist()
    begins = [0]
    for first, end in pairwise([*falls, t.size]):
        lasts = end - first >= _FEWEST and t[end - 1] - t[first] >= _BACK
        if lasts and t[first - 1] - t[first] >= _BACK:
            begins.append(first)
    if len(begins) > 1 and not restarts:
        return None
    late, orders, times = 0, list[NDArray[np.intp]](), list[Array]()
    for first, end in pairwise([*begins, t.size]):
        piece = t[first:end]
        late += int(np.count_nonzero(piece < np.maximum.accumulate(piece)))
        risen, order = np.unique(piece, return_index=True)
        orders.append(first + order)
        times.append(risen + (times[-1][-1] + PAUSE - risen[0] if times else 0.0))
    found = np.concatenate(times)
    twice = t.size - found.size
    if t.size >= _SHARED * found.size:
        return None  # rounded, or written twice throughout: who leaves them out leaves out too much
    counted = {
        "samples out of order are sorted": late,
        "samples that share their stamp with one before are left out": twice,
        f"times it goes back by {_BACK:g} s or more, and on {PAUSE:g} s later": len(begins) - 1,
    }
    notes = tuple(f"{what}: {count}" for what, count in counted.items() if count)
    return Stamps(found, notes, np.concatenate(orders))


def typical_rate(t: Array) -> float:
    """Return the samples per second [Hz] of times, by the first of many; NaN of fewer than two."""
    steps = np.diff(t[:_MOST_STEPS])
    step = float(np.median(steps)) if steps.size else 0.0
    return 1.0 / step if step > 0.0 else math.nan


def since(t: Array, first: float) -> Array:
    """Return times of the calendar since an instant, (n,); doubles hold them to the microsecond.
    t : times since 1970 [s], (n,).   first : instant since 1970 [s].
    """
    return filled(t.size, lambda part: np.round((t[part] - first) * _MICROSECONDS) / _MICROSECONDS)


def in_seconds(clock: Clock, values: NDArray[Any]) -> Array:
    """Return stamps in seconds, (n,); those of the calendar from the first on."""
    per_second = PER_SECOND.get(clock.unit, 1.0)
    first, values = 0, np.cumsum(values) if clock.summed else values
    if clock.unit == "instant":
        first, per_second = values[0], 1e9
    if clock.unit == "hhmmss":
        start = float(_of_digits(values[:1])[0])
        return filled(values.size, lambda part: np.round(_of_digits(values[part]) - start, 6))
    if per_second == 1.0:
        return values
    return filled(values.size, lambda part: (values[part] - first) / per_second)


def started(clock: Clock, cell: str) -> float:
    """Return the instant that a clock of the calendar counts from [s]; 0 of any other."""
    if clock.unit == "instant":
        return (nanoseconds(cell) or 0) / 1e9
    return float(_of_digits(np.array([float(cell)]))[0]) if clock.unit == "hhmmss" else 0.0


def _of_digits(values: Array) -> Array:
    hours, rest = np.divmod(values, 10000.0)
    minutes, whole = np.divmod(rest, 100.0)
    return np.asarray(hours * 3600.0 + minutes * 60.0 + whole)


def _first(values: NDArray[Any], wrong: Callable[[NDArray[Any]], NDArray[Any]]) -> int | None:
    for part in blocks(values.size, overlap=1):
        found = np.flatnonzero(wrong(values[part]))
        if found.size:
            return int(found[0] + part.start)
    return None


def _first_step(t: Array, wrong: np.ufunc) -> int | None:
    """Return the first step that is wrong against 0."""
    return _first(t, lambda part: wrong(np.diff(part), 0.0))


# Rounded stamps of an even clock.


@np.errstate(all="ignore")
def _even_clock(t: Array) -> Stamps | None:
    """Return the even clock that stamps were rounded from; None where there is none, or no need.
    Its note goes on after the name of the column.
    t : stamps [s] that never fall, (n,).
    """
    head = t[:LONGEST_IN_MEMORY]
    steps = np.diff(head)
    moves = steps[steps > 0.0]
    tick = _tick(head)
    if t.size < 10 or moves.size < 3 or tick is None or tick > 1.0:
        return None
    repeats = bool(moves.size < steps.size)
    if repeats and steps.size < _SHARED * moves.size:
        return _unjittered(t)
    usual = float(np.median(moves))
    near = moves[moves < usual + 1.5 * tick]
    if not repeats and (not _WORTH * usual < tick <= usual / 2.0 or np.ptp(near) < 0.5 * tick):
        return None  # by a coarser tick a lost sample could look rounded
    return _fitted(t, tick)


def _unjittered(t: Array) -> Stamps | None:
    """Return the even clock of stamps that jitter so far that some are there twice; or None.
    They must wander about it by less than a step, and not drift by half of one: then none is lost.
    """
    usual = float(np.median(np.diff(t)))
    dt = _even_step(t, _JITTER * usual) if usual > 0.0 else None
    if dt is None or t.size < 2 * _AVERAGED:
        return None
    off = t - dt * np.arange(t.size)
    smooth = np.convolve(off, np.full(_AVERAGED, 1.0 / _AVERAGED), "valid")
    rough = float(np.median(np.abs(np.diff(off))))
    if np.ptp(off) > _JITTER * dt or np.ptp(smooth) > 0.5 * dt or rough < 0.1 * dt:
        return None
    begin = float(off.max() + off.min()) / 2.0
    even = np.round(begin + dt * np.arange(t.size), 9)
    said = f"jitters, some stamps are there twice: taken as even at {1.0 / dt:.6g} Hz"
    return Stamps(even, (said,))


def _tick(t: Array) -> float | None:
    """Return what stamps are rounded to: the coarsest tick of which all are whole numbers [s]."""
    some = t[: 1 << 17]
    lost = float(np.spacing(np.abs(some).max()))  # by floats, of seconds since 1970 0.24 us
    for tick in _TICKS:
        counts = some / tick
        if lost < 0.01 * tick and np.abs(counts - np.rint(counts)).max() < 1e-4 + lost / tick:
            return tick
    return None


def _fitted(t: Array, tick: float) -> Stamps | None:
    """Return the even clock of which every stamp is less than a tick away, lost samples aside."""
    steps = np.diff(t)
    usual = float(np.median(steps[steps > 0.0]))
    cuts = np.flatnonzero(steps > max(2.5 * usual, usual + 1.5 * tick)) + 1
    edges = np.concatenate([[0], cuts, [t.size]])
    longest = int(np.argmax(np.diff(edges)))
    dt = _even_step(t[edges[longest] : edges[longest + 1]], tick)
    if dt is None:
        return None
    even, start, zero = np.empty(t.size), float(t[0]), math.nan
    for first, end in pairwise(edges):
        k = np.arange(end - first)
        off = t[first:end] - dt * k
        if np.ptp(off) > _slack(tick, t):
            return None
        middle = (off.max() + off.min()) / 2.0
        zero = middle if math.isnan(zero) else zero
        lost = round((middle - zero) / dt)  # whole steps: the clock went on meanwhile
        even[first:end] = start + dt * (lost + k)
    if not (np.diff(even) > 0.0).all():
        return None
    said = f"is rounded to {tick:g} s, its samples were put on the even clock of {dt:.9g} s that "
    return Stamps(np.round(even, 9), (said + "explains every stamp",))


def _slack(tick: float, t: Array) -> float:
    """Return how far stamps of an even clock may lie apart [s]: a tick, and what floats lose."""
    return tick * (1.0 + 1e-6) + 4.0 * float(np.spacing(np.abs(t).max()))


def _even_step(t: Array, tick: float) -> float | None:
    """Return the step [s], the roundest that explains every stamp; None where none does."""
    if t.size < 10:
        return None
    k = np.arange(t.size, dtype=np.float64)
    centered = k - k.mean()
    slope = float(centered @ (t - t.mean()) / (centered @ centered))
    if not slope > 0.0:
        return None
    per_second = max(round(1.0 / slope), 1)
    rounded, slack = [round(slope, digits) for digits in range(2, 8)], _slack(tick, t)
    tried = (*rounded[:3], 1.0 / per_second, *rounded[3:], slope)
    return next((dt for dt in tried if dt > 0.0 and np.ptp(t - dt * k) <= slack), None)


@np.errstate(all="ignore")
def not_rising(t: Array, rows: NDArray[np.int64], place: str, *, restarts: bool = True) -> str:
    """Return the rule that stamps break which fall or repeat, with value and remedy.
    t : stamps [s], one of which is not above the one before, (n,).
    """
    k = _first_step(t, np.less_equal)
    assert k is not None
    said = f"must increase, {place} {rows[k + 1]} has {t[k + 1]:.9g} after {t[k]:.9g}; "
    if t[k + 1] < t[k]:
        if not restarts and t[k] - t[k + 1] >= _BACK:
            return said + "the clock starts again beside others: cut the log there"
        if t[k + 1] - t[0] <= 0.5 * (t[k] - t[0]) and t[k] > t[0]:  # else a sample is astray
            return said + (
                "the clock starts again: several runs in one file need a column run, or "
                f"{_MENDING}, which learns on them as one drive"
            )
        return said + f"samples are out of order: {_MENDING} sorts them by time"
    steps = np.diff(t[k : k + LONGEST_IN_MEMORY])
    moves = int(np.count_nonzero(steps > 0.0))
    if k == 0 and not moves:
        return said + "it never moves: declare the column of the time, or --rate HZ"
    if moves and steps.size / moves >= _SHARED:
        return said + (
            f"stamps are rounded, {steps.size / moves:.3g} samples share one, and no even clock "
            "explains them: export time with more digits"
        )
    return said + f"a sample is there twice: {_MENDING} leaves one of them out"
