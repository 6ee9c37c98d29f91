"""Tables in text files, read block by block: only the columns that are asked for are kept.

A block is whole lines. pyarrow reads it where it is installed; a block in which it finds anything
that is not plain (a blank line, a missing cell in a word, a wrong one) is read by Python instead,
which decides, so that numbers and messages are the same without pyarrow.
"""

import codecs
import csv
import io
import math
import re
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.escape import displayed
from models.logs import arrow
from models.logs.log import RecordingError, few
from models.logs.preamble import (
    BLANKS,
    COMMENT,
    HEAD,
    MISSING,
    Layout,
    cells_of,
    find_layout,
    of_fortran,
    typed,
)
from models.logs.stamps import nanoseconds
from models.logs.table import Cells, Columns, Gathered, Kind, TableLog, Words
from models.schema import pieces

_BLOCK = 1 << 21  # bytes of text that pyarrow reads at once; more is memory that is new each time
_SMALL_BLOCK = 1 << 19  # bytes of text that Python reads at once
_QUOTES = 8  # that may stand before the end of a block and not close
_LARGEST_LINE = 1 << 23  # bytes: 10 000 columns of 800

_BLANK = re.compile(rb"[ \t]+")
_MARGIN = re.compile(rb"^ | $", re.MULTILINE)


def open_text(path: Path, unnamed: Mapping[int, tuple[str, ...]] | None = None) -> TableLog:
    """Return the log in a text file of any dialect, its layout understood.
    unnamed : names of columns without a header, by their number.
    """
    head, whole = b"", True
    for part in pieces(path, RecordingError, limit="megabytes"):
        head += part
        if len(head) > HEAD:
            head, whole = head[:HEAD], False
            break
    layout = find_layout(path, head, whole, unnamed or {})
    few(path, len(layout.columns.names), "columns", "columns")
    table = TextTable(path=path, layout=layout)
    return TableLog(table=table)


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """A table in a text file.
    arrow : whether pyarrow is used; None where it is installed and the file is large.
    """

    place = "line"

    path: Path
    layout: Layout
    arrow: bool | None = None

    @property
    def format(self) -> str:
        return "VBO" if self.layout.made_by == "Racelogic VBOX" else "CSV"

    @property
    def columns(self) -> Columns:
        return self.layout.columns

    def first_rows(self, column: int) -> list[str]:
        """Return the first cells of a column, with decimal points, "" where one is missing.
        column : from 0.
        """
        layout = self.layout
        apart, comma = layout.thousands or "\0", layout.decimal.replace(".", "\0")
        cells = (row[column].replace(apart, "").replace(comma, ".") for row in layout.rows)
        return ["" if cell.lower() in MISSING else of_fortran(cell) for cell in cells]

    def cells(self, kinds: Mapping[int, Kind], run: tuple[int, str] | None = None) -> Cells:
        """Return columns.
        kinds : column from 0 -> how its cells are read.
        run : a column and the word that it must have; other rows are left out.
        """
        gathered = Gathered(self.path, kinds, self.columns.names, "line", run)
        wanted = gathered.kinds
        reader = _Python(self.path, self.layout, wanted)
        fast = arrow.is_used(self.path) if self.arrow is None else self.arrow
        fast = fast and arrow.is_installed()
        for line, block in _blocks(self.path, self.layout, _BLOCK if fast else _SMALL_BLOCK):
            plain = fast and reader.is_plain(block)
            count = lines(block) + (not block.endswith(b"\n"))
            columns = arrow.columns_of(block, count, self.layout, wanted) if plain else None
            if columns is None:
                rows, columns = reader.read(line, block)
            else:
                rows = np.arange(line, line + count)
            gathered.extend(rows, columns)
        if not reader.seen and not len(gathered):
            raise RecordingError(f"{self.path}: there is a header but no row of data")
        return gathered.finished()


# From the bytes of a file to blocks of whole lines in UTF-8.


