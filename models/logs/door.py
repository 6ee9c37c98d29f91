"""The door that every log comes in by: its first bytes tell the format, not its name.

A format is a line here: how its first bytes look, and the function that opens it, imported only
when such a file comes, so that the libraries it needs stay optional.
"""

import zlib
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from models.logs.log import LogFile, RecordingError

# Endings of names that logs have; "LOG:RUN" is split after one, and a recording's name lacks it.
ENDINGS = (
    ".csv", ".csv.gz", ".parquet", ".txt", ".txt.gz", ".dat", ".dat.gz", ".asc", ".tsv", ".vbo",
    ".mat", ".mf4", ".mdf", ".mcap", ".db3", ".bag", ".blf", ".trc",
)  # fmt: skip
HEAD = 1 << 12  # bytes that tell the format


class Format(NamedTuple):
    """A format that is no text.

    is_it: whether a file is of it, by path and first bytes, unpacked; opener: "module:function".
    """

    is_it: Callable[[Path, bytes], bool]
    opener: str


FORMATS: tuple[Format, ...] = (
    Format(
        lambda path, head: head[:4] == b"PAR1" or path.suffix.lower() == ".parquet",
        "models.logs.parquet:open_parquet",
    ),
)
TEXT = "models.logs.text:open_text"


def open_log(path: str | Path) -> LogFile:
    """Open a log of any format; nothing but its beginning is read.

    Parameters
    ----------
    path : of a file; of a folder, where a format keeps a log in one.

    Raises
    ------
    RecordingError
        One line: where there is no such file, no format fits, or a library is missing.
    """
    path = Path(path)
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file")
    try:
        head = _head(path)
        opener = next((one.opener for one in FORMATS if one.is_it(path, head)), TEXT)
        if path.is_dir() and opener == TEXT:
            raise RecordingError(f"{path}: there is no such file, it is a folder")
        module, _, function = opener.partition(":")
        opened: LogFile = getattr(import_module(module), function)(path)
        return opened
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror or error})") from None


def _head(path: Path) -> bytes:
    """Return the first bytes of a regular file, unpacked; of anything else nothing."""
    if not path.is_file():
        return b""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head[:2] == b"\x1f\x8b":
        try:
            return zlib.decompressobj(wbits=31).decompress(head, HEAD)
        except zlib.error:
            return b""  # damaged, which the reader of text says
    return head
