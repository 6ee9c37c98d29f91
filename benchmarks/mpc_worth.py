"""What learnt tires are worth: `tireid drive` near the limit of grip, on four tires.

    python -m benchmarks.mpc_worth OUT [SEEDS] [--record]

drives ISO 3888-2 and the handling course at 90 % and 97 % of the limit, on friction 1.0 and 0.5, as
the command does with these words and `--tires`: the linear tire of the data sheet; learnt and
frozen the paper's network (`--paper`) and the axle model, the default; the true tire. Seeds are
those of `--seed`. A drive that leaves the path by 2 m or spins ends there and counts as it was
until then. How far the tracker believes a tire was chosen on ISO 3888-1, the slalom and a course of
other turns, with other seeds.
Prints a table, writes OUT/mpc_worth.json and the figure OUT/mpc_worth.png.
"""

import json
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.mpc_cases import TIRES, Case, run
from benchmarks.targets import Targets, keeps
from identifier.compare.work import spread

PATHS = ("iso-3888-2", "course")
SHARES = (0.9, 0.97)
FRICTIONS = (1.0, 0.5)
BEST = "axle"
SEEDS = 10
WORKERS = 2
WITHIN = 1.1  # times the rms of the tracker that is told the truth
ORACLE_BEFORE = {  # cm, of the tracker that was told the truth, before this was driven as users do
    "iso-3888-2/90/1.0": 1.3,
    "iso-3888-2/90/0.5": 0.7,
    "iso-3888-2/97/1.0": 1.4,
    "iso-3888-2/97/0.5": 0.8,
    "course/90/1.0": 1.3,
    "course/90/0.5": 0.6,
    "course/97/1.0": 1.8,
    "course/97/0.5": 1.0,
}
ROUNDED = 0.05  # cm, of these numbers
VISIBLY_WRONG = 1.5  # times the oracle's rms, from which on the linear tire is


class Row(NamedTuple):
    """One path, share and friction: scores by tires, one for each seed."""

    path: str
    share: float
    mu: float
    rms: dict[str, list[float]]
    peak: dict[str, list[float]]
    completed: dict[str, list[bool]]
    failures: dict[str, int]

    @property
    def key(self) -> str:
        """Where its numbers are recorded."""
        return f"{self.path}/{100 * self.share:.0f}/{self.mu}"

    @property
    def name(self) -> str:
        """What tables call it."""
        return f"{self.path}, {100 * self.share:.0f} %, friction {self.mu}"

    def median_rms(self, tires: str) -> float:
        """Return the median over the seeds [m].

        Parameters
        ----------
        tires : one of `TIRES`.
        """
        return float(np.median(self.rms[tires]))


def situations() -> Iterator[tuple[str, float, float]]:
    """Give path, share and friction of each row."""
    yield from product(PATHS, SHARES, FRICTIONS)


def score(case: Case) -> tuple[float, float, bool, int]:
    """Return rms and peak deviation [m], whether completed, and periods without a new plan.

    Parameters
    ----------
    case : to drive.
    """
    found = run(case).scores
    bad = sum(found.failures.values())
    return found.rms_e_y_m, found.peak_e_y_m, found.completed, bad


def drive_all(seeds: int) -> list[Row]:
    """Drive everything, on both cores.

    Parameters
    ----------
    seeds : of each situation.
    """
    cases = [
        Case(path, share, mu, tires, seed)
        for mu, seed in product(FRICTIONS, range(seeds))
        for path, share, tires in product(PATHS, SHARES, TIRES)
    ]
    with spread(WORKERS, chunk=len(PATHS) * len(SHARES) * len(TIRES)) as over:
        found = dict(zip(cases, over(score, cases), strict=True))
    rows = []
    for path, share, mu in situations():
        of = {
            tires: [found[Case(path, share, mu, tires, seed)] for seed in range(seeds)]
            for tires in TIRES
        }
        rows.append(
            Row(
                path=path,
                share=share,
                mu=mu,
                rms={tires: [s[0] for s in all_] for tires, all_ in of.items()},
                peak={tires: [s[1] for s in all_] for tires, all_ in of.items()},
                completed={tires: [s[2] for s in all_] for tires, all_ in of.items()},
                failures={tires: sum(s[3] for s in all_) for tires, all_ in of.items()},
            )
        )
    return rows


def print_table(rows: list[Row]) -> None:
    """Print medians over the seeds, worst peaks, and how many drives were completed.

    Parameters
    ----------
    rows : what was driven.
    """
    print(f"{'rms e_y [m] median (peak, worst seed), completed':44}", end="")
    print("".join(f"{tires:>24}" for tires in TIRES))
    for row in rows:
        print(f"{row.name:44}", end="")
        for tires in TIRES:
            done = f"{sum(row.completed[tires])}/{len(row.completed[tires])}"
            peak = max(row.peak[tires])
            print(f"{row.median_rms(tires):10.4f} ({peak:5.3f}) {done:>5}", end="")
        print()