def _blocks(path: Path, layout: Layout, size: int) -> Iterator[tuple[int, bytes]]:
    """Yield the number of the first line of a block, and the block; from the first row of data."""
    line, rest, reach, begun = layout.first, b"", size, False
    for text in _in_utf8(path, layout.encoding):
        rest += text
        if not begun:
            *_, rest = split = rest.split(b"\n", layout.first - 1)
            begun = True
            if len(split) < layout.first:
                return
        while len(rest) >= reach:
            cut = _whole_lines(rest, reach)
            if cut:
                block, rest, reach = rest[:cut], rest[cut:], size
                yield line, _plain(path, layout, line, block)
                line += lines(block)
            elif reach >= _LARGEST_LINE:
                raise RecordingError(
                    f"{path}: line {line} is longer than {_LARGEST_LINE} bytes, or opens a "
                    "quote that is never closed"
                )
            else:
                reach *= 2
    if rest:
        yield line, _plain(path, layout, line, rest)


def lines(text: bytes) -> int:
    """Return how many lines end in a text, in a sixth of the time of `bytes.count`."""
    return int(np.count_nonzero(np.frombuffer(text, np.uint8) == ord("\n")))


def _in_utf8(path: Path, encoding: str) -> Iterator[bytes]:
    """Yield the text of a file in UTF-8, each line of which ends in a line feed alone."""
    decoder = codecs.getincrementaldecoder(encoding)("replace")
    pending = b""
    for part in pieces(path, RecordingError, limit="megabytes"):
        if encoding not in ("utf-8", "utf-8-sig", "cp1252"):
            part = decoder.decode(part).encode("utf-8", "replace")
        part = pending + part
        pending = b"\r" if part.endswith(b"\r") else b""  # what follows may be its line feed
        part = part.removesuffix(b"\r")
        yield part.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in part else part
    if pending:
        yield b"\n"


def _whole_lines(text: bytes, end: int) -> int:
    """Return where the last whole line ends that does not end within quotes; 0 if none is near.
    end : of what is looked at.
    """
    cut = text.rfind(b"\n", 0, end) + 1
    for _ in range(_QUOTES):
        if not cut or text.find(b'"', 0, cut) < 0 or text.count(b'"', 0, cut) % 2 == 0:
            return cut
        cut = text.rfind(b"\n", 0, text.rfind(b'"', 0, cut)) + 1
    return 0


def _plain(path: Path, layout: Layout, line: int, block: bytes) -> bytes:
    """Return a block in UTF-8 with single blanks, without NUL bytes."""
    if b"\0" in block:
        line += block.count(b"\n", 0, block.index(b"\0"))
        raise RecordingError(
            f"{path}: is a binary file or damaged (it has NUL bytes in line {line}); a log is text"
        )
    if not block.isascii():
        try:
            text = block.decode("utf-8")
        except UnicodeDecodeError:
            text = block.decode("cp1252", "replace")
        block = typed(text).encode("utf-8")
    if layout.delimiter == BLANKS:
        block = _MARGIN.sub(b"", _BLANK.sub(b" ", block))
    return block


# Blocks read by Python, which decides what is a row and what is a number.


class _Row(NamedTuple):
    line: int
    cells: list[str]


