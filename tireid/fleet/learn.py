"""Learning from thousands of logs: which they are, what is learnt of one, and who does it.

A log is read, learnt and frozen by the default method as `tireid identify` does it, without
figures; then it is gone through once more for what it tells of the tires, with its own frozen model
as the reference (`identifier.axle.information`). A log that cannot be used becomes a row with its
error. Work is done by processes of this machine or by a Dask cluster; a process that dies loses
what it was doing, which is done again, and a log that it dies of twice becomes a row with an error.
"""

import hashlib
import json
import os
import posixpath
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np

from codegen.compiler import CompilationError
from identifier.axle import AxleIdentifier, AxleModel
from identifier.axle.information import Evidence
from identifier.compare.work import Map, fresh_processes
from identifier.frozen import vehicle_numbers
from identifier.inertial import InertialIdentifier
from identifier.reproducibility import counted_samples
from identifier.run import identify, learn
from identifier.stored import load_model
from identifier.tire_model import AXLES
from identifier.verdict import Verdict, judge_prediction
from models.logs import arrow
from models.recordings import LogMap, Recording, RecordingError, read_repaired, runs
from models.vehicle import Vehicle
from tireid.fleet.store import LogRow, Store, bucket_of, file_of, information_columns, needed

TOGETHER = 8  # logs that a process takes at once, and whose rows are written at once
PART = 300.0  # s of a log whose information is kept as one
DT = 0.01  # s, to which logs are brought
Judging = Literal["motion", "full", "none"]
DATE = r"\d{4}-\d{2}-\d{2}(?:[T ][\d.:-]+(?:Z|[+-]\d{2}:?\d{2})?)?"
FIELD = re.compile(r"\{(\w+)\}")
EXPECTED = (ValueError, ArithmeticError, OSError, MemoryError, CompilationError, ImportError)


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A log to be learnt.

    Parameters
    ----------
    log : its name: path or address.
    size : [bytes].
    tags : what its path says.
    date : when it was driven, ISO 8601; of its path, else when the file was written.
    vehicle : path of the car's TOML.
    """

    log: str
    size: int
    tags: tuple[tuple[str, str], ...]
    date: str
    vehicle: Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Telling:
    """What is told of all logs.

    Parameters
    ----------
    log_map : how they are read and repaired.
    weights : stored model that learning begins with; None begins afresh.
    judging : "motion" asks whether the frozen model gives the drive's motion back, "full" for the
        verdict of `tireid identify`, which takes ten times as long, "none" for nothing.
    check : whether a log that contradicts physics or the car is refused.
    part : longest time whose information is kept as one [s].
    """

    log_map: LogMap
    weights: Path | None = None
    judging: Judging = "motion"
    check: bool = True
    part: float = PART

    def __post_init__(self) -> None:
        if not 10.0 <= self.part < float("inf"):
            raise ValueError(f"a part must last at least 10 s, it is {self.part:g} s")

    def digest(self, vehicle: Path) -> str:
        """Return the hash of all that a row follows from beside its log.

        Parameters
        ----------
        vehicle : the car's TOML.
        """
        files = [vehicle.read_bytes(), b"" if self.weights is None else self.weights.read_bytes()]
        words = repr((self.log_map, self.judging, self.check, self.part)).encode()
        return hashlib.blake2b(b"\0".join((*files, words)), digest_size=8).hexdigest()


# Which logs there are, and what their paths say.


def find_logs(
    patterns: Sequence[str], vehicle: str, tags: str = ""
) -> tuple[list[Task], dict[str, str]]:
    """Return the logs that patterns name, in order, and why others are left out.

    Parameters
    ----------
    patterns : paths or addresses with * and **.
    vehicle : path of the car's TOML; {name} in it is replaced by the tag of that name.
    tags : pattern of a path's end with {name} for its parts, as in
        "{vehicle}/{tires}/{date}-{drive}.csv"; empty says nothing.

    Raises
    ------
    ValueError
        Where a pattern names no log, or {name} is no tag.
    """
    core = needed("fsspec.core")
    shape = tag_pattern(tags) if tags else None
    unknown = [one for one in FIELD.findall(vehicle) if one not in FIELD.findall(tags)]
    if unknown:
        raise ValueError(f"--vehicle {vehicle}: {{{unknown[0]}}} is no tag of --tags")
    found: dict[str, Task] = {}
    left: dict[str, str] = {}
    for pattern in patterns:
        fs, path = core.url_to_fs(pattern)
        local = "://" not in pattern
        try:
            listed = fs.glob(path, detail=True)
        except (ValueError, OSError) as error:
            raise ValueError(f"{pattern}: {error}") from error
        files = {name: info for name, info in listed.items() if info.get("type") == "file"}
        if not files:
            raise ValueError(f"{pattern}: names no log")
        for name, info in sorted(files.items()):
            log = _local_name(name) if local else fs.unstrip_protocol(name)
            said = shape.search(posixpath.normpath(log)) if shape is not None else None
            if shape is not None and said is None:
                left[log] = f"its path is not like {tags}"
                continue
            words = {} if said is None else said.groupdict()
            car = FIELD.sub(lambda field, words=words: words[field[1]], vehicle)  # type: ignore[misc]
            found[log] = Task(
                log=log,
                size=int(info.get("size") or 0),
                tags=tuple(sorted(words.items())),
                date=words.get("date") or _written(info),
                vehicle=Path(car),
            )
    return [found[log] for log in sorted(found)], left


def tag_pattern(tags: str) -> re.Pattern[str]:
    """Return the expression that finds tags at the end of a path.

    Parameters
    ----------
    tags : with {name} for what a name stands for; * is anything within a folder's name.

    Raises
    ------
    ValueError
        Where it names nothing, or a name twice.
    """
    names = FIELD.findall(tags)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"--tags {tags}: wants {{name}} for parts of a path, each name once")
    parts = FIELD.split(tags)
    words = [re.escape(text).replace(r"\*", "[^/]*") for text in parts[::2]]
    groups = [f"(?P<{name}>{DATE if name == 'date' else '[^/]+?'})" for name in parts[1::2]]
    body = "".join(a + b for a, b in zip(words, [*groups, ""], strict=True))
    return re.compile(rf"(?:^|/){body}$")


def _local_name(path: str) -> str:
    """Return a path as it reads from the folder that the command runs in, where it lies there."""
    try:
        return Path(path).relative_to(Path.cwd()).as_posix()
    except ValueError:
        return Path(path).as_posix()


def _written(info: Mapping[str, Any]) -> str:
    at = info.get("mtime") or info.get("LastModified") or info.get("created")
    if isinstance(at, datetime):
        return at.astimezone(UTC).isoformat(timespec="seconds")
    return (
        "" if at is None else datetime.fromtimestamp(float(at), UTC).isoformat(timespec="seconds")
    )


# What is learnt of one.


def learn_log(task: Task, telling: Telling, setting: str) -> list[LogRow]:
    """Return the row of a log, one for each run of its file; where it cannot be used, it says why.

    Parameters
    ----------
    task : the log.
    telling : what is told of all logs.
    setting : `Telling.digest` of its car.
    """
    tags = dict(task.tags)
    vehicle_name = tags.get("vehicle", "")
    row = LogRow(
        log=task.log,
        setting=setting,
        size=task.size,
        vehicle=vehicle_name,
        tires=tags.get("tires", ""),
        date=task.date,
        tags=json.dumps(tags, ensure_ascii=False, sort_keys=True),
    )
    try:
        vehicle = Vehicle.from_toml(task.vehicle)
        row = replace(row, vehicle=vehicle_name or vehicle.name)
        with _near(task.log) as path:
            try:
                return [_of_run(row, path, None, vehicle, telling)]
            except RecordingError:
                names = [] if telling.log_map.dbc or telling.log_map.run else runs(path)
                if len(names) < 2:
                    raise
            return [_tried(replace(row, log=f"{row.log}:{name}"), path, name, vehicle, telling)
                    for name in names]  # fmt: skip
    except EXPECTED as error:
        return [_failed(row, error)]


def _tried(row: LogRow, path: Path, run: str, vehicle: Vehicle, telling: Telling) -> LogRow:
    """Return the row of a run; where it cannot be used, it says why."""
    try:
        return _of_run(row, path, run, vehicle, telling)
    except EXPECTED as error:
        return _failed(row, error)


def _failed(row: LogRow, error: Exception) -> LogRow:
    text = " ".join(str(error).split()) or type(error).__name__
    return replace(row, error=text[:500])


def _of_run(row: LogRow, path: Path, run: str | None, vehicle: Vehicle, telling: Telling) -> LogRow:
    recording, vehicle = read_repaired(
        path, vehicle, run, dt=DT, check=telling.check, log_map=telling.log_map
    )
    return learnt(row, recording, vehicle, telling)


def learnt(row: LogRow, recording: Recording, vehicle: Vehicle, telling: Telling) -> LogRow:
    """Return the row with what is learnt of its log.

    Parameters
    ----------
    row : the log's name and what its path says.
    recording : the log, at `DT`.
    vehicle : the car that drove.
    telling : what is told of all logs.

    Raises
    ------
    ValueError, ArithmeticError
        Where nothing can be learnt of it.
    """
    start = None if telling.weights is None else load_model(telling.weights)
    usual = InertialIdentifier if recording.logged_v_y is None else AxleIdentifier
    method = usual.for_vehicle(vehicle, dt=recording.dt)
    counted_samples(recording, method.min_speed)  # refuses a car that never drives
    verdict: Verdict | None = None
    if recording.logged_v_y is None or telling.judging == "full":
        history = identify(recording, vehicle, method, start)
        recording, model = history.recording, history.freeze()
        verdict = history.verdict() if telling.judging == "full" else None
    else:
        model = learn(recording, vehicle, method, start)
    if not isinstance(model, AxleModel):
        raise TypeError(f"{type(method).__name__} freezes no axle model")
    if telling.judging == "motion":
        verdict = judge_prediction(model, recording, another_road=False)
    evidence = Evidence(
        design=AxleIdentifier.for_vehicle(vehicle, dt=recording.dt), reference=model
    )
    parts = evidence.parts(recording, telling.part)
    return replace(
        row,
        **conditions(recording),
        **_of_verdict(verdict),
        **_of_model(model),
        car=json.dumps(vehicle_numbers(vehicle)),
        part_begin=[begin for begin, _ in parts],
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


def conditions(recording: Recording) -> dict[str, Any]:
    """Return how a log was driven, by columns of a row.

    Parameters
    ----------
    recording : the log.
    """
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


def _of_verdict(verdict: Verdict | None) -> dict[str, Any]:
    if verdict is None:
        return {}
    codes = [f"{one.code}{f' {one.axle}' if one.axle else ''}" for one in verdict.findings]
    missed = verdict.measures.get("force_missed")
    each = missed if isinstance(missed, tuple) else (None, None)
    return {
        "valid": verdict.valid,
        "findings": codes,
        **{f"missed_{axle}": one for axle, one in zip(AXLES, each, strict=True)},
    }


def _of_model(model: AxleModel) -> dict[str, Any]:
    numbers = {
        "stiffness": model.cornering_stiffness,
        "grip": model.W.sum(axis=1),
        "relaxation": model.relaxation_length,
        "known": model.known_slip,
    }
    told = {
        f"{name}_{axle}": float(value)
        for name, both in numbers.items()
        for axle, value in zip(AXLES, both, strict=True)
    }
    text = json.dumps(model.to_dict(), ensure_ascii=False)
    return {**told, "model": text, "excitation": model.excitation.ravel().tolist()}


# Who does it.


@dataclass(frozen=True, slots=True)
class LearnSome:
    """Work of a process: a few logs.

    Parameters
    ----------
    telling : what is told of all logs.
    settings : `Telling.digest` by the car's TOML.
    """

    telling: Telling
    settings: Mapping[Path, str]

    def __call__(self, tasks: Sequence[Task]) -> list[LogRow]:
        """Return the rows of some logs.

        Parameters
        ----------
        tasks : the logs.
        """
        return [
            row for one in tasks for row in learn_log(one, self.telling, self.settings[one.vehicle])
        ]


def learn_fleet(
    tasks: Sequence[Task],
    telling: Telling,
    store: Store,
    spread_map: Map,
    *,
    again: bool = False,
    done: Callable[[int, int], None] | None = None,
) -> tuple[int, int]:
    """Learn the logs that a store has no row of, and keep what comes; return how many, and of all.

    Parameters
    ----------
    tasks : the logs.
    telling : what is told of all of them.
    store : where rows are kept, some at a time, and sorted at the end.
    spread_map : does the work; results may come in any order.
    again : also learn logs whose row holds an error.
    done : told how many logs are ready, and of how many.
    """
    settings = {one: telling.digest(one) for one in {task.vehicle for task in tasks}}
    known = {
        (name, row.setting, row.size)
        for row in store.rows(("log", "setting", "size", "error"))
        for name in (row.log, file_of(row.log))
        if not (again and row.error)
    }
    left = [one for one in tasks if (one.log, settings[one.vehicle], one.size) not in known]
    ready, of = len(tasks) - len(left), len(tasks)
    if done is not None:
        done(ready, of)
    for rows in spread_map(LearnSome(telling, settings), _together(left)):
        store.keep(rows)
        ready += len({file_of(row.log) for row in rows})
        if done is not None:
            done(ready, of)
    store.settle()
    return len(left), of


def _together(tasks: Sequence[Task]) -> list[tuple[Task, ...]]:
    """Return logs in portions, each of one bucket, in the order of the first log of each."""
    open_: dict[int, list[Task]] = {}
    portions: list[tuple[Task, ...]] = []
    for task in tasks:
        some = open_.setdefault(bucket_of(task.log), [])
        some.append(task)
        if len(some) == TOGETHER:
            portions.append(tuple(open_.pop(bucket_of(task.log))))
    return [*portions, *(tuple(some) for some in open_.values())]


def on_this_machine(jobs: int) -> Map:
    """Return a map over portions of logs that outlives processes that die; its order is any.

    Parameters
    ----------
    jobs : processes; one alone is this one.
    """
    if jobs == 1:
        return map

    def spread_map(work: Callable[[Any], Any], portions: Any) -> Iterator[list[LogRow]]:
        left = list(portions)
        while left:
            finished: set[int] = set()
            for k, rows in _until_one_dies(work, left, min(jobs, len(left))):
                finished.add(k)
                yield rows
            left = [one for k, one in enumerate(left) if k not in finished]
            for suspect in left[: 2 * jobs]:  # of these one took its process with it
                yield _carefully(work, suspect)
            left = left[2 * jobs :]

    return spread_map


def on_a_cluster(elsewhere: Callable[..., Iterator[Any]]) -> Map:
    """Return a map over portions of logs that outlives workers that die; its order is any.

    Parameters
    ----------
    elsewhere : of `tireid.cluster.cluster`; tells `lost` what several workers died of.
    """

    def spread_map(work: Callable[[Any], Any], portions: Any) -> Iterator[list[LogRow]]:
        suspects: list[Sequence[Task]] = []
        yield from elsewhere(work, portions, lost=suspects.append)
        alone = [(task,) for portion in suspects for task in portion]
        dead: list[Sequence[Task]] = []
        yield from elsewhere(work, alone, lost=dead.append)
        for portion in dead:
            yield [_died(task, work) for task in portion]

    return spread_map


def _prepare_process() -> None:
    """Keep a process to one thread; import pyarrow, which reads many short logs sooner."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "ARROW_IO_THREADS"):
        os.environ.setdefault(name, "1")
    arrow.is_installed()


