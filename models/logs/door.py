"""The door that every log comes in by: its first bytes tell the format, not its name.

A format is a line here, the function that opens it; it is imported only when such a file comes, so
that the libraries it needs stay optional. How its first bytes look is given in `magic`.
"""

import zlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from models.logs.log import LogFile, RecordingError
from models.logs.magic import GZIP, HEAD, format_of
from models.logs.table import TableLog

# Endings of names that logs have; "LOG:RUN" is split after one, and a recording's name lacks it.
_TEXTS = (".csv", ".txt", ".dat", ".asc", ".tsv", ".vbo", ".log")  # which gzip may pack
ENDINGS = (
    *_TEXTS, *(ending + ".gz" for ending in _TEXTS), ".parquet", ".mat", ".h5", ".hdf5", ".mf4",
    ".mdf", ".mcap", ".db3", ".bag", ".blf", ".trc", ".npz", ".npy",
)  # fmt: skip
_OPENERS = {
    "parquet": "models.logs.parquet:open_parquet", "mdf": "models.logs.mdf:open_",
    "matlab": "models.logs.matlab:open_", "bag": "models.logs.bag:open_",
    "can": "models.logs.can:open_", "text": "models.logs.text:open_text",
}  # fmt: skip
_JOINED, _LONG = "models.logs.joined:open_folder", "models.logs.joined:long_log"
_RATED = ("text", "parquet", "matlab")  # which may lack a time


def open_log(
    path: str | Path,
    dbc: str | Path | None = None,
    *,
    mend: bool = False,
    clock: str = "",
    clock_unit: str = "",
    rate: float = 0.0,
    unnamed: Mapping[int, tuple[str, ...]] | None = None,
) -> LogFile:
    """Open a log of any format; nothing but its beginning is read.
    path : of a file; of a folder, where a format keeps a log in one.
    mend : whether stamps that do not rise are mended, and not refused.
    clock, clock_unit : channel that is the time, where it is not what the format takes for it.
    rate : of the samples [Hz], where no channel is a time; 0 where none is given.
    unnamed : names of columns of a text without a header, by their number.
    """
    path = Path(path)
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file")
    try:
        head = b""
        if path.is_file():
            with path.open("rb") as file:
                head = file.read(HEAD)
        packed = head.startswith(GZIP)
        if packed:
            with suppress(zlib.error):  # of what is damaged it is said later
                head = zlib.decompressobj(wbits=31).decompress(head, HEAD)
        format = format_of(path, head)
        given: tuple[Any, ...] = () if dbc is None else (Path(dbc),)
        if packed and (given or format != "text"):
            raise RecordingError(
                f"{path}: is packed by gzip, which only tables in text may be; unpack it first"
            )
        if format == "folder":
            inside = {
                one: _of_folder(one, mend, clock, clock_unit, rate)
                for one in sorted(path.iterdir())
                if one.is_file() and one.name.lower().endswith(ENDINGS)
            }
            joined: LogFile = _function(_JOINED)(path, inside)
            return joined
        format = "can" if given else format
        if rate and format not in _RATED:
            raise RecordingError(f"{path}: its samples have times of their own, leave out the rate")
        given += (rate,) * (format == "matlab") + (unnamed,) * (format == "text")
        opened: Any = _function(_OPENERS[format])(path, *given)
        if isinstance(opened, TableLog) and opened.may_be_long:
            opened = _function(_LONG)(opened.table) or opened
        more = {"rate": rate} if isinstance(opened, TableLog) else {}
        log: LogFile = replace(opened, mend=mend, clock_name=clock, clock_unit=clock_unit, **more)
        return log
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror or error})") from None


def _function(place: str) -> Any:
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


def _of_folder(
    path: Path, mend: bool, clock: str, clock_unit: str, rate: float
) -> LogFile | RecordingError:
    """Return a log of a folder, of which the clock may be that of another, or why it is none."""
    try:
        log = open_log(path, mend=mend)
        if isinstance(log, TableLog) and (clock in log.names or rate):
            log = replace(log, clock_name=clock, clock_unit=clock_unit, rate=rate)
        log.listed()
        return log
    except RecordingError as error:
        return error
