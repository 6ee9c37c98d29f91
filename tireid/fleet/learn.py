"""Learning from thousands of logs: which they are, what is learnt of one, and who does it.

A log is read and fitted as `tireid identify` does it, without figures, its samples averaged to 50
Hz; its information without the prior is kept (`identifier.estimate.information`). A log that cannot
be used becomes a row with its error. Work is done by processes of this machine or by a Dask
cluster. Where a process dies, its work is done again; a log that it dies of twice becomes a row
with an error.

A log is known by the hash of its content and by its setting, wherever it lies; whoever reads it
computes the hash. A file whose name, size and time are those of a row is not read again.
"""

import hashlib
import json
import posixpath
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from codegen.compiler import CompilationError
from identifier.compare.work import Map, fresh_processes
from identifier.day import ENOUGH, INSTALLED, NUMBERS, WHERE, Day, usual_errors
from identifier.estimate.drive import SLOW
from identifier.estimate.fit import fit
from identifier.estimate.information import Information
from identifier.estimate.model import FittedModel
from identifier.estimate.poor import on_time
from identifier.estimate.priors import Priors
from identifier.frozen import vehicle_numbers
from identifier.inertial import InertialIdentifier
from identifier.reproducibility import counted_samples
from identifier.run import identify
from identifier.verdict import judge_identification
from models.logs import arrow
from models.recordings import LogMap, Recording, RecordingError, read_repaired, runs
from models.vehicle import Vehicle
from tireid.fleet.store import INDEX, VERSION, LogRow, Store, information_columns, needed

DT = 0.01  # [s] to which logs are brought
_DATE = r"\d{4}-\d{2}-\d{2}(?:[T ][\d.:-]+(?:Z|[+-]\d{2}:?\d{2})?)?"
_FIELD = re.compile(r"\{(\w+)\}")
_EXPECTED = (ValueError, ArithmeticError, OSError, MemoryError, CompilationError, ImportError)


class Task(NamedTuple):
    """A log to be learnt.

    log : absolute path or address, by which any process reads it.
    stamp : hash of what its file system says of it and what changes with it; empty where nothing.
    tags : what its path says.
    date : when it was driven, ISO 8601; of its path, else when the file was written.
    vehicle : path of its car.
    """

    log: str
    stamp: str
    tags: dict[str, str]
    date: str
    vehicle: Path


class Car(NamedTuple):
    """A car that drove logs, and the hash of it, the method and the options."""

    vehicle: Vehicle
    setting: str


def read_car(path: Path, log_map: LogMap, *, check: bool = True) -> Car:
    """Read a car once, for processes that may not reach its file.

    Files count by what they hold, not by their names.
    """
    vehicle = Vehicle.from_toml(path)
    if vehicle.chassis is not None:  # the tires are what is learnt
        vehicle = replace(vehicle, chassis=replace(vehicle.chassis, tire=None))
    beliefs, dbc = Priors.of(vehicle), log_map.dbc
    given = [VERSION, vehicle, beliefs.mean.tobytes(), beliefs.information.tobytes()]
    given += [InertialIdentifier.for_vehicle(vehicle, dt=DT), replace(log_map, dbc=""), check]
    given += [Path(dbc).read_bytes() if dbc else b""]
    return Car(vehicle, _hash("\0".join(map(repr, given))))


def _hash(text: str) -> str:
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()


# Which logs there are, and what their paths say.


