"""The folder that a command writes: complete or not there, and never over what is not ours.

It is written in a scratch folder beside it and takes its place in one step. A marker inside lists
every file with its size and hash: only a folder that holds these files, as they were written, and
nothing else, at any depth, is ever replaced. The scratch folder of a run that was killed stays, and
the next run says so.
"""

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, is_dataclass
from glob import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from codegen.writing import naming, write_file
from models.files import resolved
from models.schema import read_json
from tireid.exchange import ClaimedError, claim, exchange
from tireid.progress import say

MARKER = ".tireid"  # in every folder that we write: what we put there
Columns = dict[str, Array]  # by their name with its unit
_FORMAT = "tireid output 1"
_SPARE_NAMES = 1000  # results-2, results-3, ...


class OutputError(TireidError, ValueError):
    """The output folder cannot be used; the message says why and what to do."""


class NotEmptyError(OutputError, FileExistsError):
    """The output folder holds what an earlier run wrote, and is not to be replaced."""


class _Written(NamedTuple):
    """What a marker lists: size and SHA-256 of files, and folders, by path."""

    files: Mapping[str, tuple[int, str]]
    folders: frozenset[str]


def require_free(path: Path, *, force: bool) -> None:
    if path.exists() and not force:
        raise OutputError(f"{path} exists: choose another, or add --force to replace it")


@contextmanager
def output_folder(target: Path, *, force: bool) -> Iterator[Path]:
    """Yield an empty folder that becomes `target` when all went well; else `target` is as before.

    What may not be replaced is refused before anything is computed. Where `target` comes to hold
    something else meanwhile, it is left alone, and the message says where the results are.

    force : replace a folder that an earlier run wrote; never one that holds anything else.
    """
    final = resolved(target)
    _require_replaceable(target, final, force)
    final.parent.mkdir(parents=True, exist_ok=True)
    prefix = f".{final.name}-"
    with ExitStack() as stack:
        try:
            stack.enter_context(claim(final.parent / f"{prefix}claim"))
        except ClaimedError as error:
            raise OutputError(error.refusal(f"is writing {target}")) from None
        _require_replaceable(target, final, force)  # as the last one that held the claim left it
        for left in sorted(final.parent.glob(f"{escape(prefix)}*.part")):
            say(f"a run was stopped and left {left}: recover what you need, then delete it")
        scratch = Path(tempfile.mkdtemp(prefix=prefix, suffix=".part", dir=final.parent))
        new = scratch / "new"
        try:
            new.mkdir()
            with _named_as_final(new, target):
                yield new
                _write_marker(new)
            _put_in_place(new, target, final, force=force, aside=scratch / "old")
        finally:
            _discard(new)
            with suppress(OSError):  # it holds what could not be put back
                scratch.rmdir()


@contextmanager
def _named_as_final(new: Path, target: Path) -> Iterator[None]:
    """Say of a file that cannot be written where it was to be: nobody knows the scratch folder."""
    try:
        yield
    except OSError as error:
        path = Path(os.fsdecode(error.filename)) if isinstance(error.filename, str | bytes) else new
        if new not in path.parents:
            raise
        raise OSError(error.errno, error.strerror, str(target / path.relative_to(new))) from error


def _require_replaceable(target: Path, final: Path, force: bool) -> None:
    for place, name in ((Path.cwd(), "working folder"), (_home(), "home folder")):
        if place is not None and (final == place or final in place.parents):
            raise OutputError(f"{target} is or holds the {name}: choose a folder inside it")
    if not os.path.lexists(final):
        return
    if not final.is_dir():
        raise OutputError(f"{target} is a file, --out needs a folder")
    if final.is_mount():
        raise OutputError(f"{target} is a mount point: choose a folder inside it")
    strange = foreign(final)
    if strange is not None:
        raise OutputError(
            f"{target} is not empty and holds {strange}, which no run of tireid wrote there: "
            "choose another folder"
        )
    if any(final.iterdir()) and not force:
        raise NotEmptyError(
            f"{target} is not empty: choose another folder, or add --force to replace (in Python, "
            "overwrite=True replaces it)"
        )


def _home() -> Path | None:
    try:
        return Path.home().resolve()
    except RuntimeError:  # this user has none
        return None


def _write_marker(folder: Path) -> None:
    files, folders = {}, []
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_dir():
            folders.append(name)
        else:
            files[name] = [path.stat().st_size, _hash(path)]
    content = {"format": _FORMAT, "files": files, "folders": folders}
    write_file(folder / MARKER, json.dumps(content, indent=1) + "\n")


def _hash(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _read_marker(folder: Path) -> _Written | None:
    """Return what a folder is said to hold, None where it has no marker that can be read."""
    marker = folder / MARKER
    if marker.is_symlink() or not marker.is_file():
        return None
    try:
        content = read_json(marker, OutputError)
        if content["format"] != _FORMAT:
            return None
        files = {
            str(name): (int(size), str(hash)) for name, (size, hash) in content["files"].items()
        }
        return _Written(files, frozenset(map(str, content["folders"])))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, ArithmeticError):
        return None


def foreign(folder: Path) -> str | None:
    """Return a thing below a folder that is not as a run of tireid wrote it, or None."""
    marked = _read_marker(folder)
    written = marked or _Written({}, frozenset())
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        ours = _is_as_written(path, written.files.get(name))
        if path.is_dir():
            ours = name in written.folders
        elif name == MARKER:
            ours = marked is not None
        if path.is_symlink() or not ours:
            return name
    return None


