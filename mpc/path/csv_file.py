"""Read way-points from a CSV with a header: X_m, Y_m or x, y, in meters."""

import csv
import io
from pathlib import Path

import numpy as np

from models.doors import limits, read_text, require_few, shown
from mpc.path.line import Array, PathError
from mpc.path.waypoints import Waypoints

X_NAMES, Y_NAMES = ("x_m", "x", "x [m]"), ("y_m", "y", "y [m]")
ON_THE_GLOBE = {"lat", "latitude", "lon", "lng", "longitude"}


def read_waypoints(file: Path) -> Waypoints:
    """Read X and Y [m]; other columns, and lines that start with "#" below the header, are ignored.

    Parameters
    ----------
    file : the CSV; names in its header may be of either case, and the header may start with "#".

    Raises
    ------
    PathError
        Naming the file and the column, line or rule that is broken.
    """
    rows = _rows(file)
    header = [cell.strip().lstrip("#").strip() for cell in rows[0][1]]
    require_few(PathError, str(file), len(header), "columns", "columns")
    points = [(line, cells) for line, cells in rows[1:] if not cells[0].lstrip().startswith("#")]
    if not points:
        raise PathError(f"{file}: there is a header but no way-point")
    columns = []
    for axis, names in (("X", X_NAMES), ("Y", Y_NAMES)):
        column = _find(file, axis, names, header)
        columns.append(_numbers(file, header[column], column, points))
    return Waypoints(*columns)


def _rows(file: Path) -> list[tuple[int, list[str]]]:
    """Return the cells of every line that has some, with its number."""
    if not file.exists():
        raise PathError(f"{file}: there is no such file")
    try:
        text = read_text(file, PathError, limit="megabytes", encoding="utf-8-sig")
    except OSError as error:
        raise PathError(f"{file}: cannot be read ({error.strerror})") from None
    reader = csv.reader(io.StringIO(text, newline=""))
    rows, most = [], limits().samples
    try:
        for cells in reader:
            if any(map(str.strip, cells)):
                rows.append((reader.line_num, cells))
            if len(rows) > most:
                require_few(PathError, str(file), len(rows), "samples", "rows")
    except csv.Error as error:
        raise PathError(f"{file}: line {reader.line_num} is not CSV ({error})") from None
    if not rows:
        raise PathError(f"{file}: is empty")
    return rows


def _find(file: Path, axis: str, names: tuple[str, ...], header: list[str]) -> int:
    """Return the column of an axis."""
    found = [k for k, name in enumerate(header) if name.lower() in names]
    if len(found) == 1:
        return found[0]
    seen = ", ".join(header)[:120]
    if found:
        raise PathError(f"{file}: column {axis} must be there once, found {seen!r}")
    if len(header) == 1 and (";" in seen or "\t" in seen):
        raise PathError(f"{file}: cells must be separated by commas, found {seen!r}")
    lower = {name.lower() for name in header}
    hint = ""
    if lower & ON_THE_GLOBE:
        hint = "; convert latitude and longitude to meters in a plane"
    elif unit := [name for name in header if name.lower().startswith(f"{axis.lower()}_")]:
        hint = f"; {unit[0]} is not in meters, convert and rename it"
    elif all(_is_number(name) for name in header):
        hint = "; the first line must name the columns"
    raise PathError(f"{file}: column {axis}_m (or {axis.lower()}) is missing, found {seen!r}{hint}")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell  # which Python takes for a mark between digits


def _numbers(file: Path, name: str, column: int, points: list[tuple[int, list[str]]]) -> Array:
    """Convert a column."""
    values = []
    for line, cells in points:
        cell = cells[column].strip() if column < len(cells) else ""
        if not (_is_number(cell) and np.isfinite(float(cell))):
            raise PathError(
                f"{file}: {name} must be a finite number, line {line} has {shown(cell)}"
            )
        values.append(float(cell))
    return np.array(values)
