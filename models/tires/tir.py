"""Reader of tire property files (`.tir`): sections of `KEY = value` lines, by any program.

Both comment signs ($ and !), quoted strings, tables after a {header}, CRLF, tabs, any case of the
keys, Fortran exponents (1.5D-3), UTF-8 or Latin-1, a byte order mark. A key means the same in every
section, but units count in [UNITS] only. Unknown keys are kept and do nothing.
"""

import codecs
import math
import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from math import inf
from os import PathLike
from pathlib import Path
from typing import Literal, NamedTuple

from codegen.errors import TireidError
from codegen.escape import displayed
from models.schema import read_bytes
from models.tires.magic_formula_coefficients import ESSENTIAL, Coefficients

_LARGEST = 1e12  # of a number, in the unit of the file: a stiffness in N/km fits
_SOME = 10  # lines in a message
_FITTYPS = (5, 6, 21, 51, 52)  # MF-Tyre up to 5.2 under its several numbers; 60 and above is 6.x
_PKY4_OF_52 = 2.0  # PKY4, as MF-Tyre 5.2 has it fixed

# Units of a tire property file: which keys have one, and what it is in SI.
#
# Only the keys of `_DIMENSIONS` are converted. The coefficients of the Magic Formula (P.., R..,
# Q.., L..) are dimensionless or in radian whatever [UNITS] says: their equations are in SI.

_TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
_DIMENSIONS: Mapping[str, Mapping[str, int]] = _TABLES["dimensions"]
_UNITS: Mapping[str, Mapping[str, float]] = _TABLES["units"]


def _unit_in_si(dimension: str, unit: str) -> float:
    """One of the unit, in SI.

    Case and a plural s do not matter; from five letters on the beginning of a name will do,
    because some programs cut names after twelve letters.
    dimension : "LENGTH", "FORCE", "ANGLE", "MASS" or "TIME".
    """
    known = _UNITS[dimension]
    word = unit.strip().lower().replace(" ", "_").replace("-", "_")
    for candidate in (word, word.removesuffix("s")):
        if candidate in known:
            return known[candidate]
    begun = {factor for name, factor in known.items() if len(word) > 4 and name.startswith(word)}
    if len(begun) == 1:
        return begun.pop()
    raise ValueError(f"[UNITS] {dimension} = {unit!r} is not one of {', '.join(known)}")


_KEY = re.compile(r"[A-Za-z_]\w*")
_SECTION = re.compile(r"\[(.*?)\]")
_LINE_END = re.compile(r"\r\n|\r|\n")  # alone: str.splitlines also ends a comment at cp1252's "..."
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([EeDd][+-]?\d+)?")


class TirError(TireidError, ValueError):
    """A tire property file cannot be used; one line naming the file and the reason."""