def find_logs(
    patterns: Sequence[str], vehicle: str, tags: str = ""
) -> tuple[list[Task], dict[str, str]]:
    """Return the logs that patterns name, in order, and why others are left out.

    vehicle : path of the car's TOML; {name} in it is replaced by the tag of that name.
    tags : pattern of a path's end with {name} for its parts, as in
        "{vehicle}/{tires}/{date}-{drive}.csv"; empty says nothing.
    """
    shape = tag_pattern(tags) if tags else None
    unknown = [one for one in _FIELD.findall(vehicle) if one not in _FIELD.findall(tags)]
    if unknown:
        raise ValueError(f"--vehicle {vehicle}: {{{unknown[0]}}} is no tag of --tags")
    found: dict[str, Task] = {}
    left: dict[str, str] = {}
    local = needed("fsspec.implementations.local").LocalFileSystem
    for pattern in patterns:
        fs, path = needed("fsspec.core").url_to_fs(pattern)
        try:
            listed = fs.glob(path, detail=True)
        except (ValueError, OSError) as error:
            raise ValueError(f"{pattern}: {error}") from error
        files = {name: info for name, info in listed.items() if info.get("type") == "file"}
        if not files:
            raise ValueError(f"{pattern}: names no log")
        for name, info in files.items():
            log = name if isinstance(fs, local) else str(fs.unstrip_protocol(name))
            said = shape.search(posixpath.normpath(log)) if shape is not None else None
            if shape is not None and said is None:
                left[log] = f"its path is not like {tags}"
                continue
            words = {} if said is None else said.groupdict()
            car = vehicle
            for key, value in words.items():
                car = car.replace(f"{{{key}}}", value)
            date = words.get("date") or _written(info)
            found[log] = Task(log, _stamp(log, info), words, date, Path(car))
    return [found[log] for log in sorted(found)], left


def tag_pattern(tags: str) -> re.Pattern[str]:
    """Return the expression that finds tags at the end of a path.

    tags : with {name} for what a name stands for; * is anything within a folder's name.
    """
    names = _FIELD.findall(tags)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"--tags {tags}: wants {{name}} for parts of a path, each name once")
    parts = _FIELD.split(tags)
    words = [re.escape(text).replace(r"\*", "[^/]*") for text in parts[::2]]
    groups = [f"(?P<{name}>{_DATE if name == 'date' else '[^/]+?'})" for name in parts[1::2]]
    body = "".join(a + b for a, b in zip(words, [*groups, ""], strict=True))
    return re.compile(rf"(?:^|/){body}$")


def _stamp(log: str, info: Mapping[str, Any]) -> str:
    """Return a hash of what changes with a file; empty where its file system says nothing."""
    if "://" not in log:  # of the file itself, where `info` is of a link to it
        info = {**info, "changed": Path(log).stat().st_mtime_ns}
    silent = set(info) <= {"name", "size", "type"}
    return "" if silent else _hash(repr(sorted(info.items(), key=str)))


def _written(info: Mapping[str, Any]) -> str:
    at = info.get("mtime") or info.get("LastModified") or info.get("created")
    if at is None:
        return ""
    if not isinstance(at, datetime):
        at = datetime.fromtimestamp(float(at), UTC)
    return at.astimezone(UTC).isoformat(timespec="seconds")


# What is learnt of one.


class Learnt(NamedTuple):
    """Rows of a log, one for each of its runs; none where a store has its content.

    file : `LogRow.file` of them.
    """

    task: Task
    file: str
    rows: list[LogRow]


