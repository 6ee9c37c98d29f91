"""Thousands of logs, here a few: learnt once, kept whatever happens, merged, and watched over."""

import hashlib
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tireid.commands.fleet as command
import tireid.fleet.learn as learning
import tireid.fleet.store as storing
from benchmarks.local_cluster import free_port, start
from identifier.estimate.information import coordinates
from identifier.estimate.model import FittedModel
from identifier.estimate.priors import Priors
from identifier.motion.parameters import INDEX
from identifier.tire_model import load_model
from identifier.verdict import judge_identification
from models.recordings import read_recording, write_recording
from models.vehicle import sedan
from tireid.cli import main
from tireid.cluster import cluster
from tireid.exchange import claim
from tireid.fleet.learn import (
    Car,
    LearnSome,
    Learnt,
    Telling,
    find_logs,
    learn_fleet,
    on_a_cluster,
    on_this_machine,
)
from tireid.fleet.merge import MergeError, fleet_prior, merge, usable
from tireid.fleet.store import Store, StoreError, information_columns
from tireid.fleet.watch import Watching, watch
from tireid.learning import identify

for name in ("pyarrow", "fsspec"):
    pytest.importorskip(name, reason="needs a store")
pytestmark = pytest.mark.filterwarnings("default")  # Dask's own

DAYS = 3
CAR, TAGS = "cars/{vehicle}.toml", "{vehicle}/{tires}/{date}-*.csv"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory, logs):
    """A folder of two cars' logs, two drives over and over, and one log that is none."""
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "cars").mkdir()
    for car in ("red", "blue"):
        replace(sedan(), name=car, chassis=None).to_toml(folder / "cars" / f"{car}.toml")
        (folder / car / "summer").mkdir(parents=True)
        for day in range(DAYS):
            for drive in ("slalom", "quick"):
                path = folder / car / "summer" / f"2026-03-{day + 1:02d}-{drive}.csv"
                path.write_bytes((logs / f"{drive}.csv").read_bytes() + b"\n" * day)
    (folder / "red" / "summer" / "2026-03-09-broken.csv").write_text("t,vx\n0,1\n")
    return folder


@pytest.fixture(autouse=True)
def there(fleet, monkeypatch):
    monkeypatch.chdir(fleet)


def learnt(out, *more):
    words = ["fleet", "learn", "*/*/*.csv", "--vehicle", CAR, "--tags", TAGS, "--out", str(out)]
    return main([*words, "--jobs", "1", *more])


@pytest.fixture(scope="module")
def store(fleet, tmp_path_factory):
    """The address of a store of all logs."""
    out, before = tmp_path_factory.mktemp("store") / "all", Path.cwd()
    os.chdir(fleet)
    try:
        assert learnt(out) == 1  # one log is none
    finally:
        os.chdir(before)
    return str(out)


def fleet_model(car):
    """The estimate of a car of which nothing was learnt."""
    usual = Priors.of(car)
    return FittedModel(
        vehicle=car, p=usual.mean, covariance=usual.covariance, driven=np.zeros(2),
        speeds=np.array([10.0, 20.0]), a_x=np.zeros(2), unexplained=np.full(2, 0.6),
    )  # fmt: skip


def used(rows):
    return [row for row in rows if usable(row, refused=True)]


def digest(out):
    """A hash of every file of a store."""
    files = sorted(path for path in Path(out).rglob("*") if path.is_file())
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_each_log_becomes_a_row_and_a_bad_one_says_why(store):
    rows = Store(store).rows()
    assert len(rows) == 4 * DAYS + 1
    (bad,) = [row for row in rows if row.error]
    assert bad.log == str(Path("red/summer/2026-03-09-broken.csv").absolute())
    assert "column" in bad.error and bad.date == "2026-03-09"
    assert not bad.model and not usable(bad)
    good = rows[0]
    assert (good.vehicle, good.tires, good.date) == ("blue", "summer", "2026-03-01")
    assert good.declared_car.name == "blue"


def test_a_store_is_read_without_the_threads_of_a_dataset(store):
    # They may hold a file of Python's while Python ends, which aborts the program.
    program = (
        "import sys; from tireid.fleet.store import Store; "
        f"assert Store({store!r}).rows(); print('pyarrow._dataset' in sys.modules)"
    )
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (told.returncode, told.stdout) == (0, "False\n"), told.stderr


def test_what_is_there_is_not_learnt_again_and_what_is_new_is(store, fleet, tmp_path, capsys):
    store = shutil.copytree(store, tmp_path / "store")
    assert learnt(store) == 1
    assert "0 identified now, 13 before" in capsys.readouterr().out
    assert learnt(store, "--again") == 1
    assert "1 identified now, 12 before" in capsys.readouterr().out
    extra = fleet / "blue" / "summer" / "2026-03-20-more.csv"
    extra.write_bytes((fleet / "blue/summer/2026-03-01-quick.csv").read_bytes() + b"\n" * 9)
    try:
        before = digest(store)
        assert learnt(store) == 1
        assert "1 identified now, 13 before" in capsys.readouterr().out
        changed = {name for name, one in digest(store).items() if before.get(name) != one}
        assert len(changed) == 1  # its bucket alone
    finally:
        extra.unlink()


