"""What was learnt of many logs, as a Parquet dataset: a row for each log, in files by bucket.

    STORE/logs/bucket-07.parquet   rows by the name of their log; a bucket is a hash of its content
    STORE/pending/<digest>.parquet rows of a run that has not ended yet

A row is that of a log's content (and run) learnt with a setting; there is one of each. A run writes
the rows of a few logs at once, whole or not at all, and sorts them into their bucket at its end:
what it had written when it was stopped is found by the next one, and the same logs give the same
bytes, in whatever order they were learnt and wherever. A store lies in a folder or at any address
of fsspec, as in s3://bucket/store. A question reads the columns that it wants, a few rows at once.
"""

import hashlib
import importlib
import io
import json
import math
import posixpath
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from codegen.writing import naming
from identifier.estimate.information import FORCES, PLACE, SIZE, Information
from identifier.estimate.model import FittedModel
from identifier.estimate.priors import Priors
from identifier.frozen import vehicle_from
from identifier.motion.parameters import NAMES
from models.extras import needs
from models.vehicle import Vehicle, sedan
from tireid.fleet.chosen import CHOSEN

_Key = tuple[str, str, str]
_FORMAT = "tireid fleet 3"
MOVING = [name for name, moves in zip(NAMES, Priors.of(sedan()).moves, strict=True) if moves]
_OBSERVABLE = np.array([*range(FORCES), *(PLACE[name] for name in MOVING if name in PLACE)])  # of u
_WHOLE = {
    "s3",
    "s3a",
    "gs",
    "gcs",
    "abfs",
    "abfss",
    "az",
    "adl",
    "oss",
    "oci",
    "memory",
}  # see _put


class StoreError(TireidError, ValueError):
    """The store cannot be used; the message names it, and says why and what to do."""


