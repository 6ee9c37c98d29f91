"""What was learnt of many logs, as a Parquet dataset: a row for each log, in files by bucket.

    STORE/logs/bucket-07.parquet      rows by the name of their log; a bucket is a hash of that name
    STORE/pending/07-<digest>.parquet rows of a run that has not ended yet

A run writes the rows of a few logs at once, whole or not at all, and sorts them into their bucket
at its end: what it had written when it was stopped is found by the next one, and the same logs give
the same bytes, in whatever order they were learnt and wherever. A store lies in a folder or at any
address of fsspec, as in s3://bucket/store.
"""

import hashlib
import importlib
import io
import json
import math
import posixpath
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from codegen.arrays import Array
from codegen.writing import naming
from identifier.axle import AxleModel
from identifier.axle.information import Information
from identifier.frozen import vehicle_from
from models.extras import needs
from models.vehicle import Vehicle

BUCKETS = 16
FORMAT = "tireid fleet 1"


class StoreError(ValueError):
    """The store cannot be used; the message names it, and says why and what to do."""


def needed(name: str, what: str = "a fleet's store") -> Any:
    """Return a library of the extra [fleet].

    Parameters
    ----------
    name : of its module.
    what : what needs it.

    Raises
    ------
    ImportError
        Where it is not installed; the message says how.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(needs(what, name.partition(".")[0], "fleet")) from error


def file_of(log: str) -> str:
    """Return the file of a log.

    Parameters
    ----------
    log : its name: FILE, or FILE:RUN where a file has several runs.
    """
    folder, slash, name = log.rpartition("/")
    return folder + slash + (name.rpartition(":")[0] or name)


def bucket_of(log: str) -> int:
    """Return the bucket of a log, 0 to 15; the runs of a file lie together.

    Parameters
    ----------
    log : its name.
    """
    return hashlib.blake2b(file_of(log).encode(), digest_size=1).digest()[0] % BUCKETS


@dataclass(frozen=True, slots=True, kw_only=True)
class LogRow:
    """What was learnt of a log, or why nothing was.

    Parameters
    ----------
    log : its name, by which rows are told apart: FILE, or FILE:RUN where it has several runs.
    setting : hash of all that was told: car, map, start, options.
    size : of the file [bytes].
    vehicle, tires, date : as its path or its folder says; the date as ISO 8601.
    tags : everything that the path says, as JSON.
    error : why nothing was learnt, one line; empty where it was. All that follows is empty then.
    seconds : that it lasts.
    v_x_mean, v_x_most : speed [m/s].
    a_y_rms, a_y_most : lateral acceleration v_x r [m/s²].
    steering_most : of the front wheels [rad].
    estimated_v_y : whether it had no lateral velocity, so that it was estimated.
    valid : whether the verdict holds the answer for valid; None where it was not asked.
    findings : codes of what speaks against it, with the axle where it is one's.
    missed_front, missed_rear : share of the force that the model misses [-].
    stiffness_front, stiffness_rear : cornering stiffness [N/rad].
    grip_front, grip_rear : force at which the curves saturate [static axle loads].
    relaxation_front, relaxation_rear : length [m].
    known_front, known_rear : slip up to which the curves are known [rad].
    car : the vehicle's numbers, as JSON.
    model : the frozen model, as JSON, what weights.json holds.
    excitation : largest slip [rad] and times of learning [s], (2, 9) by rows.
    part_begin : when the parts begin [s], counted from the first sample, k of them.
    part_seconds, part_samples : time of learning [s] and samples that count, (k,).
    matrix : information of the parts, upper triangles, (k, 2, q (q + 1)/2) by rows.
    vector, square : of the parts, (k, 2, q) and (k, 2) by rows.
    """

    log: str
    setting: str
    size: int
    vehicle: str
    tires: str
    date: str
    tags: str
    error: str = ""
    seconds: float | None = None
    v_x_mean: float | None = None
    v_x_most: float | None = None
    a_y_rms: float | None = None
    a_y_most: float | None = None
    steering_most: float | None = None
    estimated_v_y: bool | None = None
    valid: bool | None = None
    findings: Sequence[str] = ()
    missed_front: float | None = None
    missed_rear: float | None = None
    stiffness_front: float | None = None
    stiffness_rear: float | None = None
    grip_front: float | None = None
    grip_rear: float | None = None
    relaxation_front: float | None = None
    relaxation_rear: float | None = None
    known_front: float | None = None
    known_rear: float | None = None
    car: str = ""
    model: str = ""
    excitation: Sequence[float] = ()
    part_begin: Sequence[float] = ()
    part_seconds: Sequence[float] = ()
    part_samples: Sequence[float] = ()
    matrix: Sequence[float] = ()
    vector: Sequence[float] = ()
    square: Sequence[float] = ()

    @property
    def told_car(self) -> Vehicle:
        """The car as it was told."""
        try:
            return vehicle_from(json.loads(self.car))
        except ValueError as error:
            raise StoreError(f"{self._where}: car is none: {error}") from None

    @property
    def frozen(self) -> AxleModel:
        """The frozen model."""
        return AxleModel.from_dict(json.loads(self.model), self.log)

    @property
    def parts(self) -> list[Information]:
        """What its parts tell of the tires, in the order of time.

        Raises
        ------
        StoreError
            Where its columns do not fit one another, or a number is not finite.
        """
        k = len(self.part_begin)
        self.numbers("part_begin", k)
        q = len(self.vector) // max(2 * k, 1)
        matrix = unpacked_triangles(self.numbers("matrix", k, 2, q * (q + 1) // 2), q)
        each = zip(
            matrix,
            self.numbers("vector", k, 2, q),
            self.numbers("square", k, 2),
            self.numbers("part_samples", k).tolist(),
            self.numbers("part_seconds", k).tolist(),
            strict=True,
        )
        try:
            return [
                Information(matrix=M, vector=v, square=c, samples=n, seconds=s)
                for M, v, c, n, s in each
            ]
        except ValueError as error:
            raise StoreError(f"{self._where}: {error}") from None

    def numbers(self, name: str, *shape: int) -> Array:
        """Return a column that is a list, in its shape.

        Parameters
        ----------
        name : of the column.
        shape : that it must have.

        Raises
        ------
        StoreError
            Where it holds more numbers or fewer, or one that is not finite.
        """
        values, count = np.asarray(getattr(self, name), dtype=np.float64), math.prod(shape)
        if values.size != count:
            raise StoreError(f"{self._where}: {name} must hold {count} numbers, not {values.size}")
        if not np.isfinite(values).all():
            raise StoreError(f"{self._where}: {name} holds a number that is not finite")
        return values.reshape(shape)

    @property
    def _where(self) -> str:
        """Which row of a store it is, for messages."""
        return f"logs/bucket-{bucket_of(self.log):02d}.parquet, log {self.log!r}"


COLUMNS = tuple(field.name for field in fields(LogRow))
LISTS = ("excitation", *COLUMNS[COLUMNS.index("part_begin") :])
WORDS = ("log", "setting", "vehicle", "tires", "date", "tags", "error", "car", "model")
HEAVY = ("model",)  # what a fleet's arithmetic does not want


def packed_triangles(matrix: Array) -> Array:
    """Return the upper triangles of symmetric matrices, (..., q (q + 1)/2).

    Parameters
    ----------
    matrix : (..., q, q).
    """
    rows, columns = np.triu_indices(matrix.shape[-1])
    return np.asarray(matrix[..., rows, columns])


def unpacked_triangles(packed: Array, q: int) -> Array:
    """Return symmetric matrices of their upper triangles.

    Parameters
    ----------
    packed : (..., q (q + 1)/2).
    q : size of the matrices.
    """
    rows, columns = np.triu_indices(q)
    matrix = np.zeros((*packed.shape[:-1], q, q))
    matrix[..., rows, columns] = packed
    matrix[..., columns, rows] = packed
    return matrix


def information_columns(parts: Sequence[Information]) -> dict[str, Any]:
    """Return the columns that hold what parts of a log tell.

    Parameters
    ----------
    parts : in the order of time.
    """
    return {
        "part_seconds": [one.seconds for one in parts],
        "part_samples": [one.samples for one in parts],
        "matrix": np.ravel([packed_triangles(one.matrix) for one in parts]).tolist(),
        "vector": np.ravel([one.vector for one in parts]).tolist(),
        "square": np.ravel([one.square for one in parts]).tolist(),
    }


@dataclass(frozen=True)
class Store:
    """A fleet's rows at an address.

    Parameters
    ----------
    address : a folder, or what fsspec opens.
    """

    address: str

    @cached_property
    def _place(self) -> tuple[Any, str]:
        """The file system and the path in it."""
        core = needed("fsspec.core")
        try:
            fs, path = core.url_to_fs(self.address)
        except (ValueError, ImportError, OSError) as error:
            raise StoreError(f"{self.address}: {error}") from error
        return fs, path.rstrip("/") or "/"

    def _path(self, *names: str) -> str:
        return posixpath.join(self._place[1], *names)

    def _files(self, kind: str) -> list[str]:
        """Return the Parquet files of a kind, in order."""
        fs, _ = self._place
        fs.invalidate_cache()
        if not fs.isdir(self._path(kind)):
            return []
        found = {one["name"]: one["type"] for one in fs.ls(self._path(kind), detail=True)}
        names = sorted(name for name in found if name.endswith(".parquet"))
        for name in names:
            if found[name] == "other":  # of which reading may not end
                raise StoreError(f"{name}: must be a file, it is a device, pipe or socket")
        return names

    @property
    def exists(self) -> bool:
        """Whether there are rows, of a run that ended or of one that did not."""
        return bool(self._files("logs") or self._files("pending"))

    def require_ours(self) -> None:
        """Refuse an address at which there is something else.

        Raises
        ------
        StoreError
            Where there is a file, or a folder that is not empty and no store.
        """
        fs, path = self._place
        if fs.isfile(path):
            raise StoreError(f"{self.address} is a file: a store is a folder, choose another name")
        if fs.isdir(path) and not self.exists and fs.ls(path, detail=False):
            raise StoreError(f"{self.address} holds something else: choose another folder")

    def require(self) -> None:
        """Refuse an address without rows.

        Raises
        ------
        StoreError
            Where nothing was learnt there yet.
        """
        if not self.exists:
            raise StoreError(f"{self.address} is no store: tireid fleet learn LOGS --out makes one")

    def rows(
        self, columns: Sequence[str] | None = None, *, where: str = "", light: bool = True
    ) -> list[LogRow]:
        """Return the rows, by the name of their log.

        Parameters
        ----------
        columns : that are read; others are as of a log without result. None reads all.
        where : a condition of SQL on the columns; empty takes every row.
        light : leave the frozen models out where `columns` is None.

        Raises
        ------
        StoreError
            Where a file is none of a store, or the condition is not right.
        """
        wanted = columns or [one for one in COLUMNS if not (light and one in HEAVY)]
        table = self.table(wanted if not where else None)
        if where:
            table = selected(table, f"SELECT * FROM logs WHERE {where}", self.address)
        must = ("log", "setting", "size", "vehicle", "tires", "date", "tags")
        empty = dict.fromkeys(must, "") | {"size": 0}
        kept = table.select([one for one in wanted if one in table.column_names])
        found = {row["log"]: LogRow(**(empty | _plain(row))) for row in kept.to_pylist()}
        return [found[name] for name in sorted(found)]

    def table(self, columns: Sequence[str] | None = None) -> Any:
        """Return all rows as an Arrow table; what pends stands last.

        Parameters
        ----------
        columns : that are read; None reads all.

        Raises
        ------
        StoreError
            Where a file is none of a store.
        """
        pyarrow = needed("pyarrow")
        tables = [
            self._read(one, columns) for one in (*self._files("logs"), *self._files("pending"))
        ]
        empty = (
            schema() if columns is None else pyarrow.schema([schema().field(c) for c in columns])
        )
        return pyarrow.concat_tables(tables) if tables else empty.empty_table()

    def _read(self, path: str, columns: Sequence[str] | None) -> Any:
        parquet, pyarrow = needed("pyarrow.parquet"), needed("pyarrow")
        fs, _ = self._place
        try:
            # Its bytes, not the file: a thread of pyarrow that drops what belongs to Python while
            # Python ends aborts the program.
            held = pyarrow.BufferReader(fs.cat_file(path))
            with parquet.ParquetFile(held) as file:
                table = file.read(columns=None if columns is None else list(columns))
        except (OSError, ValueError, pyarrow.ArrowException) as error:
            raise StoreError(f"{path}: cannot be read as a store's file: {error}") from error
        names = COLUMNS if columns is None else columns
        told = (table.schema.metadata or {}).get(b"format", b"").decode()
        if told != FORMAT or table.column_names != list(names):
            raise StoreError(f"{path}: is not of this version's store ({told or 'no format'})")
        for name in names:
            column, kind = table.column(name), schema().field(name).type
            if column.type != kind:
                raise StoreError(f"{path}: {name} must be of type {kind}, it is {column.type}")
            if name == "log" and column.null_count:
                raise StoreError(
                    f"{path}: log must be the name of a log in every row, one is empty"
                )
        return table

    def keep(self, rows: Sequence[LogRow]) -> None:
        """Write rows of one bucket, whole or not at all; they pend until `settle`.

        Parameters
        ----------
        rows : of logs of one bucket.
        """
        names = "\0".join(f"{row.log}\0{row.setting}\0{row.size}" for row in rows)
        digest = hashlib.blake2b(names.encode(), digest_size=12).hexdigest()
        self._write(self._path("pending", f"{bucket_of(rows[0].log):02d}-{digest}.parquet"), rows)

    def _write(self, path: str, rows: Iterable[LogRow]) -> None:
        pyarrow, parquet = needed("pyarrow"), needed("pyarrow.parquet")
        some = list(rows)
        data = {name: [getattr(row, name) for row in some] for name in COLUMNS}
        table = pyarrow.table(data, schema=schema())
        buffer = io.BytesIO()
        parquet.write_table(table, buffer, compression="zstd")
        fs, _ = self._place
        fs.makedirs(posixpath.dirname(path), exist_ok=True)
        scratch = f"{path}.part"
        with naming(path), fs.open(scratch, "wb") as file:
            file.write(buffer.getvalue())
        fs.mv(scratch, path)

    def settle(self) -> None:
        """Sort what pends into its buckets, the newest row of each log."""
        fs, _ = self._place
        pending = self._files("pending")
        by_bucket: dict[str, list[str]] = {}
        for path in pending:
            by_bucket.setdefault(posixpath.basename(path)[:2], []).append(path)
        for bucket, files in sorted(by_bucket.items()):
            final = self._path("logs", f"bucket-{bucket}.parquet")
            before = [final] if fs.exists(final) else []
            rows: dict[str, LogRow] = {}
            for path in (*before, *files):
                for row in self._read(path, None).to_pylist():
                    rows[row["log"]] = LogRow(**_plain(row))
            self._write(final, [rows[name] for name in sorted(rows)])
            for path in files:
                fs.rm(path)


def _plain(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row of Arrow as the arguments of `LogRow`."""
    empty = {**dict.fromkeys(LISTS, ()), **dict.fromkeys(WORDS, "")}
    return {name: empty.get(name) if value is None else value for name, value in row.items()}