def test_a_file_of_a_store_that_somebody_changed_is_refused_by_its_name(store, tmp_path):
    import pyarrow
    from pyarrow import parquet

    out = tmp_path / "changed"
    shutil.copytree(store, out)
    path = sorted((out / "logs").iterdir())[0]
    table = parquet.read_table(path)
    for name, values, said in (
        ("log", pyarrow.nulls(len(table), pyarrow.string()), "log must be the name of a log in ev"),
        ("size", pyarrow.array(["many"] * len(table)), "size must be of type int64, it is string"),
    ):
        at = table.column_names.index(name)
        parquet.write_table(table.set_column(at, name, values), path)
        with pytest.raises(StoreError, match=f"^{path}: {said}"):
            Store(str(out)).rows()
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(StoreError, match=f"^{path}: must be a file, it is a device, pipe or soc"):
        Store(str(out)).rows()


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("matrix", lambda one: one[:-1], r"matrix must hold \d+ numbers, not"),
        ("part_seconds", lambda one: [*one, 0.0], r"part_seconds must hold \d+ numbers, not"),
        ("vector", lambda one: [math.nan] * len(one), "vector holds a number that is not finite"),
        ("part_seconds", lambda one: [-1.0] * len(one), "seconds must not be negative"),
    ],
)
def test_a_row_whose_numbers_do_not_fit_is_named_with_its_column(store, name, change, said):
    row = next(row for row in Store(store).rows() if row.parts)
    broken = replace(row, **{name: change(list(getattr(row, name)))})
    with pytest.raises(StoreError, match=f"bucket-.*{re.escape(repr(row.log))}: .*{said}"):
        _ = broken.parts


def test_a_car_and_a_reach_that_are_none_are_named(store):
    row = next(row for row in Store(store).rows() if row.parts)
    with pytest.raises(StoreError, match=r"bucket-.*: car is none: vehicle\.mass is missing"):
        _ = replace(row, car="{}").declared_car
    with pytest.raises(StoreError, match="reach must hold 8 numbers, not 7"):
        merge(lambda: iter([replace(row, reach=row.reach[1:])]), [])


def test_each_run_of_a_file_is_a_row(logs, tmp_path, capsys):
    lines = [(logs / f"{name}.csv").read_text().splitlines() for name in ("slalom", "quick")]
    runs = [f"{one},{k}" for k, some in enumerate(lines) for one in some[1:]]
    (tmp_path / "two.csv").write_text("\n".join([f"{lines[0][0]},run", *runs]) + "\n")
    words = ["fleet", "learn", str(tmp_path / "*.csv"), "--vehicle", "cars/red.toml", "--jobs", "1"]
    for told in ("1 identified now, 0 before", "0 identified now, 1 before"):
        assert main([*words, "--out", str(tmp_path / "store")]) == 0
        assert told in capsys.readouterr().out
    rows = Store(str(tmp_path / "store")).rows()
    assert [Path(row.name).name for row in rows] == ["two.csv:0", "two.csv:1"]
    assert {row.log for row in rows} == {str(tmp_path / "two.csv")}
    assert rows[0].stiffness_front != rows[1].stiffness_front


def rows_in(store, *columns):
    return Store(str(store)).rows(("log", "run", "content", "setting", *columns))


@pytest.fixture
def garage(tmp_path, logs):
    """Two cars' folders that look alike: car.toml and logs of the same names."""
    for k, car in enumerate(("one", "two")):
        (tmp_path / car / "logs").mkdir(parents=True)
        told = replace(sedan(), mass=1500.0 + 10.0 * k, chassis=None)
        told.to_toml(tmp_path / car / "car.toml")
        for day in range(4):
            path = tmp_path / car / "logs" / f"{day}.csv"
            path.write_bytes((logs / "quick.csv").read_bytes() + b"\n" * day)
    return tmp_path


def learns(pattern, out, *more, vehicle="car.toml"):
    words = ["--vehicle", str(vehicle), "--out", str(out), "--jobs", "1", "--judge", "none", *more]
    return main(["fleet", "learn", str(pattern), *words])


