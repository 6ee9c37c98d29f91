"""The folder that a command writes: complete or not there, and never over what is not ours."""

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

MARKER = ".tireid"  # in every folder that we write: the names that we put there, one a line


class OutputError(ValueError):
    """The output folder cannot be used; the message says why and what to do."""


@contextmanager
def output_folder(target: Path, *, force: bool) -> Iterator[Path]:
    """Yield an empty folder that becomes `target` when all went well; else `target` is as before.

    Parameters
    ----------
    target : the folder that the user asked for; a link is followed.
    force : replace a folder that an earlier run wrote; never one that holds anything else.

    Raises
    ------
    OutputError
        Before anything is computed, where `target` is not a folder that may be replaced.
    """
    final = target.resolve()
    _require_replaceable(target, final, force)
    final.parent.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=f".{final.name}-", dir=final.parent))
    new = scratch / "new"
    new.mkdir()
    try:
        yield new
        (new / MARKER).write_text("".join(f"{entry.name}\n" for entry in sorted(new.iterdir())))
        _put_in_place(new, final, aside=scratch / "old")
    finally:
        shutil.rmtree(new, ignore_errors=True)
        with suppress(OSError):  # it holds the old folder where that could not be put back
            scratch.rmdir()


def _require_replaceable(target: Path, final: Path, force: bool) -> None:
    for place, name in ((Path.cwd(), "working folder"), (_home(), "home folder")):
        if place is not None and (final == place or final in place.parents):
            raise OutputError(f"{target} is or holds the {name}: choose a folder inside it")
    if not final.exists():
        return
    if not final.is_dir():
        raise OutputError(f"{target} is a file, --out needs a folder")
    if final.is_mount():
        raise OutputError(f"{target} is a mount point: choose a folder inside it")
    held = sorted(entry.name for entry in final.iterdir())
    marker = final / MARKER
    ours = {MARKER, *marker.read_text().splitlines()} if marker.is_file() else set()
    foreign = [name for name in held if name not in ours]
    if foreign:
        raise OutputError(
            f"{target} is not empty and holds {foreign[0]}, which no run of tireid wrote there: "
            "choose another folder"
        )
    if held and not force:
        raise OutputError(
            f"{target} is not empty: choose another folder, or add --force to replace"
        )


def _home() -> Path | None:
    try:
        return Path.home().resolve()
    except RuntimeError:  # this user has none
        return None


def _put_in_place(new: Path, final: Path, *, aside: Path) -> None:
    """Move the old folder aside, the new one in its place, and only then delete the old one."""
    replaces = final.exists()
    if replaces:
        final.rename(aside)
    try:
        new.rename(final)
    except BaseException:
        if replaces:
            aside.rename(final)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def write_json(path: Path, data: Any) -> None:
    """Write data as indented JSON; a number that is not finite becomes null.

    Parameters
    ----------
    path : the file.
    data : dictionaries, lists, numbers, strings and None.
    """
    path.write_text(json.dumps(_finite(data), indent=2, allow_nan=False) + "\n")


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    if isinstance(data, float | np.floating):
        return float(data) if np.isfinite(data) else None
    return data


def write_csv(path: Path, columns: dict[str, NDArray[np.float64]]) -> None:
    """Write columns of equal length as CSV with a header: time with 15 digits, others with nine.

    Parameters
    ----------
    path : the file.
    columns : name with unit, to values (n,).
    """
    table = np.column_stack(list(columns.values()))
    digits = ["%.15g" if name == "t_s" else "%.9g" for name in columns]  # t_s may be a Unix time
    np.savetxt(path, table, fmt=digits, delimiter=",", header=",".join(columns), comments="")