@dataclass(frozen=True, slots=True)
class LearnLog:
    """Work of a process: a log.

    check : whether a log that contradicts physics or the car is refused.
    known : `LogRow.file` of logs that are not learnt again.
    """

    cars: Mapping[Path, Car]
    log_map: LogMap
    check: bool = True
    known: Set[str] = frozenset()

    def __call__(self, task: Task) -> Learnt:
        row = self.row(task)
        try:
            with _near(task.log) as path:
                with path.open("rb") as file:
                    hashed = partial(hashlib.blake2b, digest_size=16)
                    row = replace(row, content=hashlib.file_digest(file, hashed).hexdigest())
                rows = [] if row.file in self.known else self._rows(row, path, task)
        except _EXPECTED as error:
            rows = [_failed(row, error)]
        return Learnt(task, row.file, rows)

    def row(self, task: Task) -> LogRow:
        """Return the row of a log without what is learnt of it."""
        car = self.cars[task.vehicle]
        return LogRow(
            log=task.log,
            content=f"unread-{_hash(task.log)}",
            setting=car.setting,
            stamp=task.stamp,
            vehicle=task.tags.get("vehicle", "") or car.vehicle.name,
            tires=task.tags.get("tires", ""),
            date=task.date,
            tags=json.dumps(task.tags, ensure_ascii=False, sort_keys=True),
        )

    def died(self, task: Task) -> Learnt:
        """Return the row of a log that processes die of."""
        why = "its process died twice: it may need more memory than there is"
        row = replace(self.row(task), error=why)
        return Learnt(task, row.file, [row])

    def _rows(self, row: LogRow, path: Path, task: Task) -> list[LogRow]:
        vehicle = self.cars[task.vehicle].vehicle

        def learn_run(row: LogRow) -> LogRow:
            log, car = read_repaired(
                path, vehicle, row.run or None, dt=DT, check=self.check, log_map=self.log_map
            )
            return learn_recording(row, log, car)

        try:
            return [learn_run(row)]
        except RecordingError:
            names = [] if self.log_map.dbc or self.log_map.run else runs(path)
            if len(names) < 2:
                raise
        found = []
        for name in names:
            one = replace(row, run=name)
            try:
                found.append(learn_run(one))
            except _EXPECTED as error:
                found.append(_failed(one, error))
        return found


def _failed(row: LogRow, error: Exception) -> LogRow:
    return replace(row, error=(" ".join(str(error).split()) or type(error).__name__)[:500])


def learn_recording(row: LogRow, recording: Recording, vehicle: Vehicle) -> LogRow:
    """Return the row with what is learnt of its log.

    recording : the log, at `DT`.
    """
    counted_samples(recording, vehicle.lowest_speed)  # refuses a car that never drives
    if recording.logged_v_y is None:
        inertial = InertialIdentifier.for_vehicle(vehicle, dt=recording.dt)
        recording = identify(recording, vehicle, inertial).recording
    recording = on_time(recording, vehicle)
    measured = replace(recording, estimated=())  # an estimated v_y is fitted as one of a sensor
    model, _, parts = fit([measured], vehicle, coarse=True)
    verdict = judge_identification(_own_day(model, recording), recording)
    reach = (*model.reach[:3], model.reach.unexplained)
    return replace(
        row,
        seconds=recording.duration,
        valid=verdict.valid,
        findings=[" ".join(filter(None, (one.code, one.axle))) for one in verdict.findings],
        stiffness_front=float(model.stiffness[0]),
        stiffness_rear=float(model.stiffness[1]),
        car=json.dumps(vehicle_numbers(vehicle)),
        reach=[float(value) for one in reach for value in one],
        **information_columns(sum((one for _, one in parts), Information.nothing())),
    )


def _own_day(model: FittedModel, recording: Recording) -> FittedModel:
    """Return a model with the errors of the sensors that it found in the log that taught it.

    Where that may have several days, or shows no v_y, the verdict finds them anew.
    """
    if recording.breaks or recording.logged_v_y is None:
        return model
    car, found, v_x = model.vehicle, model.p[WHERE], recording.v_x
    driven = v_x[v_x > SLOW * car.froude_speed]
    expected = np.where([name in INSTALLED for name in NUMBERS], found, 0.0)
    P, anew = model.covariance[np.ix_(WHERE, WHERE)], driven.size * recording.dt >= ENOUGH
    return model.of_day(Day.of(found, P, (expected, usual_errors(car)), driven, anew=anew))


@contextmanager
def _near(log: str) -> Iterator[Path]:
    """Yield a log as a file of this machine: itself, or a copy for as long as it is wanted."""
    if "://" not in log:
        yield Path(log)
        return
    fs, path = needed("fsspec.core").url_to_fs(log)
    with tempfile.TemporaryDirectory() as folder:
        near = Path(folder) / posixpath.basename(path)
        fs.get_file(path, str(near))
        yield near


