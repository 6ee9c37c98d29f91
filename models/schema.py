"""The doors that every file comes in by: what it may hold, which types, and one line where it errs.

A file is a regular file of limited size, also when unpacked; JSON and TOML are limited in depth and
number of values; a table gives its values by name and type. Which numbers are possible is for the
records that are made of them. A refusal is one line: file, place, rule, and the value, shortened.

In functions:
limit : field of `InputLimits` that says how many megabytes it may hold.
"""

import gzip
import json
import math
import re
import stat
import tomllib
import types
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, fields
from pathlib import Path
from typing import Any, NoReturn, Union, get_args, get_origin, get_type_hints

import numpy as np

from codegen.arrays import Array
from codegen.escape import LONGEST_DISPLAYED, displayed, visible
from models.limits import VARIABLE
from models.limits import InputLimits as InputLimits
from models.limits import LimitError as LimitError
from models.limits import limits as limits

CHUNK = 1 << 20  # bytes that are unpacked at a time
_SWELLS, _SWOLLEN_FROM = 200, 1 << 28  # times that a log packs, judged beyond so many bytes
LONGEST_NAME = 200  # characters
_DECIMAL_COMMA = re.compile(r"^\s*\w+\s*=\s*[+-]?\d+,\d", re.MULTILINE)


def require_few(refusal: type[ValueError], where: str, count: float, limit: str, what: str) -> None:
    """Refuse more than a limit allows, and tell how to raise it.
    limit : field of `InputLimits`.
    """
    most = getattr(limits(), limit)
    if not count <= most:
        raise refusal(
            f"{where}: {what} must be at most {most:g}, here are {count:.10g}; "
            f"{VARIABLE}={limit}=NUMBER in the environment raises the limit"
        )


def swells(size: float, packed: float) -> bool:
    """Return whether data unpack to what no log packs to.
    size : unpacked, as memory holds it [bytes].   packed : as the file holds them [bytes].
    """
    return size > _SWOLLEN_FROM and size > _SWELLS * packed


def most_unpacked(packed: float) -> int:
    """Return how many bytes a part of a log that is unpacked whole may have at most."""
    return int(min(1e6 * limits().block, max(_SWOLLEN_FROM, _SWELLS * packed)))


def require_dense(
    refusal: type[ValueError], where: str, size: float, packed: float, what: str
) -> None:
    """Refuse data that swell as no log does."""
    if swells(size, packed):
        raise refusal(
            f"{where}: {what} must be a log, they swell to {size / max(packed, 1):.0f} times their "
            f"size, above {_SWELLS}; unpack the file first if it is one"
        )


def require_file(path: Path, refusal: type[ValueError], *, limit: str) -> None:
    """Refuse what is no regular file, and files that are too large."""
    about = path.stat()
    if not stat.S_ISREG(about.st_mode):
        kind = "a folder" if stat.S_ISDIR(about.st_mode) else "a device, pipe or socket"
        raise refusal(f"{path}: must be a file, it is {kind}")
    _require_size(path, refusal, about.st_size, limit)


def read_bytes(path: Path, refusal: type[ValueError], *, limit: str = "document") -> bytes:
    """Read a file.   path : a regular file: no device, pipe or folder, which may have no end."""
    most = int(min(1e6 * getattr(limits(), limit), 2.0**62))
    try:
        require_file(path, refusal, limit=limit)
        with path.open("rb") as file:
            data = file.read(most + 1)
    except FileNotFoundError:
        raise refusal(f"{path}: there is no such file") from None
    except OSError as error:
        raise refusal(f"{path}: cannot be read: {(error.strerror or '').lower()}") from None
    _require_size(path, refusal, len(data), limit)  # which grew, or has no size as in /proc
    return data


def pieces(path: Path, refusal: type[ValueError], *, limit: str) -> Iterator[bytes]:
    """Yield what a file holds piece by piece, unpacked where it is gzip by its first bytes.
    limit : field of `InputLimits` that says how many megabytes there may be, unpacked.
    """
    require_file(path, refusal, limit=limit)
    with path.open("rb") as raw:
        zipped = raw.read(2) == b"\x1f\x8b"
        raw.seek(0)
        file = gzip.GzipFile(fileobj=raw) if zipped else raw
        size = 0
        while True:
            try:
                part = file.read(CHUNK)
            except (OSError, EOFError, zlib.error) as error:
                if not zipped:
                    raise
                raise refusal(f"{path}: gzip data are damaged or cut off ({error})") from None
            if not part:
                return
            size += len(part)
            _require_size(path, refusal, size, limit)
            if zipped:
                require_dense(refusal, str(path), size, raw.tell(), "gzip data")
            yield part


def _require_size(path: Path, refusal: type[ValueError], size: int, limit: str) -> None:
    require_few(refusal, str(path), size / 1e6, limit, "megabytes")


