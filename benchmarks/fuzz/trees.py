"""Mutations of JSON and TOML: the tree of values is changed and written in the format again.

A value of the tree may be a `Token`, text that is written as it stands: what no writer writes.
"""

import json
import random
import tomllib
from collections.abc import Callable
from typing import Any, NamedTuple

from benchmarks.fuzz.hostile import DEEPEST, INTEGERS, LONGEST, number, text
from benchmarks.fuzz.raw import bytes_mutated, lines_mutated


class Token(NamedTuple):
    """Text in the place of a value."""

    text: str


class Slot(NamedTuple):
    """A place in a tree: a table or list, and the key or index in it."""

    inside: Any
    key: Any


Writer = Callable[[Any], str]
TOKENS = (
    "[" * DEEPEST, "[" * DEEPEST + "]" * DEEPEST, '{"a":' * DEEPEST + "1" + "}" * DEEPEST,
    "{a=" * 500 + "1" + "}" * 500, "9" * LONGEST, "-" + "9" * 400, "1e400", "0." + "3" * LONGEST,
    "NaN", "nan", "-Infinity", "inf", "1979-05-27T07:32:00Z", "1979-05-27", "07:32:00", "0x1F",
    "tru", "", '"', '"\\ud800"', '"\\u0000"', "'''", "[1, 2", "{}", "[]", "null", "[[]]",
    '{"W": 1, "W": 2}', "1__0", "+1", "01", "1.", ".5",
)  # fmt: skip


def json_mutated(rng: random.Random, data: bytes) -> bytes:
    """Return a JSON file with one thing changed.

    Parameters
    ----------
    rng : source of chance.
    data : of the file, which may be none any more.
    """
    return _mutated(rng, data, json.loads, json_text)


def toml_mutated(rng: random.Random, data: bytes) -> bytes:
    """Return a TOML file with one thing changed.

    Parameters
    ----------
    rng : source of chance.
    data : of the file, which may be none any more.
    """
    return _mutated(rng, data, tomllib.loads, toml_text)


def _mutated(rng: random.Random, data: bytes, read: Callable[[str], Any], write: Writer) -> bytes:
    if rng.random() < 0.15:
        return rng.choice((bytes_mutated, lines_mutated))(rng, data)
    try:
        tree = read(data.decode())
        slots = list(_slots(tree))
    except (ValueError, RecursionError):  # changed before into what is no tree
        return bytes_mutated(rng, data)
    if not slots:
        return bytes_mutated(rng, data)
    # By key as often as by value: a matrix of a hundred numbers is one thing among others.
    keyed = [slot for slot in slots if isinstance(slot.inside, dict)]
    _change(rng, rng.choice(keyed if keyed and rng.random() < 0.6 else slots))
    return write(tree).encode("utf-8", "surrogatepass")


def _slots(tree: Any) -> list[Slot]:
    found: list[Slot] = []
    if isinstance(tree, dict | list):
        for key in tree if isinstance(tree, dict) else range(len(tree)):
            found.append(Slot(tree, key))
            found += _slots(tree[key])
    return found


def _change(rng: random.Random, slot: Slot) -> None:
    inside, key = slot
    value = inside[key]
    match rng.randrange(10):
        case 0:
            del inside[key]
        case 1:  # under another name, or twice
            if isinstance(inside, dict):
                inside[text(rng)] = value if rng.random() < 0.5 else inside.pop(key)
            else:
                inside.insert(key, value)
        case 2:
            inside[key] = Token(rng.choice(TOKENS))
        case 3:
            inside[key] = text(rng)
        case 4:
            inside[key] = rng.choice(([], {}, [value], [value] * 3, {"a": value}, True, [[value]]))
        case 5:
            inside[key] = rng.choice(INTEGERS)
        case _:
            inside[key] = _other_value(rng, value)


def _other_value(rng: random.Random, value: Any) -> Any:
    if isinstance(value, bool) or value is None:
        return rng.choice((True, 1, 0.5, "true"))
    if isinstance(value, int | float):
        return number(rng, value)
    if isinstance(value, str):
        return rng.choice((text(rng), value[:-1], value.upper(), value + value))
    if isinstance(value, list) and value:
        shape = rng.randrange(5)
        if shape == 0:
            return value[:-1]
        if shape == 1:
            return [*value, value[-1]]
        if shape == 2:
            return value[::-1]
        if shape == 3:
            return value[0]
        return _filled(value, number(rng, 1.0))
    return value


def _filled(value: Any, other: float) -> Any:
    """Return a list with all of its numbers replaced."""
    return [_filled(item, other) for item in value] if isinstance(value, list) else other


def json_text(tree: Any) -> str:
    """Return a tree as JSON, tokens as they are; numbers that are not finite as Python writes them.

    Parameters
    ----------
    tree : dictionaries, lists, numbers, texts, tokens.
    """
    match tree:
        case Token(text=token):
            return token
        case dict():
            return (
                "{" + ", ".join(f"{json.dumps(k)}: {json_text(v)}" for k, v in tree.items()) + "}"
            )
        case list():
            return "[" + ", ".join(map(json_text, tree)) + "]"
        case _:
            return _plain(tree, json.dumps)


def toml_text(tree: Any) -> str:
    """Return a tree as TOML, tokens as they are.

    Parameters
    ----------
    tree : dictionaries, lists, numbers, texts, tokens.
    """
    plain = {key: value for key, value in tree.items() if not isinstance(value, dict)}
    lines = [f"{_toml_key(key)} = {_toml_value(value)}" for key, value in plain.items()]
    for key, table in tree.items():
        if isinstance(table, dict):
            lines += ["", f"[{_toml_key(key)}]"]
            lines += [f"{_toml_key(name)} = {_toml_value(value)}" for name, value in table.items()]
    return "\n".join(lines) + "\n"


def _toml_key(key: str) -> str:
    return key if key.isidentifier() and key.isascii() else json.dumps(key, ensure_ascii=False)


def _toml_value(value: Any) -> str:
    match value:
        case Token(text=token):
            return token
        case dict():
            inner = ", ".join(f"{_toml_key(k)} = {_toml_value(v)}" for k, v in value.items())
            return f"{{{inner}}}"
        case list():
            return "[" + ", ".join(map(_toml_value, value)) + "]"
        case bool() | str():
            return json.dumps(value, ensure_ascii=False)
        case None:
            return '""'
        case _:
            return _plain(value, repr)


def _plain(value: Any, write: Callable[[Any], str]) -> str:
    if isinstance(value, int) and not isinstance(value, bool):
        return hex(value) if abs(value) > 10**4000 else str(value)
    return write(value)
