"""Reader of tire property files (`.tir`): sections of `KEY = value` lines, by any program.

Both comment signs ($ and !), quoted strings, tables after a {header}, CRLF, tabs, any case of the
keys, Fortran exponents (1.5D-3), UTF-8 or Latin-1, a byte order mark. A key means the same in every
section, but units count in [UNITS] only. Unknown keys are kept and do nothing.
"""

import codecs
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from models.doors import read_bytes, shown
from models.tires.tir_units import DIMENSIONS, unit_in_si

LARGEST = 1e12  # of a number, in the unit of the file: a stiffness in N/km fits
SOME = 10  # lines in a message
_KEY = re.compile(r"[A-Za-z_]\w*")
_SECTION = re.compile(r"\[(.*?)\]")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([EeDd][+-]?\d+)?")


class TirError(ValueError):
    """A tire property file cannot be used; one line naming the file and the reason."""


class Entry(NamedTuple):
    """One `KEY = value` line.

    Attributes
    ----------
    value : text without quotes and comment.
    line : its number, from 1.
    section : the section it stands in, in capitals; empty before the first.
    """

    value: str
    line: int
    section: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TirFile:
    """The entries of one file.

    Parameters
    ----------
    path : the file, for messages.
    entries : all lines of each key, the key in capitals.
    without_sign : lines that begin with a word but have no "=", by that word in capitals.
    """

    path: Path
    entries: Mapping[str, tuple[Entry, ...]]
    without_sign: Mapping[str, int]

    def __contains__(self, key: str) -> bool:
        return key in self.entries

    def text(self, key: str, default: str) -> str:
        """The value as text; the last line counts where a key comes twice.

        Parameters
        ----------
        key : in capitals.
        default : the answer where the file has no such key, or an empty value.
        """
        return (self.entries[key][-1].value or default) if key in self.entries else default

    def number(self, key: str) -> float | None:
        """The value in SI; None where the file has no such key.

        Parameters
        ----------
        key : in capitals; those of `DIMENSIONS` are converted from the units of the file.

        Raises
        ------
        TirError
            The value is no finite number, two lines disagree, the "=" is missing, or the unit is
            unknown.
        """
        if key not in self.entries:
            if key in self.without_sign:
                raise self.error(f'line {self.without_sign[key]}: {key} has no "="')
            return None
        values = {self._parsed(key, entry): entry.line for entry in self.entries[key]}
        if len(values) > 1:
            lines = ", ".join(str(line) for line in list(values.values())[:SOME])
            raise self.error(f"{key} has different values in lines {lines}")
        return next(iter(values)) * self._unit(key)

    def error(self, reason: str) -> TirError:
        """A TirError that names this file.

        Parameters
        ----------
        reason : the rule and the value, in one line.
        """
        return TirError(f"{self.path}: {reason}")

    def _parsed(self, key: str, entry: Entry) -> float:
        if _NUMBER.fullmatch(entry.value):
            value = float(entry.value.upper().replace("D", "E"))
            if LARGEST < abs(value) < math.inf:
                raise self.error(f"line {entry.line}: {key} must be below {LARGEST:g}, is {value}")
            if math.isfinite(value):
                return value
        raise self.error(
            f"line {entry.line}: {key} must be a finite number, it is {shown(entry.value)}"
        )

    def _unit(self, key: str) -> float:
        factor = 1.0
        for dimension, exponent in DIMENSIONS.get(key, {}).items():
            units = [e for e in self.entries.get(dimension, ()) if e.section == "UNITS"]
            if units:
                try:
                    factor *= unit_in_si(dimension, units[-1].value) ** exponent
                except ValueError as error:
                    raise self.error(str(error)) from None
        return factor


def read_tir(path: str | PathLike[str]) -> TirFile:
    """Read a tire property file without judging what it describes.

    Parameters
    ----------
    path : the `.tir` file.

    Raises
    ------
    TirError
        It is no file, or too large.
    OSError
        The file cannot be read.
    """
    path = Path(path)
    entries: dict[str, list[Entry]] = {}
    without_sign: dict[str, int] = {}
    section = ""
    for number, raw in enumerate(_decoded(read_bytes(path, TirError)).splitlines(), start=1):
        line = _without_comment(raw).strip()
        key, sign, value = (part.strip() for part in line.partition("="))
        if header := _SECTION.match(line):
            section = header.group(1).strip().upper()
        elif sign and _KEY.fullmatch(key):
            entry = Entry(_unquoted(value), number, section)
            entries.setdefault(key.upper(), []).append(entry)
        elif word := _KEY.match(line):
            without_sign[word.group().upper()] = number
    together = {key: tuple(lines) for key, lines in entries.items()}
    return TirFile(path=path, entries=together, without_sign=without_sign)


def _decoded(raw: bytes) -> str:
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16", errors="replace")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.removeprefix(codecs.BOM_UTF8).decode("latin-1")


def _without_comment(line: str) -> str:
    """The line up to the first $ or ! that is not inside a closed pair of quotes."""
    position = 0
    while position < len(line):
        sign = line[position]
        if sign in "$!":
            return line[:position]
        if sign in "'\"":
            closing = line.find(sign, position + 1)
            position = closing if closing > 0 else position
        position += 1
    return line


def _unquoted(value: str) -> str:
    if len(value) >= 2 and value[0] == value[-1] and value[0] in "'\"":
        return value[1:-1].strip()
    return value