class _Python:
    """Reads blocks of one table.   wanted : column from 0 -> how its cells are read."""

    def __init__(self, path: Path, layout: Layout, wanted: Mapping[int, Kind]) -> None:
        self._path, self._layout, self._wanted = path, layout, wanted
        self._width = len(layout.columns.names)
        again = [list(cells_of(one, layout.delimiter)) for one in layout.again]
        self._again = [one for one in again if any(one)]
        self._marks = [one.encode() for one in COMMENT]
        self._marks += [text.strip().encode() for text in layout.again if text.strip()]
        self.seen = 0

    def is_plain(self, block: bytes) -> bool:
        """Return whether no line of a block is a comment or the header once more."""
        if b"(" in block and arrow.ODD_NAN.search(block):
            return False
        return not any(
            mark[:1] in block and (block.startswith(mark) or b"\n" + mark in block)
            for mark in self._marks
        )

    def read(self, line: int, block: bytes) -> tuple[NDArray[np.int64], dict[int, Any]]:
        """Return the line of every row, and the columns that are wanted."""
        text = block.decode("utf-8")
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=self._layout.delimiter)
        rows, lines = [], []
        try:
            for cells in reader:
                rows.append(cells)
                lines.append(line + reader.line_num - 1)
        except csv.Error as error:
            number = line + reader.line_num - 1
            raise RecordingError(f"{self._path}: line {number} is not CSV ({error})") from None
        if not self.is_plain(block) or set(map(len, rows)) != {self._width}:
            kept = [row for row in map(_Row, lines, rows) if self._is_row(row)]
            lines = [row.line for row in kept]
            rows = [row.cells for row in kept]
        self.seen += len(rows)
        columns = {
            column: self._column(column, kind, [row[column] for row in rows], lines, "_" in text)
            for column, kind in self._wanted.items()
        }
        return np.array(lines, dtype=np.int64), columns

    def _is_row(self, row: _Row) -> bool:
        """Return whether a line is a row of data: no comment, not blank, not the header again."""
        cells = row.cells
        if not any(cell.strip() for cell in cells):
            if len(cells) == self._width:
                return True
            if len(cells) <= 1:
                return False
        elif cells[0].lstrip().startswith(COMMENT):
            return False
        if len(cells) == self._width + 1 and not cells[-1].strip():
            cells.pop()  # a delimiter at the end
        elif len(cells) == self._width - 1 and not self._layout.columns.names[-1]:
            cells.append("")  # no delimiter at the end, where others have one
        if len(cells) != self._width:
            raise RecordingError(
                f"{self._path}: line {row.line} has {len(cells)} cells, the header has "
                f"{self._width}; was the file cut off?"
            )
        return [cell.strip() for cell in cells] not in self._again

    def _column(
        self, column: int, kind: Kind, cells: list[str], lines: Sequence[int], marked: bool
    ) -> Any:
        if kind is Kind.WORD:
            return Words.of(cells)
        if kind is Kind.INSTANT:
            return self._each(column, cells, lines, nanoseconds, np.int64, "a time")
        layout = self._layout
        if not marked and not layout.thousands:
            with suppress(ValueError):
                if layout.decimal == ".":
                    return np.array(array("d", map(float, cells)))
                if not any("." in cell for cell in cells):
                    return np.array(array("d", (float(c.replace(",", ".")) for c in cells)))
        number = partial(_float, decimal=layout.decimal, thousands=layout.thousands)
        return self._each(column, cells, lines, number, np.float64, "numeric")

    def _each(
        self,
        column: int,
        cells: list[str],
        lines: Sequence[int],
        read: Callable[[str], float | None],
        dtype: Any,
        what: str,
    ) -> NDArray[Any]:
        values = [read(cell) for cell in cells]
        if None in values:
            k = values.index(None)
            comma = self._layout.decimal == "," and "." in cells[k]
            raise RecordingError(
                f"{self._path}: {self._layout.columns.names[column]} must be {what}, line "
                f"{lines[k]} has {displayed(cells[k])}"
                + (" where others have decimal commas" if comma else "")
            )
        return np.array(values, dtype=dtype)


def _float(cell: str, decimal: str, thousands: str) -> float | None:
    """Return a cell as a number, NaN where it is missing, None where it is neither."""
    text = of_fortran(cell.strip())
    if text.lower() in MISSING:
        return math.nan
    if "_" in text:  # which Python takes for a mark between digits
        return None
    if thousands and thousands in text:
        whole = text.split(decimal)[0].lstrip("+-").split(thousands)
        if not (1 <= len(whole[0]) <= 3 and all(len(part) == 3 for part in whole[1:])):
            return None
        text = text.replace(thousands, "")
    if decimal == ",":
        if "." in text:
            return None
        text = text.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        return None
