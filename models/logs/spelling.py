"""Units in headers of text files: which words are units, and where a name holds one."""

import re
from collections.abc import Sequence

from models.logs.units import TABLES, are_same, is_known
from models.schema import LONGEST_NAME

_OTHERS = TABLES["header"]["others"].split()
_EMPTY = ("1", "-", "--", "none", "")
_BRACKETS = re.compile(r".*?[\[({]\s*([^\])}]{0,24}?)\s*[\])}]\s*")
_NUMBER = re.compile(r"[-+]?[\d.,]+(?:[eE][-+]?\d+)?")
_ENDINGS, _CAPITAL = (
    dict(pair.split("=") for pair in TABLES["endings"][kind].split())
    for kind in ("plain", "capital")
)
_LONGEST_FIRST = sorted(_ENDINGS.items(), key=lambda one: -len(one[0]))
_CAPITAL_ENDING = re.compile(
    f"(?:(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Za-z0-9])_(?=[A-Z]))(?i:(?P<unit>{'|'.join(_CAPITAL)}))$"
)
_OF_ANGLES = re.compile("(?i:ang|winkel|slip|steer|yaw|roll|pitch|heading|delta|beta)")
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
    """Return the unit that a name holds, as in "Speed [km/h]", "Speed:km/h" or "Speed_kmh"."""
    return _split(name)[1]


def _split(name: str) -> tuple[str, str]:
    if len(name) > LONGEST_NAME:
        return name, ""
    match = _BRACKETS.fullmatch(name)
    if match and not match[1].isdigit() and (is_unit(match[1]) or "[" in name):
        return without_unit(name), match[1]
    for mark in (":", " / ", ", ", " in "):
        bare, there, unit = name.rpartition(mark)
        if there and is_unit(unit) and unit.strip() not in _EMPTY:
            return bare.strip(), unit.strip()
    if _LENKRAD.search(name):
        return name, ""
    for ending, unit in _LONGEST_FIRST:
        if name.endswith("_" + ending):
            return name.removesuffix("_" + ending), unit
    found = _CAPITAL_ENDING.search(name)
    unit = _CAPITAL[found["unit"].lower()] if found else ""
    if found is None or (unit == "rad" and not _OF_ANGLES.search(name)):  # "vRad" is of a wheel
        return name, ""
    return name[: found.start()], unit


_UNIT_BEHIND = re.compile(r"\s*[\[(][^\[\]()]*[\])]$")


def without_unit(name: str) -> str:
    """Return a name without the unit in brackets that it ends in: "Speed" of "Speed [km/h]"."""
    return _UNIT_BEHIND.sub("", name)


def without_ending(name: str, unit: str) -> str:
    """Return a name without the unit that it holds, where it is that unit.
    name : of a column, as in the file: "speed_kmh", "speed [km/h]".
    unit : that was understood: "km/h".
    """
    bare, meant = _split(name)
    return bare if are_same(meant, unit) else name
