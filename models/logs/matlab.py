"""Files of arrays: MATLAB 5 to 7, 7.3 (which is HDF5) and other HDF5 by h5py, and NumPy's."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from codegen.arrays import Array
from models.logs import hdf5, mat5, npz
from models.logs.foreign import one_line
from models.logs.grouped import GroupedLog, Samples, noted
from models.logs.log import Listed, RecordingError
from models.logs.magic import HEAD as HEAD_OF_FILE
from models.logs.magic import MATLAB, is_hdf5, is_mat5, is_numpy
from models.logs.stamps import find_clock, typical_rate
from models.logs.tree import HEAD, Clock, Signal, line_of, signals_of, times_of
from models.logs.units import PER_SECOND

_REMEDY = (
    "save vectors and their time, for example s = struct('t', x.Time, 'v', x.Data); "
    "save('log.mat', '-struct', 's'); or --rate HZ gives the samples per second"
)


def open_(path: Path, rate: float = 0.0) -> GroupedLog[Signal]:
    """List the channels of a file.
    rate : of vectors without a time beside them [Hz]; 0 takes that which the file tells.
    """
    with path.open("rb") as file:
        head = file.read(HEAD_OF_FILE)
    if not (is_hdf5(head) or is_mat5(head) or is_numpy(head)):
        raise RecordingError(
            f"{path}: is not a MATLAB file of version 5, 6, 7 or 7.3; save it with save(..., '-v7')"
        )
    of_matlab = head.startswith(MATLAB)
    format = "MATLAB" if not is_hdf5(head) else "MATLAB 7.3" if of_matlab else "HDF5"
    format = "NumPy" if is_numpy(head) else format
    what = f"{'an' if format == 'HDF5' else 'a'} {format} file"
    with one_line(path, what):
        read_tree = {"MATLAB": mat5.read_tree, "NumPy": npz.read_tree}.get(format, hdf5.read_tree)
        found = signals_of(read_tree(path), rate)
        said = (
            *found.said,
            *noted("not read", found.unread),
            *noted("there is no vector t or time of the same length for", found.clockless),
        )
        per_second, rates = dict[Clock, float](), dict[Clock, float]()
        for clock in dict.fromkeys(one.clock for one in found.signals):
            t = times_of(clock)
            cells = [repr(one) for one in t[:HEAD].tolist()]
            known = find_clock(["t"], [clock.unit], {0: cells}.__getitem__)
            per_second[clock] = PER_SECOND[known.unit] if known is not None else 1.0
            rates[clock] = typical_rate(t / per_second[clock])
    channels = []
    for one in found.signals:
        struct, rate = one.clock.name.rpartition(".")[0] or "top", rates[one.clock]
        listed = Listed(one.name, one.unit, one.samples, rate)
        channels.append((struct, listed, one))
    return GroupedLog(
        path,
        format,
        what,
        "sample",
        channels,
        said,
        partial(_samples, per_second),
        "signal with a time",
        _REMEDY if said else f"there is no vector of numbers; {_REMEDY}",
    )


def _samples(
    per_second: Mapping[Clock, float], requested: Sequence[tuple[Listed, Signal]]
) -> list[Samples]:
    """Read signals; those of one matrix together, and the matrix is not kept.

    Clocks of the calendar keep their seconds since 1970.
    """
    together: dict[int, list[tuple[Listed, Signal]]] = {}
    for one in requested:
        together.setdefault(id(one[1].leaf), []).append(one)
    found: dict[Clock, dict[str, Array]] = {}
    for some in together.values():
        leaf = some[0][1].leaf
        values = leaf.load()
        for listed, signal in some:
            found.setdefault(signal.clock, {})[listed.name] = line_of(values, signal)
    return [
        Samples(clock.name, times_of(clock) / per_second[clock], values)
        for clock, values in found.items()
    ]
