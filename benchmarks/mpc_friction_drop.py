"""Friction halves in mid course: does learning while driving save the car?

    python -m benchmarks.mpc_friction_drop OUT [SEEDS] [--record]

What `tireid drive --mu-drop` does, in slaloms through 12 cones 24, 30 and 36 m apart at the
constant speed that takes 95 % of the cornering limit of the road after the drop, and on ISO 3888-1
at 97 % of it: before the drop the car uses half of its grip, after it nearly all, so that the
course stays drivable. The faster, the less feedback alone makes up for a wrong tire: the three gaps
show from where on it matters. The drop from 1.0 to 0.5 is a line across the road, which each wheel
meets on its own; in a slalom it lies between the fifth and the seventh cone, at another phase for
each seed, in the lane change 45 to 63 m from the start, before the first change. Seeds also change
the noise and the drive on the dry road that the frozen tires were learnt on.

linear: the tire of the data sheet.   frozen: learnt on the dry road.   learning: begins with the
frozen one, learns on and hands over.   oracle: the true tire, told of the drop as the car passes.
Prints a table, writes OUT/mpc_friction_drop.json and the figure OUT/mpc_friction_drop.png.
"""

import json
import sys
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path as File
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.mpc_cases import drive_with, options_of
from benchmarks.targets import Targets, keeps, show
from identifier.compare.work import spread
from models.vehicle import sedan
from mpc.handover.learner import Learner
from mpc.loop.sensing import cornering_limit
from mpc.path import Path, iso_3888_1, slalom, steady_speed
from tireid.commands.drive_case import conditions_of, make_setup
from tireid.driving.runs import Conditions, Run
from tireid.driving.setup import SpeedWish

TIRES = ("linear", "frozen", "learning", "oracle")
GAPS = {"slalom 24 m": 24.0, "slalom 30 m": 30.0, "slalom 36 m": 36.0}  # of the cones [m]
COURSES = (*GAPS, "lane change")
SAVED = ("slalom 36 m", "lane change")  # where the linear tire leaves the path
DRY, WET = 1.0, 0.5
WITHIN = 0.5  # m
SEEDS = 10
WORKERS = 2


class Case(NamedTuple):
    """One drive: course, tires, seed of noise, place and learning drive."""

    course: str
    tires: str
    seed: int

    @property
    def place(self) -> float:
        """Arc length where the friction drops [m]."""
        if self.course in GAPS:
            return 40.0 + GAPS[self.course] * (25.0 + self.seed) / 6.0
        return 45.0 + 2.0 * self.seed


class Result(NamedTuple):
    """What became of a drive: deviation after the drop [m], and what was noticed when [s].

    found: time from the drop to the first change of friction that was believed, and friction over
    the dry one then [-]; none where nothing was.   jump: largest change of the planned steering
    rate at a handover [rad/s].   usual: 99th percentile of its changes from period to period
    before the drop, which noise makes [rad/s].
    """

    peak: float
    rms: float
    completed: bool
    found: tuple[float, float] | None
    jump: float
    usual: float
    notes: list[str]


@cache
def course(name: str) -> tuple[Path, float]:
    """Return the path and the speed [m/s].

    Parameters
    ----------
    name : one of `COURSES`.
    """
    limit = cornering_limit(sedan(), None, WET)
    if name in GAPS:
        path, share = slalom(gap=GAPS[name], cones=12), 0.95
    else:
        path, share = iso_3888_1(), 0.97
    return path, steady_speed(path, a_y_max=limit, share=share)


def conditions(case: Case) -> Conditions:
    """Return what `tireid drive` would drive, on a path of our own.

    Parameters
    ----------
    case : what to drive.
    """
    path, speed = course(case.course)
    setup = make_setup(
        path,
        vehicle=None,
        mu=DRY,
        drops=[(case.place, WET)],
        wish=SpeedWish(None, speed),
    )
    defaults = conditions_of(options_of(["--seed", str(case.seed)]))
    return replace(defaults, setup=setup)


def run(case: Case) -> Run:
    """Drive a case.

    Parameters
    ----------
    case : what to drive.
    """
    return drive_with(conditions(case), case.tires)


def score(case: Case) -> Result:
    """Return what became of a drive.

    Parameters
    ----------
    case : to drive.
    """
    run_, place = run(case), float(course(case.course)[0].pose(case.place)[0])
    driven, learner = run_.drive, run_.learner if isinstance(run_.learner, Learner) else None
    after = place <= driven.X
    e_y, dropped_at = driven.e_y[after], float(driven.t[after][0])
    decisions = learner.supervisor.decisions if learner else []
    changes = [(one.t - dropped_at, one.friction) for one in decisions if one.friction != 1.0]
    rates = np.diff(driven.command[driven.t < dropped_at]) / driven.period
    return Result(
        peak=float(np.abs(e_y).max()),
        rms=float(np.sqrt(np.mean(e_y**2))),
        completed=driven.completed,
        found=changes[0] if changes else None,
        jump=max((move.jump for move in learner.moves), default=0.0) if learner else 0.0,
        usual=float(np.percentile(np.abs(np.diff(rates)), 99.0)),
        notes=[f"{t - dropped_at:+.2f} s: {text}" for t, text in driven.notes],
    )


