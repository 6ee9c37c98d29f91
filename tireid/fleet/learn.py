"""Learning from thousands of logs: which they are, what is learnt of one, and who does it.

A log is read and fitted as `tireid identify` does it, without figures, its samples averaged to 50
Hz; its information without the prior is kept (`identifier.estimate.information`). A log that cannot
be used becomes a row with its error. Work is done by processes of this machine or by a Dask
cluster; a process that dies loses what it was doing, which is done again, and a log that it dies of
twice becomes a row with an error.

A log is known by the hash of its content and by its setting, wherever it lies; whoever reads it
computes the hash. A file whose name, size and time are those of a row is not read again.
"""

import hashlib
import json
import os
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
from typing import Any, Literal, NamedTuple

import numpy as np

from codegen.compiler import CompilationError
from identifier.compare.work import Map, fresh_processes
from identifier.estimate.fit import fit
from identifier.estimate.model import FittedModel
from identifier.estimate.poor import on_time
from identifier.estimate.priors import Priors
from identifier.frozen import vehicle_numbers
from identifier.inertial import InertialIdentifier
from identifier.reproducibility import counted_samples
from identifier.run import identify
from identifier.tire_model import AXLES, TireModel
from identifier.verdict import judge_identification
from models.logs import arrow
from models.recordings import LogMap, Recording, RecordingError, read_repaired, runs
from models.vehicle import Vehicle
from tireid.fleet.chosen import CHOSEN
from tireid.fleet.store import INDEX, LogRow, Store, information_columns, needed, protocols

_Judging = Literal["motion", "none"]
_DATE = r"\d{4}-\d{2}-\d{2}(?:[T ][\d.:-]+(?:Z|[+-]\d{2}:?\d{2})?)?"
_FIELD = re.compile(r"\{(\w+)\}")
_EXPECTED = (ValueError, ArithmeticError, OSError, MemoryError, CompilationError, ImportError)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Task:
    """A log to be learnt.

    log : its name: absolute path or address, or where it lies under a root.
    address : absolute path or address, by which any process reads it.
    size : [bytes].
    stamp : hash of what its file system says of it and what changes with it; empty where nothing.
    date : when it was driven, ISO 8601; of its path, else when the file was written.
    """

    log: str
    address: str
    size: int
    stamp: str
    tags: tuple[tuple[str, str], ...]
    date: str
    vehicle: Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Telling:
    """What is given of all logs.

    start : a fit or a prior that is believed before; None believes the table.
    judging : "motion" asks whether the frozen model gives the drive's motion back, "none" for
        nothing.
    check : whether a log that contradicts physics or the car is refused.
    part : longest time whose information is kept as one [s].
    """

    log_map: LogMap
    start: TireModel | None = None
    judging: _Judging = "motion"
    check: bool = True
    part: float = CHOSEN.part

    def __post_init__(self) -> None:
        if not 10.0 <= self.part < float("inf"):
            raise ValueError(f"a part must last at least 10 s, it is {self.part:g} s")
        if not (self.start is None or isinstance(self.start, FittedModel)):
            kind = self.start.kind
            raise ValueError(
                f"a fleet begins with a fit or a fleet's prior, not with kind {kind!r}"
            )
        if self.log_map.dbc:  # whoever reads a log may run in another folder
            given = replace(self.log_map, dbc=str(Path(self.log_map.dbc).absolute()))
            object.__setattr__(self, "log_map", given)

    def digest(self, vehicle: Vehicle) -> str:
        """Return the hash of all that a row follows from beside its log: car, method, options.

        Files count by what they hold, not by their names.
        """
        dbc, beliefs = self.log_map.dbc, Priors.of(vehicle)
        parts = (
            vehicle,
            (beliefs.mean.tobytes(), beliefs.information.tobytes()),
            InertialIdentifier.for_vehicle(vehicle, dt=CHOSEN.dt),
            replace(self.log_map, dbc=""),
            Path(dbc).read_bytes() if dbc else b"",
            None if self.start is None else json.dumps(self.start.to_dict()),
            (self.judging, self.check, self.part),
        )
        given = "\0".join(map(repr, parts)).encode()
        return hashlib.blake2b(given, digest_size=8).hexdigest()


