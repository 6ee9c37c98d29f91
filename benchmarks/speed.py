"""How long things take: the first command, a long log to its report, a run of each method.

    python -m benchmarks.speed [--quick] [--record]

`import tireid` and `tireid --help` are wall time of fresh processes, medians; a bare Python stands
beside them. A log of a minute, an hour and ten hours at 100 Hz goes from CSV to the report of
`tireid identify` in a process of its own: a sedan's drive over and over, with noise of its own on
every sample. Time is that of the processor; memory what the process alone holds (RssAnon of /proc,
sampled). Functions compiled before; the minute counts at the second time, and at the first as first
use. Python keeps its bytecode, as an installed package has it. A run of 45 s by each method that
works in a car is the least of many. On a busy machine processor time is up to three times as long:
record on an idle one. Linux only.
"""

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.targets import Table, Targets, Values, parse, show
from identifier.methods import LIVE, REFERENCE, make_method
from models.maneuvers import Slalom
from models.plant import Plant
from models.recordings import Recording
from models.vehicle import sedan

STARTS = {"python": ["-c", "pass"], "import": ["-c", "import tireid"],
          "help": ["-m", "tireid", "--help"]}  # fmt: skip
LONGEST = 150.0  # ms, of a start
DT = 0.01  # s
LASTS = {"60 s": 60.0, "1 h": 3600.0, "10 h": 36000.0}  # s
SECONDS = {"60 s": 1.5, "1 h": 6.0, "10 h": 40.0}  # of the processor
FIRST = 6.0  # s of the processor, of a minute's log and all that it compiles
GIGABYTES = {"60 s": 0.4, "1 h": 0.4, "10 h": 0.5}
NOISE = {"v_x": 0.01, "v_y": 0.01, "r": 0.002, "delta_f": 0.0, "a_y": 0.05}  # SI
ROWS = 100_000  # that are written at once
POLL = 0.02  # s
SLALOM = Slalom(amplitude=np.radians(4.0), frequency=0.5, onset=1.0, rate_limit=1.0, duration=44.99)


