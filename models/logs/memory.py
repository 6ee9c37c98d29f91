"""Arrays in memory, as of a data frame, as a log."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from models.logs.log import Channel, Heading, Listed, RecordingError, chosen, one_run, some
from models.logs.spelling import without_unit
from models.logs.stamps import Stamps, risen
from models.logs.units import TIME, to_si

_TIMES = ("t", "time", "timestamp")  # what the clock is called
_RUN = "run"
_EVEN = "(even)"  # a time that a rate makes
_NANOSECONDS = 1e9  # of a second


class ArrayLog:
    """Columns of one length, of which one is the time.
    data : a data frame or a mapping, by column: what `data[column]` is has one axis.
    clock : column that is the time: seconds, or times of the calendar or durations, which count
        from the first; empty takes the one called t or time.
    clock_unit : of it, where it is numbers; empty are seconds.
    mend : whether times that do not rise are mended, and not refused.
    rate : of the samples [Hz], in place of a time; 0 where none is given.
    """

    format = "arrays"
    dialect = ()
    clock = None
    unlisted = ()

    def __init__(
        self,
        name: str,
        data: Any,
        clock: str = "",
        clock_unit: str = "",
        *,
        mend: bool = False,
        rate: float = 0.0,
    ) -> None:
        found = getattr(data, "columns", data)  # of a data frame; a mapping yields its keys
        try:
            header = [str(column) for column in found]
            columns = (_array(name, str(column), data[column]) for column in found)
            arrays = dict(zip(header, columns, strict=True))
        except (TypeError, KeyError, IndexError):
            raise RecordingError(
                f"{name}: a data frame or a mapping of arrays is needed, not {type(data).__name__}"
            ) from None
        if rate and arrays:
            clock = _EVEN
            arrays[_EVEN] = np.arange(next(iter(arrays.values())).size) / rate
        self._name, self._arrays, self._mend = name, arrays, mend
        self._noted: list[str] = []
        lower = {column.lower(): column for column in reversed(header)}
        named = next((lower[one] for one in _TIMES if one in lower), None)
        if clock and clock not in arrays:  # it may stand with its unit
            clock = next((one for one in header if without_unit(one) == clock), clock)
        self._clock, self._second = clock or named, to_si(clock_unit, TIME, f"{name}: {clock}")
        if self._clock not in arrays:
            missing = f"{clock!r}" if clock else "t"
            raise RecordingError(
                f"{name}: column {missing} is missing, the time [s]; columns found: "
                f"'{some(header)}'"
            )

    @property
    def path(self) -> Path:
        return Path(self._name)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was mended in what has been read so far, one sentence each."""
        return tuple(dict.fromkeys(self._noted))

    def headings(self) -> tuple[Heading, ...]:
        """Return the columns, but for the time and the runs; which are numeric shows in reading."""
        return tuple(Heading(name, "") for name in self._arrays if name not in (self._clock, _RUN))

    def listed(self) -> tuple[Listed, ...]:
        """Return the columns of `headings`, with how many samples there are."""
        size = self._arrays[str(self._clock)].size
        return tuple(
            Listed(name=one.name, unit=one.unit, samples=size, rate=np.nan)
            for one in self.headings()
        )

    def runs(self) -> tuple[str, ...]:
        """Return the words of the column run in their order."""
        if _RUN not in self._arrays:
            return ()
        return tuple(dict.fromkeys(str(word) for word in self._arrays[_RUN].tolist()))

    def read(self, names: Sequence[str], run: str | None = None) -> tuple[Channel, ...]:
        """Return columns as channels.   run : one of `runs`; None where there are none, or one."""
        run = one_run(self.path, self.runs(), run)
        chosen(self.path, names, self._arrays)
        clock = str(self._clock)
        columns = {name: self._column(name) for name in (clock, *names)}
        kept: NDArray[np.bool_] = np.ones(columns[clock].size, dtype=np.bool_)
        sizes = {name: column.size for name, column in columns.items()}
        if _RUN in self._arrays:
            sizes[_RUN] = self._arrays[_RUN].size
        if len(set(sizes.values())) > 1:
            raise RecordingError(f"{self._name}: columns must have one length, they have {sizes}")
        if run is not None:
            kept = np.array([str(word) == run for word in self._arrays[_RUN].tolist()])
        t, rows = columns[clock][kept], np.flatnonzero(kept)
        stamps = Stamps(t, ())
        if self._mend:
            stamps = risen(self._name, clock, t, rows, "index", mend=True)
            self._noted.extend(stamps.notes)
        return tuple(
            Channel(
                name=name,
                unit="",
                t=stamps.t,
                values=stamps.of(columns[name][kept]),
                place="index",
                rows=stamps.of(rows),
            )
            for name in names
        )

    def _column(self, name: str) -> Array:
        value = self._arrays[name]
        if value.ndim != 1:
            raise RecordingError(
                f"{self._name}: {name} must have one axis, its shape is {value.shape}"
            )
        if name == self._clock and value.dtype.kind in "Mm":
            there = value[~np.isnat(value)]
            seconds = np.full(value.size, np.nan)
            if there.size:
                since = (there - there[0]).astype("timedelta64[ns]").astype(np.int64)
                seconds[~np.isnat(value)] = since / _NANOSECONDS
            return seconds
        try:
            if value.dtype.kind in "MmSUbc":  # times of the calendar, words, flags, complex numbers
                raise TypeError
            number = value.astype(np.float64)
            return number * self._second if name == self._clock else number
        except (TypeError, ValueError):
            raise RecordingError(
                f"{self._name}: {name} must be numeric, its type is {value.dtype}"
            ) from None


def _array(name: str, column: str, value: Any) -> NDArray[Any]:
    """Return a column as an array; what a mask hides is empty, whatever number lies below it."""
    if getattr(getattr(value, "dtype", None), "tz", None) is not None:  # of pandas
        return np.asarray(value, dtype="datetime64[ns]")  # of UTC, where no hour is there twice
    if isinstance(value, np.ma.MaskedArray) and value.dtype.kind in "iuf":
        return np.asarray(np.ma.filled(value.astype(np.float64), np.nan))
    try:
        return np.asarray(value)
    except ValueError:
        raise RecordingError(
            f"{name}: {column} must have one axis, its rows are of several lengths"
        ) from None