def drive_all(seeds: int) -> dict[Case, Result]:
    """Drive everything, on both cores.

    Parameters
    ----------
    seeds : of each course and tires.
    """
    cases = [Case(*one) for one in product(COURSES, TIRES, range(seeds))]
    cases.sort(key=lambda case: case.seed)  # a worker learns each dry road once
    with spread(WORKERS, chunk=len(COURSES) * len(TIRES)) as over:
        return dict(zip(cases, over(score, cases), strict=True))


def report(found: dict[Case, Result], seeds: int, targets: Targets) -> None:
    """Print peaks after the drop by seed, and the numbers beside their targets.

    Parameters
    ----------
    found : what was driven.
    seeds : of each course and tires.
    targets : collects what is missed.
    """
    for name in COURSES:
        path, speed = course(name)
        print(f"{name}, {path.length:.0f} m at {speed:.1f} m/s: peak |e_y| after the drop [m]")
        results = {kind: [found[Case(name, kind, seed)] for seed in range(seeds)] for kind in TIRES}
        for kind, row in results.items():
            marks = "".join(f"{r.peak:5.2f}{' ' if r.completed else '*'}" for r in row)
            print(f"  {kind:9}{marks}  median rms {np.median([r.rms for r in row]):.3f}")
        judge(name, results, targets)
    print("  * left the path by 2 m, or spun")


def judge(name: str, results: dict[str, list[Result]], targets: Targets) -> None:
    """Print the numbers of a course beside their targets.

    Parameters
    ----------
    name : of the course.
    results : by tires, one for each seed.
    targets : collects what is missed.
    """
    place = name.replace(" ", "_")
    for kind, row in results.items():
        peaks = [r.peak for r in row]
        targets.record(f"{place}/{kind}/least", min(peaks), "m")
        targets.record(f"{place}/{kind}/most", max(peaks), "m")
        targets.record(f"{place}/{kind}/left", sum(not _kept(r) for r in row))
    targets.record(f"{place}/speed", course(name)[1], "m/s")
    learning = results["learning"]
    kept = [_kept(r) for r in learning]
    least = 0.9 * len(kept)
    targets.at_least(f"{name}: learning stays within {WITHIN} m", sum(kept), least, "")
    if name in SAVED:
        saved = sum(
            one and not _kept(other) for one, other in zip(kept, results["linear"], strict=True)
        )
        label = f"{name}: learning within {WITHIN} m where linear leaves it"
        targets.at_least(label, saved, least, "", key=f"{place}/saved")
    share = max(r.jump for r in learning) / min(r.usual for r in learning)
    label = f"{name}: jump of the plan at a handover over its usual"
    targets.at_most(label, share, 1.0, "-", key=f"{place}/jump")
    found = [r.found[0] for r in learning if r.found is not None]
    if found:
        targets.record(f"{place}/noticed", float(np.median(found)), "s")
        targets.record(f"{place}/noticed_latest", max(found), "s")
    show("time from the drop to a lower friction, median and longest", _times(learning))


def _kept(result: Result) -> bool:
    """Return whether the car stayed on the path after the drop."""
    return result.completed and result.peak <= WITHIN


def _times(results: list[Result]) -> str:
    found = [result.found for result in results if result.found is not None]
    if not found:
        return "never"
    after, ratio = np.array(found).T
    return f"{np.median(after):.2f} s, {after.max():.2f} s; then taken for {np.median(ratio):.2f}"


def draw(seeds: int, path: File) -> None:
    """Draw the deviation along both courses for the first seeds.

    Parameters
    ----------
    seeds : of each course and tires.
    path : the PNG file.
    """
    rows = len(COURSES)
    figure, axes = plt.subplots(
        rows, 1, figsize=(10.0, 3.0 * rows), sharey=True, layout="constrained"
    )
    for ax, name in zip(axes, COURSES, strict=True):
        for k, tires in enumerate(TIRES):
            for seed in range(min(seeds, 3)):
                case = Case(name, tires, seed)
                driven = run(case).drive
                label = tires if seed == 0 else None
                ax.plot(driven.s - case.place, driven.e_y, color=f"C{k}", lw=1.0, label=label)
        ax.axvline(0.0, color="0.3", lw=0.8)
        ax.axhspan(-WITHIN, WITHIN, color="0.93", zorder=0)
        ax.set_ylim(-1.5, 1.5)
        ax.set_ylabel(f"{name}: deviation [m]")
    axes[0].legend(fontsize=8, ncols=4)
    axes[1].set_xlabel("way from where the friction halves [m]")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main(out: File, seeds: int = SEEDS, *, keep: bool = False) -> int:
    """Drive, print, draw; return 1 where a target was missed.

    Parameters
    ----------
    out : folder of the JSON and the figure.
    seeds : of each course and tires.
    keep : record the numbers for the documents.
    """
    out.mkdir(parents=True, exist_ok=True)
    found, targets = drive_all(seeds), Targets("mpc_friction_drop")
    report(found, seeds, targets)
    rows = [{**case._asdict(), "place": case.place, **r._asdict()} for case, r in found.items()]
    (out / "mpc_friction_drop.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
    print(f"wrote {out / 'mpc_friction_drop.json'}")
    status = targets.finish(keep=keep)
    draw(seeds, out / "mpc_friction_drop.png")
    return status


if __name__ == "__main__":
    records = keeps()
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: mpc_friction_drop OUT [SEEDS] [--record]")
    sys.exit(main(File(sys.argv[1]), *(int(word) for word in sys.argv[2:]), keep=records))
