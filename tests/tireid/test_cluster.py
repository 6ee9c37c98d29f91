"""A fleet on a Dask cluster of two workers is the fleet of this machine."""

import os
import socket
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from benchmarks.local_cluster import free_port, start

import tireid.cluster
from models.vehicle import sedan
from tireid.cli import main
from tireid.cluster import ClusterError, cluster

pytest.importorskip("distributed", reason="needs Dask")
pytestmark = pytest.mark.filterwarnings("default")  # Dask's own


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """The address of a scheduler with two workers, processes as a user starts them."""
    folder, port = tmp_path_factory.mktemp("cluster"), free_port()
    address = f"tcp://127.0.0.1:{port}"
    running = [
        start("scheduler", ["--host", "127.0.0.1", "--port", str(port)], folder),
        start("worker", [address, "--nthreads", "1", "--nworkers", "2"], folder),
    ]
    yield address
    for process in reversed(running):
        process.terminate()
        process.wait(timeout=20)


def where(pause, item):
    time.sleep(pause)
    return os.getpid(), item


@pytest.mark.heavy
def test_both_workers_work_and_no_result_is_lost(address):
    with cluster(address) as elsewhere:
        found = list(elsewhere(partial(where, 0.05), range(20)))
    assert sorted(item for _, item in found) == list(range(20))
    processes = {process for process, _ in found}
    assert len(processes) == 2
    assert os.getpid() not in processes


def fail(item):
    raise ValueError(f"item {item} cannot be done")


@pytest.mark.heavy
def test_an_error_of_a_worker_arrives_here(address):
    with cluster(address) as elsewhere, pytest.raises(ValueError, match="item 1 cannot be done"):
        list(elsewhere(fail, [1]))


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
    port = free_port()
    lonely = f"tcp://127.0.0.1:{port}"
    process = start("scheduler", ["--host", "127.0.0.1", "--port", str(port)], tmp_path)
    try:
        wait_until_open(port)
        with pytest.raises(ClusterError, match="the scheduler has no workers"), cluster(lonely):
            pass
    finally:
        process.terminate()
        process.wait(timeout=20)


def test_a_worker_of_threads_is_told_how_to_start_as_processes(tmp_path, capsys):
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    running = [
        start("scheduler", ["--host", "127.0.0.1", "--port", str(port)], tmp_path),
        start("worker", [address, "--nthreads", "3", "--no-nanny"], tmp_path),
    ]
    try:
        with cluster(address) as elsewhere:
            assert list(elsewhere(abs, [-1])) == [1]
    finally:
        for process in reversed(running):
            process.terminate()
            process.wait(timeout=20)
    (line,) = [one for one in capsys.readouterr().err.splitlines() if "threads" in one]
    assert "has 3 threads, of which one works" in line
    assert line.endswith(f"dask worker {address} --nworkers -1 --nthreads 1")


def test_logs_of_relative_paths_are_learnt_by_workers_in_another_folder(
    address, logs, tmp_path, monkeypatch, capsys
):
    pytest.importorskip("pyarrow", reason="needs pyarrow and fsspec")
    for name in ("slalom", "quick"):
        (tmp_path / f"{name}.csv").write_bytes((logs / f"{name}.csv").read_bytes())
    replace(sedan(), chassis=None).to_toml(tmp_path / "car.toml")
    monkeypatch.chdir(tmp_path)
    words = ["fleet", "learn", "*.csv", "--vehicle", "car.toml", "--judge", "none"]
    for out, more in (("here", ["--jobs", "1"]), ("there", ["--scheduler", address])):
        assert main([*words, "--out", out, *more]) == 0
        printed = capsys.readouterr()
        assert "2 identified now, 0 before; 0 not valid, 0 could not be used" in printed.out
        assert "threads" not in printed.err
    files = [sorted(Path(out).rglob("*.parquet")) for out in ("here", "there")]
    assert [one.read_bytes() for one in files[0]] == [one.read_bytes() for one in files[1]]


def wait_until_open(port, patience=20.0):
    until = time.monotonic() + patience
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
    words = ["fleet", "learn", str(logs / "slalom.csv"), "--vehicle", str(logs / "car.toml")]
    words += ["--out", str(tmp_path / "out"), "--scheduler", nobody]
    assert main(words) == 2
    assert f"{nobody}: no Dask scheduler answers there" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(words) == 2
    assert "needs Dask: pip install dask distributed (" in capsys.readouterr().err
