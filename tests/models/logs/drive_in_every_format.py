"""One drive, written in every format that is read: the same doubles, the same clock."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

Columns = Mapping[str, np.ndarray]
# By name of a column: its unit, and the message and field that hold it in a bag.
UNITS = {
    "v_x": "m/s",
    "v_y": "m/s",
    "r": "rad/s",
    "delta_f": "rad",
    "a_y": "m/s^2",
}
FIRST_NS = 1_700_000_000_000_000_000  # of a bag: ns since 1970
MAT73_HEADER = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: then HDF5 schema 1.00 ."


def write_mat5(path: Path, t: np.ndarray, columns: Columns) -> Path:
    """Vectors and their time, as `save` writes them."""
    import scipy.io

    scipy.io.savemat(
        path, {"t": t[:, None], **{k: v[:, None] for k, v in columns.items()}}, do_compression=True
    )
    return path


def write_mat73(path: Path, tree: Mapping) -> Path:
    """Structs of vectors, as `save -v7.3` writes them: HDF5 behind a header of 512 bytes."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        _fill(file, tree)
    with path.open("r+b") as file:
        file.write(MAT73_HEADER.ljust(124) + b"\x00\x02IM")
    return path


def _fill(group, tree: Mapping) -> None:
    for name, value in tree.items():
        if isinstance(value, Mapping):
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            _fill(inner, value)
        elif isinstance(value, str):
            codes = np.array([[ord(one)] for one in value], dtype="u2")
            group[name] = codes
            group[name].attrs["MATLAB_class"] = np.bytes_("char")
        elif isinstance(value, list):
            _fill_cell(group, name, value)
        else:
            array = np.atleast_2d(np.asarray(value))
            group[name] = array if np.asarray(value).ndim == 1 else array.T
            group[name].attrs["MATLAB_class"] = np.bytes_(
                {"float64": "double", "float32": "single"}.get(array.dtype.name, array.dtype.name)
            )


def _fill_cell(group, name: str, cells: list) -> None:
    """A cell array: references to what lies in #refs#."""
    import h5py

    refs = group.file.require_group("#refs#")
    first = len(refs)
    names = [f"{first + k}" for k in range(len(cells))]
    _fill(refs, dict(zip(names, cells, strict=True)))
    group.create_dataset(name, (len(cells), 1), dtype=h5py.ref_dtype)
    for k, one in enumerate(names):
        group[name][k, 0] = refs[one].ref
    group[name].attrs["MATLAB_class"] = np.bytes_("cell")


def write_mdf(path: Path, t: np.ndarray, columns: Columns, version: str = "4.10") -> Path:
    """One group of channels."""
    from asammdf import MDF, Signal

    with MDF(version=version) as file:
        file.append(
            [Signal(v, t, name=k, unit=UNITS.get(k, "")) for k, v in columns.items()],
            comment="drive",
            common_timebase=True,
        )
        file.save(path, overwrite=True, compression=2 if version >= "4" else 0)
    return path
