"""Every benchmark in turn: `make bench`. What it prints is kept in OUT, one text file each.

    python -m benchmarks.run_all [--record] [--only NAME ...] [--out OUT]

Ends with a table of scripts, targets met and missed, and seconds; returns 1 where a target was
missed or a script failed, and names each. `--record` lets every script write what it measured to
benchmarks/results; `python -m benchmarks.documents` then writes it into README and docs.
"""

import argparse
import re
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
APART = ("mutants", "fuzz", "fuzz_c")  # have targets of make of their own: they take longest
BENCHMARKS: Mapping[str, Sequence[str]] = {  # and the words of each command
    "front_door": [],
    "speed": [],
    "long_logs": ["--long"],
    "recorded_cars": [],
    "estimate": [],
    "learn_and_extrapolate": [],
    "sensor_faults": [],
    "beginnings": [],
    "inertial": [],
    "without_v_y": [],
    "latent": [],
    "noisy_runs": [],
    "several_rates": [],
    "fault_table": ["{out}"],
    "doctor_gross": [],
    "verdicts": [],
    "verdicts_without_v_y": [],
    "bands": [],
    "fleet": [],
    "guaranteed": [],
    "guaranteed_faster": [],
    "road_friction": [],
    "live": [],
    "braking": [],
    "doctor": [],
    "plant_against_commonroad": ["{out}"],
    "paper_gains": [],
    "stability_formulas": [],
    "gain_limit": [],
    "bounds_monte_carlo": [],
    "forgetting": [],
    "hostile_certificates": [],
    "hostile_axle": [],
    "export_cost": [],
    "kill_and_fill": [],
    "mpc_speed": [],
    "mpc_optimality": [],
    "mpc_stress": [],
    "mpc_deadline": [],
    "mpc_worth": ["{out}"],
    "mpc_friction_drop": ["{out}"],
    "mpc_caution": ["{out}"],
    "mpc_sensor_faults": ["{out}"],
    "mpc_without_v_y": ["{out}"],
}


class Outcome(NamedTuple):
    """How a script ended: its exit code, targets met, labels of those missed, and seconds.

    `met` is None where the script said nothing about targets.
    """

    script: str
    code: int
    met: int | None
    missed: tuple[str, ...]
    seconds: float

    @property
    def verdict(self) -> str:
        """One word or more for the table."""
        if self.missed:
            return f"MISSED: {'; '.join(self.missed)}"
        return "ok" if self.code == 0 else f"FAILED with exit code {self.code}"

    @property
    def good(self) -> bool:
        """Whether the script ended well and missed nothing."""
        return self.code == 0 and not self.missed


def outcome(script: str, code: int, printed: str, seconds: float) -> Outcome:
    """Read what `Targets.finish` printed.

    Parameters
    ----------
    script : its name.
    code : its exit code.
    printed : its output.
    seconds : how long it took.
    """
    found = re.search(rf"^{script}: (\d+) targets met, \d+ missed(?:: (.*))?$", printed, re.M)
    if found is None:
        return Outcome(script, code, None, (), seconds)
    missed = tuple(found[2].split("; ")) if found[2] else ()
    return Outcome(script, code, int(found[1]), missed, seconds)


def summary(outcomes: Sequence[Outcome]) -> str:
    """Return the table that ends `make bench`.

    Parameters
    ----------
    outcomes : of every script that ran.
    """
    lines = [f"{'benchmark':28}{'met':>5}{'missed':>8}{'time [s]':>10}  verdict"]
    for one in outcomes:
        met = "-" if one.met is None else str(one.met)
        missed = "-" if one.met is None else str(len(one.missed))
        lines.append(f"{one.script:28}{met:>5}{missed:>8}{one.seconds:10.0f}  {one.verdict}")
    bad = [one.script for one in outcomes if not one.good]
    lines.append(f"missed or failed: {', '.join(bad) or 'none'}")
    return "\n".join(lines)


def run(script: str, words: Sequence[str], out: Path) -> Outcome:
    """Run one script; keep what it prints.

    Parameters
    ----------
    script : its name.
    words : of its command.
    out : folder of the text file.
    """
    command = [sys.executable, "-m", f"benchmarks.{script}", *words]
    start = time.perf_counter()
    answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - start
    (out / f"{script}.txt").write_text(answer.stdout + answer.stderr, encoding="utf-8")
    print(answer.stdout, end="", flush=True)
    found = outcome(script, answer.returncode, answer.stdout, seconds)
    if not found.good and not found.missed:
        print(*answer.stderr.strip().splitlines()[-1:], flush=True)
    return found


def main(argv: list[str] | None = None) -> int:
    """Run them; return 1 where a target was missed or a script failed.

    Parameters
    ----------
    argv : words of the command.
    """
    parser = argparse.ArgumentParser(description="Run the benchmarks and judge their targets.")
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument("--record", action="store_true", help="write benchmarks/results")
    parser.add_argument("--only", nargs="+", choices=BENCHMARKS, metavar="NAME", help="these only")
    options = parser.parse_args(argv)
    out = options.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    outcomes = []
    for script in options.only or BENCHMARKS:
        print(f"== {script}", flush=True)
        words = [word.format(out=out) for word in BENCHMARKS[script]]
        outcomes.append(run(script, [*words, *["--record"] * options.record], out))
    table = summary(outcomes)
    (out / "summary.txt").write_text(table + "\n", encoding="utf-8")
    print(table)
    return 0 if all(one.good for one in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