def test_the_same_logs_from_another_folder_are_known_and_counted_once(garage, monkeypatch, capsys):
    store, car, merged = garage / "store", garage / "one" / "car.toml", garage / "merged"
    for folder, pattern, told in (
        (garage, garage / "one" / "logs" / "*.csv", "4 identified now, 0 before"),
        (garage / "two", garage / "one" / "logs" / "*.csv", "0 identified now, 4 before"),
        (garage / "one" / "logs", "*.csv", "0 identified now, 4 before"),
        (garage, "two/../one/logs/*.csv", "0 identified now, 4 before"),
    ):
        monkeypatch.chdir(folder)
        assert learns(pattern, store, vehicle=car) == 0
        assert told in capsys.readouterr().out
    assert [row.log for row in rows_in(store)] == [
        str(garage / "one" / "logs" / f"{day}.csv") for day in range(4)
    ]
    assert main(["fleet", "merge", str(store), "--out", str(merged)]) == 0
    (model,) = json.loads((merged / "models.json").read_text())
    assert model["logs"] == 4


def test_two_cars_whose_folders_look_alike_lose_no_log(garage, monkeypatch, capsys):
    store = garage / "store"
    for car in ("one", "two"):
        monkeypatch.chdir(garage / car)
        assert learns("logs/*.csv", garage / "named", "--root", "logs") == 0
        assert "4 identified now, 0 before" in capsys.readouterr().out
        assert learns("logs/*.csv", store) == 0
        assert "4 identified now, 0 before" in capsys.readouterr().out
    assert len(rows_in(store)) == 8
    names = [row.log for row in rows_in(garage / "named")]
    assert names == sorted(2 * [f"{day}.csv" for day in range(4)])
    assert main(["fleet", "merge", str(store), "--out", str(garage / "no")]) == 2
    assert "are of cars whose files differ" in capsys.readouterr().err
    words = ["--by", "setting", "--out", str(garage / "merged")]
    assert main(["fleet", "merge", str(store), *words]) == 0
    assert [one["logs"] for one in json.loads((garage / "merged/models.json").read_text())] == [
        4,
        4,
    ]


def test_a_copy_counts_once_whichever_is_learnt_and_is_named(garage, monkeypatch, capsys):
    monkeypatch.chdir(garage / "one")
    shutil.copy("logs/2.csv", "logs/a.csv")
    assert learns("logs/*.csv", "store") == 0
    assert [Path(row.log).name for row in rows_in("store")] == ["0.csv", "1.csv", "2.csv", "3.csv"]
    shutil.copy("logs/2.csv", "logs/b.csv")
    capsys.readouterr()
    assert learns("logs/b.csv", "store") == 0
    printed = capsys.readouterr()
    assert "1 logs" in printed.out and "0 identified now, 1 before" in printed.out
    assert f"{garage}/one/logs/b.csv: is in the store as {garage}/one/logs/2.csv" in printed.err


def test_what_was_learnt_otherwise_is_told_of_and_replaced_where_asked(garage, monkeypatch, capsys):
    monkeypatch.chdir(garage / "one")
    assert learns("logs/*.csv", "store") == 0
    changed = Path("logs/3.csv")
    changed.write_bytes(changed.read_bytes() + b"\n")
    capsys.readouterr()
    assert learns("logs/*.csv", "store") == 0
    printed = capsys.readouterr()
    assert "1 identified now, 3 before" in printed.out and len(rows_in("store")) == 5
    assert "3.csv and 0 others are in the store with another car, other options" in printed.err
    assert learns("logs/*.csv", "store", "--part", "60") == 0
    assert len(rows_in("store")) == 9
    assert main(["fleet", "merge", "store", "--out", "merged"]) == 2
    assert "has rows of two settings" in capsys.readouterr().err
    for _ in range(2):
        assert learns("logs/*.csv", "store", "--part", "60", "--replace") == 0
    assert len(rows_in("store")) == 4 and len({row.setting for row in rows_in("store")}) == 1
    assert "removed from the store, as were 4 others" in capsys.readouterr().err
    assert main(["fleet", "merge", "store", "--out", "merged"]) == 0


def test_a_log_that_could_not_be_read_is_learnt_once_it_can(garage, monkeypatch):
    monkeypatch.chdir(garage / "one")
    telling, store = Telling(log_map=learning.LogMap(), judging="none"), Store("store")
    tasks, _ = find_logs(["logs/0.csv"], "car.toml")
    dead = LearnSome(telling, {Path("car.toml"): Car.read(Path("car.toml"), telling)}).died(
        tasks[0]
    )
    learn_fleet(tasks, telling, store, lambda work, portions: [dead])
    (row,) = store.rows()
    assert not row.content and "died" in row.error
    assert learn_fleet(tasks, telling, store, map).learnt == 0  # it would die again
    assert learn_fleet(tasks, telling, store, map, again=True).learnt == 1
    (row,) = store.rows()
    assert (
        row.content == hashlib.blake2b(Path("logs/0.csv").read_bytes(), digest_size=16).hexdigest()
    )
    assert not row.error and row.seconds > 3.0


