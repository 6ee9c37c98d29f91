"""Work that may be stopped and goes on where it was: what is finished is kept by its content.

The name of a result is a hash of all that it follows from, this source text included, so that a
result is never taken for that of other input or of another version. The files may be deleted at
any time.
"""

import hashlib
import json
import multiprocessing
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from models.files import write_atomically
from models.schema import read_json

# Work spread over processes, in order; one worker stays in this process.

Map = Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[Any]]


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


def fresh_processes(workers: int, prepare: Callable[[], None] | None = None) -> ProcessPoolExecutor:
    """Return a pool of new processes that end with this one, however it ends.

    Parameters
    ----------
    workers : number of processes.
    prepare : what each does first; a function of a module.
    """
    return ProcessPoolExecutor(
        workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=exec,
        initargs=(BEGIN, {"prepare": prepare}),
    )


# A new process knows no module yet: tireid is its first, which finds its own packages.
BEGIN = """import tireid
from identifier.compare.work import begin_process
begin_process(prepare)
"""


def begin_process(prepare: Callable[[], None] | None) -> None:
    """Let this process, one of a pool, end with the one that made it.

    Parameters
    ----------
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


ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("codegen", "models", "identifier")


@cache
def source_digest() -> str:
    """Return a hash of the source text and the versions that results follow from."""
    digest = hashlib.sha256(f"{version('casadi')} {np.__version__}".encode())
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            digest.update(f"\0{path.relative_to(ROOT)}\0".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


def content_digest(*parts: object) -> str:
    """Return a hash of values, and of the source text.

    Parameters
    ----------
    parts : arrays, and what `repr` tells completely, such as numbers and records of them.
    """
    digest = hashlib.sha256(source_digest().encode())
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"\0{part.dtype}{part.shape}\0".encode())
            digest.update(np.ascontiguousarray(part).tobytes())
        else:
            digest.update(f"\0{part!r}\0".encode())
    return digest.hexdigest()[:32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Store:
    """A folder of results.

    Parameters
    ----------
    folder : where they are; made where it is missing.
    from_json : the result that `to_json` describes; KeyError, TypeError or ValueError where it is
        none, which is then found anew.
    """

    folder: Path
    name: Callable[[Any], str]
    to_json: Callable[[Any], Any]
    from_json: Callable[[Any], Any]

    def read(self, item: Any) -> Any:
        """Return a result that was kept, or None."""
        try:
            return self.from_json(read_json(self._path(item), ValueError))
        except (OSError, KeyError, TypeError, ValueError):
            return None

    def write(self, item: Any, result: Any) -> None:
        """Keep a result, whole or not at all.

        Raises
        ------
        OSError
            Where the folder cannot be written.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        write_atomically(self._path(item), json.dumps(self.to_json(result)) + "\n")

    def _path(self, item: Any) -> Path:
        return self.folder / f"{self.name(item)}.json"


@dataclass(frozen=True, slots=True)
class _Numbered:
    """Work that tells which item it was, so that results may come in any order."""

    work: Callable[[Any], Any]

    def __call__(self, numbered: tuple[int, Any]) -> tuple[int, Any]:
        number, item = numbered
        return number, self.work(item)


def run_resumably(
    work: Callable[[Any], Any],
    items: Sequence[Any],
    spread_map: Map,
    *,
    store: Store | None = None,
    done: Callable[[int, int], None] | None = None,
) -> list[Any]:
    """Return the result of every item, in order; those that were kept are not worked out again.

    Parameters
    ----------
    work : from item to result, never None; picklable where other processes do it.
    spread_map : does the work; its results may come in any order.
    store : where results are kept as soon as they come; None keeps none.
    done : told after every item how many were found by an earlier run and how many are ready.
    """
    results = [None if store is None else store.read(item) for item in items]
    missing = [(i, item) for i, item in enumerate(items) if results[i] is None]
    earlier = ready = len(items) - len(missing)
    if done and earlier:
        done(earlier, ready)
    for number, result in spread_map(_Numbered(work), missing):
        results[number], ready = result, ready + 1
        if store is not None:
            store.write(items[number], result)
        if done:
            done(earlier, ready)
    return results
