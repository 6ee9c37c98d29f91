"""From a log file to a Recording: one run, rising time, finite values, uniform grid, physics."""

import csv
import difflib
import io
import math
import sys
from array import array
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from models.logs.log import RecordingError
from models.recordings.checks import check_physics
from models.recordings.record import LARGEST, MINIMUM_SAMPLES, Recording, resample
from models.schema import (
    LONGEST_NAME,
    limits,
    read_bytes,
    require_few,
    require_file,
    shown,
    unpack,
)

# Read the numeric columns of a log file: CSV, gzipped CSV or Parquet.

NEEDED = ("t", "vx", "vy", "r", "delta_f")
OPTIONAL = ("delta_r", "ay", "Fyf", "Fyr")
RUN = "run"
# Forces that were computed backwards from the motion stand in where none were measured.
INVERSE = {"Fyf_inv": "Fyf", "Fyr_inv": "Fyr"}
NO_NAMES: Mapping[str, str] = {}
ENDINGS = (".csv", ".csv.gz", ".parquet")
ALIASES = {
    "t": ("time", "timestamp", "time_s", "sec"),
    "vx": ("v_x", "u", "speed", "velocity_x", "vel_x", "v"),
    "vy": ("v_y", "velocity_y", "vel_y"),
    "r": ("yaw_rate", "yawrate", "yaw rate", "psi_dot", "psidot", "omega_z", "wz", "gyro_z"),
    "delta_f": ("delta", "steer", "steering", "steering_angle", "delta_front", "steer_angle"),
}


class Table(NamedTuple):
    """Columns of a log as written, with the line (CSV) or row (Parquet) of every sample.

    columns: name -> (n,) float64, NaN for an empty cell; run: (n,) strings or None; row: (n,).
    """

    columns: dict[str, Array]
    run: NDArray[Any] | None
    row: NDArray[np.int64]
    unit: str


def read_table(path: Path, only_runs: bool = False, columns: Mapping[str, str] = NO_NAMES) -> Table:
    """Read the columns a recording needs; others are ignored.

    Parameters
    ----------
    path : a .csv, .csv.gz or .parquet file with a header.
    only_runs : read the run column alone.
    columns : by our name of a column, the name that it has in this file, where they differ.

    Raises
    ------
    RecordingError
        If the file cannot be read, or a column is missing, doubled or not numeric.
    """
    if path.is_dir() or not path.exists():
        raise RecordingError(f"{path}: there is no such file")
    name = path.name.lower()
    if not name.endswith(ENDINGS):
        raise RecordingError(f"{path}: the name must end in one of {', '.join(ENDINGS)}")
    if name.endswith(".parquet"):
        return _read_parquet(path, only_runs, columns)
    return _read_csv(path, only_runs, columns)


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
    values = {key: _array(name, key, arrays[ours[key]]) for key in _choose(name, list(ours), False)}
    sizes = {key: value.size for key, value in values.items()}
    run = None
    if RUN in ours:
        run = np.array([str(word) for word in arrays[ours[RUN]].tolist()], dtype=object)
    if run is not None:
        sizes[RUN] = run.size
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


def _read_csv(path: Path, only_runs: bool, columns_named: Mapping[str, str]) -> Table:
    """Read a CSV, plain or gzipped, line by line; columns that nobody asks for are not kept."""
    reader = csv.reader(io.TextIOWrapper(io.BytesIO(_text(path)), "utf-8-sig", newline=""))
    most = limits().samples
    lines: list[int] = []
    runs: list[str] = []
    try:
        header = [cell.strip() for cell in next(reader, [])]
        require_few(RecordingError, str(path), len(header), "columns", "columns")
        header = _standard_names(path, header, columns_named)
        names = _choose(path, header, only_runs)
        places = [header.index(name) for name in names]
        columns = [array("d") for _ in names]
        run = header.index(RUN) if RUN in header else None
        for cells in reader:
            if not cells:
                continue
            line = reader.line_num
            if len(cells) != len(header):
                raise RecordingError(
                    f"{path}: line {line} has {len(cells)} cells, the header has {len(header)}; "
                    "was the file cut off?"
                )
            if len(lines) >= most:
                require_few(RecordingError, str(path), len(lines) + 1, "samples", "rows")
            lines.append(line)
            for name, place, column in zip(names, places, columns, strict=True):
                column.append(_number(path, name, cells[place], line))
            if run is not None:
                runs.append(_run_name(path, cells[run], line))
    except csv.Error as error:
        raise RecordingError(f"{path}: line {reader.line_num} is not CSV ({error})") from None
    if not lines:
        raise RecordingError(f"{path}: there is a header but no row of data")
    return Table(
        {name: np.array(column) for name, column in zip(names, columns, strict=True)},
        None if run is None else np.array(runs, dtype=object),
        np.array(lines),
        "line",
    )