class Car(NamedTuple):
    """A car that drove logs, and `Telling.digest` of it."""

    vehicle: Vehicle
    setting: str

    @classmethod
    def read(cls, path: Path, telling: Telling) -> "Car":
        """Read a car once, for processes that may not reach its file."""
        vehicle = Vehicle.from_toml(path)
        if vehicle.chassis is not None:  # the tires are what is learnt
            vehicle = replace(vehicle, chassis=replace(vehicle.chassis, tire=None))
        return cls(vehicle, telling.digest(vehicle))


# Which logs there are, and what their paths say.


def find_logs(
    patterns: Sequence[str], vehicle: str, tags: str = "", root: str = ""
) -> tuple[list[_Task], dict[str, str]]:
    """Return the logs that patterns name, in order, and why others are left out.

    vehicle : path of the car's TOML; {name} in it is replaced by the tag of that name.
    tags : pattern of a path's end with {name} for its parts, as in
        "{vehicle}/{tires}/{date}-{drive}.csv"; empty says nothing.
    root : folder or address that names begin at; empty leaves them absolute.
    """
    core = needed("fsspec.core")
    above = _absolute(root) if root else ""
    shape = tag_pattern(tags) if tags else None
    unknown = [one for one in _FIELD.findall(vehicle) if one not in _FIELD.findall(tags)]
    if unknown:
        raise ValueError(f"--vehicle {vehicle}: {{{unknown[0]}}} is no tag of --tags")
    found: dict[str, _Task] = {}
    left: dict[str, str] = {}
    for pattern in patterns:
        fs, path = core.url_to_fs(pattern)
        try:
            listed = fs.glob(path, detail=True)
        except (ValueError, OSError) as error:
            raise ValueError(f"{pattern}: {error}") from error
        files = {name: info for name, info in listed.items() if info.get("type") == "file"}
        if not files:
            raise ValueError(f"{pattern}: names no log")
        for name, info in sorted(files.items()):
            address = _address(fs, name)
            if root and not address.startswith(above):
                raise ValueError(f"{address}: does not lie under --root {root}")
            log = address.removeprefix(above)
            said = shape.search(posixpath.normpath(address)) if shape is not None else None
            if shape is not None and said is None:
                left[log] = f"its path is not like {tags}"
                continue
            words = {} if said is None else said.groupdict()
            car = _FIELD.sub(lambda field, words=words: words[field[1]], vehicle)  # type: ignore[misc]
            found[address] = _Task(
                log=log,
                address=address,
                size=int(info.get("size") or 0),
                stamp=_stamp(address, info),
                tags=tuple(sorted(words.items())),
                date=words.get("date") or _written(info),
                vehicle=Path(car),
            )
    return [found[address] for address in sorted(found)], left


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


def _address(fs: Any, path: str) -> str:
    """Return where a file lies, for any process: an absolute path, or an address."""
    return path if "file" in protocols(fs) else str(fs.unstrip_protocol(path))


def _absolute(root: str) -> str:
    """Return a root as addresses under it begin."""
    return _address(*needed("fsspec.core").url_to_fs(root)).rstrip("/") + "/"


_CHANGES = ("etag", "lastmodified", "md5hash", "contentmd5", "generation", "mtime", "created")


def _stamp(address: str, info: Mapping[str, Any]) -> str:
    """Return a hash of what changes with a file; empty where its file system says nothing."""
    if "://" not in address:
        at = Path(address).stat()  # of the file itself, where `info` is of a link to it
        given: list[Any] = [at.st_ino, at.st_ctime_ns, at.st_mtime_ns, at.st_size]
    else:
        some = {key.replace("_", "").lower(): value for key, value in info.items()}
        given = [(key, str(some[key])) for key in _CHANGES if some.get(key)]
        if not given:
            return ""
        given.append(("size", info.get("size")))
    return hashlib.blake2b(repr(given).encode(), digest_size=8).hexdigest()


def _written(info: Mapping[str, Any]) -> str:
    at = info.get("mtime") or info.get("LastModified") or info.get("created")
    if isinstance(at, datetime):
        return at.astimezone(UTC).isoformat(timespec="seconds")
    return (
        "" if at is None else datetime.fromtimestamp(float(at), UTC).isoformat(timespec="seconds")
    )