def test_a_setting_is_what_files_hold_and_not_where_they_lie(garage, monkeypatch):
    monkeypatch.chdir(garage)
    for name in ("a.dbc", "b.dbc"):
        Path(name).write_text("VERSION")
    one = sedan()

    def of(vehicle=one, **told):
        return Telling(log_map=learning.LogMap(**told)).digest(vehicle)

    assert of(dbc="a.dbc") == of(dbc="b.dbc") == of(dbc=str(garage / "a.dbc")) != of()
    told = Telling(log_map=learning.LogMap(dbc="a.dbc"))
    assert told.log_map.dbc == str(garage / "a.dbc")
    before = of(dbc="a.dbc")
    Path("a.dbc").write_text("VERSION 2")
    assert of(dbc="a.dbc") != before
    others = [of(replace(one, mass=1501.0)), of(axes="SAE")]
    plain = Telling(log_map=learning.LogMap())
    start = fleet_model(one)
    for change in ({"judging": "none"}, {"check": False}, {"part": 60.0}, {"start": start}):
        others.append(replace(plain, **change).digest(one))
    assert len({of(), *others}) == 1 + len(others)
    read = [Car.read(garage / name / "car.toml", plain) for name in ("one", "two", "one")]
    assert read[0] == read[2] and read[0].setting != read[1].setting


class StoppedError(Exception):
    pass


def test_a_row_tells_how_its_log_was_driven_and_what_was_learnt(store, logs):
    row = next(one for one in Store(store).rows() if one.log.endswith("quick.csv"))
    log = read_recording(logs / "quick.csv")
    a_y = [v * r for v, r in zip(log.v_x, log.r, strict=True)]
    assert row.a_y_rms == pytest.approx(math.sqrt(sum(one * one for one in a_y) / len(a_y)))
    assert row.a_y_most == pytest.approx(max(map(abs, a_y)))
    assert row.v_x_mean == pytest.approx(sum(log.v_x) / len(log.v_x))
    assert (row.v_x_most, row.steering_most) == (max(log.v_x), max(map(abs, log.delta_f)))
    assert row.seconds == log.t[-1] - log.t[0] and row.estimated_v_y is False
    model = row.frozen
    for i, axle in enumerate(("front", "rear")):
        assert getattr(row, f"stiffness_{axle}") == model.stiffness[i]
        assert getattr(row, f"grip_{axle}") == pytest.approx(math.exp(model[f"ln_grip_{axle[0]}"]))
        assert getattr(row, f"relaxation_{axle}") == model.relaxation_length[i]
        assert getattr(row, f"known_{axle}") == model.known_slip[i]
    assert row.reach == [*model.driven, *model.speeds, *model.a_x, *model.unexplained]
    judged = judge_identification(model, log)
    assert row.valid is judged.valid and len(row.findings) == len(judged.findings)
    assert [row.missed_front, row.missed_rear] == list(judged.measures["force_missed"])
    assert all(one.code in told for one, told in zip(judged.findings, row.findings, strict=True))
    assert row.part_begin == [pytest.approx(0.0)] and 3.0 < row.part_seconds[0] < row.seconds


def test_a_log_without_v_y_is_learnt_and_has_the_date_of_its_file(garage, monkeypatch):
    monkeypatch.chdir(garage / "one")
    log = replace(read_recording("logs/0.csv"), v_y=None)
    Path("logs").rename("before")
    write_recording(log, "without.csv")
    os.utime("without.csv", (1.7e9, 1.7e9))
    shutil.copy("before/1.csv", "with.csv")
    assert learns("without.csv", "none") == 0
    (alone,) = Store("none").rows()
    assert (alone.error, alone.valid) == ("", None)
    assert learns("*.csv", "s", "--judge", "motion") == 0
    other, row = Store("s").rows()
    assert (other.estimated_v_y, row.estimated_v_y) == (False, True)
    assert None not in (other.valid, row.valid) and not row.error
    assert len(row.part_begin) == len(other.part_begin) == 1  # to be merged, both
    assert row.model == alone.model
    assert (row.date, row.vehicle, row.tires) == ("2023-11-14T22:13:20+00:00", sedan().name, "")


