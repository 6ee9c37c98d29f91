"""Work that is spread over processes, or over machines whose source text is the same."""

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import Any

Map = Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[Any]]


def fresh_processes(workers: int, prepare: Callable[[], None] | None = None) -> ProcessPoolExecutor:
    """Return a pool of new processes, each of one thread, that end with this one, however it ends.
    prepare : what each does first; a function of a module.
    """
    pool = ProcessPoolExecutor(
        workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=exec,
        initargs=(BEGIN, {"prepare": prepare}),
    )
    added = dict.fromkeys(set(_THREADS) - set(os.environ), "1")
    os.environ.update(added)  # which is read where a process loads NumPy
    try:
        for _ in range(workers):
            pool.submit(int)  # begins a process
    finally:
        for name in added:
            del os.environ[name]
    return pool


_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "ARROW_IO_THREADS")

# A new process knows no module yet: tireid is its first, which finds its own packages.
BEGIN = """import tireid
from identifier.compare.work import begin_process
begin_process(prepare)
"""


def begin_process(prepare: Callable[[], None] | None) -> None:
    """Let this process, one of a pool, end with the one that made it.
    prepare : what it does first; None for nothing.
    """
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if prepare is not None:
        prepare()


def _end_with_parent() -> None:
    """End this process with the one that made it: one that is killed tells its pool nothing."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
