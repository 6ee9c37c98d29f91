"""What commands read: recordings that are judged against physics and the vehicle."""

from collections.abc import Sequence

from models.recordings import (
    Recording,
    check_against_vehicle,
    read_recording,
    split_log_argument,
)
from models.vehicle import Vehicle
from tireid.progress import say


def read_log(
    log: str,
    vehicle: Vehicle,
    *,
    run_name: str | None = None,
    columns: Sequence[str] = (),
    check: bool = True,
    dt: float = 0.01,
) -> Recording:
    """Read a recording and say what was read.

    Parameters
    ----------
    log : path, or path:run.
    vehicle : the car that is said to have driven.
    run_name : run of the file, if `log` does not name it.
    columns : NAME=COLUMN, each a column of the file to be read as NAME.
    check : whether a log that contradicts physics or the vehicle is refused.
    dt : sampling interval that it is brought to [s].

    Raises
    ------
    ValueError
        One line, where the words or the file are not right.
    """
    path, named = split_log_argument(log)
    if named is not None and run_name is not None and named != run_name:
        raise ValueError(f"{log} names the run {named}, --run names {run_name}: name one of them")
    recording = read_recording(
        path, run=run_name or named, dt=dt, check=check, columns=column_names(columns)
    )
    if check:
        check_against_vehicle(recording, vehicle)
    say(f"read {recording.name}: {recording.t.size} samples, {recording.duration:.1f} s")
    return recording


def column_names(pairs: Sequence[str]) -> dict[str, str]:
    """Return the columns of a file by the name that they are read as.

    Parameters
    ----------
    pairs : NAME=COLUMN.

    Raises
    ------
    ValueError
        Where a word is not such a pair.
    """
    columns = {}
    for pair in pairs:
        name, equals, column = pair.partition("=")
        if not (name and equals and column):
            raise ValueError(f"--columns wants NAME=COLUMN, not {pair!r}")
        columns[name] = column
    return columns
