"""A fleet on a Dask cluster of two workers is the fleet of this machine."""

import os
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

import tireid.cluster
from models.recordings import LogMap
from models.vehicle import sedan
from tests.tireid.conftest import typed
from tireid.cluster import ClusterError, cluster
from tireid.fleet.learn import LearnLog, find_logs, learn_fleet, on_a_cluster, read_car
from tireid.fleet.store import Store

pytest.importorskip("distributed", reason="needs Dask")
pytestmark = pytest.mark.filterwarnings("default")  # Dask's own
ROOT = Path(__file__).resolve().parents[2]


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def running(folder, *workers):
    """The address of a scheduler, and the processes of its workers, as a user starts them."""
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"

    def start(kind, *words):
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{kind}", "--no-dashboard", *words],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    processes = [start("scheduler", "--host", "127.0.0.1", "--port", str(port))]
    processes += [start("worker", address, *words) for words in workers]
    try:
        yield address, processes[1:]
    finally:
        for process in reversed(processes):
            process.terminate()
            process.wait(timeout=20)


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """The address of a scheduler with two workers."""
    folder = tmp_path_factory.mktemp("cluster")
    with running(folder, ["--nthreads", "1", "--nworkers", "2"]) as (address, _):
        yield address


def where(pause, item):
    time.sleep(pause)
    return os.getpid(), item


@pytest.mark.heavy
def test_both_workers_work_and_no_result_is_lost(address):
    with cluster(address) as elsewhere:
        found = list(elsewhere(partial(where, 0.05), range(20), lost=print))
    assert sorted(item for _, item in found) == list(range(20))
    processes = {process for process, _ in found}
    assert len(processes) == 2
    assert os.getpid() not in processes


def fail(item):
    raise ValueError(f"item {item} cannot be done")


@pytest.mark.heavy
def test_an_error_of_a_worker_arrives_here(address):
    with cluster(address) as elsewhere, pytest.raises(ValueError, match="item 1 cannot be done"):
        list(elsewhere(fail, [1], lost=print))


@pytest.mark.heavy
def test_a_worker_of_another_version_is_refused(address, monkeypatch):
    monkeypatch.setattr(tireid.cluster, "source_digest", another_version)
    with pytest.raises(ClusterError, match="has another version of tireid"), cluster(address):
        pass


def another_version():
    return f"that of process {os.getpid()}"


@pytest.mark.heavy
def test_a_scheduler_without_workers_is_told_of(monkeypatch, tmp_path):
    monkeypatch.setattr(tireid.cluster, "PATIENCE", 2.0)
    with running(tmp_path) as (lonely, _):
        wait_until_open(int(lonely.rpartition(":")[2]))
        with pytest.raises(ClusterError, match="the scheduler has no workers"), cluster(lonely):
            pass


def test_a_worker_of_threads_is_told_how_to_start_as_processes(tmp_path, capsys):
    with (
        running(tmp_path, ["--nthreads", "3", "--no-nanny"]) as (address, _),
        cluster(address) as elsewhere,
    ):
        assert list(elsewhere(abs, [-1], lost=print)) == [1]
    (line,) = [one for one in capsys.readouterr().err.splitlines() if "threads" in one]
    assert "has 3 threads, of which one works" in line
    assert line.endswith(f"dask worker {address} --nworkers -1 --nthreads 1")


def bytes_of(out):
    return [one.read_bytes() for one in sorted(Path(out).rglob("*.parquet"))]


def test_a_worker_that_is_killed_loses_nothing_and_the_bytes_are_the_same(logs, tmp_path):
    pytest.importorskip("pyarrow", reason="needs pyarrow and fsspec")
    for k in range(8):
        text = (logs / "quick.csv").read_bytes() + b"\n" * k
        (tmp_path / f"{k}.csv").write_bytes(text)
    replace(sedan(), chassis=None).to_toml(tmp_path / "car.toml")
    tasks, _ = find_logs([str(tmp_path / "*.csv")], str(tmp_path / "car.toml"))
    car = tmp_path / "car.toml"
    work = LearnLog({car: read_car(car, LogMap())}, LogMap())
    here, there = Store(str(tmp_path / "here")), Store(str(tmp_path / "there"))
    learn_fleet(tasks, work, here, map, lambda _: None)
    options, killed = ["--nthreads", "1", "--no-nanny"], []
    with running(tmp_path, options, options) as (address, workers), cluster(address) as elsewhere:

        def kill_one(ready):
            if ready > 0 and not killed:
                killed.append(ready)
                workers[0].kill()

        learn_fleet(tasks, work, there, on_a_cluster(elsewhere), kill_one)
    assert killed and killed[0] < len(tasks)
    assert bytes_of(tmp_path / "here") == bytes_of(tmp_path / "there")


def test_logs_of_relative_paths_are_learnt_by_workers_in_another_folder(
    address, logs, tmp_path, monkeypatch, capsys
):
    pytest.importorskip("pyarrow", reason="needs pyarrow and fsspec")
    for name in ("slalom", "quick"):
        (tmp_path / f"{name}.csv").write_bytes((logs / f"{name}.csv").read_bytes())
    replace(sedan(), chassis=None).to_toml(tmp_path / "car.toml")
    monkeypatch.chdir(tmp_path)
    words = ["fleet", "learn", "*.csv", "--vehicle", "car.toml"]
    for out, more in (("here", ["--jobs", "1"]), ("there", ["--scheduler", address])):
        assert typed(*words, "--out", out, *more) == 0
        printed = capsys.readouterr()
        assert "2 identified now, 0 before; 0 not valid, 0 could not be used" in printed.out
        assert "threads" not in printed.err
    assert bytes_of("here") == bytes_of("there")


def wait_until_open(port):
    until = time.monotonic() + 20.0
    while time.monotonic() < until:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise TimeoutError(port)


def test_the_command_names_what_is_wrong_with_the_cluster(logs, tmp_path, monkeypatch, capsys):
    pytest.importorskip("pyarrow", reason="needs pyarrow and fsspec")
    monkeypatch.setattr(tireid.cluster, "PATIENCE", 1.0)
    nobody = f"tcp://127.0.0.1:{free_port()}"
    words = ["fleet", "learn", logs / "slalom.csv", "--vehicle", logs / "car.toml"]
    words += ["--out", tmp_path / "out", "--scheduler", nobody]
    assert typed(*words) == 2
    assert f"{nobody}: no Dask scheduler answers there" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert typed(*words) == 2
    assert "needs Dask: pip install dask distributed (" in capsys.readouterr().err