def test_logs_at_an_address_are_known_by_what_their_file_system_says(garage, logs, monkeypatch):
    from fsspec.implementations.memory import MemoryFileSystem

    monkeypatch.chdir(garage / "one")
    fs, text = MemoryFileSystem(), (logs / "quick.csv").read_bytes()
    telling, store = Telling(log_map=learning.LogMap(), judging="none"), Store("store")

    def learnt_now():
        tasks, left = find_logs(
            ["memory://drives/*/*.csv"], "car.toml", "{tires}/{date}-*.csv", "memory://drives"
        )
        assert list(left) == ["wet/0.csv", "wet/last.csv"]
        return learn_fleet(tasks, telling, store, map).learnt

    try:
        fs.pipe_file("/drives/wet/2026-03-01T10:00-a.csv", text)
        for name in ("0", "last"):
            fs.pipe_file(f"/drives/wet/{name}.csv", text)
        assert (learnt_now(), learnt_now()) == (1, 0)
        fs.pipe_file("/drives/wet/2026-03-01T10:00-a.csv", text[:-1] + b" ")  # of the same size
        assert learnt_now() == 1
        rows = store.rows()
        assert {row.log for row in rows} == {"wet/2026-03-01T10:00-a.csv"} and len(rows) == 2
        assert (rows[0].tires, rows[0].date, rows[0].size) == ("wet", "2026-03-01T10:00", len(text))
        assert json.loads(rows[0].tags) == {"tires": "wet", "date": "2026-03-01T10:00"}
        (task,), _ = find_logs(["memory://drives/wet/last.csv"], "car.toml")
        assert task.log == task.address == fs.unstrip_protocol("/drives/wet/last.csv")
        assert task.date == fs.info("/drives/wet/last.csv")["created"].isoformat(timespec="seconds")
    finally:
        fs.rm("/drives", recursive=True)
    silent = {"name": "a", "size": 3, "type": "file"}
    assert learning._stamp("http://host/a", silent) == ""
    told = [{**silent, "ETag": "x"}, {**silent, "ETag": "y"}, {**silent, "LastModified": "x"}]
    stamps = {learning._stamp("s3://host/a", one) for one in [*told, {**told[0], "size": 4}]}
    assert len(stamps) == 4 and "" not in stamps


def test_a_store_is_sorted_in_rounds_and_emptied_row_by_row(store, tmp_path, monkeypatch):
    rows, whole, parts = Store(store).rows(), Store(str(tmp_path / "a")), Store(str(tmp_path / "b"))
    for out in (whole, parts):
        for row in rows:
            out.keep([row])
        monkeypatch.setattr(
            storing, "CHOSEN", storing.CHOSEN._replace(files_at_once=2 if out is parts else 1000)
        )
        out.settle()
    assert digest(tmp_path / "a") == digest(tmp_path / "b") == digest(store)
    parts.drop(rows[:3])
    assert parts.rows() == rows[3:]
    parts.drop(rows[3:])
    assert not parts.exists and not list((tmp_path / "b" / "logs").iterdir())


def test_few_logs_are_shared_into_as_many_portions_and_many_by_eight():
    sizes = {n: [len(one) for one in learning._portions(range(n))] for n in (0, 5, 40, 500)}
    assert sizes[0] == [] and sizes[5] == [1] * 5 and sizes[40] == [2] * 20
    assert set(sizes[500][:-1]) == {8} and sum(sizes[500]) == 500


def test_a_run_that_was_stopped_goes_on_and_ends_with_the_same_bytes(tmp_path, monkeypatch):
    tasks, _ = find_logs(["*/*/*.csv"], CAR, TAGS)
    telling = Telling(log_map=learning.LogMap())
    whole, halted = Store(str(tmp_path / "whole")), Store(str(tmp_path / "halted"))
    learn_fleet(tasks, telling, whole, map)

    def stopping(work, portions):
        for k, one in enumerate(portions):
            if k == 3:
                raise StoppedError
            yield work(one)

    with pytest.raises(StoppedError):
        learn_fleet(tasks, telling, halted, stopping)
    kept = len(halted.rows(("log",)))
    assert 0 < kept < len(tasks)
    done = []

    def backwards(work, portions):
        for one in reversed(list(portions)):
            done.append(len(one))
            yield work(one)

    learn_fleet(tasks, telling, halted, backwards)
    assert sum(done) == len(tasks) - kept
    assert digest(tmp_path / "halted") == digest(tmp_path / "whole")


DEADLY = "red/summer/2026-03-02-quick.csv"


class Deadly(LearnSome):
    def __call__(self, tasks):
        if any(task.log.endswith(DEADLY) for task in tasks):
            os.kill(os.getpid(), signal.SIGKILL)
        return Learnt([learning.row_of(task, self.cars[task.vehicle]) for task in tasks], [])


def harmless(tasks):
    telling = Telling(log_map=learning.LogMap(), judging="none")
    return telling, {task.vehicle: Car.read(task.vehicle, telling) for task in tasks}


@pytest.mark.heavy
def test_a_log_that_kills_its_process_costs_its_own_row_alone():
    tasks, _ = find_logs(["red/summer/2026-03-02-*.csv", "red/summer/*-03-quick.csv"], CAR, TAGS)
    work = Deadly(*harmless(tasks))
    rows = [row for some in on_this_machine(2)(work, [tuple(tasks)]) for row in some.rows]
    assert sorted(row.log for row in rows) == [task.log for task in tasks]
    (dead,) = [row for row in rows if "died" in row.error]
    assert dead.log.endswith(DEADLY) and (dead.vehicle, dead.date) == ("red", "2026-03-02")
    assert dead.setting == rows[0].setting != "" and dead.stamp == tasks[0].stamp


