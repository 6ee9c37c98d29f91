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
