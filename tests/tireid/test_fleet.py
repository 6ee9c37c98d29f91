"""Many logs, here a few: learnt once, kept whatever happens, merged, and watched."""

import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

import tireid.fleet.learn as learning
from identifier.tire_model import load_model
from identifier.verdict import judge_identification
from models.recordings import LogMap, read_recording, write_recording
from models.vehicle import sedan
from tests.tireid.conftest import json_of, typed
from tireid.fleet.learn import (
    LearnLog,
    Learnt,
    find_logs,
    learn_fleet,
    on_a_cluster,
    on_this_machine,
    read_car,
)
from tireid.fleet.merge import usable
from tireid.fleet.store import INDEX, Store, StoreError
from tireid.learning import identify

for name in ("pyarrow", "fsspec"):
    pytest.importorskip(name, reason="needs a store")

DAYS = 2
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


def learns(out, *more):
    words = ["fleet", "learn", "*/*/*.csv", "--vehicle", CAR, "--tags", TAGS, "--out", out]
    return typed(*words, "--jobs", "1", *more)


@pytest.fixture(scope="module")
def store(fleet, tmp_path_factory):
    """The address of a store of all logs."""
    out, before = tmp_path_factory.mktemp("store") / "all", Path.cwd()
    os.chdir(fleet)
    try:
        assert learns(out) == 1  # one log is none
    finally:
        os.chdir(before)
    return str(out)


def told_by(tasks):
    cars = {task.vehicle: read_car(task.vehicle, LogMap()) for task in tasks}
    return LearnLog(cars, LogMap())


def learnt_into(out, tasks, spread_map=map, **more):
    return learn_fleet(tasks, told_by(tasks), Store(str(out)), spread_map, lambda _: None, **more)


def rows_of(out, *columns):
    return list(Store(str(out)).stream(*columns))


def digest(out):
    """A hash of every file of a store, hidden ones apart."""
    files = sorted(path for path in Path(out).rglob("*.parquet"))
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_each_log_becomes_a_row_and_a_bad_one_says_why(store):
    rows = sorted(rows_of(store), key=lambda row: row.log)
    assert len(rows) == 4 * DAYS + 1
    (bad,) = [row for row in rows if row.error]
    assert bad.log == str(Path("red/summer/2026-03-09-broken.csv").absolute())
    assert "column" in bad.error and bad.date == "2026-03-09" and not usable(bad, rejected=True)
    good = rows[0]
    assert (good.vehicle, good.tires, good.date) == ("blue", "summer", "2026-03-01")
    assert good.declared_car.name == "blue"


def test_a_row_is_what_identify_says_of_its_log(store, logs):
    row = next(one for one in rows_of(store) if one.log.endswith("quick.csv"))
    log = read_recording(logs / "quick.csv")
    tire = identify(log, replace(sedan(), chassis=None)).tire
    assert [row.stiffness_front, row.stiffness_rear] == pytest.approx(
        list(tire.stiffness), rel=0.03
    )
    assert row.seconds == log.t[-1] - log.t[0] and 3.0 < row.driven < row.seconds
    assert row.valid is judge_identification(tire, log).valid
    assert row.reach[:2] == pytest.approx(list(tire.reach.slip), rel=0.05)


def test_what_is_there_is_not_learnt_again_and_what_is_new_is(store, fleet, tmp_path, capsys):
    store = shutil.copytree(store, tmp_path / "store")
    before = digest(store)
    for more, told in (((), "0 identified now, 9 before"), (("--again",), "1 identified now, 8")):
        assert learns(store, *more) == 1
        assert told in capsys.readouterr().out
    assert digest(store) == before
    extra, copy = (fleet / "blue" / "summer" / f"2026-03-2{k}-more.csv" for k in range(2))
    text = (fleet / "blue/summer/2026-03-01-quick.csv").read_bytes()
    extra.write_bytes(text + b"\n" * 9)
    copy.write_bytes(text)  # counts once, whatever its name
    try:
        assert learns(store) == 1
    finally:
        extra.unlink(), copy.unlink()
    assert "11 logs" in (said := capsys.readouterr().out) and "1 identified now, 10 before" in said
    assert len(digest(store)) == len(before) + 1