class _Entry(NamedTuple):
    """One `KEY = value` line.
    value : text without quotes and comment.   line : its number, from 1.
    section : the section it stands in, in capitals; empty before the first.
    """

    value: str
    line: int
    section: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TirFile:
    """The entries of one file.
    without_sign : lines that begin with a word but have no "=", by that word in capitals; their
        value is empty.
    """

    path: Path
    entries: Mapping[str, tuple[_Entry, ...]]
    without_sign: Mapping[str, tuple[_Entry, ...]]

    def __contains__(self, key: str) -> bool:
        return key in self.entries

    def text(self, key: str, default: str) -> str:
        """The value as text.
        default : the answer where the file has no such key, or an empty value.
        """
        return self._text(key, default, self.entries.get(key, ()), self.without_sign.get(key, ()))

    def number(self, key: str) -> float | None:
        """The value in SI; None where the file has no such key.
        key : in capitals; those of `_DIMENSIONS` are converted from the units of the file.
        """
        if key not in self.entries:
            self._require_sign(key, self.without_sign.get(key, ()))
            return None
        values = {self._parsed(key, entry): entry.line for entry in self.entries[key]}
        self._require_one(key, values.values())
        return next(iter(values)) * self._unit(key)

    def error(self, reason: str) -> TirError:
        return TirError(f"{self.path}: {reason}")

    def _parsed(self, key: str, entry: _Entry) -> float:
        if _NUMBER.fullmatch(entry.value):
            value = float(entry.value.upper().replace("D", "E"))
            if _LARGEST < abs(value) < math.inf:
                raise self.error(f"line {entry.line}: {key} must be below {_LARGEST:g}, is {value}")
            if math.isfinite(value):
                return value
        raise self.error(
            f"line {entry.line}: {key} must be a finite number, it is {displayed(entry.value)}"
        )

    def _text(
        self, key: str, default: str, entries: Sequence[_Entry], without_sign: Sequence[_Entry]
    ) -> str:
        if not entries:
            self._require_sign(key, without_sign)
            return default
        self._require_one(key, {entry.value.upper(): entry.line for entry in entries}.values())
        return entries[-1].value or default

    def _require_sign(self, key: str, without_sign: Sequence[_Entry]) -> None:
        if without_sign:
            raise self.error(f'line {without_sign[-1].line}: {key} has no "="')

    def _require_one(self, key: str, lines: Collection[int]) -> None:
        if len(lines) > 1:
            some = ", ".join(str(line) for line in list(lines)[:_SOME])
            raise self.error(f"{key} has different values in lines {some}")

    def _unit(self, key: str) -> float:
        factor = 1.0
        for dimension, exponent in _DIMENSIONS.get(key, {}).items():
            units, without_sign = (
                [one for one in lines.get(dimension, ()) if one.section == "UNITS"]
                for lines in (self.entries, self.without_sign)
            )
            unit = self._text(dimension, "", units, without_sign)
            if units:
                try:
                    factor *= _unit_in_si(dimension, unit) ** exponent
                except ValueError as error:
                    raise self.error(str(error)) from None
        return factor


def read_tir(path: str | PathLike[str]) -> TirFile:
    """Read a tire property file without judging what it describes.   path : the `.tir` file."""
    path = Path(path)
    entries: dict[str, list[_Entry]] = {}
    without_sign: dict[str, list[_Entry]] = {}
    section = ""
    lines = _LINE_END.split(_decoded(read_bytes(path, TirError)))
    for number, raw in enumerate(lines, start=1):
        line = _without_comment(raw).strip()
        key, sign, value = (part.strip() for part in line.partition("="))
        if header := _SECTION.match(line):
            section = header.group(1).strip().upper()
        elif sign and _KEY.fullmatch(key):
            entry = _Entry(_unquoted(value), number, section)
            entries.setdefault(key.upper(), []).append(entry)
        elif word := _KEY.match(line):
            entry = _Entry("", number, section)
            without_sign.setdefault(word.group().upper(), []).append(entry)
    return TirFile(
        path=path,
        entries={key: tuple(found) for key, found in entries.items()},
        without_sign={key: tuple(found) for key, found in without_sign.items()},
    )


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


# From a tire property file to the Magic Formula 5.2: that model, complete, and possible.
#
# MF-Tyre 5.0, 5.1 and 5.2 and PAC2002 write the lateral and the longitudinal force with the same
# equations and names; TNO's own label for 5.0 is PROPERTY_FILE_FORMAT = 'MF_05' with FITTYP = 5.
# MF-Tyre 6.x and the motorcycle's MF-MCTyre reuse most of the names in other equations, and their
# files often keep an old label. So a file is judged by its coefficients as well as by its labels.

