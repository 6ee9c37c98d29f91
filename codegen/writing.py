"""Files that are written: an error says which; that of a full disk names none by itself."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path


@contextmanager
def naming(path: str | PathLike[str]) -> Iterator[None]:
    """Name a file in the error of what writes it, where that names none."""
    try:
        yield
    except OSError as error:
        if error.filename is not None or error.errno is None:
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from error


def write_file(path: Path, content: str | bytes) -> None:
    """Write a file.
    content : all of it, text in UTF-8 with line ends as they are.
    """
    with naming(path):
        path.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