def test_a_log_that_kills_workers_of_a_cluster_costs_its_own_row_alone():
    tasks, _ = find_logs(["red/summer/*.csv"], CAR, TAGS)

    def elsewhere(work, portions, *, lost):
        for portion in portions:
            if any(task.log.endswith(DEADLY) for task in portion):
                lost(portion)
            else:
                yield work(portion)

    work = LearnSome(*harmless(tasks))
    found = list(on_a_cluster(elsewhere)(work, [tuple(tasks)]))
    rows = [row for some in found for row in some.rows]
    assert sorted(row.log for row in rows) == [task.log for task in tasks]
    assert [row.log for row in rows if "died" in row.error] == [str(Path(DEADLY).absolute())]


@pytest.mark.heavy
def test_a_dask_worker_that_is_killed_loses_nothing_and_the_bytes_are_the_same(tmp_path):
    pytest.importorskip("distributed", reason="needs Dask")
    tasks, _ = find_logs(["*/*/*.csv"], CAR, TAGS)
    telling = Telling(log_map=learning.LogMap())
    here, there = Store(str(tmp_path / "here")), Store(str(tmp_path / "there"))
    learn_fleet(tasks, telling, here, map)
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    options = [address, "--nthreads", "1", "--no-nanny"]
    running = [
        start("scheduler", ["--host", "127.0.0.1", "--port", str(port)], tmp_path),
        *(start("worker", options, tmp_path) for _ in range(2)),
    ]
    killed = []

    def kill_one(ready, of):
        if ready > 0 and not killed:
            killed.append(ready)
            running[1].kill()

    try:
        with cluster(address) as elsewhere:
            learn_fleet(tasks, telling, there, on_a_cluster(elsewhere), done=kill_one)
    finally:
        for process in reversed(running):
            process.kill()
            process.wait(timeout=20)
    assert killed and killed[0] < len(tasks)
    assert digest(tmp_path / "there") == digest(tmp_path / "here")


def test_a_store_lies_at_any_address_and_each_portion_costs_one_request(store, monkeypatch):
    memory = pytest.importorskip("fsspec.implementations.memory").MemoryFileSystem
    asked = []

    def counted(name, of):
        return lambda *words, **more: (asked.append(name), of(*words, **more))[1]

    for name in ("pipe_file", "cat_file", "open", "mv", "rm", "ls", "makedirs", "info"):
        monkeypatch.setattr(memory, name, counted(name, getattr(memory, name)))
    away, rows = Store("memory://fleet"), Store(store).rows()
    try:
        for k in range(0, len(rows), 5):
            away.keep(rows[k : k + 5])
        assert asked.count("pipe_file") == len(range(0, len(rows), 5))
        assert set(asked) <= {"pipe_file", "open"}  # by which the memory itself is written
        assert away.exists and away.rows(("log",)) == Store(store).rows(("log",))
        asked.clear()
        away.settle()
        buckets = len({row.bucket for row in rows})
        assert asked.count("pipe_file") == buckets and asked.count("cat_file") == 3
        assert asked.count("ls") <= 2 and "makedirs" not in asked and "mv" not in asked
        assert away.rows() == rows
        monkeypatch.setattr(
            storing, "CHOSEN", storing.CHOSEN._replace(small=0)
        )  # then what is asked for is fetched alone
        assert away.rows(("log", "vector")) == Store(store).rows(("log", "vector"))
    finally:
        away._place[0].rm("/fleet", recursive=True)


def test_models_are_merged_by_what_logs_have_in_common(store, tmp_path, capsys):
    out = tmp_path / "merged"
    assert main(["fleet", "merge", store, "--all", "--by", "vehicle,week", "--out", str(out)]) == 0
    told = json.loads((out / "models.json").read_text())
    assert [(one["vehicle"], one["week"]) for one in told] == [
        ("blue", "2026-W09"), ("blue", "2026-W10"), ("red", "2026-W09"), ("red", "2026-W10"),
    ]  # fmt: skip
    assert sum(one["logs"] for one in told) >= 4 * DAYS
    model = load_model(out / told[0]["file"])
    assert model.stiffness == pytest.approx(told[0]["cornering_stiffness_N_rad"])
    assert "blue 2026-W09" in capsys.readouterr().out


def test_a_question_in_sql_chooses_rows_and_sees_nothing_else(store):
    pytest.importorskip("duckdb", reason="needs DuckDB")
    rows = Store(store).rows(where="vehicle = 'red' AND error = ''")
    assert {row.vehicle for row in rows} == {"red"} and len(rows) == 2 * DAYS
    some = Store(store).rows(("log",), where="len(part_seconds) = 1 AND model LIKE '%fit%'")
    assert len(some) == 4 * DAYS and {row.model for row in some} == {""}
    for wrong in ("nobody > 3", "log IN (SELECT content FROM read_text('cars/red.toml'))"):
        with pytest.raises(StoreError, match=r"all: "):
            Store(store).rows(where=wrong)