_FORMATS = ("PAC2002", "MF05", "MF52", "MFTYRE", "MFTYRE52", "DELFTTYRE", "USER")
_PRESSURE = ("PPX1", "PPX2", "PPX3", "PPX4", "PPY1", "PPY2", "PPY3", "PPY4")
# No equation of 5.2 has these. Zero is how programs that list all names say "not used": a tire of
# 6.1 is not hidden by it, with PKY4 = 0 it would have no cornering stiffness.
_MARKS_OF_OTHERS = (
    "PKY4", "PKY5", "PKY6", "PKY7", "PEY5", "PPY5", "RBX3", "RBY4", "PCY2", "NOMPRES", "INFLPRES",
)  # fmt: skip
# Of these, what changes no equation of a tire of 5.2: the pressures by their names of 6.x, and the
# value of PKY4 at which K_y of 6.x is that of 5.2. PHY3 is what 6.x has no more: a file that calls
# itself 5.2 and has it was extended for a program that asks for all names.
_PRESSURES_OF_OTHERS = ("INFLPRES", "NOMPRES")

# MF-Tyre 5.0 often fits a negative mu_y. Its sign is free: B = K/(C D) takes it too, and the curve
# is the same in (-B, -D); D_Vyk = mu_y F_z (RVY1 + ...) is the only other place of mu_y.
_SIGNED_AS_FRICTION = ("PDY1", "PDY2", "RVY1", "RVY2", "RVY3")


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidRange:
    """What the tire was measured for, as (least, greatest); infinite where the file does not say.
    alpha : slip angle, paper's sign [rad]; the file has the ISO sign, so its limits change places.
    kappa : longitudinal slip [-].   gamma : camber [rad].   F_z : wheel load [N].
    """

    alpha: tuple[float, float]
    kappa: tuple[float, float]
    gamma: tuple[float, float]
    F_z: tuple[float, float]


class _MagicFormulaFile(NamedTuple):
    """What a file tells about its tire.
    coefficients : of the force equations, at the inflation pressure of the file.
    side : of the car the file is valid for.   valid_range : of the measurement.
    name : file name without extension.
    """

    coefficients: Coefficients
    side: Literal["left", "right"]
    valid_range: ValidRange
    name: str


def read_magic_formula(path: str | PathLike[str]) -> _MagicFormulaFile:
    """Read a PAC2002 or MF-Tyre 5.0 to 5.2 property file.   path : the `.tir` file."""
    tir = read_tir(path)
    _require_mf52(tir)
    c = _inflated(_coefficients(tir), tir)
    if (tir.number("USE_MODE") or 0.0) < 0.0:
        c = c.mirrored()  # as the format has it: a negative mode mirrors the characteristics
    side = tir.text("TYRESIDE", "LEFT").upper()
    if side not in ("LEFT", "RIGHT", "SYMMETRIC", "UNKNOWN"):
        raise tir.error(f"TYRESIDE must be LEFT, RIGHT or SYMMETRIC, it is {side!r}")
    if side == "SYMMETRIC":
        c = c.symmetric()
    alpha = _limits(tir, "ALPMIN", "ALPMAX")
    valid = ValidRange(
        alpha=(-alpha[1], -alpha[0]),
        kappa=_limits(tir, "KPUMIN", "KPUMAX"),
        gamma=_limits(tir, "CAMMIN", "CAMMAX"),
        F_z=_limits(tir, "FZMIN", "FZMAX"),
    )
    return _MagicFormulaFile(c, "right" if side == "RIGHT" else "left", valid, tir.path.stem)