def test_a_car_file_that_changed_is_another_setting_and_never_counts_twice(
    garage, monkeypatch, capsys
):
    monkeypatch.chdir(garage)
    words = ["fleet", "learn", "*.csv", "--vehicle", "car.toml", "--jobs", "1", "--out", "store"]
    assert typed(*words) == 0
    replace(sedan(), mass=1510.0, chassis=None).to_toml("car.toml", overwrite=True)
    assert typed(*words) == 0
    assert "2 identified now, 0 before" in capsys.readouterr().out
    assert typed("fleet", "merge", "store", "--all", "--out", "merged") == 2
    assert "are of cars whose files differ" in capsys.readouterr().err
    assert typed("fleet", "merge", "store", "--all", "--by", "setting", "--out", "merged") == 0
    assert [one["logs"] for one in json_of(Path("merged/models.json"))] == [2, 2]
    shutil.rmtree(sorted(Path("store").iterdir())[0])  # a setting is a folder
    assert typed("fleet", "merge", "store", "--all", "--out", "once") == 0


@pytest.fixture
def garage(tmp_path, logs):
    """A folder with a car and two logs."""
    replace(sedan(), chassis=None).to_toml(tmp_path / "car.toml")
    for k in range(2):
        (tmp_path / f"{k}.csv").write_bytes((logs / "quick.csv").read_bytes() + b"\n" * k)
    return tmp_path


def test_each_run_of_a_file_is_a_row(logs, tmp_path):
    lines = [(logs / f"{name}.csv").read_text().splitlines() for name in ("slalom", "quick")]
    runs = [f"{one},{k}" for k, some in enumerate(lines) for one in some[1:]]
    (tmp_path / "two.csv").write_text("\n".join([f"{lines[0][0]},run", *runs]) + "\n")
    tasks, _ = find_logs([str(tmp_path / "*.csv")], "cars/red.toml")
    assert learnt_into(tmp_path / "store", tasks)[0] == 1
    assert learnt_into(tmp_path / "store", tasks)[0] == 0
    rows = rows_of(tmp_path / "store")
    assert [Path(row.name).name for row in rows] == ["two.csv:0", "two.csv:1"]
    assert {row.file for row in rows} == {rows[0].file}
    assert rows[0].stiffness_front != rows[1].stiffness_front


def test_a_log_without_v_y_is_learnt_and_has_the_date_of_its_file(garage):
    log = replace(read_recording(garage / "0.csv"), v_y=None)
    write_recording(log, garage / "without.csv")
    os.utime(garage / "without.csv", (1.7e9, 1.7e9))
    tasks, _ = find_logs([str(garage / "without.csv")], str(garage / "car.toml"))
    learnt_into(garage / "store", tasks)
    (row,) = rows_of(garage / "store")
    assert not row.error and usable(row, rejected=True)
    assert (row.date, row.vehicle, row.tires) == ("2023-11-14T22:13:20+00:00", sedan().name, "")


def test_a_setting_is_what_files_hold_and_not_where_they_lie(tmp_path):
    for name in ("a", "b"):
        sedan().to_toml(tmp_path / f"{name}.toml")
        (tmp_path / f"{name}.dbc").write_text("VERSION")

    def setting(car="a", check=True, **given):
        return read_car(tmp_path / f"{car}.toml", LogMap(**given), check=check).setting

    a, b = (str(tmp_path / f"{name}.dbc") for name in "ab")
    assert setting() == setting("b") and setting(dbc=a) == setting(dbc=b)
    before = setting(dbc=a)
    Path(a).write_text("VERSION 2")
    replace(sedan(), mass=1501.0).to_toml(tmp_path / "b.toml", overwrite=True)
    others = [setting(), before, setting(dbc=a), setting("b"), setting(axes="SAE")]
    assert len({*others, setting(check=False)}) == 6


