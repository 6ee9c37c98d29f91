"""The kind of array that everything here is made of; how long ones are gone through, and kept.

A recording of ten hours has millions of samples. What is computed of every sample goes through them
block by block, and what is kept of every sample lies on disk where it is large: memory then does
not grow with the recording. Up to `LONG` samples there is one block, and all is in memory.
BLAS takes one thread: matrices are small here, and threads that wait for work cost more than it.
"""

import mmap
import os
import sys
import tempfile
import weakref
from collections.abc import Callable, Iterator
from contextlib import ContextDecorator, suppress
from functools import cache
from threading import Lock
from typing import IO, Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LONG = 60_000  # samples, ten minutes at 100 Hz, up to which there is one block
BLOCK = 16_384  # samples of a block beyond that
IN_MEMORY = 8 * 8 * LONG  # bytes, beyond which an array lies on disk


def blocks(n: int, first: int = 0, *, overlap: int = 0) -> Iterator[slice]:
    """Yield consecutive parts of samples: one where there are at most `LONG`, else of `BLOCK`.
    n : samples, the end of the last part.
    """
    size = BLOCK if n > LONG else max(n, 1)
    for begin in range(first, n, size):
        yield slice(begin, min(begin + size + overlap, n))
        if n > LONG:
            _let_go()


def thinning(n: int) -> int:
    """Return which sample is looked at where not all are: each one of at most `LONG`."""
    return -(-n // LONG)


def large(shape: tuple[int, ...]) -> Array:
    """Return an array to be filled: in memory, or in a file without a name where it is large.

    The file lies in the folder for temporary files (TMPDIR) and goes with the array. Where that
    folder has no room the array is in memory.
    """
    size = 8 * int(np.prod(shape, dtype=np.int64))
    if size > IN_MEMORY:
        with suppress(OSError), tempfile.TemporaryFile(prefix="tireid-") as file:
            if hasattr(os, "posix_fallocate"):  # else a disk that is full would kill the process
                os.posix_fallocate(file.fileno(), 0, size)
            return on_disk(file, np.dtype(np.float64), shape, "w+")
    return np.empty(shape)


def on_disk(
    file: IO[bytes], dtype: np.dtype[Any], shape: tuple[int, ...], mode: Literal["r", "w+"]
) -> NDArray[Any]:
    """Return an array that is a file, of which memory holds what was used last alone.
    mode : "r", or "w+" to make the file as large as that.
    """
    mapped = np.memmap(file, dtype, mode=mode, shape=shape)
    if isinstance(mapped.base, mmap.mmap):
        _mapped.add(mapped.base)
    return np.asarray(mapped)


_mapped: "weakref.WeakSet[mmap.mmap]" = weakref.WeakSet()


def _let_go() -> None:
    """Let the system take back the pages of arrays on disk: they count as memory of the process.

    What was written stays: in the file, or in the cache of the system, whose memory that is then.
    """
    if hasattr(mmap, "MADV_DONTNEED"):
        for mapped in tuple(_mapped):
            mapped.madvise(mmap.MADV_DONTNEED)


def filled(n: int, compute: Callable[[slice], Array], *shape: int) -> Array:
    """Return values of samples, computed block by block, on disk where they are many (n, ...).

    Nobody may write them.
    compute : returns the values of a part of them (k, ...).   shape : of a sample's values.
    """
    values = large((n, *shape))
    for part in blocks(n):
        values[part] = compute(part)
    values.setflags(write=False)
    return values


class _OneThread(ContextDecorator):
    """BLAS on one thread in the whole process, until the last of the calls that ask for it ends."""

    def __init__(self) -> None:
        self._lock, self._calls = Lock(), 0
        self._before: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if not self._calls:
                libraries = _libraries("scipy.linalg" in sys.modules)
                self._before = libraries.limit(limits=1, user_api="blas")
            self._calls += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._calls -= 1
            if not self._calls:
                self._before.restore_original_limits()


@cache
def _libraries(_scipy: bool) -> Any:
    """Return those of the process, looked up anew when SciPy has brought its own."""
    from threadpoolctl import ThreadpoolController  # 6 ms

    return ThreadpoolController()


one_thread = _OneThread()


def root_mean_square(values: Array) -> float:
    """Return the root mean square of all values, 0 of none."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0
