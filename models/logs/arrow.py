"""What pyarrow does for us: blocks of text to columns, its arrays to arrays of NumPy.

It is an extra, imported where it is worth the time. Its arrays are read by DLPack: its own way from
them to NumPy imports pandas.
"""

import importlib
import math
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.logs.preamble import Layout
from models.logs.stamps import nanoseconds
from models.logs.table import Kind, Words

_WORTH = 1 << 22  # bytes of a text from which on importing pyarrow takes less than it saves
ODD_NAN = re.compile(rb"(?i)nan\(")  # a number to pyarrow alone
_NULLS = ["", "nan", "NaN", "NAN", "NA", "N/A", "#N/A", "null", "NULL", "None", "-", "--", "---"]


def is_installed() -> bool:
    """Whether pyarrow is there, with its reader of text."""
    try:
        for name in ("pyarrow", "pyarrow.csv"):
            importlib.import_module(name)
    except ImportError:
        return False
    return True


def is_used(path: Path) -> bool:
    """Whether pyarrow is imported already, or a text is long enough to import it."""
    return "pyarrow" in sys.modules or path.stat().st_size > _WORTH


def columns_of(
    block: bytes, lines: int, layout: Layout, wanted: Mapping[int, Kind]
) -> dict[int, Any] | None:
    """Return columns of a text; None where anything in it is not plain, which Python decides on.
    block : whole lines in UTF-8, and their number.   wanted : column from 0 -> how its cells are
    read.
    """
    import pyarrow
    import pyarrow.csv

    if layout.thousands or not wanted:
        return None
    kinds = {
        str(column): pyarrow.float64() if kind is Kind.NUMBER else pyarrow.string()
        for column, kind in wanted.items()
    }
    # In memory of pyarrow's own, whose threads may drop it last, while Python ends: of what is
    # Python's that aborts the program.
    buffer = pyarrow.allocate_buffer(len(block))
    np.frombuffer(buffer, dtype=np.uint8)[:] = np.frombuffer(block, dtype=np.uint8)
    try:
        table = pyarrow.csv.read_csv(
            pyarrow.BufferReader(buffer),
            pyarrow.csv.ReadOptions(
                column_names=[str(k) for k in range(len(layout.columns.names))],
                block_size=len(block) + 1,
            ),
            pyarrow.csv.ParseOptions(
                delimiter=layout.delimiter, newlines_in_values=b'"' in block, double_quote=True
            ),
            pyarrow.csv.ConvertOptions(
                column_types=kinds,
                include_columns=list(kinds),
                null_values=_NULLS,
                strings_can_be_null=False,
                decimal_point=layout.decimal,
            ),
        )
        if table.num_rows != lines:
            return None
        columns: dict[int, Any] = {}
        for column, kind in wanted.items():
            found = pyarrow.concat_arrays(table.column(str(column)).chunks)
            if kind is Kind.NUMBER:
                columns[column] = doubles(found)
            elif kind is Kind.WORD:
                columns[column] = words(found)
            else:
                instants = [nanoseconds(cell) for cell in found.to_pylist()]
                if None in instants:
                    return None
                columns[column] = np.array(instants, dtype=np.int64)
    except (pyarrow.ArrowException, UnicodeDecodeError):
        return None
    return columns


def words(cells: Any) -> Words:
    """Return cells of any type as the distinct words of them, "" where one is missing.

    What a dictionary keeps once is never written out row by row.
    cells : array of pyarrow, (n,).
    """
    import pyarrow

    if not pyarrow.types.is_dictionary(cells.type):
        cells = cells.dictionary_encode()
    codes = whole_numbers(cells.indices, -1)
    used, first, where = np.unique(codes, return_index=True, return_inverse=True)
    order = np.argsort(first)  # a dictionary may hold words in another order, and more of them
    found = [None if k < 0 else cells.dictionary[int(k)].as_py() for k in used[order]]
    return Words(["" if one is None else str(one) for one in found], np.argsort(order)[where])


def doubles(cells: Any) -> NDArray[np.float64]:
    """Return numbers of any type as float64, (n,), NaN where one is missing.
    cells : array of pyarrow, (n,).
    """
    import pyarrow

    if pyarrow.types.is_duration(cells.type):
        cells = cells.cast(pyarrow.int64())
    whole = cells.cast(pyarrow.float64(), safe=False)
    return _filled(whole, math.nan)


def whole_numbers(cells: Any, missing: int) -> NDArray[np.int64]:
    """Return whole numbers or instants [ns] as int64, (n,).   cells : array of pyarrow, (n,)."""
    import pyarrow

    if pyarrow.types.is_timestamp(cells.type):
        cells = cells.cast(pyarrow.timestamp("ns", cells.type.tz))
    whole = cells.cast(pyarrow.int64())
    return _filled(whole, missing)


def _filled(cells: Any, missing: float) -> NDArray[Any]:
    """Return the numbers of an array, and another where one is missing."""
    import pyarrow

    buffer = pyarrow.py_buffer(np.array([missing], cells.type.to_pandas_dtype()))
    other = pyarrow.Array.from_buffers(cells.type, 1, [None, buffer])  # others import pandas, too
    return np.from_dlpack(cells.fill_null(other[0]))