# Who does it.


def learn_fleet(
    tasks: Sequence[Task],
    work: LearnLog,
    store: Store,
    spread_map: Map,
    done: Callable[[int], None],
    *,
    again: bool = False,
) -> tuple[int, Set[str]]:
    """Learn the logs that a store has no row of, and write each as it comes.

    Returns how many were learnt now, and `LogRow.file` of what all of them hold.

    spread_map : does the work; results may come in any order.
    done : called with how many logs are ready.
    again : also learn logs of which a row holds an error.
    """
    index = list(store.stream(INDEX))
    there = {row.file for row in index}
    failed = {row.file for row in index if row.error and again}
    names = {row.file: row.log for row in index if row.file not in failed}
    stamps = {
        (row.setting, row.log, row.stamp): row.file
        for row in sorted(index, key=lambda row: not row.error)
        if row.file in names
    }
    holds: dict[str, str] = {}  # files of rows, by the names of these logs
    left = []
    for task in tasks:
        file = stamps.get((work.cars[task.vehicle].setting, task.log, task.stamp))
        if file is None or not task.stamp:
            left.append(task)
        else:
            holds[task.log] = file
    learnt = set()
    done(len(holds))
    for task, file, rows in spread_map(replace(work, known=frozenset(names)), left):
        if rows and task.log <= names.get(file, task.log):  # of copies the first counts
            store.write(rows)
            names[file] = task.log
            learnt.add(file)
        unread = work.row(task).file
        if unread in there and unread != file:
            store.drop(unread)
        holds[task.log] = file
        done(len(holds))
    return len(learnt), set(holds.values())


def on_this_machine(jobs: int) -> Map:
    """Return a map over logs that outlives processes that die; its order is any.

    jobs : processes; one alone is this one.
    """
    if jobs == 1:
        return map

    def spread_map(work: Any, tasks: Any) -> Iterator[Learnt]:
        left = list(tasks)
        while left:
            ready = set()
            for found in _until_one_dies(work, left, min(jobs, len(left))):
                ready.add(found.task.log)
                yield found
            left = [task for task in left if task.log not in ready]
            for suspect in left[: 2 * jobs]:  # of these one took its process with it
                yield next(_until_one_dies(work, [suspect], 1), None) or work.died(suspect)
            left = left[2 * jobs :]

    return spread_map


def on_a_cluster(elsewhere: Callable[..., Iterator[Any]]) -> Map:
    """Return a map over logs that outlives workers that die; its order is any.

    elsewhere : of `tireid.cluster.cluster`; gives `lost` what several workers died of.
    """

    def spread_map(work: Any, tasks: Any) -> Iterator[Learnt]:
        suspects: list[Task] = []
        yield from elsewhere(work, tasks, lost=suspects.append)
        for suspect in suspects:  # alone: what waited at a worker that died is blamed, too
            dead: list[Task] = []
            yield from elsewhere(work, [suspect], lost=dead.append)
            yield from map(work.died, dead)

    return spread_map


_WORK: list[LearnLog] = []  # of a process: given once, as it holds what the store knows


def _prepare_process(work: LearnLog) -> None:
    """Import pyarrow, which reads many short logs sooner."""
    arrow.is_installed()
    _WORK[:] = [work]


def _work_of_process(task: Task) -> Learnt:
    return _WORK[0](task)


def _until_one_dies(work: LearnLog, tasks: Sequence[Task], jobs: int) -> Iterator[Learnt]:
    """Yield what is learnt of logs, as long as no process dies."""
    pool = fresh_processes(jobs, partial(_prepare_process, work))
    try:
        for future in as_completed([pool.submit(_work_of_process, one) for one in tasks]):
            try:
                found = future.result()
            except BrokenProcessPool:
                continue
            yield found
    finally:
        pool.shutdown(cancel_futures=True)
