"""From a log of a minute, an hour, or ten, to the report of `tireid identify`: time and memory.

A sedan is driven at random on the plant and logged at 100 Hz, as CSV; a log is forty seconds of
it over and over, with noise of its own on every sample and without a jump in time. The command
runs as a user runs it, in a process of its own. Memory that counts is what the process alone holds
(RssAnon of /proc, sampled): pages of files that are mapped are the system's, which takes them back
when it needs them; the largest of both together (VmHWM) stands beside it. Reading lasts until the
command says that it has read. Time that counts is that of the processor; the wall clock's stands
beside it. Processor time too is up to three times as long where others keep the machine busy: it is
recorded on an idle one. What the command compiles once on a machine has been compiled: the minute
is learnt twice, and counts at the second time.

    python -m benchmarks.long_logs [--long] [--record]

`--long` adds the ten hours. Linux only.
"""

import resource
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.targets import Targets, keeps, show
from models.recordings import Recording
from models.vehicle import sedan
from tireid.driving.learn import sample_recording

DT = 0.01  # s
LASTS = {"60_s": 60.0, "1_h": 3600.0, "10_h": 36000.0}  # s
SECONDS = {"60_s": 1.5, "1_h": 6.0, "10_h": 40.0}  # of the processor
GIGABYTES = {"1_h": 0.4, "10_h": 0.5}
GROWTH = 1.5  # of what the process holds, from one hour to ten
NOISE = {"v_x": 0.01, "v_y": 0.01, "r": 0.002, "delta_f": 0.0, "a_y": 0.05}  # SI
ROWS = 100_000  # that are written at once
POLL = 0.02  # s


def write_log(path: Path, base: Recording, seconds: float) -> None:
    """Write a drive over and over.

    Parameters
    ----------
    path : of the CSV.
    base : the drive.
    seconds : that the log lasts.
    """
    n = round(seconds / DT)
    rng = np.random.default_rng(n)
    assert base.a_y is not None
    with path.open("w", encoding="utf-8") as file:
        file.write("t,vx,vy,r,delta_f,ay\n")
        for first in range(0, n, ROWS):
            k = np.arange(first, min(first + ROWS, n))
            columns = [DT * k] + [
                getattr(base, name)[k % len(base)] + size * rng.standard_normal(k.size)
                for name, size in NOISE.items()
            ]
            np.savetxt(file, np.column_stack(columns), fmt="%.9g", delimiter=",")


class Run(NamedTuple):
    """What a run of the command took.

    seconds : of the whole process.   processor : of its processor [s].   reading : of the seconds
    until the log was read.   held : most that the process alone held [MB].   mapped : most with
    mapped pages [MB].
    """

    seconds: float
    processor: float
    reading: float
    held: float
    mapped: float


def run(words: list[str]) -> Run:
    """Run a command of tireid and watch it.

    Parameters
    ----------
    words : after `tireid`.
    """
    begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    process = subprocess.Popen(
        [sys.executable, "-m", "tireid", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    read: list[float] = []

    def listen() -> None:
        assert process.stderr is not None
        for line in process.stderr:
            if line.strip().startswith("read ") and not read:
                read.append(time.perf_counter() - begin)

    ear = threading.Thread(target=listen)
    ear.start()
    most = {"RssAnon": 0.0, "VmHWM": 0.0}
    status = Path(f"/proc/{process.pid}/status")
    while process.poll() is None:
        with suppress(OSError):  # it has ended meanwhile
            for line in status.read_text(encoding="utf-8").splitlines():
                name, _, rest = line.partition(":")
                if name in most:
                    most[name] = max(most[name], float(rest.split()[0]) / 1024.0)
        time.sleep(POLL)
    seconds = time.perf_counter() - begin
    ear.join()
    if process.returncode != 0 or not read:
        raise RuntimeError(f"tireid {' '.join(words)} ended with {process.returncode}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Run(seconds, processor, read[0], most["RssAnon"], most["VmHWM"])


def main() -> int:
    """Print and record what logs take; 1 where one takes too long or too much memory."""
    cases = [name for name in LASTS if "--long" in sys.argv or name != "10_h"]
    targets, base, held = Targets("long_logs"), sample_recording(sedan()), {}
    with tempfile.TemporaryDirectory(prefix="tireid-long-") as folder:
        log, car, out = Path(folder) / "log.csv", Path(folder) / "car.toml", Path(folder) / "out"
        sedan().to_toml(car)
        words = ["identify", str(log), "--vehicle", str(car), "--out", str(out), "--force"]
        write_log(log, base, LASTS[cases[0]])
        run(words)  # compiles
        for key in cases:
            write_log(log, base, LASTS[key])
            took = run(words)
            held[key], name = took.held, key.replace("_", " ")
            size = log.stat().st_size / 1e6
            show(name, f"{size:.1f} MB, read in {took.reading:.1f} s")
            label = f"{name} of log to the report"
            targets.at_most(label, took.processor, SECONDS[key], "s", f"{key}/processor")
            targets.record(f"{key}/seconds", took.seconds, "s")
            if key in GIGABYTES:
                most = GIGABYTES[key]
                targets.at_most(f"{label}, memory", took.held / 1e3, most, "GB", f"{key}/held")
                targets.record(f"{key}/mapped", took.mapped / 1e3, "GB")
                targets.record(f"{key}/log", size, "MB")
                targets.record(f"{key}/reading", 100.0 * took.reading / took.seconds, "%")
    if "10_h" in held:
        label = "memory of ten hours over that of one"
        targets.at_most(label, held["10_h"] / held["1_h"], GROWTH, "", "growth")
    keep = keeps()
    return targets.finish(keep=keep and "10_h" in held)  # ten hours are quoted too


if __name__ == "__main__":
    sys.exit(main())
