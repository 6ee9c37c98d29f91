"""Files that appear whole or not at all."""

import hashlib
import json
import tempfile
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any


def write_atomically(path: str | PathLike[str], content: str | bytes | Iterable[bytes]) -> None:
    """Write a file; whoever reads it meanwhile, or after a failure, sees the old one whole.

    Parameters
    ----------
    path : the file; where it is a link, what it points to.
    content : text, written in UTF-8 with line ends as they are, or bytes, also one part
        after the other.

    Raises
    ------
    OSError
        Where the file cannot be written; nothing is left behind.
    """
    target = Path(path).resolve()
    whole = content.encode("utf-8") if isinstance(content, str) else content
    with tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.parent) as scratch:
        part = Path(scratch) / target.name  # in the same folder, thus on the same disk
        with part.open("wb") as file:
            file.writelines([whole] if isinstance(whole, bytes) else whole)
        part.replace(target)


def digest(content: Any) -> str:
    """Return twelve characters that stand for a content.

    Parameters
    ----------
    content : ready for JSON.
    """
    return digest_of_bytes([json.dumps(content, sort_keys=True).encode()])


def digest_of_bytes(parts: Iterable[bytes]) -> str:
    """Return twelve characters that stand for bytes.

    Parameters
    ----------
    parts : of them, one after the other.
    """
    found = hashlib.sha256()
    for part in parts:
        found.update(part)
    return found.hexdigest()[:12]
