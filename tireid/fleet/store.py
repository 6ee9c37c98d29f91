"""What was learnt of many logs: a Parquet file for each log, in a folder for each setting.

    STORE/<setting>/<content>.parquet   a row, or one for each run of the log

The setting is a hash of the car, the method and the options; the content is a hash of the log. So
the same log learnt twice is the same file, and writers at a time lose nothing. A file is written
under a hidden name and moved when it is whole, or in one put where a file system only copies.
Readers pass over files that are not whole, or gone since they were listed. A store lies in a folder
or at any address of fsspec, as in s3://bucket/store.
"""

import importlib
import io
import json
import posixpath
import re
import uuid
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError
from codegen.writing import naming
from identifier.estimate.information import FORCES, PLACE, SIZE, Information
from identifier.estimate.priors import Priors
from identifier.frozen import vehicle_from
from identifier.motion.parameters import NAMES
from models.extras import needs
from models.vehicle import Vehicle, sedan

VERSION = 5  # of rows
_SETTING = re.compile(r"[0-9a-f]{16}")
_MAGIC = b"PAR1"  # with which a whole Parquet file begins and ends
_MOVES = Priors.of(sedan()).with_play().moves
_MOVING = [name for name, moves in zip(NAMES, _MOVES, strict=True) if moves]
OBSERVABLE = np.array([*range(FORCES), *(PLACE[name] for name in _MOVING if name in PLACE)])  # of u
_TRIANGLE = tuple(OBSERVABLE[np.array(np.triu_indices(len(OBSERVABLE)))])


class StoreError(TireidError, ValueError):
    """A store or its rows cannot be used; the message says which, why and what to do."""


