"""A fleet: how long `tireid fleet learn` takes for many logs of a minute.

    python -m benchmarks.fleet [--logs N] [--jobs N] [--record]

500 logs of 60 s, CSV: everyday drives, each some times over, with as many empty lines behind as
make them different.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from benchmarks.everyday_drives import KINDS, everyday_drive
from benchmarks.random_cars import FIRST_SEED, random_car
from benchmarks.targets import Targets, keeps
from models.plant import PlantError
from models.recordings import write_recording

LOGS = 500
DISTINCT = 20  # drives that logs are made of


def write_logs(folder: Path, count: int) -> None:
    """Write car.toml and logs of its everyday drives.

    Parameters
    ----------
    folder : that they go to.
    count : of logs.
    """
    rng = np.random.default_rng(FIRST_SEED)
    car = random_car("sedan", rng)
    car.told.to_toml(folder / "car.toml")
    texts: list[bytes] = []
    while len(texts) < min(count, DISTINCT):
        with suppress(PlantError):
            log = everyday_drive(car, KINDS[len(texts) % 2], rng).log(rng)
            texts.append(write_recording(log, folder / "one.csv").read_bytes())
    (folder / "logs").mkdir()
    for k in range(count):
        text = texts[k % DISTINCT] + b"\n" * (k // DISTINCT)
        (folder / "logs" / f"{k:05d}.csv").write_bytes(text)


def main(argv: Sequence[str] | None = None) -> int:
    """Time the command; return 1 where a target is missed."""
    keep = keeps()
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fleet")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--logs", type=int, default=LOGS)
    options = parser.parse_args(argv)
    targets = Targets("fleet")
    with tempfile.TemporaryDirectory(prefix="tireid-fleet-") as name:
        folder = Path(name)
        write_logs(folder, options.logs)
        words = ["fleet", "learn", str(folder / "logs" / "*.csv")]
        words += ["--vehicle", str(folder / "car.toml"), "--out", str(folder / "store")]
        words += ["--jobs", str(options.jobs)]
        began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, "-m", "tireid", *words], check=True)
        seconds, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    limit = 60.0 * options.logs / LOGS
    targets.at_most(f"{options.logs} logs of 60 s, CSV", seconds, limit, "s", "seconds")
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    targets.record("processor", spent, "s")
    targets.record("logs", options.logs)
    return targets.finish(keep=keep)


if __name__ == "__main__":
    sys.exit(main())