# What is learnt of one.


def _learn_log(task: _Task, telling: Telling, car: Car, known: Set[str] = frozenset()) -> "Learnt":
    """Return the row of a log, one for each run of its file; where it cannot be used, it says why.

    known : `LogRow.known` of logs that are not learnt again.
    """
    row = row_of(task, car)
    try:
        with _near(task.address) as path:
            row = replace(row, content=_content_of(path))
            if row.known in known:
                return Learnt([], [(row.log, row.known)])
            try:
                return Learnt([_of_run(row, path, car.vehicle, telling)], [])
            except RecordingError:
                names = [] if telling.log_map.dbc or telling.log_map.run else runs(path)
                if len(names) < 2:
                    raise
            each = [replace(row, run=name) for name in names]
            return Learnt([_tried(one, path, car.vehicle, telling) for one in each], [])
    except _EXPECTED as error:
        return Learnt([_failed(row, error)], [])


def row_of(task: _Task, car: Car) -> LogRow:
    tags = dict(task.tags)
    return LogRow(
        log=task.log,
        setting=car.setting,
        size=task.size,
        stamp=task.stamp,
        vehicle=tags.get("vehicle", "") or car.vehicle.name,
        tires=tags.get("tires", ""),
        date=task.date,
        tags=json.dumps(tags, ensure_ascii=False, sort_keys=True),
    )


def _content_of(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, partial(hashlib.blake2b, digest_size=16)).hexdigest()


def _tried(row: LogRow, path: Path, vehicle: Vehicle, telling: Telling) -> LogRow:
    """Return the row of a run; where it cannot be used, it says why."""
    try:
        return _of_run(row, path, vehicle, telling)
    except _EXPECTED as error:
        return _failed(row, error)


def _failed(row: LogRow, error: Exception) -> LogRow:
    text = " ".join(str(error).split()) or type(error).__name__
    return replace(row, error=text[:500])


def _of_run(row: LogRow, path: Path, vehicle: Vehicle, telling: Telling) -> LogRow:
    recording, vehicle = read_repaired(
        path, vehicle, row.run or None, dt=CHOSEN.dt, check=telling.check, log_map=telling.log_map
    )
    return learnt(row, recording, vehicle, telling)


def learnt(row: LogRow, recording: Recording, vehicle: Vehicle, telling: Telling) -> LogRow:
    """Return the row with what is learnt of its log.

    recording : the log, at `CHOSEN.dt`.
    """
    counted_samples(recording, vehicle.lowest_speed)  # refuses a car that never drives
    begin, start = float(recording.t[0]), telling.start
    if recording.logged_v_y is None:
        inertial = InertialIdentifier.for_vehicle(vehicle, dt=recording.dt)
        recording = identify(recording, vehicle, inertial, start).recording
    recording = on_time(recording, vehicle)
    priors = start.as_prior(vehicle) if isinstance(start, FittedModel) else None
    measured = replace(recording, estimated=())  # an estimated v_y is fitted as one of a sensor
    model, _, parts = fit([measured], vehicle, priors, block=telling.part, coarse=True)
    return replace(
        row,
        **_conditions(recording),
        **(_judged(model, recording) if telling.judging == "motion" else {}),
        **_of_model(model),
        car=json.dumps(vehicle_numbers(vehicle)),
        part_begin=[at - begin for at, _ in parts],
        **information_columns([one for _, one in parts]),
    )


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


def _conditions(recording: Recording) -> dict[str, Any]:
    """Return how a log was driven, by columns of a row."""
    a_y = recording.v_x * recording.r
    return {
        "seconds": recording.duration,
        "v_x_mean": float(recording.v_x.mean()),
        "v_x_most": float(recording.v_x.max()),
        "a_y_rms": float(np.sqrt(np.mean(a_y**2))),
        "a_y_most": float(np.abs(a_y).max()),
        "steering_most": float(np.abs(recording.delta_f).max()),
        "estimated_v_y": recording.logged_v_y is None,
    }