def _require_mf52(tir: TirFile) -> None:
    """Refuse other models, whose coefficients have the same names and another meaning."""
    fittyp = tir.number("FITTYP")
    model = tir.text("PROPERTY_FILE_FORMAT", "")
    if fittyp is not None and fittyp not in _FITTYPS:
        what = "Magic Formula 6.x" if fittyp >= 60 else "an unknown model"
        raise tir.error(
            f"FITTYP = {fittyp:g} is {what}; its equations differ, only MF 5.2 and PAC2002 are read"
        )
    plain = re.sub(r"[^A-Z0-9]", "", model.upper())
    if model and plain not in _FORMATS:
        raise tir.error(
            f"PROPERTY_FILE_FORMAT = {model!r} is another tire model; only PAC2002, MF_05 and "
            "MF 5.2 (MF-TYRE or USER with FITTYP 5, 6, 21 or 52) are read"
        )
    found = {key: value for key in _MARKS_OF_OTHERS if (value := tir.number(key))}
    if "PHY3" in tir and (model or fittyp is not None):
        same = {
            *_PRESSURES_OF_OTHERS,
            *(["PKY4"] if found.get("PKY4") == _PKY4_OF_52 else []),
        }
        found = {key: value for key, value in found.items() if key not in same}
    if marks := [f"{key} = {value:g}" for key, value in found.items()]:
        label = f"it calls itself {model}" if model else "it has no PROPERTY_FILE_FORMAT"
        label += "" if fittyp is None else f", FITTYP {fittyp:g}"
        raise tir.error(
            f"{', '.join(marks)} belong to Magic Formula 6.x or MF-MCTyre, whose equations differ, "
            f"although {label}; only MF 5.2 and PAC2002 are read"
        )


def _coefficients(tir: TirFile) -> Coefficients:
    values: dict[str, float] = {}
    for name in (field.name for field in fields(Coefficients)):
        value = tir.number(name)
        if name == "LKYG" and value is None:
            value = tir.number("LKG")
        if value is not None:
            values[name] = value
    if values.get("PDY1", 0.0) < 0.0:
        values |= {name: -values[name] for name in _SIGNED_AS_FRICTION if name in values}
    if missing := [name for name in ESSENTIAL if name not in values]:
        raise tir.error(f"lacks {', '.join(missing)}, without which there is no Magic Formula 5.2")
    try:
        return Coefficients(**values)
    except ValueError as error:
        raise tir.error(str(error)) from None


def _inflated(c: Coefficients, tir: TirFile) -> Coefficients:
    """PAC2002's effect of inflation pressure, a constant of the file: scales eight coefficients."""
    names = ("IP", "IP_NOM") if "IP" in tir else _PRESSURES_OF_OTHERS
    p, p_0 = (tir.number(name) for name in names)
    if p is None or p_0 is None or (names == _PRESSURES_OF_OTHERS and p == p_0 == 0.0):
        return c
    if not (p > 0.0 and p_0 > 0.0):
        raise tir.error(f"{' and '.join(names)} must be positive, they are {p:g} and {p_0:g}")
    scale = tir.number("LIP")
    dp = ((1.0 if scale is None else scale) * p - p_0) / p_0
    PPX1, PPX2, PPX3, PPX4, PPY1, PPY2, PPY3, PPY4 = (tir.number(name) or 0.0 for name in _PRESSURE)
    K_x = 1.0 + PPX1 * dp + PPX2 * dp**2
    mu_x = 1.0 + PPX3 * dp + PPX4 * dp**2
    mu_y = 1.0 + PPY3 * dp + PPY4 * dp**2
    try:
        return replace(
            c,
            PKX1=c.PKX1 * K_x, PKX2=c.PKX2 * K_x,
            PDX1=c.PDX1 * mu_x, PDX2=c.PDX2 * mu_x,
            PDY1=c.PDY1 * mu_y, PDY2=c.PDY2 * mu_y,
            PKY1=c.PKY1 * (1.0 + PPY1 * dp), PKY2=c.PKY2 * (1.0 + PPY2 * dp),
        )  # fmt: skip
    except ValueError as error:
        raise tir.error(f"at its inflation pressure {error}") from None


def _limits(tir: TirFile, least: str, greatest: str) -> tuple[float, float]:
    low, high = tir.number(least), tir.number(greatest)
    low, high = -inf if low is None else low, inf if high is None else high
    if not low < high:
        raise tir.error(f"{least} must be below {greatest}, they are {low:g} and {high:g}")
    return low, high
