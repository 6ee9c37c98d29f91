"""What a command tells while it works: short lines on the standard error stream."""

import logging
import sys
import time


class _Line(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        """Print one message of the library."""
        say(record.getMessage())


def say(text: str) -> None:
    """Print one line for the person who waits.

    Parameters
    ----------
    text : the line.
    """
    print(f"  {text}", file=sys.stderr, flush=True)


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