def judge(rows: list[Row], targets: Targets) -> None:
    """Print the numbers beside their targets.

    Parameters
    ----------
    rows : what was driven.
    targets : collects what is missed.
    """
    for row in rows:
        for tires in TIRES:
            key = f"{row.key}/{tires}"
            targets.record(f"{key}/rms", 100.0 * row.median_rms(tires), "cm")
            targets.record(f"{key}/peak", 100.0 * max(row.peak[tires]), "cm")
            targets.record(f"{key}/completed", sum(row.completed[tires]), "")
        best, oracle, linear = (row.median_rms(tires) for tires in (BEST, "oracle", "linear"))
        label, key = f"{row.name}: frozen over oracle", f"{row.key}/over_oracle"
        targets.at_most(label, best / oracle, WITHIN, "-", key=key)
        before = ORACLE_BEFORE[row.key] + ROUNDED
        targets.at_most(f"{row.name}: oracle against before", 100.0 * oracle, before, "cm")
        if linear > VISIBLY_WRONG * oracle:
            targets.at_most(f"{row.name}: frozen over linear", best / linear, 0.5, "-")
        pairs = zip(row.completed[BEST], row.completed["oracle"], strict=True)
        lost = sum(told and not learnt for learnt, told in pairs)
        targets.at_most(f"{row.name}: drives that only the oracle completes", lost, 0, "")


def summarize(rows: list[Row], targets: Targets) -> None:
    """Record what sentences say: least and largest ratio, and the paths that networks lose.

    Parameters
    ----------
    rows : what was driven.
    targets : records.
    """
    ratios = [row.median_rms(BEST) / row.median_rms("oracle") for row in rows]
    targets.record("least_over_oracle", min(ratios), "-")
    targets.record("largest_over_oracle", max(ratios), "-")
    for mu in FRICTIONS:
        lost = [not done for row in rows if row.mu == mu for done in row.completed["paper"]]
        targets.record(f"paper/lost/{mu}", sum(lost), "")
        targets.record(f"paper/driven/{mu}", len(lost), "")
    for tires in TIRES:
        targets.record(f"{tires}/failures", sum(row.failures[tires] for row in rows), "")


def draw(rows: list[Row], path: Path) -> None:
    """Draw rms deviation of every seed.

    Parameters
    ----------
    rows : what was driven.
    path : the PNG file.
    """
    figure, ax = plt.subplots(figsize=(11.0, 4.5), layout="constrained")
    for k, tires in enumerate(TIRES):
        x = np.arange(len(rows)) + 0.15 * (k - 0.5 * (len(TIRES) - 1))
        for place, row in zip(x, rows, strict=True):
            rms, done = np.array(row.rms[tires]), np.array(row.completed[tires])
            ax.plot(np.full(done.sum(), place), rms[done], ".", color=f"C{k}")
            ax.plot(np.full((~done).sum(), place), rms[~done], "x", color=f"C{k}")
        ax.plot([], [], ".", color=f"C{k}", label=tires)
    ax.plot([], [], "x", color="0.3", label="left the path or spun")
    ax.set_yscale("log")
    ax.set_ylabel("rms deviation [m]")
    labels = [f"{r.path}\n{100 * r.share:.0f} %, μ {r.mu}" for r in rows]
    ax.set_xticks(np.arange(len(rows)), labels, fontsize=8)
    ax.grid(axis="y", alpha=0.3)
    ax.legend(fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main(out: Path, seeds: int = SEEDS, *, keep: bool = False) -> int:
    """Drive, print, draw; return 1 where a target was missed.

    Parameters
    ----------
    out : folder of the JSON and the figure.
    seeds : of each situation.
    keep : record the numbers for the documents.
    """
    out.mkdir(parents=True, exist_ok=True)
    rows, targets = drive_all(seeds), Targets("mpc_worth")
    print_table(rows)
    judge(rows, targets)
    summarize(rows, targets)
    (out / "mpc_worth.json").write_text(
        json.dumps([row._asdict() for row in rows], indent=1), encoding="utf-8"
    )
    draw(rows, out / "mpc_worth.png")
    print(f"wrote {out / 'mpc_worth.json'}, {out / 'mpc_worth.png'}")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    records = keeps()
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: mpc_worth OUT [SEEDS] [--record]")
    sys.exit(main(Path(sys.argv[1]), *(int(word) for word in sys.argv[2:]), keep=records))
