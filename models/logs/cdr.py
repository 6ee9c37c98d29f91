"""Numbers of ROS 2 messages, from their definitions alone: nothing is generated or executed.

A message is serialized as CDR: four bytes that tell the byte order, then the fields in their order,
each aligned to its size. Where a field lies thus depends on the lengths of the texts and sequences
before it alone; messages of the same lengths share a layout and are read together.
"""

import struct
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.errors import TireidError
from models.limits import limits

PREFIX = 4  # bytes
_BASE = 1  # kind of a node of a definition: a number or text
_NAME = 2  # likewise: another definition
_ARRAY = 3  # likewise: of a fixed length
_SEQUENCE = 4  # likewise: of any length

ORDERS = {b"\x00\x00": ">", b"\x00\x01": "<"}
# numpy's kind and bytes of what has a fixed size; no signals are what is given by a bool, or words.
_NUMBERS = {
    f"{word}{8 * size}": f"{word[0]}{size}"
    for word, sizes in (("int", (1, 2, 4, 8)), ("uint", (1, 2, 4, 8)), ("float", (4, 8)))
    for size in sizes
}
_SIZES = {name: int(kind[1]) for name, kind in _NUMBERS.items()} | {"bool": 1, "byte": 1, "char": 1}

# By name of a type: its constants, and name and node of each field.
Definitions = Mapping[str, tuple[Any, list[tuple[str, Any]]]]


class CdrError(TireidError, ValueError):
    """A message or definition cannot be read; the message says why."""


class Field(NamedTuple):
    """A number of a message.
    path: its name, with those of the messages that it lies in; owners: types and fields of these,
    the outermost first; kind: as numpy calls it.
    """

    path: str
    owners: tuple[tuple[str, str], ...]
    kind: str


class Layout(NamedTuple):
    """Where numbers lie in messages of the same lengths.
    size: bytes of the message; lengths: place and value of each length; places: of the fields.
    """

    order: str
    size: int
    lengths: tuple[tuple[int, int], ...]
    places: Mapping[str, int]


def fields_of(
    definitions: Definitions, kind: str, prefix: str = "", owners: tuple[tuple[str, str], ...] = ()
) -> Iterator[Field]:
    """Yield the numbers of a message, without those in arrays and sequences."""
    for name, node in _fields(definitions, kind, len(owners)):
        inner = (*owners, (kind, name))
        number, value = _kind(node), node[1]
        if number == _NAME:
            yield from fields_of(definitions, value, f"{prefix}{name}.", inner)
        elif number == _BASE and value[0] in _NUMBERS:
            yield Field(prefix + name, inner, _NUMBERS[value[0]])
        elif number in (_ARRAY, _SEQUENCE) and _kind(value[0]) == _NAME:
            list(fields_of(definitions, value[0][1], "", inner))  # it must be known, too


def layout_of(definitions: Definitions, kind: str, raw: bytes) -> Layout:
    order = ORDERS.get(bytes(raw[:2]))
    if order is None:
        raise CdrError("a message is not plain CDR")
    walk = _Walk(definitions, order, raw)
    walk.read((_NAME, kind), "", 0)
    return Layout(order, len(raw), tuple(walk.lengths), walk.places)


def fits(layout: Layout, messages: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return which messages have a layout.   messages : (n, size)."""
    order = next(word for word, one in ORDERS.items() if one == layout.order)
    same: NDArray[np.bool_] = np.all(messages[:, :2] == np.frombuffer(order, np.uint8), axis=1)
    for place, value in layout.lengths:
        raw = np.frombuffer(struct.pack(layout.order + "I", value), np.uint8)
        same &= np.all(messages[:, place : place + 4] == raw, axis=1)
    return same


def numbers(layout: Layout, messages: NDArray[np.uint8], field: Field) -> NDArray[Any]:
    """Return a number of each message, (n,), as it is stored.   messages : (n, size)."""
    place, kind = layout.places[field.path], np.dtype(layout.order + field.kind)
    raw = np.ascontiguousarray(messages[:, place : place + kind.itemsize])
    return raw.reshape(-1).view(kind)


class _Walk:
    """Goes through a message field by field."""

    def __init__(self, definitions: Definitions, order: str, raw: bytes) -> None:
        self.definitions, self.order, self.raw = definitions, order, raw
        self.place = 0  # behind the prefix
        self.lengths: list[tuple[int, int]] = []
        self.places: dict[str, int] = {}

    def read(self, node: Any, path: str | None, depth: int) -> None:
        """Go through a value; numbers of one in an array, whose path is None, are not kept."""
        number, value = _kind(node), node[1]
        if number == _NAME:
            for name, inner in _fields(self.definitions, value, depth):
                self.read(inner, None if path is None else f"{path}.{name}", depth + 1)
        elif number != _BASE:
            one, count = value[0], value[1] if number == _ARRAY else self.length()
            if count > len(self.raw):
                raise CdrError("a message is cut off")
            if _kind(one) != _BASE or one[1][0] == "string":
                for _ in range(count):
                    self.read(one, None, depth)
            elif count:
                size = self.align(one[1][0])  # moves the place, too
                self.place += count * size
        elif value[0] == "string":
            length = self.length()  # moves the place, too
            self.place += length
        else:
            size = self.align(value[0])
            if path is not None:
                self.places[path.removeprefix(".")] = self.place + PREFIX
            self.place += size
        if self.place + PREFIX > len(self.raw):
            raise CdrError("a message is cut off")

    def align(self, name: str) -> int:
        """Go to where a number begins; return its size."""
        size = _SIZES.get(name)
        if size is None:
            raise CdrError(f"a definition has the type {name}, which is not read")
        self.place += -self.place % size
        return size

    def length(self) -> int:
        self.align("uint32")
        place = self.place + PREFIX
        if place + 4 > len(self.raw):
            raise CdrError("a message is cut off")
        value = int(struct.unpack_from(self.order + "I", self.raw, place)[0])
        self.lengths.append((place, value))
        self.place += 4
        return value


def _fields(definitions: Definitions, kind: str, depth: int) -> list[tuple[str, Any]]:
    if depth > limits().depth:
        raise CdrError(f"types must lie in one another at most {limits().depth:g} deep")
    if kind not in definitions:
        raise CdrError(f"the type {kind} has no definition")
    return definitions[kind][1]


def _kind(node: Any) -> int:
    return int(getattr(node[0], "value", node[0]))
