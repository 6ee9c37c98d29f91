"""The folder that a command writes: complete or not there, and never over other files unasked."""

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


class OutputError(ValueError):
    """The output folder cannot be used; the message says why and what to do."""


@contextmanager
def output_folder(target: Path, *, force: bool) -> Iterator[Path]:
    """Yield an empty scratch folder that becomes `target` when all went well.

    Parameters
    ----------
    target : the folder that the user asked for.
    force : replace what is there.

    Raises
    ------
    OutputError
        Where `target` is a file, or holds files and `force` is not given.
    """
    if target.is_file():
        raise OutputError(f"{target} is a file, --out needs a folder")
    if not force and target.is_dir() and any(target.iterdir()):
        raise OutputError(
            f"{target} is not empty: choose another folder, or add --force to replace"
        )
    target.parent.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    try:
        yield scratch
        if target.exists():
            shutil.rmtree(target)
        scratch.chmod(0o755)
        scratch.rename(target)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


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
    """Write columns of equal length as CSV with a header, nine significant digits.

    Parameters
    ----------
    path : the file.
    columns : name with unit, to values (n,).
    """
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, fmt="%.9g", delimiter=",", header=",".join(columns), comments="")
