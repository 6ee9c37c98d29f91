"""Functions called in a process apart, with limits of memory and time, for libraries in C.

A changed byte of a file may lead such a library to take all memory, to run for ever or to crash:
there it ends in one line. The process serves one thread, call after call, and ends with it all.
"""

import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from models.limits import VARIABLE

try:
    import fcntl
    import resource
except ImportError:  # not on Windows
    resource = None  # type: ignore[assignment]  # a module else

_T = TypeVar("_T")

_SHARE = 0.5  # of the memory of the machine, at most
_LEAST_MEMORY, _COPIES = 5e8, 3.0  # bytes for any file, and so often the file and what is read
_STACK = 8e6  # bytes of a thread of a library, which has one for each processor
_LEAST_SECONDS = 5.0  # of the processor, for any file
_SLOWEST = 3e5  # bytes in a second: ten times less than small arrays are listed at
_PICKLE = 5  # protocol that copies no array
_SERVE = "from models.apart import serve; serve()"

_idle: dict[tuple[int, int], subprocess.Popen[bytes]] = {}  # by process, as it may fork; thread


def apart(
    refusal: type[ValueError], path: Path, size: float, function: Callable[..., _T], *args: Any
) -> _T:
    """Return what a function finds in a file, or raise what it raises, as `each`."""
    (found,) = each(refusal, path, size, _once, function, *args)
    return found


def _once(function: Callable[..., _T], *args: Any) -> Iterator[_T]:
    yield function(*args)


def each(
    refusal: type[ValueError],
    path: Path,
    size: float,
    function: Callable[..., Iterator[_T]],
    *args: Any,
) -> Iterator[_T]:
    """Yield what a function finds in a file, one after another, or raise what it raises.

    Where no limit can be set (Windows), or no Python be started (a program that embeds it), it is
    called here.
    size : of all that it finds [bytes].   function, args : of a module, and what can be pickled.
    """
    name = Path(sys.executable or "").name.lower()
    if resource is None or getattr(sys, "frozen", False) or not name.startswith(("python", "pypy")):
        yield from function(*args)
        return
    machine = float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    least, size = _LEAST_MEMORY + _STACK * (os.cpu_count() or 1), size + path.stat().st_size
    memory, seconds = (
        min(_SHARE * machine, least + _COPIES * size),
        _LEAST_SECONDS + size / _SLOWEST,
    )
    key = os.getpid(), threading.get_ident()
    worker = _idle.pop(key, None) or _started()
    assert worker.stdin is not None and worker.stdout is not None
    what = f"takes more than {memory / 1e9:.2g} GB of memory"
    try:
        pickle.dump((os.environ.get(VARIABLE, ""), memory, seconds, function, args), worker.stdin)
        worker.stdin.flush()
        error = None
        while error is None:
            error, found = pickle.load(worker.stdout)
            if error is None:
                yield found
        _idle[key] = worker
    except BaseException as stopped:  # of the worker, or Ctrl-C while it is at work
        worker.kill()
        with worker:
            late = worker.wait() == -signal.SIGXCPU
        if not isinstance(stopped, EOFError | OSError | pickle.UnpicklingError):
            raise
        error, what = MemoryError(), f"takes more than {seconds:.0f} s" if late else "crashes"
    if isinstance(error, MemoryError):
        raise refusal(f"{path}: is damaged, reading it {what}; save it anew") from None
    if not isinstance(error, StopIteration):
        raise error


def _started() -> subprocess.Popen[bytes]:
    found = os.pathsep.join(one or str(Path.cwd()) for one in sys.path)
    return subprocess.Popen(
        [sys.executable, "-P", "-c", _SERVE],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": found, "OPENBLAS_NUM_THREADS": "1"},  # stacks are memory
    )


def serve() -> None:
    """Call what the parent asks for, until it ends."""
    ask, answer = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # for what a library prints
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's
    fcntl.fcntl(ask, fcntl.F_SETOWN, os.getpid())
    while ask.peek(1):  # type: ignore[union-attr]  # a buffered reader
        os.environ[VARIABLE], memory, seconds, function, args = pickle.load(ask)
        used = resource.getrusage(resource.RUSAGE_SELF)
        _limit(resource.RLIMIT_DATA, memory)
        _limit(resource.RLIMIT_CPU, used.ru_utime + used.ru_stime + seconds + 1.0)
        fcntl.fcntl(ask, fcntl.F_SETFL, os.O_ASYNC)  # from here the end of the parent kills
        error: Exception = StopIteration()
        try:
            for found in function(*args):
                pickle.dump((None, found), answer, _PICKLE)
        except Exception as raised:
            error = raised
        fcntl.fcntl(ask, fcntl.F_SETFL, 0)
        pickle.dump((error, None), answer)
        answer.flush()


def _limit(what: int, most: float) -> None:
    hard = resource.getrlimit(what)[1]
    soft = int(most) if hard == resource.RLIM_INFINITY else min(int(most), hard)
    resource.setrlimit(what, (soft, hard))
