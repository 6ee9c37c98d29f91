"""A log that is a table: one clock, one row per sample, whatever format holds it."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from codegen.escape import displayed
from models.logs.growing import Growing
from models.logs.log import (
    Channel,
    Clock,
    Heading,
    Listed,
    RecordingError,
    chosen,
    few,
    one_run,
    some,
)
from models.logs.spelling import unit_in_name, without_unit
from models.logs.stamps import (
    MISSING,
    Stamps,
    alike_clocks,
    clocks_of_channels,
    find_clock,
    given_clock,
    no_clock,
    seconds,
    started,
    typical_rate,
)
from models.schema import LONGEST_NAME, limits

_LONG = 8  # columns at most of a table with a row for each value
_MOST_WORDS = 10_000  # names of runs in one log

_RUN = "run"


class Kind(Enum):
    """How the cells of a column are read."""

    NUMBER = "number"  # float64, NaN where a cell is missing
    WORD = "word"
    INSTANT = "instant"  # a date, a time of day or both, in ns


class Words(NamedTuple):
    """A column of words: the distinct ones in their order, and which of them each row has.
    names: of the words; codes: (n,) places among them.
    """

    names: list[str]
    codes: NDArray[Any]

    @classmethod
    def of(cls, cells: Sequence[str]) -> "Words":
        codes: dict[str, int] = {}
        coded = [codes.setdefault(cell, len(codes)) for cell in cells]
        return cls(list(codes), np.array(coded, dtype=np.int32))


class Cells(NamedTuple):
    """Columns of a table.
    columns: column from 0 -> (n,) float64, or int64 of nanoseconds; words: column -> its words;
    rows: (n,) lines of a text or rows from 1, for messages.
    """

    columns: dict[int, NDArray[Any]]
    words: dict[int, Words]
    rows: NDArray[np.int64]


class Columns(NamedTuple):
    """What a file tells of its columns, before its cells are read.
    names: as in the file, which may repeat; units: "" where none is given; numeric: whether they
    hold numbers; words: how the file is written, for people; rate: samples per second that the file
    tells of all rows [Hz], 0 where it tells none.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    numeric: tuple[bool, ...]
    words: tuple[str, ...] = ()
    rate: float = 0.0


class Table(Protocol):
    """What a format that is a table answers; columns are named by their places from 0."""

    @property
    def path(self) -> Path:
        """The file."""

    @property
    def format(self) -> str:
        """Its format as users call it."""

    @property
    def place(self) -> str:
        """What a sample is in: "line" or "row"."""

    @property
    def columns(self) -> Columns:
        """All columns."""

    def first_rows(self, column: int) -> list[str]:
        """Return the first cells of a column as text, "" where one is missing."""

    def cells(self, kinds: Mapping[int, Kind], run: tuple[int, str] | None = None) -> Cells:
        """Return columns, read as their kinds say; only the rows of a run where one is named."""