def needed(name: str, what: str = "a fleet's store") -> Any:
    """Return a library of the extra [fleet]."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(needs(what, name.partition(".")[0], "fleet")) from error


@dataclass(frozen=True, slots=True, kw_only=True)
class LogRow:
    """What was learnt of a log, or why nothing was.

    log : its name: absolute path or address, or where it lies under a root.
    run : of the file, where it has several; else empty.
    content : hash of what the file holds; empty where it could not be read.
    setting : hash of all that was given: car, method, map, start, options.
    size : of the file [bytes].
    stamp : hash of what its file system says of the file, which changes with it.
    vehicle, tires, date : as its path or its folder says; the date as ISO 8601.
    tags : everything that the path says, as JSON.
    error : why nothing was learnt, one line; empty where it was. All that follows is empty then.
    v_x_mean, v_x_most : speed [m/s].
    a_y_rms, a_y_most : lateral acceleration v_x r [m/s²].
    steering_most : of the front wheels [rad].
    estimated_v_y : whether it had no lateral velocity, so that it was estimated.
    valid : whether the verdict holds the answer for valid; None where it was not asked.
    findings : codes of what speaks against it, with the axle where it is one's.
    missed_front, missed_rear : share of the force that the model misses [-].
    stiffness_front, stiffness_rear : cornering stiffness [N/rad].
    grip_front, grip_rear : largest force of the Magic Formula [static axle loads].
    relaxation_front, relaxation_rear : length [m].
    known_front, known_rear : slip up to which the curves are known [rad].
    car : the vehicle's numbers, as JSON.
    model : the frozen model, as JSON, what weights.json holds.
    reach : largest slip of both axles [rad], least and largest speed [m/s] and a_x [m/s²], what a
        model of it leaves unexplained of both axles, (8,).
    part_begin : when the parts begin [s], counted from the first sample, k of them.
    part_seconds : of driving that counts [s], (k,).
    matrix : information of the parts over `_OBSERVABLE`, upper triangles, (k, q (q + 1)/2) by rows.
    vector : of the parts, (k, q) by rows.
    """

    log: str
    run: str = ""
    content: str = ""
    setting: str = ""
    size: int = 0
    stamp: str = ""
    vehicle: str = ""
    tires: str = ""
    date: str = ""
    tags: str = "{}"
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
    reach: Sequence[float] = ()
    part_begin: Sequence[float] = ()
    part_seconds: Sequence[float] = ()
    matrix: Sequence[float] = ()
    vector: Sequence[float] = ()

    @property
    def name(self) -> str:
        """Its log, and its run where the log has several."""
        return f"{self.log}:{self.run}" if self.run else self.log

    @property
    def known(self) -> str:
        """What the log is known by: its content, and its setting."""
        return f"{self.content} {self.setting}"

    @property
    def key(self) -> _Key:
        """What its row is known by: content, or name where that could not be read, run, setting."""
        return self.content or self.log, self.run, self.setting

    @property
    def bucket(self) -> str:
        """The file of its row; the runs of a file lie together."""
        word = hashlib.blake2b(self.key[0].encode(), digest_size=1)
        return f"bucket-{word.digest()[0] % CHOSEN.buckets:02d}.parquet"

    @property
    def declared_car(self) -> Vehicle:
        try:
            return vehicle_from(json.loads(self.car))
        except ValueError as error:
            raise StoreError(f"{self._where}: car is none: {error}") from None

    @property
    def frozen(self) -> FittedModel:
        return FittedModel.from_dict(json.loads(self.model), self.name)

    @property
    def parts(self) -> list[Information]:
        """The information of its parts, in the order of time."""
        k, q = len(self.part_begin), len(_OBSERVABLE)
        self.numbers("part_begin", k)
        triangles = self.numbers("matrix", k, q * (q + 1) // 2)
        vectors, seconds = self.numbers("vector", k, q), self.numbers("part_seconds", k)
        rows, columns = _OBSERVABLE[np.array(np.triu_indices(q))]
        found = []
        for packed, vector, some in zip(triangles, vectors, seconds.tolist(), strict=True):
            matrix, whole = np.zeros((SIZE, SIZE)), np.zeros(SIZE)
            matrix[rows, columns] = matrix[columns, rows] = packed
            whole[_OBSERVABLE] = vector
            try:
                found.append(Information(matrix=matrix, vector=whole, seconds=some))
            except ValueError as error:
                raise StoreError(f"{self._where}: {error}") from None
        return found

    def numbers(self, name: str, *shape: int) -> Array:
        """Return a column that is a list, in its shape."""
        values, count = np.asarray(getattr(self, name), dtype=np.float64), math.prod(shape)
        if values.size != count:
            raise StoreError(f"{self._where}: {name} must hold {count} numbers, not {values.size}")
        if not np.isfinite(values).all():
            raise StoreError(f"{self._where}: {name} holds a number that is not finite")
        return values.reshape(shape)

    @property
    def _where(self) -> str:
        """Which row of a store it is, for messages."""
        return f"logs/{self.bucket}, log {self.name!r}"


COLUMNS = tuple(field.name for field in fields(LogRow))
_LISTS = ("reach", *COLUMNS[COLUMNS.index("part_begin") :])
_WORDS = ("log", "run", "content", "setting", "stamp", "vehicle", "tires", "date", "tags", "error",
         "car", "model")  # fmt: skip
INDEX = ("log", "run", "content", "setting", "stamp", "error")  # which rows there are
_HEAVY = (*_LISTS, "car", "model")  # read where they are asked for by name


def information_columns(parts: Sequence[Information]) -> dict[str, Any]:
    """Return the columns that hold the information of the parts of a log."""
    rows, columns = _OBSERVABLE[np.array(np.triu_indices(len(_OBSERVABLE)))]
    return {
        "part_seconds": [one.seconds for one in parts],
        "matrix": np.ravel([one.matrix[rows, columns] for one in parts]).tolist(),
        "vector": np.ravel([one.vector[_OBSERVABLE] for one in parts]).tolist(),
    }


@dataclass(frozen=True)
class Store:
    """A fleet's rows at an address."""

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

    def _sizes(self, kind: str) -> dict[str, int]:
        """Return the Parquet files of a kind, in order, with their bytes."""
        fs, _ = self._place
        fs.invalidate_cache(self._path(kind))
        try:
            found = {one["name"]: one for one in fs.ls(self._path(kind), detail=True)}
        except (FileNotFoundError, NotADirectoryError):
            return {}
        names = sorted(name for name in found if name.endswith(".parquet"))
        for name in names:
            if found[name]["type"] == "other":  # of which reading may not end
                raise StoreError(f"{name}: must be a file, it is a device, pipe or socket")
        return {name: int(found[name]["size"] or 0) for name in names}

    @property
    def exists(self) -> bool:
        """Whether there are rows, of a run that ended or of one that did not."""
        return bool(self._sizes("logs") or self._sizes("pending"))

    def require_ours(self) -> None:
        """Refuse an address at which there is something else."""
        fs, path = self._place
        if fs.isfile(path):
            raise StoreError(f"{self.address} is a file: a store is a folder, choose another name")
        if fs.isdir(path) and not self.exists and fs.ls(path, detail=False):
            raise StoreError(f"{self.address} holds something else: choose another folder")

    def require(self) -> None:
        if not self.exists:
            raise StoreError(f"{self.address} is no store: tireid fleet learn LOGS --out makes one")

    def rows(self, columns: Sequence[str] | None = None, *, where: str = "") -> list[LogRow]:
        """Return the rows, by the name of their log."""
        return sorted(self.stream(columns, where=where), key=_order)

    def stream(self, columns: Sequence[str] | None = None, *, where: str = "") -> Iterator[LogRow]:
        """Yield the rows as they lie in their files, a few of them in memory.

        columns : that are read; others are as of a log without result. None reads all.
        where : a condition of SQL on the columns; empty takes every row.
        """
        pyarrow = needed("pyarrow")
        files = {**self._sizes("logs"), **self._sizes("pending")}
        taken = self._taken(files, where)
        for path, size in files.items():
            begin = 0
            for batch in self._batches(path, size, columns):
                if taken is not None:
                    some = taken[path][begin : begin + len(batch)]
                    begin += len(batch)
                    batch = batch.filter(pyarrow.array(some))
                yield from _rows_of(batch)

    def _taken(self, files: Mapping[str, int], where: str) -> dict[str, Array] | None:
        """Return which rows of each file are asked for, one of each key; None takes all."""
        if not where and not any(self._pends(path) for path in files):
            return None
        columns = dict.fromkeys([*INDEX, *(_named_in(where) if where else ())])
        tables = {path: self._table(path, size, list(columns)) for path, size in files.items()}
        counts = np.cumsum([0, *map(len, tables.values())])
        best: dict[_Key, tuple[Any, int]] = {}
        k = 0
        for path, table in tables.items():
            for batch in table.select(INDEX).to_batches(CHOSEN.batch):
                for row in _rows_of(batch):
                    rank = _rank(row, pending=self._pends(path)), k
                    best[row.key] = min(best.get(row.key, rank), rank)
                    k += 1
        taken = np.zeros(counts[-1], dtype=bool)
        taken[[at for _, at in best.values()]] = True
        if where and files:
            table = needed("pyarrow").concat_tables(tables.values())
            taken = _answered(table, taken, where, self.address)
        return {
            path: taken[first:last]
            for path, first, last in zip(tables, counts[:-1], counts[1:], strict=True)
        }

    def _pends(self, path: str) -> bool:
        return posixpath.dirname(path) == self._path("pending")

    def _table(self, path: str, size: int, columns: Sequence[str] | None = None) -> Any:
        """Return columns of a file as an Arrow table."""
        pyarrow = needed("pyarrow")
        names = COLUMNS if columns is None else columns
        kinds = pyarrow.schema([schema().field(name) for name in names])
        batches = (batch.select(names) for batch in self._batches(path, size, columns))
        return pyarrow.Table.from_batches(batches, kinds)

    def _batches(self, path: str, size: int, columns: Sequence[str] | None) -> Iterator[Any]:
        """Yield columns of a file, some rows at once.

        Nothing is read by threads: one that drops what belongs to Python while Python ends aborts
        the program.
        """
        parquet, pyarrow = needed("pyarrow.parquet"), needed("pyarrow")
        names = list(COLUMNS if columns is None else columns)
        try:
            with (
                self._opened(path, size, columns) as source,
                parquet.ParquetFile(source) as file,
            ):
                _require_ours(path, file.schema_arrow)
                for batch in file.iter_batches(CHOSEN.batch, columns=names, use_threads=False):
                    if "log" in names and batch.column("log").null_count:
                        raise StoreError(
                            f"{path}: log must be the name of a log in every row, one is empty"
                        )
                    yield batch.replace_schema_metadata()
        except StoreError:
            raise
        except (OSError, ValueError, pyarrow.ArrowException) as error:
            raise StoreError(f"{path}: cannot be read as a store's file: {error}") from error

    def _opened(self, path: str, size: int, columns: Sequence[str] | None) -> Any:
        """Return a file to read: as it lies here, or with what is asked for of it fetched."""
        pyarrow, (fs, _) = needed("pyarrow"), self._place
        if "file" in protocols(fs):
            return pyarrow.OSFile(path)
        if columns is None or size <= CHOSEN.small:
            return pyarrow.BufferReader(fs.cat_file(path))
        remote = needed("fsspec.parquet")
        return remote.open_parquet_file(path, fs=fs, columns=list(columns), engine="pyarrow")

    def keep(self, rows: Sequence[LogRow]) -> None:
        """Write rows, whole or not at all; they pend until `settle`."""
        names = "\0".join("\0".join((*row.key, row.log)) for row in rows)
        digest = hashlib.blake2b(names.encode(), digest_size=12).hexdigest()
        data = {name: [getattr(row, name) for row in rows] for name in COLUMNS}
        table = needed("pyarrow").table(data, schema=schema())
        self._put(self._path("pending", f"{digest}.parquet"), table)

    def _put(self, path: str, table: Any) -> None:
        """Write a file that appears whole or not at all: by one request where objects do so."""
        parquet = needed("pyarrow.parquet")
        table = table.replace_schema_metadata(schema().metadata)
        buffer = io.BytesIO()
        parquet.write_table(
            table,
            buffer,
            compression="zstd",
            row_group_size=8 * CHOSEN.batch,
            use_dictionary=list(_WORDS),
        )
        fs, _ = self._place
        if _WHOLE & protocols(fs):
            fs.pipe_file(path, buffer.getvalue())
            return
        fs.makedirs(posixpath.dirname(path), exist_ok=True)
        scratch = f"{path}.part"
        with naming(path), fs.open(scratch, "wb") as file:
            file.write(buffer.getvalue())
        fs.mv(scratch, path)

    def settle(self) -> None:
        """Sort what pends into its buckets."""
        paths, tables = [], []
        for path, size in self._sizes("pending").items():
            paths.append(path)
            tables.append(self._table(path, size))
            if (
                len(paths) == CHOSEN.files_at_once
                or sum(table.nbytes for table in tables) > CHOSEN.bytes_at_once
            ):
                self._settle(paths, tables)
                paths, tables = [], []
        if paths:
            self._settle(paths, tables)

    def _settle(self, paths: Sequence[str], tables: Sequence[Any]) -> None:
        """Sort files that pend into their buckets."""
        new = needed("pyarrow").concat_tables(tables)
        by_bucket: dict[str, list[int]] = {}
        for k, row in enumerate(_rows_of(new.select(INDEX))):
            by_bucket.setdefault(row.bucket, []).append(k)
        sizes = self._sizes("logs")
        for bucket, some in sorted(by_bucket.items()):
            self._sort(bucket, sizes, [new.take(some)])
        self._place[0].rm(list(paths))

    def drop(self, rows: Sequence[LogRow]) -> None:
        """Take rows out; none may pend."""
        sizes = self._sizes("logs") if rows else {}
        for bucket in sorted({row.bucket for row in rows}):
            self._sort(bucket, sizes, [], frozenset(row.key for row in rows))

    def _sort(
        self,
        bucket: str,
        sizes: Mapping[str, int],
        new: list[Any],
        without: Set[_Key] = frozenset(),
    ) -> None:
        """Write a bucket with new rows and without some, one of each key, in order."""
        path = self._path("logs", bucket)
        old = [self._table(path, sizes[path])] if path in sizes else []
        table = needed("pyarrow").concat_tables([*old, *new])
        rows, settled = list(_rows_of(table.select(INDEX))), sum(map(len, old))
        best: dict[_Key, int] = {}
        for k in sorted(range(len(rows)), key=lambda k: _rank(rows[k], pending=k >= settled)):
            if rows[k].key not in without:
                best.setdefault(rows[k].key, k)
        if best:
            order = sorted(best.values(), key=lambda k: _order(rows[k]))
            self._put(path, table.take(order).combine_chunks())
        elif old:
            self._place[0].rm(path)