def read_text(
    path: Path, refusal: type[ValueError], *, limit: str = "document", encoding: str = "utf-8"
) -> str:
    """Read a text file.   encoding : utf-8, or utf-8-sig where a byte order mark may begin it."""
    try:
        return read_bytes(path, refusal, limit=limit).decode(encoding)
    except UnicodeDecodeError as error:
        raise refusal(f"{path}: is not a text file in UTF-8 (byte {error.start})") from None


def read_json(path: Path, refusal: type[ValueError]) -> Any:
    text = read_text(path, refusal)

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            keys = [key for key, _ in pairs]
            twice = next(key for key in found if keys.count(key) > 1)
            raise json.JSONDecodeError(f"{displayed(twice)} is given twice in one table", "", 0)
        return found

    try:
        data = json.loads(text, object_pairs_hook=once)
    except RecursionError:
        raise refusal(f"{path}: cannot be read as JSON: tables or lists too deep") from None
    except ValueError as error:
        raise refusal(f"{path}: cannot be read as JSON: {_said(error)}") from None
    _require_small(path, data, refusal)
    return data


def read_toml(path: Path, refusal: type[ValueError]) -> dict[str, Any]:
    """Read a TOML file, as `read_json` a JSON file; a byte order mark may begin it."""
    text = read_text(path, refusal, limit="toml", encoding="utf-8-sig")
    longest = max(map(len, text.splitlines()), default=0)  # its parser takes the square of it
    require_few(refusal, str(path), longest, "line", "characters of a line")
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise refusal(f"{path}: cannot be read as TOML: tables or lists too deep") from None
    except ValueError as error:
        comma = "; a decimal point, not a comma?" * bool(_DECIMAL_COMMA.search(text))
        raise refusal(f"{path}: cannot be read as TOML: {_said(error)}{comma}") from None
    _require_small(path, data, refusal)
    return data


def _said(error: ValueError) -> str:
    """Return what a parser says; of a long number it is Python that speaks, to programmers."""
    known = isinstance(error, json.JSONDecodeError | tomllib.TOMLDecodeError)
    return str(error) if known else "a number or date that cannot be"


def _require_small(path: Path, data: Any, refusal: type[ValueError]) -> None:
    """Refuse a document that is deep or has many values, level by level."""
    level, depth, count = [data], 0, 0
    while level:
        require_few(refusal, str(path), depth, "depth", "levels of tables and lists")
        count += len(level)
        require_few(refusal, str(path), count, "values", "values")
        inner: list[Any] = []
        for one in level:
            if isinstance(one, dict):
                inner += one.values()
            elif isinstance(one, list):
                inner += one
        level, depth = inner, depth + 1


