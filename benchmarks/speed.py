"""How long users wait: a minute, an hour and ten of log, a fleet, the first use, methods in a car.

    python -m benchmarks.speed [--quick] [--record] [--before CHECKOUT]

Every task is a process of its own, whose processor time counts, and the most that it alone holds
(RssAnon of /proc, sampled). Logs come from CSV at 100 Hz and end in the report of `tireid
identify`: a sedan's drive of 40 s over and over, with noise of its own on every sample. Functions
are compiled before but for the first use; Python keeps its bytecode, as an installed package does.
The least counts. A fleet's log is what one more of them costs. `fit` alone is told by sample, of
one log and of eight together. `--before` runs each task with another checkout in turn and prints
the ratio. On a busy machine processor time is up to three times as long: record on an idle one.
Linux only.
"""

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

import tireid as ti
from benchmarks.everyday_drives import drawn_everyday
from benchmarks.targets import Table, Targets, Values, show
from identifier.methods import DEFAULT, LIVE, REFERENCE, make_method
from models.maneuvers import Slalom
from models.plant import Plant
from models.recordings import Recording, write_recording
from models.vehicle import sedan

ROOT = Path(__file__).resolve().parents[1]
STARTS = {"python": ["-c", "pass"], "import": ["-c", "import tireid"],
          "help": ["-m", "tireid", "--help"]}  # fmt: skip
LONGEST = 150.0  # ms, of a start
DT = 0.01  # s
NOISE = {"v_x": 0.01, "v_y": 0.01, "r": 0.002, "delta_f": 0.0, "a_y": 0.05}  # SI
ROWS = 100_000  # that are written at once
POLL = 0.02  # s
FLEET, FEW = 60, 6  # logs of a minute, and how many tell what beginning costs
SLALOM = Slalom(amplitude=np.radians(4.0), frequency=0.5, onset=1.0, rate_limit=1.0, duration=44.99)
FIT = """
import sys, time, tireid as ti
from identifier.estimate.fit import fit
car, n = ti.sedan(), int(sys.argv[1])
logs = [ti.sample_recording(car, seed=k) for k in range(n)]
fit(logs, car)
begin = time.process_time()
for _ in range(16 // n):
    fit(logs, car)
print(1e6 * (time.process_time() - begin) / (16 // n) / sum(map(len, logs)))
"""


class Task(NamedTuple):
    """A log to its report: how long it lasts [s], whether it shows v_y, how often it runs, and its
    targets: time of the processor [s], memory [GB].
    """

    lasts: float
    v_y: bool
    runs: int
    seconds: float
    held: float


TASKS = {
    "60 s": Task(60.0, True, 4, 1.5, 0.3),
    "60 s without v_y": Task(60.0, False, 3, 4.0, 0.3),
    "1 h": Task(3600.0, True, 2, 7.0, 0.3),
    "10 h": Task(36000.0, True, 1, 25.0, 0.3),
}
FIRST, FLEET_LOG, TOGETHER = 6.0, 0.06, 1.2  # s, s, times of one log


class Took(NamedTuple):
    """Processor time [s] of a command, and the most that its process held [GB]."""

    processor: float
    held: float


class Checkout(NamedTuple):
    """The code that runs: its folder, and one for what Python and tireid compile."""

    root: Path
    kept: Path

    def variables(self) -> dict[str, str]:
        given = {k: value for k, value in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        for name in ("PYTHONPYCACHEPREFIX", "TIREID_CACHE"):
            given[name] = str(self.kept / name)
        return given | {"PYTHONPATH": str(self.root)}

    def run(self, words: Sequence[str]) -> str:
        """Return what a Python prints; words come after `python`."""
        return subprocess.run(
            [sys.executable, *words], check=True, env=self.variables(), cwd=self.root,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        ).stdout  # fmt: skip

    def took(self, words: Sequence[str]) -> Took:
        """Run a command of tireid and watch it; words come after `tireid`."""
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        quiet, held = subprocess.DEVNULL, 0.0
        process = subprocess.Popen(
            [sys.executable, "-m", "tireid", *words],
            stdout=quiet, stderr=quiet, env=self.variables(), cwd=self.root,
        )  # fmt: skip
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


def write_log(path: Path, base: Recording, task: Task) -> None:
    """Write a drive over and over as CSV.   base : the drive."""
    n = round(task.lasts / DT)
    rng = np.random.default_rng(n)
    names = [name for name in NOISE if task.v_y or name != "v_y"]
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(["t", *names]) + "\n")
        for first in range(0, n, ROWS):
            k = np.arange(first, min(first + ROWS, n))
            signals = [
                getattr(base, name)[k % len(base)] + NOISE[name] * rng.standard_normal(k.size)
                for name in names
            ]
            np.savetxt(file, np.column_stack([DT * k, *signals]), fmt="%.9g", delimiter=",")


def judge(
    targets: Targets, label: str, key: str, found: Mapping[str, float], limit: float, unit: str
) -> None:
    """Judge a number of today's code, and print its ratio to that of the one before.

    Parameters
    ----------
    found : by "now" and, where it ran, "before".
    """
    targets.at_most(label, found["now"], limit, unit, key)
    if "before" in found:
        ratio = found["now"] / found["before"]
        show(f"{label}, over the code before", f"{ratio:.2f} ({found['before']:.3g} {unit})")


