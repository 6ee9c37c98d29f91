"""Files that libraries of others read: each is an extra, and whatever it raises becomes one line.

Such a library is imported when a file of its format is opened. It is given bytes that anybody may
have written, raises what it likes, warns and logs; a user sees the file and the rule. One in C that
a changed byte leads to allocate all memory, or never to end, runs in a process apart, with limits.
"""

import atexit
import errno
import gc
import importlib
import io
import logging
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from codegen.escape import displayed
from models.extras import needs
from models.limits import VARIABLE
from models.logs.log import RecordingError

try:
    import fcntl
    import resource
except ImportError:  # not on Windows
    resource = None  # type: ignore[assignment]

_T = TypeVar("_T")

_LONGEST_REASON = 160  # characters
# Of a process apart.
_SHARE = 0.5  # of the memory of the machine, at most
_LEAST_MEMORY, _COPIES = 5e8, 3.0  # bytes for any file, and so often the file and what is read
_STACK = 8e6  # bytes of a thread of a library, which has one for each processor
_LEAST_SECONDS = 5.0  # of the processor, for any file
_SLOWEST = 3e5  # bytes in a second: ten times less than small arrays are listed at
_OUT_OF_BAND = 5  # protocol of pickle that sends arrays as they are
_FULL = (errno.ENOSPC, errno.EDQUOT)
_LOGGERS = ("asammdf", "can", "cantools", "canmatrix", "h5py", "rosbags")


def need(path: Path, module: str, format: str, extra: str) -> Any:
    library = module.partition(".")[0]
    try:
        with _quiet():
            importlib.import_module(library)
            return importlib.import_module(module)
    except ImportError:
        raise RecordingError(needs(f"{path}: reading {format}", library, extra)) from None


@contextmanager
def one_line(path: Path, format: str) -> Iterator[None]:
    """Let a library read a file: what it raises is a refusal, what it warns of is not said.
    What is no fault of the file is not reported as one: a full disk is one, and MemoryError
    stays what it is.
    """
    with _quiet():
        try:
            yield
        except (RecordingError, MemoryError):  # which says nothing of the file
            raise
        except Exception as error:  # libraries raise anything of a file that is not theirs
            reason = _reason(error)
            _forget(error)
            if isinstance(error, FileNotFoundError) and not path.exists():
                raise RecordingError(f"{path}: there is no such file") from None
            if isinstance(error, PermissionError):
                raise RecordingError(f"{path}: may not be read") from None
            if isinstance(error, OSError) and error.errno in _FULL:
                raise RecordingError(
                    f"{path}: cannot be unpacked, there is no room in {tempfile.gettempdir()}; "
                    "name a folder with room by TMPDIR"
                ) from None
            raise RecordingError(
                f"{path}: is not {format}, or is damaged or cut off ({reason})"
            ) from None


def _forget(error: BaseException | None) -> None:
    """Let go of what a library was building: some complain aloud when they are taken away."""
    while error is not None:
        traceback.clear_frames(error.__traceback__)
        error = error.__context__
    gc.collect(1)  # it is young


def _reason(error: Exception) -> str:
    text = " ".join(str(error).split())
    if not text:
        return type(error).__name__
    return (
        displayed(text[:_LONGEST_REASON]).strip("'\"")
        if not text.isprintable()
        else (text if len(text) <= _LONGEST_REASON else f"{text[:_LONGEST_REASON]}...")
    )


@contextmanager
def _quiet() -> Iterator[None]:
    """Say nothing that a library says: on the screen, in warnings, in logs or when it is freed."""
    loggers = [logging.getLogger(name) for name in _LOGGERS]
    before = [logger.disabled for logger in loggers]
    hook = sys.unraisablehook
    sys.unraisablehook = lambda _: None
    for logger in loggers:
        logger.disabled = True
    try:
        with (
            warnings.catch_warnings(),
            np.errstate(all="ignore"),
            redirect_stdout(io.StringIO()),
            redirect_stderr(io.StringIO()),
        ):
            warnings.simplefilter("ignore")
            yield
    finally:
        sys.unraisablehook = hook
        for logger, disabled in zip(loggers, before, strict=True):
            logger.disabled = disabled


