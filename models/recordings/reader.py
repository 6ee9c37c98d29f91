"""From a log file to a Recording: one run, rising time, finite values, uniform grid, physics."""

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from models.logs.door import ENDINGS, open_log
from models.logs.log import RecordingError
from models.logs.stamps import not_rising
from models.logs.table import RUN, Kind, TableLog, Words
from models.recordings.checks import check_physics
from models.recordings.record import LARGEST, MINIMUM_SAMPLES, Recording, resample
from models.schema import require_few, shown

# Read the numeric columns of a log.

NEEDED = ("t", "vx", "vy", "r", "delta_f")
OPTIONAL = ("delta_r", "ay", "Fyf", "Fyr")
# Forces that were computed backwards from the motion stand in where none were measured.
INVERSE = {"Fyf_inv": "Fyf", "Fyr_inv": "Fyr"}
NO_NAMES: Mapping[str, str] = {}
ALIASES = {
    "t": ("time", "timestamp", "time_s", "sec"),
    "vx": ("v_x", "u", "speed", "velocity_x", "vel_x", "v"),
    "vy": ("v_y", "velocity_y", "vel_y"),
    "r": ("yaw_rate", "yawrate", "yaw rate", "psi_dot", "psidot", "omega_z", "wz", "gyro_z"),
    "delta_f": ("delta", "steer", "steering", "steering_angle", "delta_front", "steer_angle"),
}


class Table(NamedTuple):
    """Columns of a log as written, with the line (CSV) or row (Parquet) of every sample.

    columns: name -> (n,) float64, NaN for an empty cell; run: which each row is of, or None, and
    all that there are; row: (n,).
    """

    columns: dict[str, Array]
    run: Words | None
    row: NDArray[np.int64]
    unit: str


def read_table(path: Path, columns: Mapping[str, str] = NO_NAMES, run: str | None = None) -> Table:
    """Read the columns a recording needs; others are ignored.

    Parameters
    ----------
    path : a log with a header.
    columns : by our name of a column, the name that it has in this file, where they differ.
    run : name of the run to read; None reads all.

    Raises
    ------
    RecordingError
        If the file cannot be read, or a column is missing, doubled or not numeric.
    """
    log = open_log(path)
    if not isinstance(log, TableLog):
        raise RecordingError(f"{path}: {log.format} needs a map of its channels")
    table = log.table
    header = _standard_names(path, list(table.names), columns)
    names = _choose(path, header)
    kinds = {header.index(name): Kind.NUMBER for name in names}
    if RUN in header:
        kinds[header.index(RUN)] = Kind.WORD
    place = (header.index(RUN), run) if RUN in header and run is not None else None
    cells = table.cells(kinds, place)
    words = cells.words[header.index(RUN)] if RUN in header else None
    return Table(
        {name: cells.columns[header.index(name)] for name in names},
        words,
        cells.rows,
        table.place,
    )


def table_of_arrays(name: str, data: Any, columns: Mapping[str, str] = NO_NAMES) -> Table:
    """Return the columns that a recording needs of arrays in memory; others are ignored.

    Parameters
    ----------
    name : of the data, for messages.
    data : a data frame or a mapping, by column: what `data[column]` is has one axis.
    columns : by our name of a column, the name that it has in `data`, where they differ.

    Raises
    ------
    RecordingError
        If there are no columns, one is missing or not numeric, or their lengths differ.
    """
    found = getattr(data, "columns", data)  # of a data frame; a mapping yields its keys
    try:
        header = [str(column) for column in found]
        arrays = dict(zip(header, (np.asarray(data[column]) for column in found), strict=True))
    except (TypeError, KeyError, IndexError):
        raise RecordingError(
            f"{name}: a data frame or a mapping of arrays is needed, not {type(data).__name__}"
        ) from None
    ours = dict(zip(_standard_names(name, header, columns), header, strict=True))
    values = {key: _array(name, key, arrays[ours[key]]) for key in _choose(name, list(ours))}
    sizes = {key: value.size for key, value in values.items()}
    run = None
    if RUN in ours:
        run = Words.of([str(word) for word in arrays[ours[RUN]].tolist()])
        sizes[RUN] = run.codes.size
    if len(set(sizes.values())) > 1:
        raise RecordingError(f"{name}: columns must have one length, they have {sizes}")
    return Table(values, run, np.arange(values["t"].size), "index")


def _array(name: str, column: str, value: NDArray[Any]) -> Array:
    """Return one column as numbers."""
    if value.ndim != 1:
        raise RecordingError(f"{name}: {column} must have one axis, its shape is {value.shape}")
    try:
        if value.dtype.kind in "MmSU":  # a time of the calendar, or words, is no number of ours
            raise TypeError
        return value.astype(np.float64)
    except (TypeError, ValueError):
        raise RecordingError(
            f"{name}: {column} must be numeric, its type is {value.dtype}"
        ) from None


