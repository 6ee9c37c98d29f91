"""MATLAB files: version 5 to 7 as they are, 7.3 (which is HDF5) and other HDF5 files by h5py."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from models.logs import hdf5, mat5
from models.logs.foreign import (
    chosen,
    noted,
    one_line,
    require_clock,
    require_room,
    typical_rate,
)
from models.logs.log import Channel, Listed, RecordingError
from models.logs.tree import Clock, Signal, line_of, signals_of, times_of

HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
HDF5_PLACES = (0, 512)  # MATLAB puts a header before
MAT5_ORDERS = (b"IM", b"MI")
REMEDY = (
    "save vectors and their time, for example s = struct('t', x.Time, 'v', x.Data); "
    "save('log.mat', '-struct', 's')"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MatlabFile:
    """A MATLAB or HDF5 file, as `LogFile` says.

    Parameters
    ----------
    path : of the file.
    format : "MATLAB", "MATLAB 7.3" or "HDF5".
    channels : as listed.
    signals : where they are.
    said : what is left out.
    """

    path: Path
    format: str
    channels: tuple[Listed, ...]
    signals: tuple[Signal, ...]
    said: tuple[str, ...]

    def listed(self) -> tuple[Listed, ...]:
        """Return the vectors that have a clock."""
        return self.channels

    def runs(self) -> tuple[str, ...]:
        """Return no names: runs that a file holds apart are channels with clocks of their own."""
        return ()

    def notes(self) -> tuple[str, ...]:
        """Return what is left out."""
        return self.said

    def read(self, names: Sequence[str], run: str | None = None) -> tuple[Channel, ...]:
        """Return channels in the order of their names.

        Parameters
        ----------
        names : as listed.
        run : None.
        """
        known = {signal.name: signal for signal in self.signals}
        asked = chosen(self.path, names, known, run)
        clocks: dict[Clock, tuple[Array, NDArray[np.int64]]] = {}
        result: dict[str, Channel] = {}
        with one_line(self.path, f"a {self.format} file"):
            # Signals of one matrix are read together, and the matrix is not kept.
            leaves = {id(signal.leaf): signal.leaf for signal in asked}
            for leaf in leaves.values():
                require_room(self.path, max(leaf.shape), 8 * min(leaf.shape))
                values = leaf.load()
                for signal in asked:
                    if signal.leaf is not leaf:
                        continue
                    if signal.clock not in clocks:
                        t = times_of(signal.clock)
                        require_clock(self.path, signal.clock.name, t, "sample")
                        clocks[signal.clock] = t, np.arange(1, t.size + 1)
                    t, rows = clocks[signal.clock]
                    result[signal.name] = Channel(
                        name=signal.name,
                        unit=signal.unit,
                        t=t,
                        values=line_of(values, signal),
                        place="sample",
                        rows=rows,
                    )
        return tuple(result[signal.name] for signal in asked)


def recognizes(head: bytes, path: Path) -> bool:
    """Whether a file is of this format.

    Parameters
    ----------
    head : its first bytes, at least 520.
    path : of the file.
    """
    return path.is_file() and (_is_hdf5(head) or _is_mat5(head))


def _is_hdf5(head: bytes) -> bool:
    return any(head[k : k + 8] == HDF5_MAGIC for k in HDF5_PLACES)


def _is_mat5(head: bytes) -> bool:
    return head[:6] == b"MATLAB" and head[126:128] in MAT5_ORDERS


def open_(path: Path) -> MatlabFile:
    """List the channels of a file.

    Parameters
    ----------
    path : of the file.

    Raises
    ------
    RecordingError
        One line, where it is no such file or holds no vector with a time.
    """
    with one_line(path, "a MATLAB file"):
        with path.open("rb") as file:
            head = file.read(520)
        if _is_hdf5(head):
            format = "MATLAB 7.3" if head[:6] == b"MATLAB" else "HDF5"
            found = signals_of(hdf5.read_tree(path))
        elif _is_mat5(head):
            format = "MATLAB"
            found = signals_of(mat5.read_tree(path))
        else:
            raise RecordingError(
                f"{path}: is not a MATLAB file of version 5, 6, 7 or 7.3; save it with "
                "save(..., '-v7')"
            )
        said = (
            *noted("not read", found.unread),
            *noted("there is no vector t or time of the same length for", found.clockless),
        )
        if not found.signals:
            why = "; ".join(said) or "there is no vector of numbers"
            raise RecordingError(f"{path}: holds no signal with a time; {why}; {REMEDY}")
        rates: dict[Clock, float] = {}
        for signal in found.signals:
            if signal.clock not in rates:
                rates[signal.clock] = typical_rate(times_of(signal.clock))
    return MatlabFile(
        path=path,
        format=format,
        channels=tuple(
            Listed(name=one.name, unit=one.unit, samples=one.samples, rate=rates[one.clock])
            for one in found.signals
        ),
        signals=found.signals,
        said=said,
    )
