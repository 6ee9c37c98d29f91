"""MATLAB's own binary files (`save` of version 5, 6 and 7) as a tree of what is not read yet.

A file is a row of elements: type, size, data. A variable is an element of type 14, plain or
deflated (type 15), of elements itself: flags, dimensions, name, then numbers or further variables.
Nothing here trusts a size: each lies in what holds it, and depth and what is inflated have limits.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from models.logs.grouped import require_room
from models.logs.log import dense, few
from models.logs.tree import Leaf, Tree, Unread
from models.schema import most_unpacked, swells

_HEADER = 128  # bytes
_MATRIX, _COMPRESSED = 14, 15  # types of an element
_NUMBERS = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
_TEXTS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _OPAQUE = 1, 2, 3, 4, 5, 17  # classes of a variable
_OTHERS = {
    _OPAQUE: "a table, timeseries or other object", _OBJECT: "an object", _SPARSE: "sparse",
}  # fmt: skip
_NUMERIC = range(6, 16)
_COMPLEX = 0x0800  # flag
_BEGINNING = 4096  # bytes that hold what a variable of numbers says of itself
_LARGEST_DIMENSION = 2**40


class _DamagedError(TireidError, ValueError):
    """The file is not what it says."""


class _Element(NamedTuple):
    """A part of a variable; end: where the next one begins."""

    kind: int
    data: memoryview
    end: int


class _Beginning(NamedTuple):
    """What a variable says of itself, and the elements that follow."""

    kind: int
    is_complex: bool
    shape: tuple[int, int]
    dimensions: int
    name: str
    rest: memoryview

    @property
    def is_internal(self) -> bool:
        """Whether MATLAB keeps it for itself."""
        return not self.name or self.name.startswith("__")

    @property
    def is_read(self) -> bool:
        """Whether it is a vector or matrix of real numbers."""
        return self.kind in _NUMERIC and not self.is_complex and self.dimensions == 2


def read_tree(path: Path) -> dict[str, Tree]:
    """Return the variables of a file; numbers are read when they are asked for."""
    with path.open("rb") as file:
        header = file.read(_HEADER)
        order = {b"IM": "<", b"MI": ">"}.get(header[126:128])
        if order is None:
            raise _DamagedError("its header has no byte order")
        size = path.stat().st_size
        result: dict[str, Tree] = {}
        # Bytes that stay in memory, and of the file for them.
        place, in_memory, packed = _HEADER, 0, 0
        while place < size:
            file.seek(place)
            tag = file.read(8)
            if len(tag) < 8:
                raise _DamagedError(f"cut off at byte {place}")
            kind, length = struct.unpack(order + "II", tag)
            place += 8
            if length > size - place:
                raise _DamagedError(f"the variable at byte {place - 8} is cut off")
            if kind in (_MATRIX, _COMPRESSED):
                variable = _Variable(path, place, length, kind == _COMPRESSED, order)
                begin = _beginning(variable.data(_BEGINNING), order)
                count = math.prod(begin.shape)
                tree: Tree = _unread(begin)
                if begin.is_read:
                    tree = Leaf(shape=begin.shape, load=variable.load)
                    if swells(8 * count, length):
                        tree = Unread(f"{count} numbers in {length} bytes")
                elif begin.kind in (_CELL, _STRUCT, _CHAR) and not begin.is_internal:
                    data = variable.data()
                    tree = _tree(path, data, order, 0)
                    in_memory, packed = in_memory + len(data), packed + length
                if not begin.is_internal:
                    result[begin.name] = tree
                dense(path, in_memory, packed, "structs and cells")
                few(path, len(result), "columns", "variables")
            place += length + (0 if kind == _COMPRESSED else -length % 8)
    return result


class _Variable(NamedTuple):
    path: Path
    place: int
    length: int
    deflated: bool
    order: str

    def data(self, most: int | None = None) -> memoryview:
        """Read the element's data, or their beginning."""
        with self.path.open("rb") as file:
            file.seek(self.place)
            raw = file.read(
                self.length if self.deflated or most is None else min(most, self.length)
            )
        if not self.deflated:
            return memoryview(raw)
        allowed = most_unpacked(self.length)
        inflated = zlib.decompressobj().decompress(raw, (allowed + 1) if most is None else most + 8)
        size = len(inflated)
        few(self.path, size / 1e6, "block", "megabytes of a variable")
        dense(self.path, size, self.length, "variables")
        kind, length = struct.unpack(self.order + "II", inflated[:8].ljust(8, b"\0"))
        if kind != _MATRIX or (most is None and length > size - 8):
            raise _DamagedError(f"the variable at byte {self.place} is cut off")
        return memoryview(inflated)[8 : 8 + length]

    def load(self) -> Array:
        return _load(self.path, _beginning(self.data(), self.order), self.order)