def _text(path: Path) -> bytes:
    """Read and decompress a file, which holds text in UTF-8."""
    data = read_bytes(path, RecordingError, limit="megabytes")
    zipped = data.startswith(b"\x1f\x8b")
    if path.name.lower().endswith(".gz"):
        if not zipped:
            raise RecordingError(f"{path}: is not gzip, although its name ends in .gz")
        data = unpack(path, data, RecordingError, limit="megabytes")
    elif zipped:
        raise RecordingError(f"{path}: is gzip, rename it to end in .csv.gz")
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"{path}: is not a text file in UTF-8 (byte {error.start}); a recording is CSV"
        ) from None
    if b"\0" in data:
        raise RecordingError(f"{path}: is a binary file (it has NUL bytes); a recording is CSV")
    if not data.strip():
        raise RecordingError(f"{path}: is empty")
    return data


def _read_parquet(path: Path, only_runs: bool, columns_named: Mapping[str, str]) -> Table:
    """Read a Parquet file."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise RecordingError(
            f"{path}: reading Parquet needs pyarrow: pip install tireid[parquet]"
        ) from None
    require_file(path, RecordingError, limit="megabytes")
    try:
        with pyarrow.parquet.ParquetFile(path) as file:
            _require_small(path, file.metadata)
            found = list(file.schema_arrow.names)
            header = _standard_names(path, found, columns_named)
            names = _choose(path, header, only_runs)
            known = names + [RUN] * (RUN in header)
            data: Any = file.read(columns=[found[header.index(name)] for name in known])
            data = data.rename_columns(known)
    except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise RecordingError(f"{path}: is not a Parquet file ({reason})") from None
    if data.num_rows == 0:
        raise RecordingError(f"{path}: has columns but no row of data")
    row = np.arange(1, data.num_rows + 1)
    columns = {}
    for name in names:
        kind = data.schema.field(name).type
        if not (pyarrow.types.is_floating(kind) or pyarrow.types.is_integer(kind)):
            raise RecordingError(f"{path}: {name} must be numeric, its type is {kind}")
        values = data.column(name).cast(pyarrow.float64(), safe=False)
        columns[name] = np.array(values.to_numpy(), dtype=np.float64)
    run = None
    if RUN in header:
        cells = data.column(RUN).to_pylist()
        names_of_runs = [_run_name(path, str(cell), k) for k, cell in enumerate(cells, start=1)]
        run = np.array(names_of_runs, dtype=object)
    return Table(columns, run, row, "row")


def _require_small(path: Path, about: Any) -> None:
    """Refuse a Parquet file that unpacks to more than is allowed, by what it says of itself."""
    require_few(RecordingError, str(path), about.num_columns, "columns", "columns")
    require_few(RecordingError, str(path), about.num_rows, "samples", "rows")
    size = sum(about.row_group(k).total_byte_size for k in range(about.num_row_groups))
    require_few(RecordingError, str(path), size / 1e6, "megabytes", "megabytes")


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


def _choose(path: str | Path, header: list[str], only_runs: bool) -> list[str]:
    """Check the header and return the numeric columns to read."""
    known = (*NEEDED, *OPTIONAL, RUN)
    doubled = [name for name in known if header.count(name) > 1]
    if doubled:
        raise RecordingError(f"{path}: column {', '.join(doubled)} appears more than once")
    if only_runs:
        return []
    missing = [name for name in NEEDED if name not in header]
    if missing:
        only = header[0] if len(header) == 1 else ""
        if ";" in only or "\t" in only:
            raise RecordingError(f"{path}: cells must be separated by commas, found {only[:40]!r}")
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


def _number(path: Path, name: str, cell: str, line: int) -> float:
    """Convert a cell; an empty one is NaN."""
    try:
        if "_" not in cell:  # which Python takes for a mark between digits
            return float(cell) if cell else math.nan
    except ValueError:
        if not cell.strip():
            return math.nan
    raise RecordingError(f"{path}: {name} must be numeric, line {line} has {shown(cell)}")


def _run_name(path: Path, cell: str, line: int) -> str:
    name = sys.intern(cell.strip())  # the same in every row
    if len(name) > LONGEST_NAME:
        raise RecordingError(
            f"{path}: run must be at most {LONGEST_NAME} characters, line {line} has {shown(name)}"
        )
    return name


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
    table = read_table(path, columns=columns)
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
    run = read_table(Path(path), only_runs=True).run
    return [] if run is None else list(dict.fromkeys(run.tolist()))


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
    names = list(dict.fromkeys(table.run.tolist()))
    if run is None and len(names) > 1:
        raise RecordingError(f"{path}: name one of its runs: {_some(names)}")
    if run is not None and run not in names:
        raise RecordingError(f"{path}: there is no run {shown(run)}, the runs are: {_some(names)}")
    run = names[0] if run is None else run
    keep = table.run == run
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
        k = back[0]
        raise RecordingError(
            f"{label}: t must increase, {table.unit} {table.row[k + 1]} has {t[k + 1]:.9g} after "
            f"{t[k]:.9g}; several runs in one file need a column run"
        )
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