def _standard_names(path: str | Path, header: list[str], columns: Mapping[str, str]) -> list[str]:
    """Return the header with our names for the columns that the file calls otherwise."""
    known = (*NEEDED, *OPTIONAL, RUN)
    renamed = list(header)
    for name, in_file in columns.items():
        if name not in known:
            raise RecordingError(f"{path}: {name!r} is no column of ours: {', '.join(known)}")
        if in_file not in header:
            raise RecordingError(f"{path}: there is no column {in_file!r} to read as {name}")
        renamed = [f"{old} (not read)" if old == name else old for old in renamed]
        renamed[header.index(in_file)] = name
    if not {"Fyf", "Fyr"} & set(renamed):
        renamed = [INVERSE.get(name, name) for name in renamed]
    return renamed


def _choose(path: str | Path, header: list[str]) -> list[str]:
    """Check the header and return the numeric columns to read."""
    known = (*NEEDED, *OPTIONAL, RUN)
    doubled = [name for name in known if header.count(name) > 1]
    if doubled:
        raise RecordingError(f"{path}: column {', '.join(doubled)} appears more than once")
    missing = [name for name in NEEDED if name not in header]
    if missing:
        hints = [f"{found!r} for {name}" for name in missing if (found := _similar(name, header))]
        listing = ", ".join(header[:12]) + (", ..." if len(header) > 12 else "")
        raise RecordingError(
            f"{path}: column {', '.join(missing)} is missing; "
            + (f"did you mean {', '.join(hints)}? rename it; " if hints else "")
            + f"columns found: {listing[:200]!r}"
        )
    if ("Fyf" in header) != ("Fyr" in header):
        lonely = "Fyf" if "Fyf" in header else "Fyr"
        raise RecordingError(
            f"{path}: {lonely} needs its partner, give both Fyf and Fyr or neither"
        )
    return [name for name in (*NEEDED, *OPTIONAL) if name in header]


def _similar(name: str, header: list[str]) -> str | None:
    """Find a column that may have been meant."""
    lower = {column.lower(): column for column in reversed(header) if column not in NEEDED}
    for alias in (name, *ALIASES[name]):
        for column in lower:
            if column == alias or column.split("[")[0].split("(")[0].strip() == alias:
                return lower[column]
    close = difflib.get_close_matches(name, list(lower), n=1, cutoff=0.75)
    return lower[close[0]] if close else None


FIELDS = {"vx": "v_x", "vy": "v_y", "ay": "a_y", "Fyf": "axle_force", "Fyr": "axle_force"}
SOME = 30  # names in a message
LONGEST_GAP = 0.1  # [s]: a car can build up or lose all its lateral force meanwhile


def read_recording(
    path: str | Path,
    run: str | None = None,
    dt: float = 0.01,
    *,
    check: bool = True,
    columns: Mapping[str, str] = NO_NAMES,
) -> Recording:
    """Read one run of a log and bring it to a uniform sample time.

    Columns, SI and ISO axes: t [s], vx, vy [m/s], r [rad/s], delta_f [rad]; if present also
    delta_r [rad] (else 0), ay [m/s^2], Fyf and Fyr [N], run (text). Others are ignored. Where
    there are no Fyf and Fyr, the columns Fyf_inv and Fyr_inv (forces computed backwards from the
    motion) stand in for them.

    Parameters
    ----------
    path : a .csv, .csv.gz or .parquet file.
    run : name of the run; may be left out when the file has only one.
    dt : sample time T_s of the result [s].
    check : whether to judge signs, axes and units by physics; turn it off for a log that is right
        and refused all the same.
    columns : by our name of a column, the name that it has in this file, where they differ.

    Returns
    -------
    Recording
        Named "FILE:RUN", or "FILE" when there is no run column.

    Raises
    ------
    RecordingError
        One line: file and run, column, rule, value, remedy.
    """
    path = Path(path)
    _require_positive(str(path), dt)
    table = read_table(path, columns=columns, run=run)
    return recording_from_table(str(path), _stem(path), table, run=run, dt=dt, check=check)


def recording_from_table(
    source: str, name: str, table: Table, *, run: str | None, dt: float, check: bool
) -> Recording:
    """Return one run of a table, judged and brought to a uniform sample time.

    Parameters
    ----------
    source : where the table is from, for messages.
    name : of the recording, without its run.
    table : columns as they came.
    run : name of the run; None where there is only one.
    dt : sample time T_s of the result [s].
    check : whether to judge signs, axes and units by physics.

    Raises
    ------
    RecordingError
        One line: source and run, column, rule, value, remedy.
    """
    _require_positive(source, dt)
    table, run = _one_run(source, table, run)
    label = source if run is None else f"{source}:{run}"
    _check_values(label, table)
    _check_time(label, table)
    steps = (table.columns["t"][-1] - table.columns["t"][0]) / dt
    require_few(RecordingError, label, steps, "samples", f"steps of {dt:g} s")
    signals = dict(table.columns)
    t, signals = resample(signals.pop("t"), signals, dt)
    if t.size < MINIMUM_SAMPLES:
        raise RecordingError(
            f"{label}: the run lasts {t[-1] - t[0]:.4g} s, at least {MINIMUM_SAMPLES} steps of "
            f"{dt:g} s are needed"
        )
    force = np.column_stack([signals["Fyf"], signals["Fyr"]]) if "Fyf" in signals else None
    recording = Recording(
        name=name if run is None else f"{name}:{run}",
        t=t,
        v_x=signals["vx"],
        v_y=signals["vy"],
        r=signals["r"],
        delta_f=signals["delta_f"],
        delta_r=signals.get("delta_r", np.zeros(t.size)),
        a_y=signals.get("ay"),
        axle_force=force,
    )
    if check:
        try:
            check_physics(recording)
        except RecordingError as error:
            raise RecordingError(label + str(error).removeprefix(recording.name)) from None
    return recording