class Gathered:
    """Columns that are gathered block by block.
    kinds : column from 0 -> how its cells are read.
    run : column and word of the rows to keep; None keeps all.
    """

    def __init__(
        self,
        path: Path,
        kinds: Mapping[int, Kind],
        names: Sequence[str],
        place: str,
        run: tuple[int, str] | None,
    ) -> None:
        self.kinds = dict(kinds) | ({} if run is None else {run[0]: Kind.WORD})
        self._path, self._names = path, names
        self._place, self._run = place, run
        self._rows = Growing(np.int64)
        types = {Kind.NUMBER: np.float64, Kind.INSTANT: np.int64, Kind.WORD: np.int32}
        self._columns = {column: Growing(types[kind]) for column, kind in self.kinds.items()}
        self._codes: dict[int, dict[str, int]] = {
            column: {} for column, kind in self.kinds.items() if kind is Kind.WORD
        }
        self._most = limits().samples
        self._seen = 0

    def __len__(self) -> int:
        """Return how many rows came by, kept or not."""
        return self._seen

    def extend(self, rows: NDArray[np.int64], columns: Mapping[int, Any]) -> None:
        """Add the rows of a block.
        rows : (n,) where they are in the file.   columns : column -> (n,) values, or `Words`.
        """
        self._seen += rows.size
        if self._seen > self._most:
            few(self._path, self._seen, "samples", "rows")
        coded = {c: self._coded(c, columns[c], rows) for c in self._codes}
        keep: Any = slice(None)
        if self._run is not None:
            column, word = self._run
            keep = coded[column] == self._codes[column].get(word, -1)
        self._rows.extend(rows[keep])
        for column, kind in self.kinds.items():
            values = coded[column] if kind is Kind.WORD else columns[column]
            self._columns[column].extend(values[keep])

    def _coded(self, column: int, words: Words, rows: NDArray[np.int64]) -> NDArray[np.int32]:
        """Return the places of words among all that came by."""
        codes = self._codes[column]
        for k, word in enumerate(words.names):
            if len(word) > LONGEST_NAME and len(word.strip()) > LONGEST_NAME:
                row = rows[np.flatnonzero(words.codes == k)[0]]
                raise RecordingError(
                    f"{self._path}: {self._names[column]} must be at most {LONGEST_NAME} "
                    f"characters, {self._place} {row} has {displayed(word.strip())}"
                )
        new = [codes.setdefault(word.strip(), len(codes)) for word in words.names]
        if len(codes) > _MOST_WORDS:
            raise RecordingError(
                f"{self._path}: {self._names[column]} must name runs, it has more than "
                f"{_MOST_WORDS} different words"
            )
        coded: NDArray[np.int32] = np.array(new, dtype=np.int32)[words.codes]
        return coded

    def finished(self) -> Cells:
        """Return all rows; nothing can be added then."""
        found = {column: growing.finished() for column, growing in self._columns.items()}
        words = {c: Words(list(codes), found.pop(c)) for c, codes in self._codes.items()}
        return Cells(found, words, self._rows.finished())


