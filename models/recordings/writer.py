"""Write a recording as a CSV that `read_recording` reads back bit for bit."""

import csv
import gzip
import io
from pathlib import Path

import numpy as np

from models.files import write_atomically
from models.recordings.record import Recording, RecordingError


def write_recording(recording: Recording, path: str | Path) -> Path:
    """Write t [s], vx, vy [m/s], r [rad/s], delta_f, delta_r [rad], ay [m/s^2], Fyf, Fyr [N].

    Columns that the recording lacks are left out. Numbers are the shortest that read back the
    same. The file appears whole or not at all; an existing one is replaced.

    Parameters
    ----------
    recording : what to write.
    path : a name that ends in .csv or .csv.gz.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    RecordingError
        If the name ends otherwise.
    """
    path = Path(path)
    if not path.name.lower().endswith((".csv", ".csv.gz")):
        raise RecordingError(f"{path}: the name must end in .csv or .csv.gz")
    columns = {
        "t": recording.t,
        "vx": recording.v_x,
        "vy": recording.v_y,
        "r": recording.r,
        "delta_f": recording.delta_f,
        "delta_r": recording.delta_r,
    }
    if recording.a_y is not None:
        columns["ay"] = recording.a_y
    if recording.axle_force is not None:
        columns["Fyf"], columns["Fyr"] = recording.axle_force.T
    text = io.StringIO(newline="")
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    table.writerows(np.column_stack(list(columns.values())).tolist())
    data = text.getvalue().encode()
    if path.name.lower().endswith(".gz"):
        data = gzip.compress(data, mtime=0)  # without a time stamp: same recording, same bytes
    write_atomically(path, data)
    return path
