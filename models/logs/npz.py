"""Arrays that NumPy saved, .npz of several or .npy of one, as a tree; nothing in them is run."""

import math
import zipfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from codegen.arrays import Array
from models.logs.grouped import require_room
from models.logs.log import dense, few
from models.logs.tree import Leaf, Tree, Unread

_LONGEST_TEXTS = 1_000_000  # bytes of names of columns


def read_tree(path: Path) -> dict[str, Tree]:
    """Return the arrays of a file; numbers are read when they are asked for.

    The fields of a lone array are arrays themselves.
    """
    names = {"": "data"}
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as file:
            members = [one for one in file.infolist() if one.filename.endswith(".npy")]
        few(path, len(members), "columns", "arrays")
        names = {one.filename: one.filename.removesuffix(".npy") for one in members}
        for one in members:
            dense(path, one.file_size, one.compress_size, names[one.filename])
    found: dict[str, Tree] = {}
    for member, name in names.items():
        tree = _tree(path, member)
        found |= tree if isinstance(tree, dict) and name == "data" else {name: tree}
    return found


def _tree(path: Path, member: str) -> Tree:
    with _opened(path, member) as file:
        version = npy.read_magic(file)
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = read(file)
    size = math.prod(shape)
    require_room(path, size, dtype.itemsize)
    if dtype.names:
        return {name: _leaf(path, member, shape, dtype[name], name) for name in dtype.names}
    if dtype.kind in "US" and size * dtype.itemsize <= _LONGEST_TEXTS:
        words: list[Tree] = np.ravel(_load(path, member)).astype(str).tolist()
        return words if shape else words[0]
    return _leaf(path, member, shape, dtype, "")


def _leaf(path: Path, member: str, shape: tuple[int, ...], dtype: Any, field: str) -> Tree:
    if (other := dtype.kind not in "iufbmM") or len(shape) > 2:
        return Unread("no numbers" if other else f"{len(shape)} dimensions")
    rows, width = (*shape, 1, 1)[:2]
    return Leaf(shape=(rows, width), load=partial(_numbers, path, member, field, (rows, width)))


def _numbers(path: Path, member: str, field: str, shape: tuple[int, int]) -> Array:
    found = _load(path, member)
    found = found[field] if field else found
    if found.dtype.kind in "mM":  # of the calendar, or a duration
        found = found.astype(f"{found.dtype.kind}8[ns]").astype(np.int64) / 1e9
    return np.asarray(found.reshape(shape), dtype=np.float64)


def _load(path: Path, member: str) -> Any:
    with _opened(path, member) as file:
        return npy.read_array(file, allow_pickle=False)


def _opened(path: Path, member: str) -> Any:
    return zipfile.ZipFile(path).open(member) if member else path.open("rb")