def protocols(fs: Any) -> set[str]:
    return {fs.protocol} if isinstance(fs.protocol, str) else set(fs.protocol)


def _require_ours(path: str, found: Any) -> None:
    """Refuse a file whose columns are not those of this version's store."""
    given = (found.metadata or {}).get(b"format", b"").decode(errors="replace")
    if given.startswith("tireid fleet") and given != _FORMAT:
        raise StoreError(
            f"{path}: is of another version's store ({given}, not {_FORMAT}): learn its logs "
            "again, into a new store"
        )
    if given != _FORMAT or found.names != list(COLUMNS):
        raise StoreError(f"{path}: is not of this version's store ({given or 'no format'})")
    for name in COLUMNS:
        kind = schema().field(name).type
        if found.field(name).type != kind:
            raise StoreError(
                f"{path}: {name} must be of type {kind}, it is {found.field(name).type}"
            )


def _rank(row: LogRow, *, pending: bool) -> tuple[bool, bool, str]:
    """Return what is least for the row of a key that counts: a result, new, of the first name."""
    return bool(row.error), not pending, row.name


def _order(row: LogRow) -> tuple[str, ...]:
    return row.log, row.run, row.setting, row.content


def _named_in(where: str) -> list[str]:
    """Return the columns that a condition may ask for: what is heavy only where it names it."""
    return [name for name in COLUMNS if name not in _HEAVY or name in where.lower()]


