"""Every benchmark in turn: `make bench`. What it prints is kept in OUT, one text file each.

    python -m benchmarks.run_all [--record] [--quick] [--only NAME ...] [--out OUT]

Ends with a table of scripts, targets met and missed, and minutes; returns 1 where a target was
missed or a script failed. `--record` lets every script write what it measured to
benchmarks/results; `python -m benchmarks.documents` then writes it into README and docs.
"""

import argparse
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
BENCHMARKS = (
    "speed", "estimate", "bands", "recorded_cars", "without_v_y", "verdicts", "doctor",
    "sensor_faults", "road_friction", "paper_gains", "export_cost", "mpc_speed", "mpc_worth",
    "mpc_friction_drop", "lap", "live",
)  # fmt: skip


class Outcome(NamedTuple):
    """How a script ended: its exit code, targets met, labels of those missed, and minutes."""

    script: str
    code: int
    met: int
    missed: tuple[str, ...]
    minutes: float

    @property
    def verdict(self) -> str:
        """One word or more for the table."""
        if self.missed:
            return f"MISSED: {'; '.join(self.missed)}"
        return "ok" if self.code == 0 else f"FAILED with exit code {self.code}"


def outcome(script: str, code: int, printed: str, minutes: float) -> Outcome:
    """Read what `Targets.finish` printed; a script that was skipped printed nothing of it."""
    found = re.search(rf"^{script}: (\d+) targets met, \d+ missed(?:: (.*))?$", printed, re.M)
    met, labels = (int(found[1]), found[2]) if found else (0, None)
    return Outcome(script, code, met, tuple(labels.split("; ")) if labels else (), minutes)


def summary(outcomes: list[Outcome]) -> str:
    """Return the table that ends `make bench`."""
    lines = [f"{'benchmark':20}{'met':>5}{'missed':>8}{'minutes':>9}  verdict"]
    for one in outcomes:
        numbers = f"{one.met:5}{len(one.missed):8}{one.minutes:9.1f}"
        lines.append(f"{one.script:20}{numbers}  {one.verdict}")
    bad = [one.script for one in outcomes if one.verdict != "ok"]
    lines.append(f"{sum(one.minutes for one in outcomes):.1f} minutes in all")
    lines.append(f"missed or failed: {', '.join(bad) or 'none'}")
    return "\n".join(lines)


def run(script: str, words: list[str], out: Path) -> Outcome:
    """Run one script; print what it prints and keep it in a file of OUT."""
    start, printed = time.perf_counter(), []
    command = [sys.executable, "-m", f"benchmarks.{script}", *words]
    with subprocess.Popen(
        command, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            print(line, end="", flush=True)
            printed.append(line)
    (out / f"{script}.txt").write_text("".join(printed), encoding="utf-8")
    minutes = (time.perf_counter() - start) / 60.0
    return outcome(script, process.returncode, "".join(printed), minutes)


def main(argv: list[str] | None = None) -> int:
    """Run them; return 1 where a target was missed or a script failed.

    Parameters
    ----------
    argv : words of the command.
    """
    parser = argparse.ArgumentParser(description="Run the benchmarks and judge their targets.")
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument("--record", action="store_true", help="write benchmarks/results")
    parser.add_argument("--quick", action="store_true", help="a few cases of each")
    parser.add_argument("--only", nargs="+", choices=BENCHMARKS, default=BENCHMARKS, metavar="NAME")
    options = parser.parse_args(argv)
    out = options.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    words = ["--record"] * options.record + ["--quick"] * options.quick
    outcomes: list[Outcome] = []
    for script in options.only:
        took = sum(one.minutes for one in outcomes)
        print(f"== {script}, after {took:.1f} minutes", flush=True)
        outcomes.append(run(script, words, out))
    table = summary(outcomes)
    (out / "summary.txt").write_text(table + "\n", encoding="utf-8")
    print(table)
    return 0 if all(one.verdict == "ok" for one in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