def test_logs_and_store_at_an_address_are_known_by_what_their_file_system_says(garage, logs):
    from fsspec.implementations.memory import MemoryFileSystem

    fs, text = MemoryFileSystem(), (logs / "quick.csv").read_bytes()
    car, path = str(garage / "car.toml"), "/drives/wet/2026-03-01T10:00-a.csv"

    def learnt_now():
        tasks, left = find_logs(["memory://drives/*/*.csv"], car, "{tires}/{date}-*.csv")
        assert list(left) == ["memory:///drives/wet/0.csv"]
        return learnt_into("memory://fleet", tasks)[0]

    try:
        for name in (path, "/drives/wet/0.csv"):
            fs.pipe_file(name, text)
        assert (learnt_now(), learnt_now()) == (1, 0)
        fs.pipe_file(path, text[:-1] + b" ")  # of the same size
        assert learnt_now() == 1
        rows = rows_of("memory://fleet")
        assert {(row.log, row.tires) for row in rows} == {(f"memory://{path}", "wet")}
        assert {row.date for row in rows} == {"2026-03-01T10:00"} and len(rows) == 2
        assert not [name for name in fs.find("/fleet") if not name.endswith(".parquet")]
    finally:
        for folder in ("/drives", "/fleet"):
            fs.rm(folder, recursive=True)
    assert learning._stamp("http://host/a", {"name": "a", "size": 3, "type": "file"}) == ""


# Writers: stopped, killed, two at a time.


class StoppedError(Exception):
    pass


def test_a_run_that_was_stopped_goes_on_and_ends_with_the_same_bytes(store, tmp_path):
    tasks, _ = find_logs(["*/*/*.csv"], CAR, TAGS)
    halted, done = tmp_path / "halted", []

    def stopping(work, some):
        for k, one in enumerate(some):
            if k == 3:
                raise StoppedError
            yield work(one)

    def backwards(work, some):
        for one in reversed(some):
            done.append(one)
            yield work(one)

    with pytest.raises(StoppedError):
        learnt_into(halted, tasks, stopping)
    assert len(digest(halted)) == 3
    learnt_into(halted, tasks, backwards)
    assert len(done) == len(tasks) - 3 and digest(halted) == digest(store)


def test_two_writers_of_one_store_lose_nothing_and_add_no_row_twice(store, tmp_path):
    """They take turns, row by row, and neither knows what the other has."""
    tasks, _ = find_logs(["*/*/*.csv"], CAR, TAGS)
    both = tmp_path / "both"

    def while_another(work, some):
        for one in some[:6]:
            yield work(one)
            learnt_into(both, tasks[3:], lambda work, left: map(work, left[:1]))

    learnt_into(both, tasks, while_another)
    learnt_into(both, tasks)
    assert digest(both) == digest(store)


WRITES = """
import sys
from dataclasses import replace
from tireid.fleet.store import Store
rows = list(Store(sys.argv[1]).stream())
there = Store(sys.argv[2])
for k in range(100000):
    there.require(begun=False)
    row = rows[k % len(rows)]
    there.write([replace(row, content=f"unread-{k % 3}", log="dropped")])
    there.write([replace(row, content=f"{k:032x}", log=f"log-{k}")])
    there.drop(f"{row.setting}/unread-{k % 3}.parquet")
"""


def test_writers_at_once_that_are_killed_lose_no_row_and_readers_see_whole_ones(store, tmp_path):
    out = tmp_path / "out"
    address, many = f"file://{out}", 25
    words = [sys.executable, "-c", WRITES, store, address]
    writers = [subprocess.Popen(words) for _ in range(2)]
    try:
        until = time.monotonic() + 60.0
        while len(rows_of(address)) < many and time.monotonic() < until:
            assert all(writer.poll() is None for writer in writers)  # no error ends one
    finally:
        for writer in writers:
            writer.kill()
            writer.wait()
    rows = [row for row in rows_of(address) if row.log != "dropped"]
    assert len(rows) == len({row.log for row in rows}) >= many - 3
    assert {f"log-{k}" for k in range(len(rows))} == {row.log for row in rows}
    by_error = {bool(row.error): row for row in rows}
    assert set(by_error) == {True, False} and all(row.error or row.learnt() for row in rows)