class Table:
    """A table of a document; its values are asked for by name and type.
    where : begins every message, as "car.toml: "; may be empty.
    prefix : of the names of values in messages, as in "chassis.".
    """

    def __init__(self, data: Any, where: str, refusal: type[ValueError], prefix: str = "") -> None:
        if not isinstance(data, Mapping):
            name = prefix.rstrip(".") or "the document"
            raise refusal(f"{where}{name} must be a table, it is {displayed(data)}")
        self.data, self._where, self._refusal, self._prefix = data, where, refusal, prefix

    def __contains__(self, key: str) -> bool:
        return key in self.data

    def refuse(self, key: str, rule: str) -> NoReturn:
        """Raise the error of a value.   rule : that it breaks, as in "must be a number"."""
        raise self._refusal(f"{self._where}{self._prefix}{key} {rule}")

    def value(self, key: str) -> Any:
        if key not in self.data:
            self.refuse(key, "is missing")
        return self.data[key]

    def only(self, *known: str) -> None:
        """Refuse every other key."""
        for key in self.data:
            if key not in known:
                self.refuse(
                    visible(key[:LONGEST_DISPLAYED]), f"is unknown, known are {', '.join(known)}"
                )

    def number(self, key: str) -> float:
        """Return a number as float; it may be infinite, which the record that it is for refuses."""
        return float(self._as(float, key, self.value(key)))

    def whole(self, key: str) -> int:
        return int(self._as(int, key, self.value(key)))

    def text(self, key: str) -> str:
        return str(self._as(str, key, self.value(key)))

    def table(self, key: str) -> "Table":
        prefix = f"{self._prefix}{key}."
        return Table(self.value(key), self._where, self._refusal, prefix)

    def tables(self, key: str) -> list["Table"]:
        found = self.value(key)
        if not isinstance(found, list):
            self.refuse(key, f"must be a list, it is {displayed(found)}")
        prefix = f"{self._prefix}{key}."
        return [Table(one, self._where, self._refusal, prefix) for one in found]

    def array(self, key: str) -> Array:
        """Return nested lists of finite numbers, all rows alike, as an array of any shape."""
        value = self.value(key)
        shape, level = [], [value]
        while level and isinstance(level[0], list):
            if any(not isinstance(row, list) or len(row) != len(level[0]) for row in level):
                self.refuse(key, "must be lists of equal length")
            shape.append(len(level[0]))
            level = [one for row in level for one in row]
        for one in level:
            if not math.isfinite(self._as(float, key, one)):
                self.refuse(key, f"holds a number that is not finite: {displayed(one)}")
        return np.array(level, dtype=np.float64).reshape(shape)

    def only_fields(self, cls: type, *, skip: tuple[str, ...] = ()) -> dict[str, Any]:
        """Refuse every key that is no field of a dataclass; return the fields by name."""
        known = {field.name: field for field in fields(cls) if field.name not in skip}
        self.only(*known)
        return known

    def record(
        self,
        cls: type,
        *,
        skip: tuple[str, ...] = (),
        alone: tuple[str, ...] = (),
        rules: Mapping[str, str] = types.MappingProxyType({}),
    ) -> dict[str, Any]:
        """Return the arguments of a dataclass, each of the type that its field declares.
        cls : the dataclass; its fields are the keys that may be there.
        alone : tuples of which a single value may stand without a list.
        rules : by key what a value of a wrong type breaks, where its types alone do not say it.
        """
        known = self.only_fields(cls, skip=skip)
        for key, field in known.items():
            if _default(field) is MISSING:
                self.value(key)
        given = {key: self.data[key] for key in known if key in self.data}
        given |= {key: [given[key]] for key in alone if not isinstance(given.get(key, []), list)}
        values = {}
        for key, value in given.items():
            try:
                values[key] = self.typed(cls, key, value)
            except self._refusal:
                if key in rules:
                    self.refuse(key, f"{rules[key]}, it is {displayed(self.data[key])}")
                raise
        return values

    def typed(self, cls: type, name: str, value: Any, key: str = "") -> Any:
        """Return a value as the type that a field of a dataclass declares.
        name : of the field.   key : of the value in the table, where it is called otherwise.
        """
        return self._as(get_type_hints(cls)[name], key or name, value)

    def _as(self, kind: Any, key: str, value: Any) -> Any:
        """Return a value as the type that an annotation names: number, text, or a tuple of such."""
        if get_origin(kind) in (Union, types.UnionType):  # X | None: a document has no None
            kind = next(one for one in get_args(kind) if one is not types.NoneType)
        if get_origin(kind) is tuple:
            return self._tuple(get_args(kind), key, value)
        if get_origin(kind) is Mapping:
            inner = self.table(key)
            return {one: inner._as(get_args(kind)[1], one, inner.data[one]) for one in inner.data}
        if kind is bool:
            if not isinstance(value, bool):
                self.refuse(key, "must be true or false")
            return value
        if kind in (str, Path):
            if not isinstance(value, str):
                self.refuse(key, f"must be a text, it is {displayed(value)}")
            return value
        if isinstance(value, bool) or not isinstance(value, int | float):
            expected = "a whole number" if kind is int else "a number"
            self.refuse(key, f"must be {expected}, it is {displayed(value)}")
        if kind is int and not (isinstance(value, int) and abs(value) < 2**63):
            self.refuse(key, f"must be a whole number of 64 bits, it is {displayed(value)}")
        try:
            return value if kind is int else float(value)
        except OverflowError:
            self.refuse(key, f"must be a number, it is {displayed(value)}")

    def _tuple(self, kinds: tuple[Any, ...], key: str, value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list):
            self.refuse(key, f"must be a list, it is {displayed(value)}")
        if kinds[-1] is not Ellipsis and len(value) != len(kinds):
            self.refuse(key, f"must be a list of {len(kinds)}, it is {displayed(value)}")
        return tuple(self._as(kinds[0], key, one) for one in value)


def _default(field: "Field[Any]") -> Any:
    """Return what a field of a dataclass is where nothing is given; MISSING where it is needed."""
    return field.default if field.default_factory is MISSING else field.default_factory()


def changed(record: Any) -> dict[str, Any]:
    """Return what a dataclass holds beyond what it is where nothing is given, by field."""
    values = {one.name: (getattr(record, one.name), _default(one)) for one in fields(record)}
    return {name: value for name, (value, plain) in values.items() if value != plain}


def toml_value(value: Any) -> str:
    """Return a text, number, truth or tuple of such as TOML has it, which reads back the same."""
    if isinstance(value, int):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    return repr(float(value))  # the shortest text of the same bits


def toml_table(name: str, values: Mapping[str, Any]) -> str:
    """Return a table of a TOML document, empty where it holds nothing; "" is its top."""
    lines = [f"[{name}]"] * bool(name) + [f"{k} = {toml_value(v)}" for k, v in values.items()]
    return "".join(f"{line}\n" for line in lines) if values else ""


def require_name(refusal: type[ValueError], key: str, name: Any) -> None:
    """Refuse what cannot be the name of a car in files, figures and reports."""
    if not isinstance(name, str) or len(name) > LONGEST_NAME:
        raise refusal(
            f"{key} must be a text of at most {LONGEST_NAME} characters, not {displayed(name)}"
        )
    if any("\ud800" <= one <= "\udfff" for one in name):
        raise refusal(f"{key} must be Unicode, it has half a surrogate pair: {displayed(name)}")
