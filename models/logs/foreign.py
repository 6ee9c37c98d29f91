"""Files that libraries of others read: each is an extra, and whatever it raises becomes one line.

Such a library is imported when a file of its format is opened. It is given bytes that anybody may
have written, raises what it likes, warns and logs; a user sees the file and the rule.
"""

import difflib
import gc
import importlib
import io
import logging
import sys
import traceback
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from codegen.arrays import Array
from models.logs.log import RecordingError
from models.logs.stamps import Clock, Stamps, seconds
from models.schema import require_few, shown

LONGEST_REASON = 160  # characters
MOST_NOTED = 5  # names that a note lists
LOGGERS = ("asammdf", "can", "cantools", "canmatrix", "h5py", "rosbags")

T = TypeVar("T")


def need(path: Path, module: str, format: str, extra: str) -> Any:
    """Import what reads a format.

    Parameters
    ----------
    path : of the file, for the message.
    module : to import.
    format : as users call it.
    extra : of tireid that installs it.

    Raises
    ------
    RecordingError
        Where it is not installed: how to install it.
    """
    try:
        with _quiet():
            return importlib.import_module(module)
    except ImportError:
        library = module.partition(".")[0]
        raise RecordingError(
            f"{path}: reading {format} needs {library}: pip install tireid[{extra}]"
        ) from None


@contextmanager
def one_line(path: Path, format: str) -> Iterator[None]:
    """Let a library read a file: what it raises is a refusal, what it warns of is not said.

    Parameters
    ----------
    path : of the file.
    format : that it is read as, with its article.

    Raises
    ------
    RecordingError
        One line: file, format and what the library says.
    """
    with _quiet():
        try:
            yield
        except RecordingError:
            raise
        except Exception as error:  # libraries raise anything of a file that is not theirs
            reason = _reason(error)
            _forget(error)
            if isinstance(error, FileNotFoundError) and not path.exists():
                raise RecordingError(f"{path}: there is no such file") from None
            if isinstance(error, PermissionError):
                raise RecordingError(f"{path}: may not be read") from None
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
    """Return the first words of an error, on one line."""
    text = " ".join(str(error).split())
    if not text:
        return type(error).__name__
    return (
        shown(text[:LONGEST_REASON]).strip("'\"")
        if not text.isprintable()
        else (text if len(text) <= LONGEST_REASON else f"{text[:LONGEST_REASON]}...")
    )


@contextmanager
def _quiet() -> Iterator[None]:
    """Say nothing that a library says: on the screen, in warnings, in logs or when it is freed."""
    loggers = [logging.getLogger(name) for name in LOGGERS]
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


def seconds_of(path: Path, clock: str, t: Array, place: str) -> Stamps:
    """Return times that rise, as `stamps.seconds` mends them where they were rounded.

    Parameters
    ----------
    path : of the file.
    clock : whose times they are.
    t : times [s], (n,).
    place : what a sample is in the file.

    Raises
    ------
    RecordingError
        One line, where they are not finite or do not rise.
    """
    told = Clock(0, f"the clock of {clock}", "s", False, "")
    return seconds(str(path), told, t, np.arange(1, t.size + 1), place)


def require_room(path: Path, samples: float, width: float) -> None:
    """Refuse what is read whole where it is too large.

    Parameters
    ----------
    path : of the file.
    samples : of a channel.
    width : bytes that each of them takes.
    """
    require_few(RecordingError, str(path), samples, "samples", "samples of a channel")
    require_few(RecordingError, str(path), samples * width / 1e6, "block", "megabytes of a block")


def typical_rate(t: Array) -> float:
    """Return the samples per second [Hz] of times, NaN of fewer than two.

    Parameters
    ----------
    t : times [s], (n,).
    """
    steps = np.diff(t)
    step = float(np.median(steps)) if steps.size else 0.0
    return 1.0 / step if step > 0.0 else float("nan")


def chosen(path: Path, names: Sequence[str], known: Mapping[str, T], run: str | None) -> list[T]:
    """Return what is known by names, of a file that holds no runs apart.

    Parameters
    ----------
    path : of the file.
    names : asked for.
    known : by name as listed.
    run : asked for.

    Raises
    ------
    RecordingError
        Where a name is not listed, or a run is asked for.
    """
    if run is not None:
        raise RecordingError(f"{path}: holds one run without a name, so no run {shown(run)}")
    for name in names:
        if name not in known:
            similar = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
            raise RecordingError(
                f"{path}: there is no channel {shown(name)}"
                + (f"; did you mean {shown(similar[0])}?" if similar else "")
            )
    return [known[name] for name in names]


def unique(names: Iterable[tuple[str, str]]) -> list[str]:
    """Return names; what several share gets the name of its group before it, then a number behind.

    Parameters
    ----------
    names : group and name of each.
    """
    pairs = list(names)
    count: dict[str, int] = {}
    for _, name in pairs:
        count[name] = count.get(name, 0) + 1
    result: list[str] = []
    taken: set[str] = set()
    for group, name in pairs:
        full = name if count[name] == 1 else f"{group}/{name}"
        number = 1
        while (one := full if number == 1 else f"{full} ({number})") in taken:
            number += 1
        taken.add(one)
        result.append(one)
    return result


def noted(what: str, names: Sequence[str]) -> tuple[str, ...]:
    """Return a note of names, none where there are none.

    Parameters
    ----------
    what : they are, with the reason.
    names : all of them; the first few are listed.
    """
    if not names:
        return ()
    some = ", ".join(names[:MOST_NOTED])
    more = f", ... ({len(names)})" if len(names) > MOST_NOTED else ""
    return (f"{what}: {some}{more}",)
