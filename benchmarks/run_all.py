"""Every benchmark in turn: `make bench`. What it prints is kept in OUT, one text file each."""

import argparse
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BENCHMARKS = {
    "speed": [],
    "recorded_cars": [],
    "learn_and_extrapolate": [],
    "plant_against_commonroad": ["{out}"],
    "paper_gains": [],
    "stability_formulas": [],
    "gain_limit": [],
    "limit_cycle": [],
    "bounds_monte_carlo": [],
    "batch_speed": [],
    "export_cost": [],
    "kill_and_fill": [],
    "mpc_speed": [],
    "mpc_optimality": [],
    "mpc_stress": [],
    "mpc_worth": ["{out}"],
    "mpc_friction_drop": ["{out}"],
}


def main() -> int:
    """Run them; return 1 where one failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    failed = []
    for name, words in BENCHMARKS.items():
        print(f"== {name}", flush=True)
        command = [sys.executable, "-m", f"benchmarks.{name}"]
        command += [word.format(out=out.resolve()) for word in words]
        answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        (out / f"{name}.txt").write_text(answer.stdout + answer.stderr)
        print(answer.stdout, end="", flush=True)
        if answer.returncode != 0:
            failed.append(name)
            print(answer.stderr.strip().splitlines()[-1:], flush=True)
    print(f"wrote {out}; failed: {', '.join(failed) or 'none'}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
