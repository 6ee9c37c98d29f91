"""Where compiled code is kept between runs."""

import atexit
import logging
import os
import shutil
import tempfile
from functools import cache
from pathlib import Path

log = logging.getLogger("tireid.codegen")


def cache_folder() -> Path:
    """Return the folder of compiled libraries, which exists afterwards.

    `$TIREID_CACHE` if set, else `$XDG_CACHE_HOME/tireid`, else `~/.cache/tireid`. Its files are
    named by their content, so that it may be deleted at any time. Where it cannot be written, a
    temporary folder stands in until the process ends, and the log says so once.
    """
    try:
        folder = _chosen_folder()
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError) as error:  # RuntimeError: this user has no home
        return _temporary_folder(str(error))
    if not os.access(folder, os.W_OK | os.X_OK):
        return _temporary_folder(f"{folder} cannot be written")
    return folder


def _chosen_folder() -> Path:
    chosen = os.environ.get("TIREID_CACHE")
    if chosen:
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tireid"


@cache
def _temporary_folder(reason: str) -> Path:
    log.warning("no cache of compiled code (%s): compiling for this run only", reason)
    folder = tempfile.mkdtemp(prefix="tireid-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)
