"""Files that libraries of others read: each is an extra, and whatever it raises becomes one line.

Such a library is imported when a file of its format is opened. It is given bytes that anybody may
have written, raises what it likes, warns and logs; a user sees the file and the rule.
"""

import errno
import gc
import importlib
import io
import logging
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from codegen.escape import displayed
from models.extras import needs
from models.logs.log import RecordingError

_LONGEST_REASON = 160  # characters
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
            said = f"is not {format}, or is damaged or cut off ({reason_of(error)})"
            _forget(error)
            if isinstance(error, FileNotFoundError) and not path.exists():
                said = "there is no such file"
            elif isinstance(error, PermissionError):
                said = "may not be read"
            elif isinstance(error, OSError) and error.errno in _FULL:
                said = f"cannot be unpacked, there is no room in {tempfile.gettempdir()}; "
                said += "name a folder with room by TMPDIR"
            raise RecordingError(f"{path}: {said}") from None


def _forget(error: BaseException | None) -> None:
    """Let go of what a library was building: some complain aloud when they are taken away."""
    while error is not None:
        traceback.clear_frames(error.__traceback__)
        error = error.__context__
    gc.collect()


def reason_of(error: Exception) -> str:
    """Return what a library says is wrong, short and on one line."""
    text = " ".join(str(error).split()) or type(error).__name__
    if not text.isprintable():
        return displayed(text[:_LONGEST_REASON]).strip("'\"")
    return text if len(text) <= _LONGEST_REASON else f"{text[:_LONGEST_REASON]}..."


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
