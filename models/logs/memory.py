"""Arrays in memory, as of a data frame, as a table."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from models.logs.log import RecordingError, some
from models.logs.spelling import without_unit
from models.logs.table import Cells, Columns, Gathered, Kind, TableLog, Words
from models.logs.units import TIME, to_si

_TIMES = ("t", "time", "timestamp")  # what the clock is called
ARRAYS = "arrays"  # the format
_INDEX = "index"  # of a data frame, where it has no name
_HEAD = 400  # rows that tell what columns are


def open_arrays(
    name: str,
    data: Any,
    clock: str = "",
    clock_unit: str = "",
    *,
    mend: bool = False,
    rate: float = 0.0,
) -> TableLog:
    """Return columns of one length as a log.
    data : a data frame or a mapping, by column: what `data[column]` is has one axis.
    clock : column that is the time: seconds, or times of the calendar or durations, which count
        from the first; empty takes the one called t or time, else a frame's index that is a time.
    clock_unit : of it, where it is numbers; empty are seconds.
    mend : whether times that do not rise are mended, and not refused.
    rate : of the samples [Hz], in place of a time; 0 where none is given.
    """
    found = getattr(data, "columns", data)  # of a data frame; a mapping yields its keys
    if (levels := getattr(found, "nlevels", 1)) > 1:
        raise RecordingError(
            f"{name}: columns have {levels} levels, one is needed: "
            "df.columns = df.columns.droplevel(1), or of the level that holds no names"
        )
    try:
        header = [str(column) for column in found]
        arrays = (_array(name, str(column), data[column]) for column in found)
        columns = dict(zip(header, arrays, strict=True))
        if len(columns) < len(header):
            twice = next(one for one in header if header.count(one) > 1)
            raise RecordingError(f"{name}: several columns are called {twice}: rename them")
    except (TypeError, KeyError, IndexError):
        raise RecordingError(
            f"{name}: a data frame or a mapping of arrays is needed, not {type(data).__name__}"
        ) from None
    if rate:
        return TableLog(table=_ArrayTable(name, columns), rate=rate)
    lower = {column.lower(): column for column in reversed(header)}
    # It may stand with its unit.
    likely = [one for one in header if clock and without_unit(one) == clock]
    named = next((lower[one] for one in _TIMES if one in lower), "")
    time = clock if clock in header else next(iter(likely), clock) or named
    notes = []
    if time not in header:
        index = getattr(data, "index", None)  # that of a list is a method
        label = str(getattr(index, "name", None) or _INDEX)
        values = _array(name, label, index)
        counts = values.dtype.kind == "i" and not clock
        if clock not in ("", label) or counts or not _rises(values):
            missing = f"{clock!r}" if clock else "t"
            rising = [one for one, value in columns.items() if _rises(value)]
            rising.sort(key=lambda one: columns[one].dtype.kind not in "mM")
            remedy = f'columns={{"t": "{rising[0]}"}}?; ' if rising else ""
            raise RecordingError(
                f"{name}: column {missing} is missing, the time [s]; {remedy}columns found: "
                f"'{some(header)}'"
            )
        time, columns[label] = label, values
        notes = [f"time is the index of the data frame, {label!r}"]
    to_si(clock_unit, TIME, f"{name}: {clock}")
    if columns[time].dtype.kind == "m":
        columns[time] = _in_seconds(columns[time])
    table = _ArrayTable(name, columns)
    unit = clock_unit or "s"
    return TableLog(table=table, clock_name=time, clock_unit=unit, mend=mend, _noted=notes)


def _rises(values: NDArray[Any]) -> bool:
    """Return whether values rise throughout, as a time does."""
    return (
        values.ndim == 1 and values.dtype.kind in "ifmM" and bool((values[1:] > values[:-1]).all())
    )


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


def _in_seconds(durations: NDArray[Any]) -> Array:
    """Return durations from the first that is there [s], (n,)."""
    first = durations[~np.isnat(durations)][:1]
    since = (durations - first).astype("timedelta64[ns]") if first.size else durations
    return np.where(np.isnat(durations), np.nan, since.astype(np.int64) / 1e9)


class _ArrayTable:
    """Columns in memory."""

    format, place = ARRAYS, "position"

    def __init__(self, name: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        self.path, self._names, self._arrays = Path(name), tuple(arrays), list(arrays.values())
        numeric = tuple(self._is_numeric(k) for k in range(len(arrays)))
        self.columns = Columns(self._names, ("",) * len(arrays), numeric)

    def _is_numeric(self, column: int) -> bool:
        try:
            self._number(column, slice(_HEAD))
        except RecordingError:
            return False
        return True

    def first_rows(self, column: int) -> list[str]:
        head = np.ravel(self._arrays[column])[:_HEAD]
        return ["" if cell is None or cell != cell else str(cell) for cell in head]  # as NaN is

    def cells(self, kinds: Mapping[int, Kind], run: tuple[int, str] | None = None) -> Cells:
        """Return columns, of the rows of a run where one is named."""
        gathered = Gathered(self.path, kinds, self._names, self.place, run)
        wanted = gathered.kinds
        found = {column: self._read(column, kind) for column, kind in wanted.items()}
        sizes = {self._names[column]: self._arrays[column].size for column in wanted}
        if len(set(sizes.values())) > 1:
            raise RecordingError(f"{self.path}: columns must have one length, they have {sizes}")
        size = next(iter(sizes.values()), self._arrays[0].size)
        gathered.extend(np.arange(size, dtype=np.int64), found)
        return gathered.finished()

    def _read(self, column: int, kind: Kind) -> Any:
        if kind is Kind.WORD:
            return Words.of([str(word) for word in np.ravel(self._arrays[column]).tolist()])
        if kind is Kind.INSTANT:
            return self._arrays[column].astype("datetime64[ns]").astype(np.int64)
        return self._number(column, slice(None))

    def _number(self, column: int, part: slice) -> Array:
        value, where = self._arrays[column], f"{self.path}: {self._names[column]}"
        if value.ndim != 1:
            raise RecordingError(f"{where} must have one axis, its shape is {value.shape}")
        try:
            if value.dtype.kind in "MmSUbc":  # times of the calendar, words, flags, complex numbers
                raise TypeError
            return value[part].astype(np.float64)
        except (TypeError, ValueError):
            raise RecordingError(f"{where} must be numeric, its type is {value.dtype}") from None