def _judged(model: FittedModel, recording: Recording) -> dict[str, Any]:
    verdict = judge_identification(model, recording)
    codes = [f"{one.code}{f' {one.axle}' if one.axle else ''}" for one in verdict.findings]
    missed = verdict.measures.get("force_missed")
    each = missed if isinstance(missed, tuple) else (None, None)
    return {
        "valid": verdict.valid,
        "findings": codes,
        **{f"missed_{axle}": one for axle, one in zip(AXLES, each, strict=True)},
    }


def _of_model(model: FittedModel) -> dict[str, Any]:
    numbers = {
        "stiffness": model.stiffness,
        "grip": np.exp([model["ln_grip_f"], model["ln_grip_r"]]),
        "relaxation": model.relaxation_length,
        "known": model.known_slip,
    }
    given = {
        f"{name}_{axle}": float(value)
        for name, both in numbers.items()
        for axle, value in zip(AXLES, both, strict=True)
    }
    text = json.dumps(model.to_dict(), ensure_ascii=False)
    reached = model.driven, model.speeds, model.a_x, model.unexplained
    reach = [value for one in reached for value in one.tolist()]
    return {**given, "model": text, "reach": reach}


# Who does it.


class Learnt(NamedTuple):
    """Rows of some logs; and the names and `LogRow.known` of others, which a store has."""

    rows: list[LogRow]
    copies: list[tuple[str, str]]


@dataclass(frozen=True, slots=True)
class LearnSome:
    """Work of a process: a few logs.

    known : `LogRow.known` of logs that are not learnt again.
    """

    telling: Telling
    cars: Mapping[Path, Car]
    known: Set[str] = frozenset()

    def __call__(self, tasks: Sequence[_Task]) -> Learnt:
        each = [_learn_log(one, self.telling, self.cars[one.vehicle], self.known) for one in tasks]
        return Learnt(
            [row for one in each for row in one.rows], [two for one in each for two in one.copies]
        )

    def died(self, task: _Task) -> Learnt:
        """Return the row of a log that processes die of."""
        why = "its process died twice: it may need more memory than there is"
        return Learnt([replace(row_of(task, self.cars[task.vehicle]), error=why)], [])


class _Done(NamedTuple):
    """What became of logs.

    learnt : how many were learnt now.   of : how many there are.
    copies : names of those that a row has under another name, and that row's.
    others : rows of the same logs with another setting, and of the same names with other content.
    """

    learnt: int
    of: int
    copies: list[tuple[str, str]]
    others: list[LogRow]


def learn_fleet(
    tasks: Sequence[_Task],
    telling: Telling,
    store: Store,
    spread_map: Map,
    *,
    again: bool = False,
    replacing: bool = False,
    done: Callable[[int, int], None] | None = None,
) -> _Done:
    """Learn the logs that a store has no row of, and keep what comes.

    store : where rows are kept, some at a time, and sorted at the end.
    spread_map : does the work; results may come in any order.
    again : also learn logs whose row holds an error.
    replacing : take `Done.others` out of the store.
    """
    cars = {one: Car.read(one, telling) for one in {task.vehicle for task in tasks}}
    before = [row for row in store.stream(INDEX) if not (again and row.error)]
    by_name = {(row.log, row.setting, row.stamp): row.known for row in before}
    names = {one: (one.log, cars[one.vehicle].setting, one.stamp) for one in tasks}
    left = [one for one in tasks if not one.stamp or names[one] not in by_name]
    current = {by_name[names[one]] for one in set(tasks) - set(left)}
    work = LearnSome(telling, cars, frozenset(row.known for row in before))
    ready, of = len(tasks) - len(left), len(tasks)
    learnt, copies = 0, list[tuple[str, str]]()
    if done is not None:
        done(ready, of)
    for found in spread_map(work, _portions(left)):
        if found.rows:
            store.keep(found.rows)
        here = len({row.log for row in found.rows})
        learnt, ready = learnt + here, ready + here + len(found.copies)
        copies += found.copies
        current |= {row.known for row in found.rows} | {known for _, known in found.copies}
        if done is not None:
            done(ready, of)
    store.settle()
    index = list(store.stream(INDEX))
    store.drop(_overcome(index))
    others = _others(index, {one.log for one in tasks}, current)
    if replacing:
        store.drop(others)
    named = {row.known: row.log for row in index}
    elsewhere = [(log, named[known]) for log, known in copies if named[known] != log]
    return _Done(learnt, of, elsewhere, others)


