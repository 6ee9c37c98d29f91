"""Mutations of recordings and paths: cells, columns, rows, time of a CSV; a .tir file by keys."""

import csv
import gzip
import io
import random
import zlib
from functools import cache
from typing import Any

from benchmarks.fuzz.hostile import number, text
from benchmarks.fuzz.raw import bytes_mutated, lines_mutated

Rows = list[list[str]]
CELLS = ("", " ", "nan", "inf", "-inf", "1e308", "-1e308", "1e999", "NULL", "#DIV/0!", "1,5", "0x1")
NAMES = ("t", "vx", "vy", "r", "delta_f", "delta_r", "ay", "Fyf", "Fyr", "run", "X_m", "Y_m", "")
UNPACKED = 32 << 20  # bytes that a mutation may look into
BOMB = 100  # members of 16 MB each


def csv_mutated(rng: random.Random, data: bytes) -> bytes:
    """Return a CSV with one thing changed.

    Parameters
    ----------
    rng : source of chance.
    data : of the file, which may be none any more.
    """
    if rng.random() < 0.15:
        return rng.choice((bytes_mutated, lines_mutated))(rng, data)
    try:
        rows = list(csv.reader(io.StringIO(data.decode(), newline="")))
    except (UnicodeDecodeError, csv.Error):
        return bytes_mutated(rng, data)
    if len(rows) < 3 or not rows[0]:
        return bytes_mutated(rng, data)
    change = rng.choices(
        (_cell, _column_of_values, _scaled, _columns, _rows, _first_column, _noise),
        (4, 4, 3, 3, 2, 2, 1),
    )[0]
    changed = change(rng, rows) or rows
    written = io.StringIO(newline="")
    csv.writer(
        written, lineterminator="\n", delimiter=rng.choices((",", ";", "\t"), (50, 1, 1))[0]
    ).writerows(changed)
    return written.getvalue().encode("utf-8", "surrogatepass")


def _cell(rng: random.Random, rows: Rows) -> None:
    row = rng.choice(rows)
    if row:
        row[rng.randrange(len(row))] = rng.choice((rng.choice(CELLS), text(rng)))


def _column_of_values(rng: random.Random, rows: Rows) -> None:
    """Fill a column, from some row to some row, with one value."""
    at = rng.randrange(len(rows[0]))
    ends = sorted((rng.randrange(1, len(rows)), rng.randrange(1, len(rows))))
    first, last = rng.choice(((1, len(rows)), tuple(ends)))
    value = rng.choice((rng.choice(CELLS), repr(number(rng, 1.0))))
    for row in rows[first:last]:
        if at < len(row):
            row[at] = value


def _scaled(rng: random.Random, rows: Rows) -> None:
    """Bring a column to another unit or sign, or add a bias."""
    at = rng.randrange(len(rows[0]))
    factor = rng.choice((-1.0, 3.6, 57.3, 1e-3, 1e3, 9.81, 1e12, 1e-12, 1e300, 0.0, 0.1, 2.0))
    bias = rng.choice((0.0, 0.0, 1.0, -20.0, 1e6, 1.7e9))
    for row in rows[1:]:
        try:
            row[at] = repr(float(row[at]) * factor + bias)
        except (ValueError, IndexError):
            continue


def _columns(rng: random.Random, rows: Rows) -> None:
    """Leave out, double, swap or rename a column."""
    at, other = rng.randrange(len(rows[0])), rng.randrange(len(rows[0]))
    what = rng.randrange(5)
    if what == 0:
        rows[0][at] = rng.choice((rng.choice(NAMES), text(rng), rows[0][at].upper()))
        return
    for row in rows if what != 4 else rows[:1]:
        if max(at, other) >= len(row):
            continue
        if what == 1:
            del row[at]
        elif what == 2:
            row.insert(other, row[at])
        else:
            row[at], row[other] = row[other], row[at]


def _rows(rng: random.Random, rows: Rows) -> Rows:
    """Leave out, repeat, turn round or mix rows."""
    head, body = rows[:1], rows[1:]
    first = rng.randrange(len(body))
    last = first + rng.choice((1, 3, 30, len(body)))
    match rng.randrange(7):
        case 0:
            return head + body[:first] + body[last:]
        case 1:
            return head + body[:last] + body[first:]
        case 2:
            return head + body[::-1]
        case 3:
            rng.shuffle(body)
            return head + body
        case 4:
            return head + body[:: rng.choice((2, 7, 50))]
        case 5:
            return head + body * 40
        case _:
            return head + body[: rng.choice((0, 1, 2, 3, 5, 20))]