def test_a_store_is_written_whole_whether_its_address_moves_files_or_not(store):
    from fsspec.implementations.memory import MemoryFileSystem

    class MovesOverNothing(MemoryFileSystem):
        cachable = False

        def mv(self, path1, path2, **_):
            if self.exists(path2):
                raise FileExistsError(path2)
            super().mv(path1, path2)

    (row, *_), fs = rows_of(store), MemoryFileSystem()
    for moves in (MemoryFileSystem(), MovesOverNothing()):
        there = Store("memory://moved")
        there.__dict__["_place"] = moves, "/moved"
        for date in ("2026-01-01", "2026-01-02"):
            there.write([replace(row, date=date)])
            assert [one.date for one in there.stream()] == [date]
            assert fs.find("/moved") == [f"/moved/{row.file}"]
        fs.rm("/moved", recursive=True)


DEADLY = "red/summer/2026-03-02-quick.csv"


class Deadly(LearnLog):
    def __call__(self, task):
        if task.log.endswith(DEADLY):
            os.kill(os.getpid(), signal.SIGKILL)
        row = self.row(task)
        return Learnt(task, row.file, [row])


@pytest.mark.heavy
def test_a_log_that_kills_its_process_costs_its_own_row_alone():
    tasks, _ = find_logs(["red/summer/2026-03-02-*.csv"], CAR, TAGS)
    work = told_by(tasks)
    found = on_this_machine(2)(Deadly(work.cars, work.log_map), tasks)
    rows = {row.log: row for one in found for row in one.rows}
    dead = [log for log, row in rows.items() if "died" in row.error]
    assert sorted(rows) == [task.log for task in tasks] and dead == [str(Path(DEADLY).absolute())]


def test_a_log_that_kills_workers_of_a_cluster_is_learnt_once_it_can(tmp_path):
    tasks, _ = find_logs([DEADLY, "red/summer/2026-03-09-broken.csv"], CAR, TAGS)

    def elsewhere(work, some, *, lost):
        for task in some:
            if task.log.endswith(DEADLY):
                lost(task)
            else:
                yield work(task)

    for again, count in ((False, 2), (False, 0), (True, 2)):
        assert learnt_into(tmp_path, tasks, on_a_cluster(elsewhere), again=again)[0] == count
    rows = {Path(row.log).name: row for row in rows_of(tmp_path)}
    assert "died" in rows[Path(DEADLY).name].error and len(rows) == 2
    learnt_into(tmp_path, tasks, again=True)
    (row,) = [row for row in rows_of(tmp_path) if row.log.endswith(DEADLY)]
    content = hashlib.blake2b(Path(DEADLY).read_bytes(), digest_size=16).hexdigest()
    assert (row.content, row.error) == (content, "")


# What is asked of a store.


def test_models_are_merged_by_what_logs_have_in_common(store, tmp_path, capsys):
    out = tmp_path / "merged"
    assert typed("fleet", "merge", store, "--all", "--by", "vehicle,week", "--out", out) == 0
    told = json_of(out / "models.json")
    groups = [(one["vehicle"], one["week"], one["logs"]) for one in told]
    assert groups == [
        (car, week, 2) for car in ("blue", "red") for week in ("2026-W09", "2026-W10")
    ]
    model = load_model(out / told[0]["file"])
    assert model.stiffness == pytest.approx(told[0]["cornering_stiffness_N_rad"])
    assert "blue 2026-W09" in capsys.readouterr().out