def _elements(data: memoryview, order: str) -> Iterator[_Element]:
    place = 0
    while place + 8 <= len(data):
        kind, length = struct.unpack(order + "II", data[place : place + 8])
        if kind >> 16:  # small: size and type share a word, the data are in the other
            some = data[place + 4 : place + 4 + min(kind >> 16, 4)]
            place += 8
            yield _Element(kind & 0xFFFF, some, place)
            continue
        some = data[place + 8 : place + 8 + length]
        place += 8 + length + (-length % 8)
        yield _Element(kind, some, place)


def _beginning(data: memoryview, order: str) -> _Beginning:
    if not data:
        return _Beginning(6, False, (0, 0), 2, "", data)
    parts = list(islice(_elements(data, order), 3))
    if len(parts) < 2 or len(parts[0].data) < 8:
        raise _DamagedError("a variable has no flags")
    flags = struct.unpack(order + "I", parts[0].data[:4])[0]
    kind = flags & 0xFF
    if kind == _OPAQUE:  # it has no dimensions: name, system, class
        words = [bytes(one.data).decode("latin-1") for one in parts[1:]]
        return _Beginning(kind, False, (0, 0), 0, words[0], data[:0])
    if len(parts) < 3:
        raise _DamagedError("a variable has no name")
    raw = parts[1].data
    dimensions = [one for (one,) in struct.iter_unpack(order + "i", raw[: len(raw) // 4 * 4])]
    if len(dimensions) < 2 or min(dimensions) < 0:
        raise _DamagedError("a variable has no dimensions")
    shape = dimensions[0], math.prod(dimensions[1:])
    if math.prod(shape) > _LARGEST_DIMENSION:
        raise _DamagedError("a variable is too large")
    return _Beginning(
        kind,
        bool(flags & _COMPLEX),
        shape,
        len(dimensions),
        bytes(parts[2].data).decode("latin-1"),
        data[parts[2].end :],
    )


def _load(path: Path, begin: _Beginning, order: str) -> Array:
    """Return the numbers of a variable, (rows, columns)."""
    require_room(path, max(begin.shape), 8 * min(begin.shape))
    element = next(_elements(begin.rest, order), None)
    count = begin.shape[0] * begin.shape[1]
    if not count:
        return np.zeros(begin.shape)
    if element is None or element.kind not in _NUMBERS:
        raise _DamagedError("a variable has no numbers")
    flat = np.frombuffer(element.data, order + _NUMBERS[element.kind], count)
    return flat.astype(np.float64).reshape(begin.shape, order="F")


def _tree(path: Path, data: memoryview, order: str, depth: int) -> Tree:
    few(path, depth, "depth", "levels of structs and cells")
    begin = _beginning(data, order)
    if begin.is_read:
        return Leaf(shape=begin.shape, load=lambda: _load(path, begin, order))
    if begin.kind == _CHAR:
        return _words(begin, order)
    count = begin.shape[0] * begin.shape[1]
    few(path, count, "values", "cells")
    elements = _elements(begin.rest, order)
    if begin.kind == _CELL:
        cells: list[Tree] = [
            _tree(path, one.data, order, depth + 1) for one in _take(elements, count)
        ]
        return cells
    if begin.kind != _STRUCT:
        return _unread(begin)
    head = [bytes(one.data) for one in islice(elements, 2)]
    longest = struct.unpack(order + "i", head[0][:4])[0] if len(head) == 2 else 0
    if longest < 1:
        raise _DamagedError("a struct has no fields")
    raw = head[1]
    names = [
        raw[k : k + longest].split(b"\0")[0].decode("latin-1") for k in range(0, len(raw), longest)
    ]
    few(path, count * len(names), "values", "fields")
    structs: list[Tree] = [
        {
            name: _tree(path, one.data, order, depth + 1)
            for name, one in zip(names, _take(elements, len(names)), strict=True)
        }
        for _ in range(count)
    ]
    return structs[0] if count == 1 else structs


def _take(elements: Iterator[_Element], count: int) -> list[_Element]:
    found = list(islice(elements, count))
    if len(found) < count or any(one.kind != _MATRIX for one in found):
        raise _DamagedError("a cell or struct is cut off")
    return found


def _words(begin: _Beginning, order: str) -> Tree:
    """Return a text; of several rows a list."""
    element = next(_elements(begin.rest, order), None)
    if element is None or element.kind not in _TEXTS:
        return ""
    encoding = _TEXTS[element.kind]
    if encoding.startswith("utf-") and encoding != "utf-8":
        encoding += "-le" if order == "<" else "-be"
    text = bytes(element.data).decode(encoding, errors="replace")
    rows, columns = begin.shape
    if rows <= 1:
        return text[:columns] if element.kind != 16 else text
    return [text[k::rows].strip() for k in range(rows)]


def _unread(begin: _Beginning) -> Unread:
    if begin.is_complex:
        return Unread("complex numbers")
    if begin.kind in _NUMERIC:
        return Unread(f"an array of {begin.dimensions} dimensions")
    return Unread(_OTHERS.get(begin.kind, f"class {begin.kind}"))