def apart(path: Path, size: float, function: Callable[..., _T], *args: Any) -> _T:
    """Return what a function finds in a file, called in a process with limits of memory and time.

    Where no limit can be set (Windows), or no Python be started (a program that embeds it), it is
    called here.
    size : of the numbers that it returns [bytes].
    function, args : a function of a module, and what can be pickled.
    """
    name = Path(sys.executable or "").name.lower()
    if resource is None or getattr(sys, "frozen", False) or not name.startswith(("python", "pypy")):
        return function(*args)
    machine = float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    size += path.stat().st_size
    least = _LEAST_MEMORY + _STACK * (os.cpu_count() or 1)
    memory, seconds = (
        min(_SHARE * machine, least + _COPIES * size),
        _LEAST_SECONDS + size / _SLOWEST,
    )
    with _Worker.lock:
        worker = _Worker.running or _Worker(path)
        try:
            done, found = worker.call(os.environ.get(VARIABLE), memory, seconds, function, args)
        except (EOFError, OSError, pickle.UnpicklingError):
            late = worker.end() == -signal.SIGXCPU
            what = f"takes more than {seconds:.0f} s" if late else "crashes its library"
            raise RecordingError(f"{path}: is damaged, reading it {what}; save it anew") from None
        except BaseException:  # as Ctrl-C: it may still be at work
            worker.end()
            raise
    if isinstance(found, MemoryError):
        raise RecordingError(
            f"{path}: is damaged, reading it takes more than {memory / 1e9:.2g} GB of memory; "
            "save it anew"
        )
    if not done:
        raise found
    result: _T = found
    return result


class _Worker:
    """A process that calls functions, one after another; it ends with this one."""

    lock = threading.Lock()
    running: "_Worker | None" = None

    def __init__(self, path: Path) -> None:
        found = os.pathsep.join(one or str(Path.cwd()) for one in sys.path)
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", "from models.logs.foreign import serve; serve()"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=os.environ | {"PYTHONPATH": found, "OPENBLAS_NUM_THREADS": "1"},  # stacks count
            )
        except OSError as error:
            raise RecordingError(
                f"{path}: cannot be read, no process can be started for it ({error.strerror})"
            ) from None
        _Worker.running = self

    def call(self, *request: Any) -> tuple[bool, Any]:
        """Return whether a function returned, and what it returned or raised."""
        ask, answer = self._process.stdin, self._process.stdout
        assert ask is not None and isinstance(answer, io.BufferedReader)
        pickle.dump(request, ask)
        ask.flush()
        parts: list[Any] = [np.empty(size, np.uint8) for size in pickle.load(answer)]
        for part in parts:
            if answer.readinto(part) < part.size:
                raise EOFError
        found: tuple[bool, Any] = pickle.loads(parts[0], buffers=parts[1:])
        return found

    def end(self) -> int:
        """End it at once, and return how it ended."""
        _Worker.running = None
        self._process.kill()
        with self._process:
            return self._process.wait()


def _forget_worker() -> None:
    """Let a fork start its own."""
    _Worker.lock, _Worker.running = threading.Lock(), None


def _end_worker() -> None:
    if _Worker.running is not None:
        _Worker.running.end()


if resource is not None:
    os.register_at_fork(after_in_child=_forget_worker)
    atexit.register(_end_worker)


def serve() -> None:
    """Call what the parent asks for, until it ends; its end stops a function that runs."""
    answer, ask = os.fdopen(os.dup(1), "wb"), sys.stdin.buffer
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # for what a library prints
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's
    signal.signal(signal.SIGIO, signal.SIG_IGN)
    fcntl.fcntl(ask, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(ask, fcntl.F_SETFL, fcntl.fcntl(ask, fcntl.F_GETFL) | os.O_ASYNC)
    while True:
        try:
            limits, memory, seconds, function, args = pickle.load(ask)
        except EOFError:
            return
        os.environ[VARIABLE] = limits or ""
        used = resource.getrusage(resource.RUSAGE_SELF)
        _limit(resource.RLIMIT_DATA, memory)
        _limit(resource.RLIMIT_CPU, used.ru_utime + used.ru_stime + seconds + 1.0)
        _limit(resource.RLIMIT_CORE, 0.0)
        signal.signal(signal.SIGIO, signal.SIG_DFL)
        found: tuple[bool, Any]
        try:
            found = True, function(*args)
        except Exception as error:
            found = False, error.with_traceback(None)
        signal.signal(signal.SIGIO, signal.SIG_IGN)
        arrays: list[pickle.PickleBuffer] = []
        said = pickle.dumps(found, _OUT_OF_BAND, buffer_callback=arrays.append)
        parts: list[Any] = [said, *(one.raw() for one in arrays)]
        pickle.dump([len(one) for one in parts], answer)
        for part in parts:
            answer.write(part)
        answer.flush()
        del found, arrays, parts


def _limit(what: int, most: float) -> None:
    hard = resource.getrlimit(what)[1]
    soft = int(most) if hard == resource.RLIM_INFINITY else min(int(most), hard)
    resource.setrlimit(what, (soft, hard))
