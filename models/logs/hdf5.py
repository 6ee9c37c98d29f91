"""HDF5 files, and MATLAB's of version 7.3, as a tree of what is not read yet.

MATLAB stores arrays transposed, texts as numbers, and cells and structs of several elements as
references. Links to other files and arrays that lie in them are not followed.
"""

import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from codegen.arrays import Array
from models.apart import apart, each
from models.logs.foreign import need
from models.logs.grouped import require_room
from models.logs.log import RecordingError, few
from models.logs.tree import Leaf, Tree, Unread
from models.schema import swells

_LONGEST_TEXT = 1_000_000  # bytes of all texts of a dataset
_MOST_TEXTS = 10_000  # of a dataset

_AT_ONCE = 1 << 17  # numbers that are handed over at a time

_INTERNAL = ("#refs#", "#subsystem#")  # groups that MATLAB keeps for itself


def read_tree(path: Path) -> dict[str, Tree]:
    """Return the variables of a file; numbers are read when they are asked for."""
    return apart(RecordingError, path, 0.0, _read_tree, path)


def _read_tree(path: Path) -> dict[str, Tree]:
    h5py = need(path, "h5py", "MATLAB 7.3 or HDF5", "mat")
    with h5py.File(path, "r") as file:
        reader = _Reader(path, h5py, file)
        return {
            name: reader.tree(one, 0) for name, one in reader.members(file) if name not in _INTERNAL
        }


class _Reader:
    def __init__(self, path: Path, h5py: Any, file: Any) -> None:
        self.path, self.h5py, self.file = path, h5py, file
        self.count, self.size, self.stored = 0, 0, 0  # of all arrays, in memory and in the file

    def members(self, group: Any) -> list[tuple[str, Any]]:
        """Return what a group holds itself, not by links to elsewhere."""
        few(self.path, len(group), "columns", "members of a group")
        hard = [
            name for name in group if isinstance(group.get(name, getlink=True), self.h5py.HardLink)
        ]
        return [(name, group[name]) for name in hard]

    def tree(self, node: Any, depth: int) -> Tree:
        self.count += 1
        few(self.path, depth, "depth", "levels of groups")
        few(self.path, self.count, "values", "groups and arrays")
        kind = _matlab_class(node)
        if "MATLAB_object_decode" in node.attrs and kind not in ("struct", "cell"):
            return Unread(kind or "an object")
        if isinstance(node, self.h5py.Group):
            if "MATLAB_sparse" in node.attrs:
                return Unread("sparse")
            return self.struct(
                {name: (one, self.tree(one, depth + 1)) for name, one in self.members(node)}
            )
        if not isinstance(node, self.h5py.Dataset):
            return Unread("no array")
        return self.dataset(node, kind, depth)

    def struct(self, members: dict[str, tuple[Any, Tree]]) -> Tree:
        """Return a struct; where all fields are references, it is one of several elements."""
        lists = {
            name: tree
            for name, (node, tree) in members.items()
            if isinstance(tree, list) and _matlab_class(node) != "cell"
        }
        sizes = {len(tree) for tree in lists.values()}
        if len(lists) == len(members) and len(sizes) == 1:
            return [{name: tree[k] for name, tree in lists.items()} for k in range(sizes.pop())]
        return {name: tree for name, (_, tree) in members.items()}

    def dataset(self, node: Any, kind: str, depth: int) -> Tree:
        if node.external or node.is_virtual:
            return Unread("in another file")
        if "MATLAB_empty" in node.attrs or node.shape is None:
            return Leaf(shape=(0, 0), load=partial(np.zeros, (0, 0)))
        if self.h5py.check_ref_dtype(node.dtype) is self.h5py.Reference:
            few(self.path, node.size, "values", "cells")
            references = np.asarray(node[()]).reshape(-1)
            return [self.tree(self.file[one], depth + 1) for one in references if one]
        text = self.h5py.check_string_dtype(node.dtype)
        if text is not None or kind == "char":
            return self.text(node, text is None)
        if node.dtype.kind not in "fiub" or node.ndim > 2:
            return Unread(
                f"{node.dtype}" if node.ndim <= 2 else f"an array of {node.ndim} dimensions"
            )
        name, path, turned = node.name, self.path, bool(kind)
        if name is None:
            return Unread("without a name")
        stored = node.id.get_storage_size()
        size = self.size + 8 * max(node.size, _chunk(node))
        if swells(size, self.stored + stored):
            return Unread(f"{node.size} numbers in {stored} bytes")
        self.size, self.stored = size, self.stored + stored
        shape = (*node.shape, 1, 1)[:2] if node.ndim < 2 else node.shape
        rows, columns = shape[::-1] if turned else shape
        return Leaf(
            shape=(int(rows), int(columns)),
            load=partial(_load, path, name, (int(rows), int(columns)), turned),
        )

    def text(self, node: Any, is_numbers: bool) -> Tree:
        read_at_once = max(node.size, _chunk(node)) * node.dtype.itemsize
        if read_at_once > _LONGEST_TEXT or (not is_numbers and node.size > _MOST_TEXTS):
            return Unread("a long text")
        if is_numbers:
            codes = np.asarray(node[()])
            rows = [codes] if codes.ndim < 2 else list(codes.T)
            words: list[Tree] = ["".join(chr(int(one)) for one in row) for row in rows]
        else:
            words, left = [], _LONGEST_TEXT
            for place in np.ndindex(node.shape):  # many may refer to one that is long
                one = node[place]
                words.append(
                    one.decode("utf-8", errors="replace") if isinstance(one, bytes) else str(one)
                )
                left -= len(one)
                if left < 0:
                    return Unread("a long text")
        return words[0] if len(words) == 1 else words


def _load(path: Path, name: str, shape: tuple[int, int], turned: bool) -> Array:
    """Read a dataset, (rows, columns)."""
    require_room(path, max(shape), 8 * min(shape))  # an array may be larger than its file
    values, at = np.empty(shape[::-1] if turned else shape), 0
    along = values if values.shape[0] >= values.shape[1] else values.T
    for piece in each(RecordingError, path, values.nbytes, _pieces, path, name):
        along[at : at + len(piece)] = piece.reshape(len(piece), -1)
        at += len(piece)
    return values.T if turned else values


def _pieces(path: Path, name: str) -> Iterator[Any]:
    """Yield the numbers of a dataset along its longest axis, made the first, in whole chunks."""
    with need(path, "h5py", "MATLAB 7.3 or HDF5", "mat").File(path, "r") as file:
        node = file[name]
        axis = int(np.argmax(node.shape)) if node.shape else 0
        size, chunk = (*node.shape, 1)[axis], (node.chunks or (1, 1))[axis]
        step = max(1, _AT_ONCE * size // max(node.size, 1) // chunk) * chunk
        for k in range(0, size, step):
            piece = node[(slice(None),) * axis + (slice(k, k + step),)] if node.shape else node[()]
            yield np.moveaxis(np.atleast_1d(piece), axis, 0)


def _chunk(node: Any) -> int:
    """Return how many elements of a dataset are unpacked at once."""
    return math.prod(node.chunks or ())


def _matlab_class(node: Any) -> str:
    kind = node.attrs.get("MATLAB_class", b"")
    return kind.decode("latin-1") if isinstance(kind, bytes) else str(kind)
