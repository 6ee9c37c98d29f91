"""Columns that grow while a log is read: in memory while they are short, then on disk.

What is on disk is a temporary file without a name, mapped when it is complete: the system brings
in what is read and drops it again, so that a log of a day needs no more memory than one of a lap.
"""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import on_disk
from models.logs.log import RecordingError

LONGEST_IN_MEMORY = 1 << 20  # numbers: 8 MB of a column of float64


@contextmanager
def _named_errors(file: IO[bytes] | None) -> Iterator[None]:
    """Say of a disk that is full that it is, whatever log is being read; the file goes."""
    try:
        yield
    except OSError as error:
        with suppress(OSError):
            if file is not None:
                file.close()
        raise RecordingError(
            f"{tempfile.gettempdir()}: takes no more of a log that is too long for memory "
            f"({error.strerror or error}); name a folder with room by TMPDIR"
        ) from None


class Growing:
    """A column of unknown length, which goes to disk where it is long."""

    def __init__(self, dtype: Any = np.float64) -> None:
        self._dtype = np.dtype(dtype)
        self._parts: list[NDArray[Any]] = []
        self._file: IO[bytes] | None = None
        self._size = 0

    def __len__(self) -> int:
        """Return how many numbers there are."""
        return self._size

    def extend(self, values: NDArray[Any]) -> None:
        """Add numbers at the end.   values : (n,), which are copied."""
        part = np.asarray(values, dtype=self._dtype)
        self._size += part.size
        self._parts.append(part)
        if self._file is None and self._size <= LONGEST_IN_MEMORY:
            return
        if self._file is None:
            with _named_errors(None):
                self._file = tempfile.TemporaryFile()  # noqa: SIM115 (the map of it outlives us)
        with _named_errors(self._file):
            for one in self._parts:
                self._file.write(one.data)
        self._parts.clear()

    def finished(self) -> NDArray[Any]:
        """Return all numbers, (n,), read-only; nothing can be added then."""
        if self._file is None:
            whole = np.concatenate(self._parts) if self._parts else np.empty(0, self._dtype)
            self._parts.clear()
            whole.setflags(write=False)
            return whole
        with _named_errors(self._file), self._file as file:
            file.flush()
            # A plain array on the map, which keeps the file until the last view of it is gone.
            return on_disk(file, self._dtype, (self._size,), "r")
