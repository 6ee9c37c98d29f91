"""Units in headers of text files: which words are units, and where a name holds one."""

import re
from collections.abc import Sequence

from models.logs.units import RATE, SPEED, TABLES, are_same, is_known, quantities
from models.schema import LONGEST_NAME

_OTHERS = TABLES["header"]["others"].split()
_EMPTY = ("1", "-", "--", "none", "")
_BRACKETS = re.compile(r"\s*[\[({]\s*([^\])}]{0,24}?)\s*[\])}]\s*")
_MARK = re.compile(r"\s*(?:\*+\s*\w*|@.*|[†‡]+|(?<=[])}])\s*\d\)?)?$")  # "*OBD", "1)"
_NUMBER = re.compile(r"[-+]?[\d.,]+(?:[eE][-+]?\d+)?")
_ENDINGS, _CAPITAL = (
    dict(pair.split("=") for pair in TABLES["endings"][kind].split())
    for kind in ("plain", "capital")
)
_ENDING = re.compile(f"_({'|'.join(_ENDINGS)})$")
_CAPITAL_ENDING = re.compile(
    f"(?:(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Za-z0-9])_(?=[A-Z]))(?i:(?P<unit>{'|'.join(_CAPITAL)}))$"
)
_OF_ANGLES = re.compile("(?i:ang|winkel|slip|steer|yaw|roll|pitch|heading|delta|beta|gyr)")
_LENKRAD = re.compile("(?i:lenk_?rad)$")  # German for a wheel: no angle in rad


def is_unit(word: str) -> bool:
    return is_known(word) or word.strip("[](){} ").lower() in _OTHERS


def is_units_row(cells: Sequence[str]) -> bool:
    filled = [cell.strip() for cell in cells if cell.strip()]
    if not filled:
        return False
    if all(cell[0] in "[(" and cell[-1] in "])" for cell in filled):
        return True
    if any(_NUMBER.fullmatch(cell) and cell != "1" for cell in filled):
        return False
    known = [cell for cell in filled if is_unit(cell)]
    telling = [cell for cell in known if cell.lower() not in _EMPTY]
    return len(known) >= 0.8 * len(filled) and len(telling) > 0


def unit_in_name(name: str) -> str:
    """Return the unit that a name holds, as in "Speed [km/h]", "Speed (km/h) *GPS", "Speed_kmh"."""
    return _split(name)[1]


def _split(name: str) -> tuple[str, str]:
    if len(name) > LONGEST_NAME:
        return name, ""
    if {SPEED, RATE} & set(quantities(name)):
        return name, name.strip()
    bare = _MARK.sub("", name)
    groups = [one for one in _BRACKETS.finditer(bare) if not one[1].isdigit()]
    for k, one in enumerate(reversed(groups)):
        last = k == 0 and one.end() == len(bare)
        if is_unit(one[1]) and (last or quantities(one[1])):  # what stands behind is a remark
            return f"{bare[: one.start()]} {bare[one.end() :]}".strip(), one[1]
    if groups and groups[-1].end() == len(bare) and "[" in name:
        return without_unit(bare), groups[-1][1]
    for mark in (":", " / ", ", ", " in "):
        before, there, unit = bare.rpartition(mark)
        if there and is_unit(unit) and unit.strip() not in _EMPTY:
            return before.strip(), unit.strip()
    if _LENKRAD.search(bare):
        return name, ""
    if found := _ENDING.search(bare):
        return bare[: found.start()], _ENDINGS[found[1]]
    found = _CAPITAL_ENDING.search(bare)
    unit = _CAPITAL[found["unit"].lower()] if found else ""
    if found is None or (unit == "rad" and not _OF_ANGLES.search(bare)):  # "vRad" is of a wheel
        return name, ""
    return bare[: found.start()], unit


_UNIT_BEHIND = re.compile(r"\s*[\[(][^\[\]()]*[\])]$")


def without_unit(name: str) -> str:
    """Return a name without the unit in brackets that it ends in: "Speed" of "Speed [km/h]"."""
    return _UNIT_BEHIND.sub("", name)


def without_units(name: str, unit: str) -> tuple[str, str]:
    """Return a name without the units that it holds, and one of them that is not the given one.
    name : of a column, as in the file: "speed_kmh", "speed_kph [km/h]".
    unit : that was understood: "km/h".
    """
    bare, meant = _split(name)
    letters = [re.sub("[^a-z0-9]", "", one.lower()) for one in (meant, unit)]  # "ms" of m/s
    turned = f"{meant}/s" if meant in ("deg", "rad") and _OF_ANGLES.search(bare) else meant
    if not meant or bare == name:
        return name, ""
    if "" != letters[0] == letters[1] or are_same(meant, unit) or are_same(turned, unit):
        return without_units(bare, unit)
    if {*quantities(meant), *quantities(turned)} & set(quantities(unit)):
        return bare, meant
    return name, ""
