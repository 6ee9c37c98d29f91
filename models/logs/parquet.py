"""Tables in Parquet files, read batch by batch; needs pyarrow."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from codegen.escape import displayed
from models.apart import apart, each
from models.logs.arrow import doubles, whole_numbers, words
from models.logs.foreign import need, one_line
from models.logs.log import RecordingError, dense, few, require_small
from models.logs.spelling import unit_in_name
from models.logs.stamps import MISSING, nanoseconds
from models.logs.table import Cells, Columns, Gathered, Kind, TableLog
from models.schema import LONGEST_NAME, require_file

_HEAD = 400  # rows that tell what columns are
_BATCH = 1 << 16  # rows that are read at once

_WHAT = "a Parquet file"  # that a file is read as


def open_parquet(path: Path) -> TableLog:
    need(path, "pyarrow", "Parquet", "parquet")
    require_file(path, RecordingError, limit="megabytes")
    with one_line(path, _WHAT):
        return TableLog(table=apart(RecordingError, path, 0.0, _table, path))


def _table(path: Path) -> "_ParquetTable":
    parquet = need(path, "pyarrow.parquet", "Parquet", "parquet")
    with parquet.ParquetFile(path) as file:
        about = file.metadata
        few(path, about.num_columns, "columns", "columns")
        few(path, about.num_rows, "samples", "rows")
        groups = [about.row_group(k) for k in range(about.num_row_groups)]
        size = sum(group.total_byte_size for group in groups)
        few(path, size / 1e6, "megabytes", "megabytes")
        total = np.zeros(2)  # unpacked and packed
        for one in (group.column(k) for group in groups for k in range(group.num_columns)):
            sizes = one.total_uncompressed_size, one.total_compressed_size
            what = f"the cells of {displayed(one.path_in_schema)}"
            dense(path, sizes[0], sizes[1], what)
            total += sizes
        dense(path, total[0], total[1], "the cells of all columns")
        return _ParquetTable(path=path, schema=file.schema_arrow, rows=about.num_rows)


@dataclass(frozen=True, kw_only=True)
class _ParquetTable:
    """A table in a Parquet file."""

    path: Path
    schema: Any
    rows: int

    format = "Parquet"
    place = "row"

    @cached_property
    def columns(self) -> Columns:
        """The columns; their units as metadata say, or as in the names."""
        units, numeric = map(_unit, self.schema), (_is_numeric(one.type) for one in self.schema)
        return Columns(tuple(self.schema.names), tuple(units), tuple(numeric))

    def first_rows(self, column: int) -> list[str]:
        return self._head.get(column, ["?"] * min(self.rows, _HEAD))

    @cached_property
    def _head(self) -> dict[int, list[str]]:
        with one_line(self.path, _WHAT):
            return apart(RecordingError, self.path, 0.0, _ParquetTable._read_head, self)

    def _read_head(self) -> dict[int, list[str]]:
        """Return the first rows of the columns that may be read, which all are looked at."""
        from pyarrow.types import is_timestamp

        columns = [  # others, as lists and bytes, are not read at all
            k
            for k, one in enumerate(self.schema)
            if _is_numeric(one.type) or _is_text(one.type) or is_timestamp(one.type)
        ]
        first = next(self._batches(columns, _HEAD), [])
        return {
            k: _as_text(cells, self.schema.field(k).type)
            for k, cells in zip(columns, first, strict=False)
        }

    def cells(self, kinds: Mapping[int, Kind], run: tuple[int, str] | None = None) -> Cells:
        """Return columns.
        kinds : column from 0 -> how its cells are read.
        run : a column and the word that it must have; other rows are left out.
        """
        gathered = Gathered(self.path, kinds, self.columns.names, "row", run)
        wanted = gathered.kinds
        for column, kind in wanted.items():
            name, found = self.columns.names[column], self.schema.field(column).type
            if self.columns.names.count(name) > 1:
                raise RecordingError(f"{self.path}: column {name} appears more than once")
            if kind is Kind.NUMBER and not _is_numeric(found):
                raise RecordingError(f"{self.path}: {name} must be numeric, its type is {found}")
        if self.rows == 0:
            raise RecordingError(f"{self.path}: has columns but no row of data")
        require_small(self.path, self.rows * len(wanted))
        size = 8.0 * self.rows * len(wanted)
        with one_line(self.path, _WHAT):
            for block in each(RecordingError, self.path, size, _ParquetTable._read, self, wanted):
                gathered.extend(*block)
        return gathered.finished()

    def _read(self, wanted: Mapping[int, Kind]) -> Iterator[tuple[Any, dict[int, Any]]]:
        seen = 0
        for batch in self._batches(list(wanted), _BATCH):
            rows = np.arange(1, len(batch[0]) + 1) + seen
            seen += rows.size
            columns = {
                column: self._column(column, kind, cells, rows)
                for (column, kind), cells in zip(wanted.items(), batch, strict=True)
            }
            yield rows, columns

    def _batches(self, columns: Sequence[int], size: int) -> Iterator[list[Any]]:
        """Yield the cells of columns, some rows at a time; names may repeat, places do not."""
        all_names = self.columns.names
        names = list(dict.fromkeys(all_names[k] for k in columns))
        which = [(all_names[k], all_names[:k].count(all_names[k])) for k in columns]
        parquet = need(self.path, "pyarrow.parquet", "Parquet", "parquet")
        texts = [one.name for one in self.schema if _is_text(one.type)]  # each is kept once
        with parquet.ParquetFile(self.path, read_dictionary=texts) as file:
            for batch in file.iter_batches(batch_size=size, columns=names):
                places: dict[str, list[int]] = {}
                for place, name in enumerate(batch.schema.names):
                    places.setdefault(name, []).append(place)
                yield [batch.column(places[name][before]) for name, before in which]

    def _column(self, column: int, kind: Kind, cells: Any, rows: Any) -> Any:
        import pyarrow

        found = self.schema.field(column).type
        if kind is Kind.NUMBER:
            return doubles(cells)
        if kind is Kind.WORD:
            return words(cells)
        if pyarrow.types.is_timestamp(found):
            try:
                return whole_numbers(cells, MISSING)
            except pyarrow.ArrowInvalid:
                raise RecordingError(
                    f"{self.path}: {self.columns.names[column]} must be of the years 1678 to 2262, "
                    f"rows from {rows[0]} on are not"
                ) from None
        names, codes = words(cells)
        instants = [nanoseconds(name) for name in names]
        if None in instants:
            k = instants.index(None)  # the first: words stand in the order of the rows
            raise RecordingError(
                f"{self.path}: {self.columns.names[column]} must be a time, row "
                f"{rows[np.argmax(codes == k)]} has {displayed(names[k][:LONGEST_NAME])}"
            )
        return np.array(instants, dtype=np.int64)[codes]


def _is_numeric(kind: Any) -> bool:
    from pyarrow import types

    return bool(
        types.is_floating(kind)
        or types.is_integer(kind)
        or types.is_decimal(kind)
        or types.is_duration(kind)
    )


def _is_text(kind: Any) -> bool:
    from pyarrow import types

    return bool(types.is_string(kind) or types.is_large_string(kind))


def _as_text(cells: Any, kind: Any) -> list[str]:
    """Return cells as text, "" where one is missing; dates with all their digits."""
    import pyarrow
    from pyarrow import types

    if types.is_timestamp(kind):
        try:
            dates = whole_numbers(cells, MISSING).view("datetime64[ns]")
        except pyarrow.ArrowInvalid:
            return ["?"] * len(cells)
        return ["" if np.isnat(date) else str(date) for date in dates]
    if types.is_duration(kind):
        cells = cells.cast("int64")
    if _is_text(kind):
        names, codes = words(cells)
        short = [name[: LONGEST_NAME + 1] for name in names]
        return [short[k] for k in codes]
    if _is_numeric(kind):
        return ["" if cell is None else str(cell) for cell in cells.to_pylist()]
    return ["?"] * len(cells)


def _unit(field: Any) -> str:
    about = field.metadata or {}
    for key in (b"unit", b"units", b"Unit", b"Units"):
        if key in about:
            return str(about[key].decode("utf-8", "replace"))
    if str(field.type).startswith("duration"):
        return str(field.type.unit)
    return unit_in_name(field.name)
