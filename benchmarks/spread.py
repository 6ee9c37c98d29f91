"""Work spread over processes, in order; one worker stays in this process."""

from collections.abc import Iterator
from contextlib import contextmanager

from identifier.compare.work import Map, fresh_processes


@contextmanager
def spread(workers: int, *, chunk: int = 1) -> Iterator[Map]:
    """Yield a `map` that uses several processes; work that has not begun is dropped on an error.

    Fresh processes rather than threads: the compiled loops release Python's lock, but what is
    around them does not, and CasADi's graphs must not be built by two threads at once.

    Parameters
    ----------
    workers : number of processes; the functions and their arguments must be picklable.
    chunk : number of items that a process takes at once.
    """
    if workers == 1:
        yield map
        return
    pool = fresh_processes(workers)
    try:
        yield lambda work, items: pool.map(work, items, chunksize=chunk)
    finally:
        pool.shutdown(cancel_futures=True)
