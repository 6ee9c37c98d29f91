"""A dataclass of a vehicle as the text of a TOML file, with exact numbers."""

import json
import os
from dataclasses import fields
from pathlib import Path
from typing import Any


def text(record: Any, *, folder: Path, table: str) -> str:
    """Return the TOML text of a dataclass and of the one dataclass inside it.

    Parameters
    ----------
    record : the dataclass to write; fields that are None are left out.
    folder : paths are written relative to it.
    table : name of the field that becomes a table of its own, last in the file.
    """
    lines = [
        f"{field.name} = {_value(getattr(record, field.name), folder)}"
        for field in fields(record)
        if field.name != table and getattr(record, field.name) is not None
    ]
    inner = getattr(record, table, None)
    if inner is not None:
        lines += ["", f"[{table}]", text(inner, folder=folder, table="")]
    return "\n".join(lines).rstrip("\n") + "\n"


def _value(value: Any, folder: Path) -> str:
    if isinstance(value, Path):
        try:
            value = Path(os.path.relpath(value, folder)).as_posix()
        except ValueError:  # another drive
            value = value.as_posix()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(float(value))  # the shortest text that reads back to the same bits
