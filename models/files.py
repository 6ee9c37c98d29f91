"""Files that appear whole or not at all."""

import errno
import hashlib
import json
import os
import stat
import tempfile
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

from codegen.writing import naming


def write_atomically(path: str | PathLike[str], content: str | bytes | Iterable[bytes]) -> None:
    """Write a file; whoever reads it meanwhile, or after a failure, sees the old one whole.
    path : the file; where it is a link, what it points to.
    content : text, written in UTF-8 with line ends as they are, or bytes, also one part
        after the other.
    """
    target = resolved(path)
    if not target.parent.exists():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(target.parent))
    _require_file_or_nothing(target)
    whole = content.encode("utf-8") if isinstance(content, str) else content
    with tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.parent) as scratch:
        part = Path(scratch) / target.name  # in the same folder, thus on the same disk
        with naming(target), part.open("wb") as file:
            file.writelines([whole] if isinstance(whole, bytes) else whole)
            file.flush()
            os.fsync(file.fileno())  # else a new name for an empty file where the power fails
        part.replace(target)


def _require_file_or_nothing(target: Path) -> None:
    try:
        kind = target.stat().st_mode
    except FileNotFoundError:
        return
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
    if not stat.S_ISREG(kind):
        raise OSError(errno.EINVAL, "Is a device, pipe or socket, no file", str(target))


def resolved(path: str | PathLike[str]) -> Path:
    """Return where a path leads, by all its links."""
    try:
        return Path(path).resolve()
    except RuntimeError:
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), os.fspath(path)) from None


def digest(content: Any) -> str:
    """Return twelve characters that stand for a content."""
    return digest_of_bytes([json.dumps(content, sort_keys=True).encode()])


def digest_of_bytes(parts: Iterable[bytes]) -> str:
    """Return twelve characters that stand for bytes."""
    found = hashlib.sha256()
    for part in parts:
        found.update(part)
    return found.hexdigest()[:12]
