"""Arrays of pyarrow as arrays of NumPy, by their buffers: its own way there imports pandas."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray


def doubles(cells: Any) -> NDArray[np.float64]:
    """Return numbers of any type as float64, (n,), NaN where one is missing.

    Parameters
    ----------
    cells : array of pyarrow, (n,).
    """
    import pyarrow

    if pyarrow.types.is_duration(cells.type):
        cells = cells.cast(pyarrow.int64())
    whole = cells.cast(pyarrow.float64(), safe=False)
    return _buffer(whole, np.float64, math.nan)


def whole_numbers(cells: Any, missing: int) -> NDArray[np.int64]:
    """Return whole numbers or instants [ns] as int64, (n,).

    Parameters
    ----------
    cells : array of pyarrow, (n,).
    missing : stands where one is missing.

    Raises
    ------
    pyarrow.ArrowInvalid
        Where an instant does not fit.
    """
    import pyarrow

    if pyarrow.types.is_timestamp(cells.type):
        cells = cells.cast(pyarrow.timestamp("ns", cells.type.tz))
    whole = cells.cast(pyarrow.int64())
    return _buffer(whole, np.int64, missing)


def _buffer(cells: Any, dtype: Any, missing: float) -> NDArray[Any]:
    """Return the numbers of an array, and another where its bitmap says that one is missing."""
    if len(cells) == 0:
        return np.empty(0, dtype)
    there, numbers = cells.buffers()
    part = slice(cells.offset, cells.offset + len(cells))
    values = np.frombuffer(numbers, dtype)[part]
    if cells.null_count == 0:
        return values
    bits = np.unpackbits(np.frombuffer(there, np.uint8), bitorder="little")
    return np.where(bits[part] == 1, values, np.array(missing, dtype))
