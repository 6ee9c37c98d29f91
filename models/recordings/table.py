"""Read the numeric columns of a log file: CSV, gzipped CSV or Parquet."""

import csv
import difflib
import gzip
import io
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.recordings.record import Array, RecordingError

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
    run: NDArray[np.str_] | None
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
    if not path.is_file():
        raise RecordingError(f"{path}: there is no such file")
    name = path.name.lower()
    if not name.endswith(ENDINGS):
        raise RecordingError(f"{path}: the name must end in one of {', '.join(ENDINGS)}")
    if name.endswith(".parquet"):
        return _read_parquet(path, only_runs, columns)
    return _read_csv(path, only_runs, columns)


def _read_csv(path: Path, only_runs: bool, columns_named: Mapping[str, str]) -> Table:
    """Read a CSV, plain or gzipped."""
    reader = csv.reader(io.StringIO(_text(path), newline=""))
    rows: list[list[str]] = []
    lines: list[int] = []
    try:
        header = [cell.strip() for cell in next(reader, [])]
        for cells in reader:
            if cells:
                rows.append(cells)
                lines.append(reader.line_num)
    except csv.Error as error:
        raise RecordingError(f"{path}: line {reader.line_num} is not CSV ({error})") from None
    header = _standard_names(path, header, columns_named)
    names = _choose(path, header, only_runs)
    if not rows:
        raise RecordingError(f"{path}: there is a header but no row of data")
    for cells, line in zip(rows, lines, strict=True):
        if len(cells) != len(header):
            raise RecordingError(
                f"{path}: line {line} has {len(cells)} cells, the header has {len(header)}; "
                "was the file cut off?"
            )
    cells_of = dict(zip(header, zip(*rows, strict=True), strict=True))
    columns = {name: _numbers(path, name, cells_of[name], lines) for name in names}
    run = np.array([cell.strip() for cell in cells_of[RUN]]) if RUN in header else None
    return Table(columns, run, np.array(lines), "line")


def _text(path: Path) -> str:
    """Read, decompress and decode a file."""
    data = path.read_bytes()
    zipped = data.startswith(b"\x1f\x8b")
    if path.name.lower().endswith(".gz"):
        if not zipped:
            raise RecordingError(f"{path}: is not gzip, although its name ends in .gz")
        try:
            data = gzip.decompress(data)
        except (OSError, EOFError, zlib.error) as error:
            raise RecordingError(f"{path}: gzip data are damaged or cut off ({error})") from None
    elif zipped:
        raise RecordingError(f"{path}: is gzip, rename it to end in .csv.gz")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"{path}: is not a text file in UTF-8 (byte {error.start}); a recording is CSV"
        ) from None
    if "\0" in text:
        raise RecordingError(f"{path}: is a binary file (it has NUL bytes); a recording is CSV")
    if not text.strip():
        raise RecordingError(f"{path}: is empty")
    return text


def _read_parquet(path: Path, only_runs: bool, columns_named: Mapping[str, str]) -> Table:
    """Read a Parquet file."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise RecordingError(
            f"{path}: reading Parquet needs pyarrow: pip install tireid[parquet]"
        ) from None
    try:
        with pyarrow.parquet.ParquetFile(path) as file:
            found = list(file.schema_arrow.names)
            header = _standard_names(path, found, columns_named)
            names = _choose(path, header, only_runs)
            wanted = names + [RUN] * (RUN in header)
            data: Any = file.read(columns=[found[header.index(name)] for name in wanted])
            data = data.rename_columns(wanted)
    except (pyarrow.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0]
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
        run = np.array([str(value) for value in data.column(RUN).to_pylist()])
    return Table(columns, run, row, "row")


def _standard_names(path: Path, header: list[str], columns: Mapping[str, str]) -> list[str]:
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


def _choose(path: Path, header: list[str], only_runs: bool) -> list[str]:
    """Check the header and return the numeric columns to read."""
    wanted = (*NEEDED, *OPTIONAL, RUN)
    doubled = [name for name in wanted if header.count(name) > 1]
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
        seen = ", ".join(header[:12]) + (", ..." if len(header) > 12 else "")
        raise RecordingError(
            f"{path}: column {', '.join(missing)} is missing; "
            + (f"did you mean {', '.join(hints)}? rename it; " if hints else "")
            + f"columns found: {seen[:200]!r}"
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


def _numbers(path: Path, name: str, cells: tuple[str, ...], lines: list[int]) -> Array:
    """Convert the cells of a column; an empty cell is NaN."""
    try:
        return np.array([float(cell or "nan") for cell in cells])
    except ValueError:
        pass
    values = np.empty(len(cells))
    for k, cell in enumerate(cells):
        try:
            values[k] = float(cell.strip() or "nan")
        except ValueError:
            raise RecordingError(
                f"{path}: {name} must be numeric, line {lines[k]} has {cell[:30]!r}"
            ) from None
    return values