def needed(name: str) -> Any:
    """Return a library of the extra [fleet]."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(needs("a fleet's store", name.partition(".")[0], "fleet")) from error


@dataclass(frozen=True, slots=True, kw_only=True)
class LogRow:
    """What was learnt of a log, or why nothing was.

    log : its name: absolute path or address.
    run : of the log, where it has several; else empty.
    content : hash of the log; where it could not be read, one of its name.
    setting : hash of the car, the method and the options.
    stamp : hash of what its file system says of the file, which changes with it.
    vehicle, tires, date : as its path or its car says; the date as ISO 8601.
    tags : everything that the path says, as JSON.
    error : why nothing was learnt, one line; empty where it was. All that follows is empty then.
    seconds : of the log [s].
    valid, findings : the verdict, and codes of what speaks against the model.
    stiffness_front, stiffness_rear : cornering stiffness [N/rad].
    car : the vehicle's numbers, as JSON.
    reach : largest slip of both axles [rad], least and largest speed [m/s] and a_x [m/s²], what a
        model of it leaves unexplained of both axles, (8,).
    driven : seconds that count [s].
    matrix : information over `OBSERVABLE` without any prior, upper triangle by rows.
    vector : of it, (q,).
    """

    log: str
    version: int = VERSION
    run: str = ""
    content: str = ""
    setting: str = ""
    stamp: str = ""
    vehicle: str = ""
    tires: str = ""
    date: str = ""
    tags: str = "{}"
    error: str = ""
    seconds: float | None = None
    valid: bool | None = None
    findings: Sequence[str] = ()
    stiffness_front: float | None = None
    stiffness_rear: float | None = None
    car: str = ""
    reach: Sequence[float] = ()
    driven: float | None = None
    matrix: Sequence[float] = ()
    vector: Sequence[float] = ()

    @property
    def name(self) -> str:
        """Its log, and its run where the log has several."""
        return f"{self.log}:{self.run}" if self.run else self.log

    @property
    def file(self) -> str:
        """Its place in a store; the runs of a log lie together."""
        return f"{self.setting}/{self.content}.parquet"

    @property
    def declared_car(self) -> Vehicle:
        try:
            return vehicle_from(json.loads(self.car))
        except ValueError as error:
            raise self._broken(error) from None

    def learnt(self) -> tuple[Information, Array]:
        """Return the information of its log, and `reach` by rows (4, 2)."""
        matrix, vector = np.zeros((SIZE, SIZE)), np.zeros(SIZE)
        rows, columns = _TRIANGLE
        try:
            reach = np.reshape(np.array(self.reach, dtype=np.float64), (4, 2))
            matrix[rows, columns] = matrix[columns, rows] = np.reshape(self.matrix, rows.size)
            vector[OBSERVABLE] = np.reshape(self.vector, OBSERVABLE.size)
            return Information(matrix=matrix, vector=vector, seconds=self.driven or 0.0), reach
        except (ValueError, TypeError) as error:
            raise self._broken(error) from None

    def _broken(self, why: Exception) -> StoreError:
        return StoreError(
            f"{self.file}, log {self.name!r}: {why}: delete the file and learn its log again"
        )


COLUMNS = tuple(field.name for field in fields(LogRow))
INDEX = ("version", "log", "run", "content", "setting", "stamp", "error")  # which rows there are


def information_columns(information: Information) -> dict[str, Any]:
    return {
        "driven": information.seconds,
        "matrix": information.matrix[_TRIANGLE].tolist(),
        "vector": information.vector[OBSERVABLE].tolist(),
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

    def files(self) -> list[str]:
        """Return the paths of files, in order."""
        fs, path = self._place
        fs.invalidate_cache()
        found = {
            name: info["type"]
            for name, info in sorted(fs.find(path, detail=True).items())
            if name.endswith(".parquet")
        }
        for name, kind in found.items():
            if kind != "file":  # of which reading may not end
                raise StoreError(f"{name}: must be a file, it is a device, pipe or socket")
        return list(found)

    def require(self, *, begun: bool) -> None:
        """Refuse an address at which there is something else.

        begun : whether there must be rows.
        """
        (fs, path), files = self._place, self.files()
        if begun and not files:
            raise StoreError(f"{self.address} is no store: tireid fleet learn LOGS --out makes one")
        inside = [] if files or not fs.isdir(path) else fs.ls(path, detail=False)
        names = [posixpath.basename(one.rstrip("/")) for one in inside]
        if fs.isfile(path) or not all(map(_SETTING.fullmatch, names)):
            raise StoreError(
                f"{self.address} holds something else: choose another folder for the store"
            )

    def stream(
        self, columns: Sequence[str] = COLUMNS, files: Sequence[str] | None = None
    ) -> Iterator[LogRow]:
        """Yield the rows in the order of their files, those of a file in memory.

        columns : that are read, `INDEX` among them; others are as of a log without result.
        files : that are read; None reads those that are there now.
        """
        pyarrow, parquet = needed("pyarrow"), needed("pyarrow.parquet")
        fs, known = self._place[0], schema()
        for name in self.files() if files is None else files:
            try:
                data = fs.cat_file(name)
                if not data.startswith(_MAGIC) or not data.endswith(_MAGIC):
                    continue  # another run writes it
                # Threads of pyarrow's may outlive Python, and must hold nothing of Python's then.
                file = parquet.ParquetFile(pyarrow.BufferReader(data))
                table = file.read(list(columns), use_threads=False)
            except FileNotFoundError:
                continue  # another run removed it
            except (OSError, pyarrow.ArrowException) as error:
                raise StoreError(f"{name}: {' '.join(str(error).split())}") from error
            for row in table.to_pylist():
                if file.schema_arrow != known or row["version"] != VERSION:
                    raise StoreError(
                        f"{self.address}: holds rows of another version: learn its logs "
                        "again, into a new store"
                    )
                yield LogRow(**{name: one for name, one in row.items() if one is not None})

    def write(self, rows: Sequence[LogRow]) -> None:
        """Write the rows of a log, whole or not at all.

        rows : of one log and one setting.
        """
        columns = {name: [getattr(row, name) for row in rows] for name in COLUMNS}
        table = needed("pyarrow").table(columns, schema())
        buffer, (fs, folder) = io.BytesIO(), self._place
        needed("pyarrow.parquet").write_table(table, buffer, compression="zstd")
        data, path = buffer.getvalue(), posixpath.join(folder, rows[0].file)
        hidden = posixpath.join(posixpath.dirname(path), f".{uuid.uuid4().hex}.part")
        with naming(path):
            fs.makedirs(posixpath.dirname(path), exist_ok=True)
            if type(fs).mv is needed("fsspec").AbstractFileSystem.mv:  # copies, then removes
                fs.pipe_file(path, data)
                return
            fs.pipe_file(hidden, data)
            try:
                fs.mv(hidden, path)
            except OSError:  # where nothing is moved over a file
                fs.pipe_file(path, data)
                fs.rm_file(hidden)

    def drop(self, file: str) -> None:
        """Remove a file of rows."""
        fs, folder = self._place
        with suppress(FileNotFoundError):  # another run removed it
            fs.rm_file(posixpath.join(folder, file))


def schema() -> Any:
    pyarrow = needed("pyarrow")
    kinds: dict[Any, Any] = {
        str: pyarrow.string(),
        int: pyarrow.int64(),
        bool | None: pyarrow.bool_(),
        float | None: pyarrow.float64(),
        Sequence[str]: pyarrow.list_(pyarrow.string()),
        Sequence[float]: pyarrow.list_(pyarrow.float64()),
    }
    return pyarrow.schema([(field.name, kinds[field.type]) for field in fields(LogRow)])
