"""What a command tells: its results on standard output, its progress on standard error.

Both go through `codegen.escape.terminal`, so that no name that comes from a file commands the
terminal; and a stream that nobody reads any more, or that cannot be written, is no reason to stop
working.
"""

import logging
import os
import sys
import time
from contextlib import suppress
from typing import TextIO


class _Line(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        """Print one message of the library."""
        say(record.getMessage())


def _escaped(text: str) -> str:
    from codegen.escape import terminal  # with all of codegen: what says nothing does not need it

    return terminal(text)


def say(text: str) -> None:
    """Print one line for the person who waits.

    Parameters
    ----------
    text : the line.
    """
    from codegen.escape import visible

    complain(f"  {visible(text)}")


def complain(text: str) -> None:
    """Print a text on standard error, where there is one to print on.

    Parameters
    ----------
    text : one or several lines.
    """
    try:
        print(_escaped(text), file=sys.stderr, flush=True)
    except OSError:
        _muffle(sys.stderr)


def tell(text: str) -> None:
    """Print results on standard output; `unwritten` remembers whether they could not be written.

    A reader that went away, as `head` does, has seen enough: the rest is not printed.

    Parameters
    ----------
    text : one or several lines.
    """
    _write_out(f"{_escaped(text)}\n")


def flush_out() -> None:
    """Write what other code printed on standard output, by the rules of `tell`."""
    _write_out("")


def unwritten() -> bool:
    """Tell whether results were lost because standard output could not be written."""
    return _lost


_lost = False


def _write_out(text: str) -> None:
    global _lost
    if sys.stdout is None:  # closed before we began
        return
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        _muffle(sys.stdout)
    except OSError as error:
        _muffle(sys.stdout)
        _lost = True
        complain(f"standard output cannot be written: {(error.strerror or str(error)).lower()}")


def _muffle(stream: TextIO) -> None:
    """Send the rest of a stream, which is buffered too, to nowhere."""
    with suppress(OSError, ValueError):  # ValueError: it has no file behind it
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def listen_to_library() -> None:
    """Show what the library has to say, such as that it compiles."""
    log = logging.getLogger("tireid")
    log.setLevel(logging.INFO)
    log.propagate = False
    if not any(isinstance(handler, _Line) for handler in log.handlers):
        log.addHandler(_Line())


class Stopwatch:
    """Time since it was made."""

    def __init__(self) -> None:
        self._start = time.perf_counter()

    @property
    def seconds(self) -> float:
        """Elapsed time [s]."""
        return time.perf_counter() - self._start


class Ticker:
    """Tells every few seconds how far something has come, so that short work says nothing.

    Parameters
    ----------
    what : that goes on.
    every : time between two lines [s].
    """

    def __init__(self, what: str, every: float = 3.0) -> None:
        self._what, self._every = what, every
        self._last = time.perf_counter()

    def __call__(self, share: float) -> None:
        """Say it where it is time.

        Parameters
        ----------
        share : done, 0 to 1.
        """
        now = time.perf_counter()
        if now - self._last >= self._every:
            self._last = now
            say(f"{self._what}: {100.0 * share:.0f} %")