def _is_as_written(path: Path, written: tuple[int, str] | None) -> bool:
    if written is None or not path.is_file() or path.stat().st_size != written[0]:
        return False
    return _hash(path) == written[1]


def _put_in_place(new: Path, target: Path, final: Path, *, force: bool, aside: Path) -> None:
    """Give the new folder its name; what has the name now is kept unless it may be replaced."""
    try:
        if _takes_name(new, final):
            return
        _require_replaceable(target, final, force)
        _swap(new, target, final, aside=aside)
    except OutputError as error:
        kept = _kept_elsewhere(new, final)
        raise OutputError(f"{error}; what this run computed is in {kept}") from None
    _discard(aside)


def _takes_name(new: Path, final: Path) -> bool:
    """Rename where nothing, or an empty folder, has the name; return whether it was so."""
    if os.name == "nt":  # where no folder is renamed over another
        with suppress(OSError):
            final.rmdir()
    try:
        new.rename(final)
    except OSError:
        if os.path.lexists(final):
            return False
        raise
    return True


def _swap(new: Path, target: Path, final: Path, *, aside: Path) -> None:
    """Change the places of the new and the old folder, and look again at what the old one held."""
    at_once = False
    try:
        at_once = exchange(new, final)
        (new if at_once else final).rename(aside)
        strange = foreign(aside)  # nobody finds it here, so that it stays as it is looked at
        if strange is not None:
            raise OutputError(f"{target} came to hold {strange} while this ran")
        if not at_once:
            new.rename(final)
    except BaseException:
        if at_once and aside.exists():
            exchange(aside, final)
            aside.rename(new)
        elif at_once:
            exchange(new, final)
        elif aside.exists():
            aside.rename(final)
        raise


def _kept_elsewhere(new: Path, final: Path) -> Path:
    """Give the new folder a name that is free, and return it."""
    for number in range(2, _SPARE_NAMES):
        other = final.with_name(f"{final.name}-{number}")
        if not os.path.lexists(other) and _takes_name(new, other):
            return other
    raise OutputError(f"{final.name}-2 to {final.name}-{_SPARE_NAMES} are all taken")


def _discard(folder: Path) -> None:
    """Delete what we wrote; whatever else came to be there in the meantime stays."""
    written = _read_marker(folder)
    if written is None:  # half-written, and nobody else's
        shutil.rmtree(folder, ignore_errors=True)
        return
    with suppress(OSError):
        for name, listed in written.files.items():
            if _is_as_written(folder / name, listed):
                (folder / name).unlink()
        for name in sorted(written.folders, reverse=True):
            (folder / name).rmdir()
        (folder / MARKER).unlink()
        folder.rmdir()


def write_json(path: Path, data: Any) -> None:
    """Write data as indented JSON; a number that is not finite becomes null.

    data : dictionaries, lists, arrays, records (dataclasses), numbers, strings and None.
    """
    write_file(path, json.dumps(finite(data), indent=2, allow_nan=False) + "\n")


def finite(data: Any) -> Any:
    """Return data as JSON has it: with null for numbers that are not finite."""
    if isinstance(data, np.ndarray):
        data = data.tolist()
    elif is_dataclass(data) and not isinstance(data, type):
        data = asdict(data)
    if isinstance(data, dict):
        return {key: finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [finite(value) for value in data]
    if isinstance(data, float | np.floating):
        return float(data) if np.isfinite(data) else None
    return data


def write_csv(path: Path, columns: Mapping[str, Array]) -> None:
    """Write columns of equal length as CSV with a header: time with 15 digits, others with nine.

    columns : name with unit, to values (n,).
    """
    write_long_csv(path, [columns])


def axle_columns(pattern: str, values: Array) -> Columns:
    """Return columns of both axles (n, 2) by a name in which {} is f in front and r at the rear."""
    return {pattern.format(axle): values[:, i] for i, axle in enumerate("fr")}


def force_columns(forces: Mapping[str, Array | None]) -> Columns:
    """Return the columns of axle forces (n, 2) [N], of those that there are of some."""
    columns: Columns = {}
    for name, force in forces.items():
        if force is not None:
            columns |= axle_columns(f"Fy{{}}_{name}_N", force)
    return columns


_ROWS = 4096  # that are put into words at once


def write_long_csv(path: Path, parts: Iterable[Mapping[str, Array]]) -> None:
    """Write columns that come part by part, as `write_csv` does."""
    with naming(path), path.open("w", encoding="utf-8", newline="\n") as file:
        for k, columns in enumerate(parts):
            if k == 0:
                file.write(",".join(columns) + "\n")
            row = ",".join("%.15g" if name == "t_s" else "%.9g" for name in columns) + "\n"
            for first in range(0, len(next(iter(columns.values()))), _ROWS):
                some = np.column_stack([one[first : first + _ROWS] for one in columns.values()])
                file.write((row * len(some)) % tuple(some.ravel().tolist()))


def text_table(rows: Sequence[Sequence[str]], align: str = "", *, indent: str = "") -> str:
    """Return rows of cells as lines of text, each column as wide as its widest cell."""
    count = max((len(row) for row in rows), default=0)
    sides = align.ljust(count, "<")
    widths = [max(len(row[i]) for row in rows if i < len(row)) for i in range(count)]
    lines = []
    for row in rows:
        cells = [f"{cell:{sides[i]}{widths[i]}}" if widths[i] else "" for i, cell in enumerate(row)]
        lines.append(f"{indent}{'  '.join(cells)}".rstrip())
    return "\n".join(lines)