def test_stiffness_of_a_small_car_has_digits_in_the_table(store):
    (group, *_) = merge(lambda: used(Store(store).rows(where="vehicle = 'red'")), [])
    names = ("mass", "yaw_inertia", "cornering_stiffness_front", "cornering_stiffness_rear")
    loads = {name: 1e-3 * getattr(group.model.vehicle, name) for name in names}
    small = replace(group.model, vehicle=replace(group.model.vehicle, **loads))
    words = command._table([replace(group, model=small)]).split("kN/rad")[0].replace(",", "")
    told = [float(one) for one in re.findall(r"([\d.]+) ±", words)[-2:]]
    assert told == pytest.approx(small.stiffness / 1e3, rel=0.02)


def test_cars_of_another_kind_are_not_merged(store):
    rows = used(Store(store).rows())
    with pytest.raises(MergeError, match="are of cars whose files differ: merge --by vehicle"):
        merge(lambda: rows, [])
    with pytest.raises(
        MergeError, match="'driver' is none of what is known of it: vehicle, tires"
    ) as no:
        merge(lambda: rows, ["driver"])
    known = str(no.value).rpartition(": ")[2].split(", ")
    assert len(set(known)) == len(known)
    with pytest.raises(MergeError, match="must begin with year-month-day"):
        merge(lambda: [replace(rows[0], date="yesterday")], ["week"])


def test_the_next_car_starts_where_the_fleet_is(store, tmp_path):
    out = tmp_path / "prior.json"
    words = ["fleet", "prior", store, "--all", "--vehicle", "cars/red.toml", "--out", str(out)]
    assert main(words) == 0
    prior = load_model(out)
    groups = merge(lambda: used(Store(store).rows()), ["vehicle"])
    fleet = np.mean([one.model.stiffness for one in groups], axis=0)
    told = fleet_model(sedan()).stiffness
    assert np.abs(prior.stiffness - fleet).max() < 0.8 * np.abs(told - fleet).max()
    recording = read_recording("red/summer/2026-03-01-quick.csv")
    short = recording[0.0:1.5]
    begun = identify(short, prior.vehicle, start=prior, check=False).tire
    afresh = identify(short, prior.vehicle, check=False).tire
    away = [np.abs(one.stiffness - fleet).max() for one in (begun, afresh)]
    assert away[0] < away[1]
    with pytest.raises(MergeError, match="no log of the store can be used"):
        fleet_prior([])


# Watching, on rows that are made: information of one drive, and tires that are chosen.


def rows_of(store, truths, *, noise=0.004, seed=0):
    """Rows of one car, a log a day, whose tires have a stiffness and a friction of their own."""
    rng = np.random.default_rng(seed)
    row = next(one for one in Store(store).rows() if one.part_begin)
    (told,) = row.parts
    usual, made = row.frozen.p, []
    for k, (front, rear, friction) in enumerate(truths):
        p = usual.copy()
        for axle, factor in zip("fr", (front, rear), strict=True):
            p[INDEX[f"ln_stiffness_{axle}"]] += np.log(factor) + noise * rng.standard_normal()
        p[INDEX["ln_road"]] = np.log(friction)
        one = replace(told, vector=told.matrix @ coordinates(p)[0], seconds=60.0)
        made.append(
            replace(row, log=f"{k:03d}", content=f"{k:032x}",
                    date=f"2026-{k // 28 + 1:02d}-{k % 28 + 1:02d}", part_begin=[0.0],
                    **information_columns([one]))
        )  # fmt: skip
    return made


SAME = (1.0, 1.0, 1.0)


def test_a_stiffness_that_falls_is_noticed_within_half_an_hour_as_step_or_as_slow_loss(store):
    rows = rows_of(store, [SAME] * 40 + [(0.9, 1.0, 1.0)] * 30)
    (alarm,) = watch(rows, ["vehicle"], Watching()).alarms
    assert alarm.statistic == 0 and alarm.began == "040" and not alarm.ended
    assert np.expm1(alarm.change[0]) == pytest.approx(-0.1, abs=0.03)
    assert alarm.after <= 20 * 60.0 + 30 * 60.0 and alarm.abrupt
    rows = rows_of(store, [SAME] * 20 + [(1.0, 1.0 - 0.002 * k, 1.0) for k in range(80)])
    (alarm,) = watch(rows, ["vehicle"], Watching()).alarms
    assert alarm.statistic == 1 and not alarm.abrupt and "wear" in alarm.cause


def test_tires_that_stay_and_minutes_of_a_broken_sensor_make_no_alarm(store):
    assert not watch(rows_of(store, [SAME] * 80), ["vehicle"], Watching()).alarms
    broken = [SAME] * 30 + [(0.6, 1.4, 0.5)] * 8 + [SAME] * 30
    assert not watch(rows_of(store, broken), ["vehicle"], Watching()).alarms