def logs_to_reports(
    targets: Targets, checkouts: Mapping[str, Checkout], tasks: Mapping[str, Task], folder: Path
) -> None:
    """Judge logs from CSV to the report, and the first use."""
    base, car = ti.sample_recording(sedan()), folder / "car.toml"
    replace(sedan(), chassis=None).to_toml(car)
    for key, task in tasks.items():
        log = folder / "log.csv"
        write_log(log, base, task)
        words = ["identify", str(log), "--vehicle", str(car), "--force", "--out"]
        runs = {
            name: [one.took([*words, str(folder / name)]) for _ in range(task.runs)]
            for name, one in checkouts.items()
        }
        if key == next(iter(TASKS)):
            first = {name: one[0].processor for name, one in runs.items()}
            judge(targets, "first use, which compiles", "log/first", first, FIRST, "s")
        least = {name: min(one.processor for one in some) for name, some in runs.items()}
        held = {name: max(one.held for one in some) for name, some in runs.items()}
        label = f"{key} of log to the report"
        judge(targets, label, f"log/{key}/processor", least, task.seconds, "s")
        judge(targets, f"{label}, memory", f"log/{key}/held", held, task.held, "GB")


def fleet(targets: Targets, checkouts: Mapping[str, Checkout], folder: Path) -> None:
    """Judge a fleet's log of a minute, processes included, without what beginning them costs."""
    drive, found = drawn_everyday("sedan", "slalom", 0), {}
    replace(drive.car.vehicle, chassis=None).to_toml(folder / "fleet.toml")
    for k in range(FLEET):  # the same drive, of each log its own noise
        write_recording(drive.log(np.random.default_rng(k)), folder / f"log-{k:02d}.csv")
    for name, one in checkouts.items():
        spent = []
        for run, logs in enumerate((f"log-0[0-{FEW - 1}].csv",) * 2 + ("log-*.csv",)):  # compiles
            words = ["fleet", "learn", str(folder / logs), "--vehicle", str(folder / "fleet.toml")]
            spent.append(one.took([*words, "--out", str(folder / f"{name}-{run}")]).processor)
        found[name] = (spent[2] - spent[1]) / (FLEET - FEW)
    judge(targets, "a fleet's log of a minute", "fleet/processor", found, FLEET_LOG, "s")


def fits(targets: Targets, checkouts: Mapping[str, Checkout]) -> None:
    """Judge `fit` alone: of eight logs together a sample takes as long as of one."""
    sizes = {
        name: {n: float(one.run(["-c", FIT, str(n)])) for n in (1, 8)}
        for name, one in checkouts.items()
    }
    for n in (1, 8):
        found = {name: one[n] for name, one in sizes.items()}
        judge(targets, f"fit of {n} log(s), a sample", f"fit/{n}", found, 60.0, "µs")
    label = "fit of eight logs over one, by sample"
    targets.at_most(label, sizes["now"][8] / sizes["now"][1], TOGETHER, "", "fit/ratio")


def least(action: Callable[[], object], repeats: int) -> float:
    """Return the least processor time of an action that has run once before [ms]."""
    action()
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        action()
        times.append(1e3 * (time.process_time() - begin))
    return min(times)


def methods(targets: Targets, repeats: int) -> None:
    """Show what a run of 45 s takes, by each method that works in a car."""
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


def canary() -> Values:
    """Return what the work that is timed gives: the plant's a_y, and forces of each method."""
    car = sedan()
    log = Plant(car).simulate(SLALOM, speed=20.0).recording()
    runs = {
        name: ti.identify(log, car, make_method(name, car), check=False)
        for name in (REFERENCE, LIVE, DEFAULT)
    }
    forces = {name: float(np.std(run.history.axle_force)) for name, run in runs.items()}
    return {"a_y": float(np.std(log.needed("a_y"))), **forces}


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
        for key in TASKS
    ]  # fmt: skip
    rows += [
        ["60 s of log at first use, with compiling", f"{v['log/first']:.1f} s", ""],
        ["a fleet's log of a minute", f"{1e3 * float(v['fleet/processor']):.0f} ms", ""],
    ]
    rows += [[f"`fit` alone, a sample of {n} log(s) together", f"{v[f'fit/{n}']:.0f} µs", ""]
             for n in (1, 8)]  # fmt: skip
    rows += [[f"run of 45 s, 4500 steps, `{name}`, processor", f"{v[f'run/{name}']:.1f} ms", ""]
             for name in (REFERENCE, LIVE)]  # fmt: skip
    rows.append(["45 s of the plant at 1 ms, processor", f"{v['run/plant']:.0f} ms", ""])
    return {"speed": Table(("task", "time", "memory"), rows)}


def main() -> int:
    """Print the times; return 1 where one is too long."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a minute, to see that it runs")
    parser.add_argument("--record", action="store_true", help="write benchmarks/results")
    parser.add_argument("--before", type=Path, help="another checkout, beside which all runs")
    options = parser.parse_args()
    if options.before is not None and not (options.before / "tireid").is_dir():
        parser.error(f"--before {options.before}: there is no checkout of tireid")
    targets = Targets("speed")
    with tempfile.TemporaryDirectory(prefix="tireid-speed-") as made:
        folder = Path(made)
        checkouts = {"now": Checkout(ROOT, folder / "kept")}
        if options.before is not None:
            checkouts["before"] = Checkout(options.before.resolve(), folder / "kept-before")
        for name, words in STARTS.items():
            times = []
            checkouts["now"].run(words)  # compiles
            for _ in range(1 if options.quick else 15):
                begin = time.perf_counter()
                checkouts["now"].run(words)
                times.append(1e3 * (time.perf_counter() - begin))
            label = f"{name}, a fresh process"
            targets.at_most(label, statistics.median(times), LONGEST, "ms", f"start/{name}")
        tasks = dict(list(TASKS.items())[: 2 if options.quick else None])
        logs_to_reports(targets, checkouts, tasks, folder)
        if not options.quick:
            fleet(targets, checkouts, folder)
            fits(targets, checkouts)
    methods(targets, 2 if options.quick else 30)
    return targets.finish(canary, keep=options.record and not options.quick)


if __name__ == "__main__":
    sys.exit(main())