@dataclass(frozen=True, kw_only=True)
class TableLog:
    """A table as a log: which of its columns is the clock, and which names the runs.
    clock_name, clock_unit : of the column that is the time; empty finds them.
    rate : of all samples [Hz], in place of a time; 0 where none is given.
    mend : whether stamps that do not rise are mended, and not refused.
    """

    table: Table
    clock_name: str = ""
    clock_unit: str = ""
    rate: float = 0.0
    mend: bool = False
    _noted: list[str] = field(default_factory=list, compare=False, repr=False)

    @property
    def path(self) -> Path:
        return self.table.path

    @property
    def _columns(self) -> Columns:
        return self.table.columns

    @property
    def format(self) -> str:
        return self.table.format

    @property
    def dialect(self) -> tuple[str, ...]:
        """How the file is written, as it was detected, for people."""
        clock = self.clock
        return (*self._columns.words, *((f"time is {clock.words}",) if clock is not None else ()))

    @property
    def notes(self) -> tuple[str, ...]:
        """What was mended in what has been read so far, one sentence each."""
        even = f"time is even at {self._even:g} Hz, as "
        even += "given" if self.rate else "the lines above the table say"
        return (*([even] if self._even else []), *dict.fromkeys(self._noted))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all columns, each once: the second "v" is "v (2)"."""
        seen: dict[str, int] = {}
        unique: list[str] = []
        for k, name in enumerate(self._columns.names):
            name = name or f"column {k + 1}"
            seen[name] = seen.get(name, 0) + 1
            unique.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
        return tuple(unique)

    @cached_property
    def clock(self) -> Clock | None:
        """The column that is the time; None where no column can be."""
        table = self.table
        if self.rate:
            return None
        if not self.clock_name:
            found = find_clock(self.names, self._columns.units, table.first_rows)
            return found and self._rising(found)
        name = self.clock_name
        if name not in self._places:  # it may stand with its unit in the file, or the unit be given
            bare = [one for one in self.names if without_unit(one) == without_unit(name)]
            name = bare[0] if len(bare) == 1 else name
        (column,) = chosen(self.path, [name], self._places)
        unit = self.clock_unit or self._columns.units[column] or unit_in_name(self.clock_name)
        given = given_clock(column, name, unit, table.first_rows(column))
        if given is None:
            raise RecordingError(
                f"{self.path}: {name} must be a time, its first cells are "
                f"{displayed(', '.join(table.first_rows(column)[:3]))}"
            )
        return given

    def _rising(self, first: Clock) -> Clock:
        """Return a clock, or the first of those with its steps that rises over the whole log."""
        table, found = self.table, [first]
        if self._run_column is None:
            found += alike_clocks(self.names, self._columns.units, table.first_rows, first)
        for one in found if len(found) > 1 else ():
            with suppress(RecordingError):  # as it does not rise, or cannot be read
                cells = table.cells({one.column: kind_of(one)})
                seconds("", one, cells.columns[one.column], cells.rows, table.place)
                said = f"; {first.name!r} does not rise throughout" * (one != first)
                return one._replace(words=one.words + said)
        return first

    @property
    def may_be_long(self) -> bool:
        """Whether a row may be one value of a channel that it names."""
        return (
            len(self.names) <= _LONG and not all(self._columns.numeric) and _RUN not in self.names
        )

    @cached_property
    def start(self) -> float:
        """The instant that times of the calendar count from [s]; 0 of others."""
        rows = [] if self.clock is None else self.table.first_rows(self.clock.column)
        head = [one for one in rows if one.strip()]
        return started(self.clock, head[0]) if self.clock and head else 0.0

    @cached_property
    def _even(self) -> float:
        """The rate of samples [Hz], given or, without a time, of the preamble; 0 where none is."""
        return self.rate or (self._columns.rate if self.clock is None else 0.0)

    @cached_property
    def _channel_clocks(self) -> dict[int, Clock]:
        if self.clock_name or self.clock is None or self._run_column is not None:
            return {}
        return clocks_of_channels(
            self.names, self._columns.units, self.table.first_rows, self.clock
        )

    @cached_property
    def _run_column(self) -> int | None:
        return self.names.index(_RUN) if _RUN in self.names else None

    @cached_property
    def _channels(self) -> tuple[int, ...]:
        """Which columns are channels: the numeric ones, but for the clock and the runs."""
        other = {None if self.clock is None else self.clock.column, self._run_column}
        other |= {clock.column for clock in self._channel_clocks.values()}
        return tuple(
            k for k, is_one in enumerate(self._columns.numeric) if is_one and k not in other
        )

    @property
    def unlisted(self) -> tuple[str, ...]:
        """Names of the columns that are no channels."""
        return tuple(name for k, name in enumerate(self.names) if k not in set(self._channels))

    def headings(self) -> tuple[Heading, ...]:
        """Return names and units of the numeric columns, but for the clock and the runs."""
        units = self._columns.units
        return tuple(Heading(self.names[k], units[k]) for k in self._channels)

    def listed(self) -> tuple[Listed, ...]:
        """Return the numeric columns in their order, but for the clock and the runs."""
        return self._listed

    @cached_property
    def _listed(self) -> tuple[Listed, ...]:
        kinds = {} if self._run_column is None else {self._run_column: Kind.WORD}
        clocks = {one.column: one for one in (self.clock, *self._channel_clocks.values()) if one}
        cells = self.table.cells(kinds | {k: kind_of(one) for k, one in clocks.items()})
        size = cells.rows.size
        for words in cells.words.values():  # each run has a clock of its own
            first = words.codes == 0
            columns = {k: cells.columns[k][first] for k in clocks}
            cells = cells._replace(columns=columns, rows=cells.rows[first])
        stamps = {k: self._stamps(str(self.path), one, cells).t for k, one in clocks.items()}
        rates = {k: typical_rate(t) for k, t in stamps.items()}
        listed = []
        for k, heading in zip(self._channels, self.headings(), strict=True):
            head = self.table.first_rows(k)
            filled = sum(cell != "" for cell in head) / max(len(head), 1)
            filled = 1.0 if self._channel_clocks else filled  # of its own times, which end sooner
            clock = self._channel_clocks.get(k, self.clock)
            listed.append(
                Listed(
                    name=heading.name,
                    unit=heading.unit,
                    samples=stamps[clock.column].size if clock and self._channel_clocks else size,
                    rate=(rates[clock.column] if clock else self._even or math.nan) * filled,
                )
            )
        return tuple(listed)

    def _stamps(self, label: str, clock: Clock | None, cells: Cells) -> Stamps:
        """Return the stamps of a clock, or of an even rate; of several each ends where it ends."""
        if clock is None:
            return Stamps(np.arange(cells.rows.size) / self._even, ())
        column, rows, place = cells.columns[clock.column], cells.rows, self.table.place
        if not self._channel_clocks:
            return seconds(label, clock, column, rows, place, mend=self.mend)
        there = np.flatnonzero(column != MISSING if column.dtype.kind == "i" else ~np.isnan(column))
        stamps = seconds(
            label, clock, column[there], rows[there], place, mend=self.mend, restarts=False
        )
        return stamps._replace(order=stamps.of(there))

    def runs(self) -> tuple[str, ...]:
        """Return the words of the column "run" in their order; empty where there is none."""
        return self._runs

    @cached_property
    def _runs(self) -> tuple[str, ...]:
        if self._run_column is None:
            return ()
        return tuple(self.table.cells({self._run_column: Kind.WORD}).words[self._run_column].names)

    def read(self, names: Sequence[str], run: str | None = None) -> tuple[Channel, ...]:
        """Return columns as channels on the clock of the log.
        run : one of `runs`; None where there are none.
        """
        places, clock = chosen(self.path, names, self._places), self.clock
        if clock is None and not self._even:
            why = no_clock(self.names, self._columns.units, self.table.first_rows)
            raise RecordingError(f"{self.path}: {why}; columns found: '{some(self.names)}'")
        clocks = {k: self._channel_clocks.get(k, clock) for k in places}
        kinds = {one.column: kind_of(one) for one in clocks.values() if one}
        column = None if clock is None else clock.column
        timed = clock is None or kind_of(clock) is Kind.NUMBER  # asked for as it stands
        kinds |= {k: Kind.NUMBER for k in places if timed or k != column}
        one_run(self.path, self.runs(), run)
        runs = self._run_column
        cells = self.table.cells(kinds, None if runs is None or run is None else (runs, run))
        label = str(self.path) if run is None else f"{self.path}:{run}"
        found = {one: self._stamps(label, one, cells) for one in dict.fromkeys(clocks.values())}
        self._noted.extend(note for stamps in found.values() for note in stamps.notes)
        if self._channel_clocks and clock is not None:
            titles = dict.fromkeys(
                displayed(one.name) for one in (clock, *self._channel_clocks.values())
            )
            said = "channels have times of their own, each the one before it: "
            self._noted.append(said + ", ".join(titles))
        channels = []
        for name, k in zip(names, places, strict=True):
            stamps = found[clocks[k]]
            is_clock = k == column and not timed
            channels.append(
                Channel(
                    name=name,
                    unit=self._columns.units[k],
                    t=stamps.t,
                    values=stamps.t if is_clock else stamps.of(cells.columns[k]),
                    place=self.table.place,
                    rows=stamps.of(cells.rows),
                )
            )
        return tuple(channels)

    @cached_property
    def _places(self) -> dict[str, int]:
        return {name: k for k, name in enumerate(self.names)}


def kind_of(clock: Clock) -> Kind:
    return Kind.INSTANT if clock.unit == "instant" else Kind.NUMBER