def environment(folder: str) -> dict[str, str]:
    """Return variables with which Python and tireid keep what they compile in a folder."""
    given = {k: value for k, value in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    return given | {name: f"{folder}/{name}" for name in ("PYTHONPYCACHEPREFIX", "TIREID_CACHE")}


def started(words: list[str], runs: int, variables: dict[str, str]) -> float:
    """Return the median time of a Python that does something and ends [ms].

    Parameters
    ----------
    words : after `python`.
    runs : how many.
    variables : of `environment`.
    """
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        quiet = subprocess.DEVNULL
        subprocess.run([sys.executable, *words], check=True, stdout=quiet, env=variables)
        times.append(1e3 * (time.perf_counter() - begin))
    return statistics.median(times)


def write_log(path: Path, base: Recording, seconds: float) -> None:
    """Write a drive over and over as CSV.

    Parameters
    ----------
    path : of the file.
    base : the drive.
    seconds : that the log lasts.
    """
    n = round(seconds / DT)
    rng = np.random.default_rng(n)
    with path.open("w", encoding="utf-8") as file:
        file.write("t,vx,vy,r,delta_f,ay\n")
        for first in range(0, n, ROWS):
            k = np.arange(first, min(first + ROWS, n))
            signals = [
                getattr(base, name)[k % len(base)] + size * rng.standard_normal(k.size)
                for name, size in NOISE.items()
            ]
            np.savetxt(file, np.column_stack([DT * k, *signals]), fmt="%.9g", delimiter=",")


class Took(NamedTuple):
    """Processor time [s] of a command, and the most that its process held [GB]."""

    processor: float
    held: float


def took(words: list[str], variables: dict[str, str]) -> Took:
    """Run a command of tireid and watch it.

    Parameters
    ----------
    words : after `tireid`.
    variables : of `environment`.
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "tireid", *words]
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, stdout=quiet, stderr=quiet, env=variables)
    held = 0.0
    status = Path(f"/proc/{process.pid}/status")
    while process.poll() is None:
        with suppress(OSError, StopIteration):  # it has ended meanwhile
            lines = status.read_text(encoding="utf-8").splitlines()
            line = next(line for line in lines if line.startswith("RssAnon"))
            held = max(held, float(line.split()[1]) / 1e6)
        time.sleep(POLL)
    if process.returncode != 0:
        raise RuntimeError(f"tireid {' '.join(words)} ended with {process.returncode}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return Took(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, held)


def long_logs(targets: Targets, lasting: list[str], variables: dict[str, str]) -> None:
    """Judge logs from CSV to the report.

    Parameters
    ----------
    targets : collects what is missed.
    lasting : keys of `LASTS`.
    variables : of `environment`; nothing was identified with them.
    """
    base = ti.sample_recording(sedan())
    with tempfile.TemporaryDirectory(prefix="tireid-long-") as folder:
        log, car, out = (str(Path(folder) / name) for name in ("log.csv", "car.toml", "out"))
        sedan().to_toml(car)
        words = ["identify", log, "--vehicle", car, "--out", out, "--force"]
        write_log(Path(log), base, LASTS[lasting[0]])
        first = took(words, variables).processor
        targets.at_most("first use, which compiles", first, FIRST, "s", "log/first")
        for key in lasting:
            write_log(Path(log), base, LASTS[key])
            found, label = took(words, variables), f"{key} of log to the report"
            targets.at_most(label, found.processor, SECONDS[key], "s", f"log/{key}/processor")
            targets.at_most(f"{label}, memory", found.held, GIGABYTES[key], "GB", f"log/{key}/held")


def least(action: Callable[[], object], repeats: int) -> float:
    """Return the least processor time of an action that has run once before [ms]."""
    action()
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        action()
        times.append(1e3 * (time.process_time() - begin))
    return min(times)


def tables(v: Values) -> dict[str, Table]:
    """Return the table of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    rows = [
        [f"{what}, wall clock", f"{v[f'start/{key}']:.0f} ms", ""]
        for key, what in (("python", "`python -c pass`"), ("import", "`import tireid`"),
                          ("help", "`tireid --help`"))
    ]  # fmt: skip
    rows += [
        [f"{key} of log at 100 Hz to the report, processor",
         f"{v[f'log/{key}/processor']:.1f} s", f"{v[f'log/{key}/held']:.2f} GB"]
        for key in LASTS
    ]  # fmt: skip
    rows += [[f"run of 45 s, 4500 steps, `{name}`, processor", f"{v[f'run/{name}']:.1f} ms", ""]
             for name in (REFERENCE, LIVE)]  # fmt: skip
    rows.append(["45 s of the plant at 1 ms, processor", f"{v['run/plant']:.0f} ms", ""])
    return {"speed": Table(("task", "time", "memory"), rows)}


def main() -> int:
    """Print the times; return 1 where one is too long."""
    targets, options = Targets("speed"), parse("speed", __doc__)
    runs, repeats = (1, 2) if options.quick else (15, 30)
    with tempfile.TemporaryDirectory(prefix="tireid-kept-") as folder:
        variables = environment(folder)
        for name, words in STARTS.items():
            label, value = f"{name}, a fresh process", started(words, runs, variables)
            targets.at_most(label, value, LONGEST, "ms", f"start/{name}")
        long_logs(targets, list(LASTS)[: 1 if options.quick else None], variables)
    car = sedan()
    plant = Plant(car)
    recording = plant.simulate(SLALOM, speed=20.0).recording()
    actions: dict[str, Callable[[], object]] = {
        name: partial(ti.identify, recording, car, make_method(name, car), check=False)
        for name in (REFERENCE, LIVE)
    }
    actions["plant"] = partial(plant.simulate, SLALOM, speed=20.0)
    for name, action in actions.items():
        value = least(action, repeats if name != "plant" else 5)
        targets.record(f"run/{name}", value)
        show(f"45 s, {name}", f"{value:.2f} ms")
    return targets.finish(keep=options.record)


if __name__ == "__main__":
    sys.exit(main())