def _first_column(rng: random.Random, rows: Rows) -> None:
    """Distort time (or X): a step, a jump, another rate."""
    rate, jump = (
        rng.choice((1.0, 1e-6, 0.01, 1.02, 10.0, 1e3, -1.0, 0.0)),
        rng.choice((0.0, 0.0, 0.05, 5.0, -1.0, 1e9)),
    )
    since = rng.randrange(1, len(rows))
    for index, row in enumerate(rows[1:], 1):
        try:
            row[0] = repr(float(row[0]) * rate + jump * (index >= since))
        except (ValueError, IndexError):
            continue


def _noise(rng: random.Random, rows: Rows) -> None:
    """Replace a column by noise of some size: no car drives so, each number is possible."""
    at, size = rng.randrange(len(rows[0])), 10.0 ** rng.uniform(-3.0, 3.0)
    for row in rows[1:]:
        if at < len(row):
            row[at] = repr(rng.gauss(0.0, size))


def gz_mutated(rng: random.Random, data: bytes) -> bytes:
    """Return a gzipped CSV that is changed inside or outside, or a small file that is a huge one.

    Parameters
    ----------
    rng : source of chance.
    data : of the file, which may be none any more.
    """
    if rng.random() < 0.03:
        return _bomb()
    if rng.random() < 0.2:
        return bytes_mutated(rng, data)
    try:
        inside = gzip.GzipFile(fileobj=io.BytesIO(data)).read(UNPACKED + 1)
    except (OSError, EOFError, zlib.error):
        return bytes_mutated(rng, data)
    if len(inside) > UNPACKED:  # it has become a bomb already
        return bytes_mutated(rng, data)
    changed = csv_mutated(rng, inside)
    return changed if rng.random() < 0.05 else gzip.compress(changed, 1, mtime=0)


@cache
def _bomb() -> bytes:
    head, body = b"t,vx,vy,r,delta_f\n", b"0,0,0,0,0\n" * 1_600_000
    return gzip.compress(head, mtime=0) + gzip.compress(body, mtime=0) * BOMB


def parquet_mutated(rng: random.Random, data: bytes) -> bytes:
    """Return a Parquet file with a column of another type, values or name, or other bytes.

    Parameters
    ----------
    rng : source of chance.
    data : of the file, which may be none any more.
    """
    import pyarrow
    import pyarrow.parquet

    if rng.random() < 0.3:
        return bytes_mutated(rng, data)
    try:
        table = pyarrow.parquet.read_table(io.BytesIO(data))
    except (pyarrow.ArrowException, OSError):
        return bytes_mutated(rng, data)
    if not table.num_columns:
        return bytes_mutated(rng, data)
    at = rng.randrange(table.num_columns)
    name, count = table.column_names[at], table.num_rows
    others: list[Any] = [repr(1.0), None, True, [1.0], {"a": 1.0}, b"\xff", 2**62, number(rng, 1.0)]
    values = [rng.choice(others)] * count
    if rng.random() < 0.2:
        values = [None, *range(count - 1)][:count]
    match rng.randrange(5):
        case 0:
            table = table.remove_column(at)
        case 1:
            table = table.append_column(name, table.column(at))
        case 2:
            table = table.slice(0, rng.choice((0, 1, 5)))
        case _:
            table = table.set_column(at, name, pyarrow.array(values))
    written = io.BytesIO()
    pyarrow.parquet.write_table(table, written)
    return written.getvalue()


def tir_mutated(rng: random.Random, data: bytes) -> bytes:
    """Return a tire property file with one value, key or section changed.

    Parameters
    ----------
    rng : source of chance.
    data : of the file, which may be none any more.
    """
    if rng.random() < 0.2:
        return rng.choice((bytes_mutated, lines_mutated))(rng, data)
    lines = data.decode("utf-8", "replace").split("\n")
    keyed = [index for index, line in enumerate(lines) if "=" in line]
    if not keyed:
        return bytes_mutated(rng, data)
    at = rng.choice(keyed)
    key, _, value = lines[at].partition("=")
    old = value.partition("$")[0].strip()
    try:
        new = repr(number(rng, float(old)))
    except ValueError:
        new = f"'{text(rng)}'"
    match rng.randrange(6):
        case 0:
            lines[at] = f"{text(rng)} = {old}"
        case 1:
            lines.insert(at, f"{key}= {new}")
        case 2:
            lines[at] = f"{key}= {text(rng)}"
        case _:
            lines[at] = f"{key}= {new}"
    return "\n".join(lines).encode("utf-8", "surrogatepass")