def test_an_alarm_ends_where_its_cause_does(store):
    rows = rows_of(store, [SAME] * 30 + [(0.9, 1.0, 1.0)] * 30 + [SAME] * 40)
    (alarm,) = watch(rows, ["vehicle"], Watching()).alarms
    assert 60 <= int(alarm.ended) < 80


def test_a_number_of_the_watch_must_be_positive():
    with pytest.raises(ValueError, match="false_alarms must be positive, it is 0"):
        Watching(false_alarms=0.0)


def test_watch_and_report_write_pages(store, tmp_path, undrawn, capsys):
    words = [store, "--all", "--baseline", "10"]
    assert main(["fleet", "watch", *words, "--out", str(tmp_path / "watch")]) in (0, 1)
    assert "2 cars" in capsys.readouterr().out
    assert json.loads((tmp_path / "watch" / "alarms.json").read_text()) is not None
    assert main(["fleet", "report", *words, "--out", str(tmp_path / "report")]) == 0
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert "Cornering stiffness, log by log" in page and "2026-03-09-broken.csv" in page


def test_alarms_are_told_and_drawn(store, tmp_path, laid_out, monkeypatch, capsys):
    rows = rows_of(store, [SAME] * 40 + [(0.9, 0.9, 1.0)] * 30)
    monkeypatch.setattr(command.Store, "stream", lambda *_, **__: iter(rows))
    assert main(["fleet", "watch", store, "--out", str(tmp_path / "out")]) == 1
    assert "both axles alike" in capsys.readouterr().out
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "against its baseline" in page


# What is told wrongly is said in one line.


def test_wrong_words_are_refused_in_one_line(store, tmp_path, capsys, monkeypatch):
    def said(*words):
        assert main(["fleet", *words]) == 2
        return capsys.readouterr().err.splitlines()[-1]

    learn = ["learn", "*/*/*.csv", "--out", str(tmp_path / "x"), "--vehicle"]
    assert "names no log" in said("learn", "none/*.csv", "--out", "x", "--vehicle", "cars/red.toml")
    assert "{vehicle} is no tag" in said(*learn, CAR)
    assert "each name once" in said(*learn, "cars/red.toml", "--tags", "{a}/{a}.csv")
    assert "at least 10 s" in said(*learn, "cars/red.toml", "--part", "1")
    assert "does not lie under --root cars" in said(*learn, "cars/red.toml", "--root", "cars")
    assert "is no store" in said("merge", str(tmp_path / "nothing"))
    assert "no such file" in said(*learn, "cars/green.toml")
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "mine.txt").write_text("mine")
    assert "holds something else" in said(*learn, "cars/red.toml")
    words = ["learn", "*/*/*.csv", "--vehicle", "cars/red.toml", "--out"]
    assert "is a file" in said(*words, str(tmp_path / "x" / "mine.txt"))
    with claim(tmp_path / ".held-claim"):
        assert "another run of tireid learns into" in said(*words, str(tmp_path / "held"))
    monkeypatch.setitem(sys.modules, "duckdb", None)
    assert "needs duckdb: pip install" in said("merge", store, "--where", "seconds > 1")
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    assert "pip install '.[fleet]'" in said("merge", store)


def test_a_file_that_is_none_of_a_store_is_named(store, tmp_path, capsys):
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    path = sorted((Path(shutil.copytree(store, tmp_path / "old")) / "logs").iterdir())[0]
    table = parquet.read_table(path)
    parquet.write_table(table.replace_schema_metadata({"format": "tireid fleet 1"}), path)
    assert main(["fleet", "merge", str(tmp_path / "old"), "--out", str(tmp_path / "merged")]) == 2
    said = capsys.readouterr().err.splitlines()
    assert f"{path}: is of another version's store (tireid fleet 1, not tireid fleet 3)" in said[-1]
    (tmp_path / "logs").mkdir()
    path = tmp_path / "logs" / "bucket-00.parquet"
    parquet.write_table(pyarrow.table({"log": ["a"]}), path)
    with pytest.raises(StoreError, match="is not of this version's store"):
        Store(str(tmp_path)).rows(("log",))
    path.write_bytes(b"PAR1 no")
    with pytest.raises(StoreError, match="cannot be read as a store's file"):
        Store(str(tmp_path)).rows()


def test_tags_are_found_at_the_end_of_a_path_and_dates_are_dates():
    tags = learning.tag_pattern("{vehicle}/{date}-{drive}.csv")
    found = tags.search("/data/fleet/a 1/2026-03-31-2.csv").groupdict()
    assert found == {"vehicle": "a 1", "date": "2026-03-31", "drive": "2"}
    assert tags.search("a/b/c.csv") is None
