"""Where compiled code is kept between runs: what is found there, this user put there.

What is loaded runs with all rights of who loads it. So the folder and the file must belong to this
user and be writable by nobody else, and the file must have the hash that its name ends with.
"""

import atexit
import hashlib
import logging
import os
import shutil
import stat
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

log = logging.getLogger("tireid.codegen")


def cache_folder() -> Path:
    """Return the folder of compiled libraries, which exists afterwards.

    `$TIREID_CACHE` if set, else `$XDG_CACHE_HOME/tireid`, else `~/.cache/tireid`. Its files are
    named by their content, so that it may be deleted at any time. Where it cannot be written, or
    another user could write it, a temporary folder stands in until the process ends, and the log
    says so once.
    """
    try:
        folder = _chosen_folder()
        if not folder.is_dir():
            folder.parent.mkdir(parents=True, exist_ok=True)
            folder.mkdir(mode=0o700, exist_ok=True)
        doubt = distrust(folder.resolve())
    except (OSError, RuntimeError) as error:  # RuntimeError: this user has no home
        return _temporary_folder(str(error))
    if not os.access(folder, os.W_OK | os.X_OK):
        return _temporary_folder(f"{folder} cannot be written")
    return folder if doubt is None else _temporary_folder(doubt)


def distrust(path: Path) -> str | None:
    """Return why another user could have written a file or what is in a folder; None if none could.

    Parameters
    ----------
    path : of the file or folder itself, not of a link.

    Raises
    ------
    OSError
        Where it cannot be looked at.
    """
    if not hasattr(os, "getuid"):  # Windows keeps a user's folders to the user
        return None
    found = path.lstat()
    if stat.S_ISLNK(found.st_mode):
        return f"{path} is a link"
    if found.st_uid != os.getuid():
        return f"{path} belongs to another user"
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"{path} can be written by other users: chmod go-w it, or delete it"
    return None


def keep(stem: str, ending: str, content: bytes) -> Path:
    """Keep a file for `kept`; return its path, which ends with the hash of its content.

    Parameters
    ----------
    stem : what it is found by: a name and a hash of all that it was made of.
    ending : of its name, with the dot.
    content : the whole of it.

    Raises
    ------
    OSError
        Where it cannot be written.
    """
    folder = cache_folder()
    file = folder / f"{stem}.{_digest(content)}{ending}"
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        part = Path(scratch) / file.name
        part.write_bytes(content)
        part.chmod(0o600)
        part.replace(file)  # atomic: two processes may keep the same file at once
    return file


def kept(stem: str, ending: str) -> Path | None:
    """Return a file that was kept, whole and by this user; None where there is none.

    What is damaged, or not to be trusted, is said and removed.

    Parameters
    ----------
    stem : as `keep` was told.
    ending : as `keep` was told.
    """
    for file in sorted(cache_folder().glob(f"{stem}.*{ending}")):
        try:
            doubt = distrust(file)
            if doubt is None and file.name == f"{stem}.{_digest(file.read_bytes())}{ending}":
                return file
        except OSError as error:
            doubt = str(error)
        if doubt is None:
            log.info("%s is damaged: building it anew", file)
        else:
            log.warning("%s: it is not loaded, but built anew", doubt)
        with suppress(OSError):
            file.unlink()
    return None


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]


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
