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
_MEASURED = 0.05  # share of a part after which its rate is known
_PACE = 0.25, 4.0  # of this machine over the one of the seconds below; beyond it, a log was long


class Progress:
    """Prints now and then how far something has come and how much time is left.

    Short work says nothing, nor does a program that only uses the library. The time left follows
    from the rate of the part that runs, without what comes before its first share, as compiling.

    parts : names of its parts in order, and about how many seconds each takes; None has one.
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
        names, lasts = list(self._parts), list(self._parts.values())
        k = names.index(part)
        self._before, self._lasts, self._after = sum(lasts[:k]), lasts[k], sum(lasts[k + 1 :])
        pace = self.seconds / self._before if k else 1.0
        self._pace = min(max(pace, _PACE[0]), _PACE[1])
        self._name, self._done = part, 0
        self._first: tuple[float, float] | None = None
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
        if share > 0.0 and self._first is None:
            self._first = now, share
        if not _listening or now - self._said < _EVERY:
            return
        self._said = now
        left = self._left(now, share)
        words = [text or self._name]
        if left is None:
            whole = self._before + self._lasts + self._after
            words.append(f"{100.0 * (self._before + self._lasts * share) / whole:.0f} %")
        else:
            words.append(f"{100.0 * self.seconds / max(self.seconds + left, 1e-9):.0f} %")
            words.append(f"{left:.0f} s left" if left < 100.0 else f"{left / 60.0:.0f} min left")
        say(f"{self._what}: {', '.join(one for one in words if one)}")

    def _left(self, now: float, share: float) -> float | None:
        """Return the time left [s]; None while nothing is known of it."""
        since, begun = self._first or (now, share)
        if share >= 1.0 or share - begun >= _MEASURED:
            own = (now - since) * (1.0 - share) / max(share - begun, _MEASURED)
        elif self._before:
            own = self._pace * self._lasts * (1.0 - share)
        else:
            return None
        return own + self._pace * self._after
