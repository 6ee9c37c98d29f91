"""What a command prints: its results on standard output, its progress on standard error.

Both go through `codegen.escape.terminal`, so that no name that comes from a file commands the
terminal; and a stream that nobody reads any more, or that cannot be written, is no reason to stop
working.
"""

import logging
import math
import os
import shutil
import sys
import time
from collections.abc import Callable, Mapping
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
    """Print one line for the person who waits."""
    from codegen.escape import visible

    complain(f"  {visible(text)}")


def complain(text: str) -> None:
    """Print a text on standard error, where there is one to print on."""
    _print(f"{_wiped()}{_escaped(text)}\n")


def _print(text: str) -> None:
    """Write on standard error, which may be closed."""
    if sys.stderr is None:
        return
    try:
        sys.stderr.write(text)
        sys.stderr.flush()
    except OSError:
        _muffle(sys.stderr)


def tell(text: str) -> None:
    """Print results on standard output; `unwritten` remembers whether they could not be written.

    A reader that went away, as `head` does, has seen enough: the rest is not printed.
    """
    _write_out(f"{_escaped(text)}\n")


def flush_out() -> None:
    """Write what other code printed on standard output, by the rules of `tell`."""
    _write_out("")


def unwritten() -> bool:
    """Return whether results were lost because standard output could not be written."""
    return _lost


_lost = False


def _write_out(text: str) -> None:
    global _lost
    if sys.stdout is None:  # closed before we began
        return
    if _live:
        _print(_wiped())
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
    """Show what the library has to say, such as that it compiles, and how far work has come."""
    global _listening
    _listening = True
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


# How far work has come. On a terminal one line that changes and goes away, elsewhere a line now and
# then; in a program that only uses the library nothing at all.

_QUIET, _PLAIN, _LIVE = 2.0, 5.0, 0.2  # s: before the first word, between lines, between changes
_TELLING = 0.02  # share from which the time left is given
_listening = False
_live = False  # whether such a line stands on the terminal


def _wiped() -> str:
    """Return what takes the changing line away, if there is one."""
    global _live
    was, _live = _live, False
    return "\r\x1b[K" if was else ""


def _on_terminal() -> bool:
    stream = sys.stderr
    return stream is not None and stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"


class Progress:
    """Prints how far something has come and how much time is left; short work says nothing.

    Use it as a context: the changing line goes away at its end.

    parts : names of its parts in order, and about how long each takes beside the others; None has
        one.
    long : whether it is known to last, so that the beginning of each part is given at once.
    """

    def __init__(
        self, what: str, parts: Mapping[str, float] | None = None, *, long: bool = False
    ) -> None:
        self._what, self._parts, self._long = what, dict(parts or {"": 1.0}), long
        self._whole = sum(self._parts.values())
        self._begun = time.perf_counter()
        self._said = self._begun + _QUIET - (_LIVE if _on_terminal() else _PLAIN)
        self._before, self._weight, self._name = 0.0, 0.0, ""
        self._done = 0
        self.begin(next(iter(self._parts)))

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *_: object) -> None:
        if _listening:
            _print(_wiped())

    def begin(self, part: str) -> "Progress":
        """Go on with a part; return what takes its share."""
        names = list(self._parts)
        self._before = sum(self._parts[name] for name in names[: names.index(part)]) / self._whole
        self._weight, self._name = self._parts[part] / self._whole, part
        self._done = 0
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
        live = _on_terminal()
        if not _listening or now - self._said < (_LIVE if live else _PLAIN):
            return
        self._said = now
        done = min(self._before + self._weight * share, 1.0)
        parts = [text or self._name, f"{100.0 * done:.0f} %"]
        if done > _TELLING:
            parts.append(f"{_time_text((now - self._begun) * (1.0 - done) / done)} left")
        line = f"{self._what}: {', '.join(one for one in parts if one)}"
        if live:
            _show(line)
        else:
            say(line)


def _time_text(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"


def _show(line: str) -> None:
    """Put a line in the place of the changing one; one that is too long is cut."""
    global _live
    from codegen.escape import visible

    width = shutil.get_terminal_size().columns - 1
    wiped = _wiped()
    _live = True
    _print(f"{wiped}{_escaped(visible(f'  {line}'))[:width]}")
