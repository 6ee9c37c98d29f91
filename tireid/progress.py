"""What a command prints: its results on standard output, its progress on standard error.

Both go through `codegen.escape.terminal`, so that no name that comes from a file commands the
terminal; and a stream that nobody reads any more, or that cannot be written, is no reason to stop
working.
"""

import logging
import math
import os
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TextIO

_listening = _lost = False


class _Line(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        """Print one message of the library."""
        say(record.getMessage())


def say(text: str) -> None:
    """Print one line for the person who waits."""
    from codegen.escape import visible

    complain(f"  {visible(text)}")


def complain(text: str) -> None:
    """Print a text on standard error, where there is one to print on."""
    with suppress(OSError):
        _write(sys.stderr, f"{text}\n")


def tell(*texts: str) -> None:
    """Print results on standard output; `unwritten` remembers whether they could not be written.

    texts : each from a new line on; what is empty is left out.

    A reader that went away, as `head` does, has seen enough: the rest is not printed.
    """
    _write_out("\n".join(filter(None, texts)) + "\n")


def flush_out() -> None:
    """Write what other code printed on standard output, by the rules of `tell`."""
    _write_out("")


def unwritten() -> bool:
    """Return whether results were lost because standard output could not be written."""
    return _lost


def _write_out(text: str) -> None:
    global _lost
    try:
        _write(sys.stdout, text)
    except BrokenPipeError:
        pass
    except OSError as error:
        _lost = True
        complain(f"standard output cannot be written: {(error.strerror or str(error)).lower()}")


def _write(stream: TextIO | None, text: str) -> None:
    """Write a text; where that fails, discard the rest of the stream, which is buffered too."""
    if stream is None:  # closed before we began
        return
    try:
        if text:
            from codegen.escape import terminal  # all of codegen: silence does not need it

            text = terminal(text)
        stream.write(text)
        stream.flush()
    except OSError:
        with suppress(OSError, ValueError):  # ValueError: it has no file behind it
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
        raise


def listen_to_library() -> None:
    """Show what the library has to say, such as that it compiles, and how far work has come."""
    global _listening
    _listening = True
    log = logging.getLogger("tireid")
    log.setLevel(logging.INFO)
    log.propagate = False
    if not any(isinstance(handler, _Line) for handler in log.handlers):
        log.addHandler(_Line())


_QUIET, _EVERY = 2.0, 5.0  # s: before the first line, between lines
_TELLING = 0.02  # share from which the time left is given


class Progress:
    """Prints now and then how far something has come and how much time is left.

    Short work says nothing, nor does a program that only uses the library.

    parts : names of its parts in order, and about how long each takes beside the others; None has
        one.
    long : whether it is known to last, so that the beginning of each part is given at once.
    """

    def __init__(
        self, what: str, parts: Mapping[str, float] | None = None, *, long: bool = False
    ) -> None:
        self._what, self._parts, self._long = what, dict(parts or {"": 1.0}), long
        self._begun = time.perf_counter()
        self._said = self._begun + _QUIET - _EVERY
        self.begin(next(iter(self._parts)))

    @property
    def seconds(self) -> float:
        """Time since it was made [s]."""
        return time.perf_counter() - self._begun

    def begin(self, part: str) -> "Progress":
        """Go on with a part; return what takes its share."""
        names, whole = list(self._parts), sum(self._parts.values())
        self._before = sum(self._parts[name] for name in names[: names.index(part)]) / whole
        self._weight, self._name, self._done = self._parts[part] / whole, part, 0
        if self._long:
            self._said = -math.inf
        self(0.0)
        return self

    def step(self, of: int, text: str = "") -> None:
        """Count one of several equal steps of the part."""
        self._done += 1
        self(min(self._done / max(of, 1), 1.0), text)

    def within(self, first: float, last: float) -> Callable[[float], None]:
        """Return who is given the share that is done of a piece of the part.

        first, last : shares of the part at which the piece begins and ends, 0 to 1.
        """
        return lambda share: self(first + (last - first) * share)

    def __call__(self, share: float, text: str = "") -> None:
        """Print it where it is time.

        share : done of the part, 0 to 1.
        """
        now = time.perf_counter()
        if not _listening or now - self._said < _EVERY:
            return
        self._said = now
        done = min(self._before + self._weight * share, 1.0)
        parts = [text or self._name, f"{100.0 * done:.0f} %"]
        if done > _TELLING:
            left = (now - self._begun) * (1.0 - done) / done
            parts.append(f"{left:.0f} s left" if left < 100.0 else f"{left / 60.0:.0f} min left")
        say(f"{self._what}: {', '.join(one for one in parts if one)}")