def test_days_are_watched_and_an_alarm_that_lasts_is_the_exit_code(store, tmp_path, capsys):
    words = ["fleet", "watch", store, "--all", "--baseline", "5"]
    assert typed(*words, "--out", tmp_path / "quiet") == 0
    assert "no change was noticed" in capsys.readouterr().out
    assert json_of(tmp_path / "quiet" / "days.json") == []  # seconds, no minute


def test_wrong_words_are_refused_in_one_line(store, tmp_path, capsys, monkeypatch):
    def said(*words):
        assert typed("fleet", *words) == 2
        return capsys.readouterr().err.splitlines()[-1]

    learn = ["learn", "*/*/*.csv", "--out", tmp_path / "x", "--vehicle"]
    assert "names no log" in said("learn", "none/*.csv", "--out", "x", "--vehicle", "cars/red.toml")
    assert "{vehicle} is no tag" in said(*learn, CAR)
    assert "each name once" in said(*learn, "cars/red.toml", "--tags", "{a}/{a}.csv")
    assert "is no store" in said("merge", str(tmp_path / "nothing"))
    assert "no such file" in said(*learn, "cars/green.toml")
    assert "'driver' is none of what is known of it: vehicle" in said(
        "merge", store, "--all", "--by", "driver"
    )
    assert "are of cars whose files differ" in said("merge", store, "--all", "--by", "tires")
    assert "baseline must be positive" in said("watch", store, "--all", "--baseline", "0")
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "mine.txt").write_text("mine")
    assert "holds something else" in said(*learn, "cars/red.toml")
    learn[3] = str(tmp_path / "x" / "mine.txt")
    assert "holds something else" in said(*learn, "cars/red.toml")
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    assert "pip install '.[fleet]'" in said("merge", store)


def test_an_older_store_and_files_that_are_none_are_refused(store, tmp_path):
    import pyarrow
    from pyarrow import parquet

    (tmp_path / "logs").mkdir()
    path = tmp_path / "logs" / "bucket-00.parquet"
    parquet.write_table(pyarrow.table({"log": ["a"], "size": [3]}), path)  # as before version 4
    for wrong, why in (
        (None, "holds rows of another version: learn its logs again, into a new store"),
        (b"PAR1 no PAR1", "bucket-00.parquet"),
    ):
        if wrong:
            path.write_bytes(wrong)
        with pytest.raises(StoreError, match=why):
            rows_of(tmp_path, INDEX)
    path.write_bytes(b"PAR1 that is written now")
    assert rows_of(tmp_path, INDEX) == []
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(StoreError, match=f"^{path}: must be a file, it is a device, pipe or soc"):
        rows_of(tmp_path, INDEX)
    row = next(row for row in rows_of(store) if not row.error)
    for broken in (
        {"matrix": row.matrix[1:]}, {"vector": [float("nan")] * len(row.vector)},
        {"driven": -1.0}, {"reach": row.reach[1:]},
    ):  # fmt: skip
        with pytest.raises(StoreError, match=f"{row.file}, log .*: delete the file and learn"):
            replace(row, **broken).learnt()
    with pytest.raises(StoreError, match=r"vehicle\.mass is missing: delete the file"):
        _ = replace(row, car="{}").declared_car


def test_a_store_at_an_address_leaves_no_thread_that_aborts_the_program(store, tmp_path):
    program = (
        "import fsspec; from tireid.fleet.store import Store; fs = fsspec.filesystem('memory'); "
        f"fs.put({store!r}, '/away', recursive=True); "
        "print(len([row for row in Store('memory://away').stream()]))"
    )
    for _ in range(3):
        told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
        assert (told.returncode, told.stdout) == (0, f"{4 * DAYS + 1}\n"), told.stderr


def test_tags_are_found_at_the_end_of_a_path_and_dates_are_dates():
    tags = learning.tag_pattern("{vehicle}/{date}-{drive}.csv")
    found = tags.search("/data/fleet/a 1/2026-03-31-2.csv").groupdict()
    assert found == {"vehicle": "a 1", "date": "2026-03-31", "drive": "2"}
    assert tags.search("a/b/c.csv") is None