def _portions(tasks: Sequence[_Task]) -> list[tuple[_Task, ...]]:
    size = min(max(len(tasks) // CHOSEN.portions, 1), CHOSEN.together)
    return [tuple(tasks[k : k + size]) for k in range(0, len(tasks), size)]


def _overcome(index: Sequence[LogRow]) -> list[LogRow]:
    """Return rows of a log that could not be read or parted into runs, and then could."""
    read = {(row.log, row.setting) for row in index if row.content}
    parted = {row.known for row in index if row.run}
    return [
        row
        for row in index
        if (not row.content and (row.log, row.setting) in read)
        or (row.error and not row.run and row.known in parted)
    ]


def _others(index: Sequence[LogRow], names: Set[str], current: Set[str]) -> list[LogRow]:
    """Return rows of the same contents with another setting, or of the same names of other content.

    current : `LogRow.known` of what these logs hold.
    """
    contents = {row.content for row in index if row.content and row.known in current}
    return [
        row
        for row in index
        if row.known not in current and (row.content in contents or row.log in names)
    ]


def on_this_machine(jobs: int) -> Map:
    """Return a map over portions of logs that outlives processes that die; its order is any.

    jobs : processes; one alone is this one.
    """
    if jobs == 1:
        return map

    def spread_map(work: Any, portions: Any) -> Iterator[Learnt]:
        left = list(portions)
        while left:
            finished: set[int] = set()
            for k, found in _until_one_dies(work, left, min(jobs, len(left))):
                finished.add(k)
                yield found
            left = [one for k, one in enumerate(left) if k not in finished]
            for suspect in left[: 2 * jobs]:  # of these one took its process with it
                yield from _carefully(work, suspect)
            left = left[2 * jobs :]

    return spread_map


def on_a_cluster(elsewhere: Callable[..., Iterator[Any]]) -> Map:
    """Return a map over portions of logs that outlives workers that die; its order is any.

    elsewhere : of `tireid.cluster.cluster`; gives `lost` what several workers died of.
    """

    def spread_map(work: Any, portions: Any) -> Iterator[Learnt]:
        suspects: list[Sequence[_Task]] = []
        yield from elsewhere(work, portions, lost=suspects.append)
        alone = [(task,) for portion in suspects for task in portion]
        dead: list[Sequence[_Task]] = []
        yield from elsewhere(work, alone, lost=dead.append)
        for portion in dead:
            yield from map(work.died, portion)

    return spread_map


_WORK: list[LearnSome] = []  # of a process: given once, as it holds what the store knows


def _prepare_process(work: LearnSome) -> None:
    """Keep a process to one thread; import pyarrow, which reads many short logs sooner."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "ARROW_IO_THREADS"):
        os.environ.setdefault(name, "1")
    arrow.is_installed()
    _WORK[:] = [work]


def _work_of_process(portion: Sequence[_Task]) -> Learnt:
    return _WORK[0](portion)


def _until_one_dies(
    work: LearnSome, portions: Sequence[Any], jobs: int
) -> Iterator[tuple[int, Learnt]]:
    """Yield which portion is done and what was learnt, as long as no process dies."""
    pool = fresh_processes(jobs, partial(_prepare_process, work))
    try:
        futures = {pool.submit(_work_of_process, one): k for k, one in enumerate(portions)}
        for future in as_completed(futures):
            try:
                found = future.result()
            except BrokenProcessPool:
                continue
            yield futures[future], found
    finally:
        pool.shutdown(cancel_futures=True)


def _carefully(work: LearnSome, portion: Sequence[_Task]) -> Iterator[Learnt]:
    """Yield what a process of its own learns of a portion; where it dies, log by log."""
    for _, found in _until_one_dies(work, [tuple(portion)], 1):
        yield found
        return
    if len(portion) == 1:
        yield work.died(portion[0])
        return
    for task in portion:
        yield from _carefully(work, [task])