def runs(path: str | Path) -> list[str]:
    """List the runs of a log in their order; empty when it has no run column.

    Parameters
    ----------
    path : a .csv, .csv.gz or .parquet file.
    """
    return list(open_log(path).runs())


def split_log_argument(argument: str) -> tuple[Path, str | None]:
    r"""Split "LOG:RUN" into file and run; a colon inside the path or after a drive stays.

    The whole argument wins when a file has that name. Else the split is after ".csv", ".csv.gz"
    or ".parquet" and a colon, so that runs and folders may hold colons too.

    Parameters
    ----------
    argument : what was typed, for example "log.csv.gz:lap2" or "C:\logs\log.csv:lap2".
    """
    if Path(argument).is_file():
        return Path(argument), None
    splits = [k for k, letter in enumerate(argument) if letter == ":" and k != 1]
    for k in splits:
        if argument[:k].lower().endswith(ENDINGS) and argument[k + 1 :]:
            return Path(argument[:k]), argument[k + 1 :]
    return Path(argument), None


def _require_positive(source: str, dt: float) -> None:
    if not (np.isfinite(dt) and dt > 0.0):
        raise RecordingError(f"{source}: the sample time dt must be positive, it is {dt}")


def _stem(path: Path) -> str:
    """File name without folder and known endings."""
    for ending in sorted(ENDINGS, key=len, reverse=True):
        if path.name.lower().endswith(ending):
            return path.name[: -len(ending)]
    return path.name


def _one_run(path: str, table: Table, run: str | None) -> tuple[Table, str | None]:
    """Keep the rows of the named run, or of the only one."""
    if table.run is None:
        if run is not None:
            raise RecordingError(f"{path}: there is no column run, so no run {run!r}; leave it out")
        return table, None
    names, codes = table.run
    if run is None and len(names) > 1:
        raise RecordingError(f"{path}: name one of its runs: {_some(names)}")
    if run is not None and run not in names:
        raise RecordingError(f"{path}: there is no run {shown(run)}, the runs are: {_some(names)}")
    run = names[0] if run is None else run
    keep = codes == names.index(run)
    if keep.all():  # as it was read: nothing is copied
        return table, run
    columns = {name: value[keep] for name, value in table.columns.items()}
    return Table(columns, None, table.row[keep], table.unit), run


def _some(names: list[str]) -> str:
    """Return names, or the first of many."""
    return ", ".join(names[:SOME]) + (f", ... ({len(names)})" if len(names) > SOME else "")


def _check_values(label: str, table: Table) -> None:
    """Refuse NaN, infinity, empty cells, and sizes that no computation is asked to bear."""
    for name, value in table.columns.items():
        bad = np.flatnonzero(~np.isfinite(value))
        if bad.size:
            raise RecordingError(
                f"{label}: {name} must be finite, {bad.size} of {value.size} values are empty, NaN "
                f"or infinite, the first in {table.unit} {table.row[bad[0]]}; fill or cut them out"
            )
        most = LARGEST[FIELDS.get(name, name)]
        bad = np.flatnonzero(np.abs(value) > most)
        if bad.size:
            raise RecordingError(
                f"{label}: {name} must be of a car, within +-{most:g}, {table.unit} "
                f"{table.row[bad[0]]} has {value[bad[0]]:.4g}"
            )


def _check_time(label: str, table: Table) -> None:
    """Refuse time that does not rise, is not in seconds, is too coarse, or has gaps."""
    t: Array = table.columns["t"]
    if t.size < MINIMUM_SAMPLES:
        raise RecordingError(f"{label}: there are {t.size} rows, at least {MINIMUM_SAMPLES} needed")
    steps = np.diff(t)
    back = np.flatnonzero(~(steps > 0.0))
    if back.size:
        raise RecordingError(f"{label}: t {not_rising(t, table.row, table.unit)}")
    typical = float(np.median(steps))
    limit = LONGEST_GAP * (1.0 + 1e-6)
    if typical > limit:
        raise RecordingError(
            f"{label}: t must be in s with at least 10 samples per second, its typical step is "
            f"{typical:.6g}" + ("; milliseconds? divide by 1000" if typical >= 1.0 else "")
        )
    longest = int(np.argmax(steps))
    if steps[longest] > max(limit, 2.5 * typical):
        raise RecordingError(
            f"{label}: t has a gap of {steps[longest]:.4g} s after {t[longest]:.6g} s "
            f"({table.unit} {table.row[longest + 1]}), above {max(limit, 2.5 * typical):.3g} s; "
            "cut the log into runs there"
        )