def _answered(table: Any, taken: Array, where: str, source: str) -> Array:
    """Return which rows that are taken fulfill a condition; DuckDB sees nothing but them."""
    pyarrow, duckdb = needed("pyarrow"), needed("duckdb", "a question in SQL")
    some = table.filter(pyarrow.array(taken))
    some = some.append_column("_row", pyarrow.array(np.flatnonzero(taken).tolist()))
    connection = duckdb.connect(":memory:")
    try:
        connection.register("logs", some)
        connection.execute("SET enable_external_access = false")
        connection.execute(f"SELECT _row FROM logs WHERE ({where}\n)")
        rows = [row for (row,) in connection.fetchall()]
    except duckdb.Error as error:
        raise StoreError(f"{source}: {' '.join(str(error).split())}") from error
    finally:
        connection.close()
    fulfilled = np.zeros_like(taken)
    fulfilled[rows] = True
    return fulfilled


def _rows_of(table: Any) -> Iterator[LogRow]:
    return (LogRow(**_plain(row)) for row in table.to_pylist())


def _plain(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row of Arrow as the arguments of `LogRow`."""
    empty = {**dict.fromkeys((*_LISTS, "findings"), ()), **dict.fromkeys(_WORDS, "")}
    return {name: empty.get(name) if value is None else value for name, value in row.items()}


def schema() -> Any:
    pyarrow = needed("pyarrow")
    kinds = {
        "size": pyarrow.int64(),
        "estimated_v_y": pyarrow.bool_(),
        "valid": pyarrow.bool_(),
        "findings": pyarrow.list_(pyarrow.string()),
        **{name: pyarrow.list_(pyarrow.float64()) for name in _LISTS},
    }
    kinds |= {name: pyarrow.string() for name in _WORDS}
    listed = [pyarrow.field(name, kinds.get(name, pyarrow.float64())) for name in COLUMNS]
    return pyarrow.schema(listed, metadata={"format": _FORMAT})
