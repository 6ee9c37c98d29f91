"""TOML in and out for the dataclasses of a vehicle: strict types in, exact numbers out."""

import json
import os
import tomllib
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from models.chassis import VehicleError


def read_table(path: Path) -> dict[str, Any]:
    """Read a TOML file as a dict.

    Parameters
    ----------
    path : the file.

    Raises
    ------
    VehicleError
        When the text is not UTF-8 or not TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise VehicleError(f"must be TOML: {error}") from None


def checked(
    table: dict[str, Any], cls: type, *, where: str, skip: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Return the keyword arguments of `cls` in `table`, with numbers as float.

    Parameters
    ----------
    table : keys and values as read.
    cls : a dataclass; its fields are the keys that may be there, text or number.
    where : put before a key in messages, for example "chassis.".
    skip : fields which do not come from this table.

    Raises
    ------
    VehicleError
        For a key that is unknown or missing, or a value of another type.
    """
    wanted = {field.name: field for field in fields(cls) if field.name not in skip}
    for key in table:
        if key not in wanted:
            raise VehicleError(f"{where}{key} is unknown, known are {', '.join(wanted)}")
    values: dict[str, Any] = {}
    for key, field in wanted.items():
        if key not in table:
            if field.default is MISSING:
                raise VehicleError(f"{where}{key} is missing")
            continue
        value, is_text = table[key], key in ("name", "tire")
        if is_text and not isinstance(value, str):
            raise VehicleError(f"{where}{key} must be a text, it is {value!r}")
        if not is_text and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise VehicleError(f"{where}{key} must be a number, it is {value!r}")
        values[key] = value if is_text else float(value)
    return values


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