def schema() -> Any:
    """Return the columns of a store with their types."""
    pyarrow = needed("pyarrow")
    kinds = {
        "size": pyarrow.int64(),
        "estimated_v_y": pyarrow.bool_(),
        "valid": pyarrow.bool_(),
        "findings": pyarrow.list_(pyarrow.string()),
        **{name: pyarrow.list_(pyarrow.float64()) for name in LISTS},
    }
    kinds |= {name: pyarrow.string() for name in WORDS}
    listed = [pyarrow.field(name, kinds.get(name, pyarrow.float64())) for name in COLUMNS]
    return pyarrow.schema(listed, metadata={"format": FORMAT})


def selected(table: Any, question: str, source: str) -> Any:
    """Return what DuckDB answers, as an Arrow table; it sees nothing but the table `logs`.

    Parameters
    ----------
    table : an Arrow table.
    question : in SQL.
    source : of the table, for errors.

    Raises
    ------
    StoreError
        Where the question is not right.
    """
    duckdb = needed("duckdb", "a question in SQL")
    connection = duckdb.connect(":memory:")
    try:
        connection.register("logs", table)
        connection.execute("SET enable_external_access = false")
        answer = connection.sql(question)
        if answer is None:
            raise StoreError(f"{source}: the question must be one that SELECTs")
        return answer.to_arrow_table() if hasattr(answer, "to_arrow_table") else answer.arrow()
    except duckdb.Error as error:
        raise StoreError(f"{source}: {' '.join(str(error).split())}") from error
    finally:
        connection.close()