def _until_one_dies(
    work: Callable[[Any], list[LogRow]], portions: Sequence[Any], jobs: int
) -> Iterator[tuple[int, list[LogRow]]]:
    """Yield which portion is done and its rows, as long as no process dies."""
    pool = fresh_processes(jobs, _prepare_process)
    try:
        futures = {pool.submit(work, one): k for k, one in enumerate(portions)}
        for future in as_completed(futures):
            try:
                rows = future.result()
            except BrokenProcessPool:
                continue
            yield futures[future], rows
    finally:
        pool.shutdown(cancel_futures=True)


def _carefully(work: Callable[[Any], list[LogRow]], portion: Sequence[Task]) -> list[LogRow]:
    """Return the rows of a portion from a process of its own; where it dies, log by log."""
    for _, rows in _until_one_dies(work, [tuple(portion)], 1):
        return rows
    if len(portion) == 1:
        return [_died(portion[0], work)]
    return [row for task in portion for row in _carefully(work, [task])]


def _died(task: Task, work: Any) -> LogRow:
    return LogRow(
        log=task.log,
        setting=work.settings[task.vehicle],
        size=task.size,
        vehicle=dict(task.tags).get("vehicle", ""),
        tires=dict(task.tags).get("tires", ""),
        date=task.date,
        tags=json.dumps(dict(task.tags), ensure_ascii=False, sort_keys=True),
        error="the process that learnt it died, twice: it may want more memory than there is",
    )
