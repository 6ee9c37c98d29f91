"""Friction halves in mid course: does learning while driving save the car?

    python -m benchmarks.mpc_friction_drop OUT [SEEDS]

A slalom through 12 cones 36 m apart at the constant speed (24 m/s) that takes 95 % of the cornering
limit of the road after the drop, and ISO 3888-1 at 97 % of it (28 m/s): before the drop the car
uses half of its grip, after it nearly all, so that the course stays drivable. (The faster, the
less feedback alone makes up for a wrong tire: 30 m apart, at 20 m/s, the linear tire stays on the
path in 2 of 10 drives.) The drop from 1.0 to 0.5 is a line across the road, which each wheel meets
on its own; in the slalom it lies 190 to 244 m from the start, at another phase for each seed, in
the lane change 45 to 63 m, before the first change. Seeds also change the noise, the delay (10, 20,
30 ms) and the drive on the dry road that the frozen tires were learnt on.

linear: the tire of the data sheet.   frozen: learnt on the dry road.   learning: begins with the
frozen one, learns on and hands over.   oracle: the true tire, told of the drop as the car passes.
Prints a table, writes OUT/mpc_friction_drop.json and the figure OUT/mpc_friction_drop.png.
"""

import json
import sys
from functools import cache
from itertools import product
from pathlib import Path as File
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.mpc_cases import LEARNING_TIME, learning_drive, plant
from benchmarks.targets import Targets, show
from identifier.axle import AxleDesign, AxleModel
from identifier.identify import identify
from identifier.online import OnlineIdentifier
from identifier.workers import spread
from models.friction import Friction, FrictionChange
from models.vehicle import sedan
from mpc.cars import DoubleTrackCar
from mpc.handover import Learner, Supervisor
from mpc.loop import Drive, Measured, drive, inertial_unit
from mpc.loop.limit import cornering_limit
from mpc.path import Path, iso_3888_1, slalom, steady_speed
from mpc.realtime import Tracker
from mpc.tires import oracle_tire, tire_model

TIRES = ("linear", "frozen", "learning", "oracle")
COURSES = ("slalom", "lane change")
DRY, WET = 1.0, 0.5
WITHIN = 0.5  # m
SEEDS = 10
WORKERS = 2


class Case(NamedTuple):
    """One drive: course, tires, seed of noise, place, delay and learning drive."""

    course: str
    tires: str
    seed: int

    @property
    def place(self) -> float:
        """Where the friction drops [m]."""
        return 190.0 + 6.0 * self.seed if self.course == "slalom" else 45.0 + 2.0 * self.seed

    @property
    def delay(self) -> int:
        """Periods of 10 ms until a command acts."""
        return 1 + self.seed % 3


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


class Told:
    """What an oracle has in place of a learner: the true tire from where the friction drops on."""

    def __init__(self, place: float) -> None:
        self._place, self._tire = place, oracle_tire(sedan(), plant().tire, WET)

    def observe(self, measured: Measured, tracker: Tracker) -> str | None:
        """Tell the tracker as the car passes the place."""
        if self._place > measured.X or tracker.tire is self._tire:
            return None
        tracker.set_tire(self._tire)
        return "told of the drop"


@cache
def course(name: str) -> tuple[Path, float]:
    """Return the path and the speed [m/s].

    Parameters
    ----------
    name : one of `COURSES`.
    """
    limit = cornering_limit(sedan(), plant().tire, WET)
    path, share = (slalom(gap=36.0, cones=12), 0.95) if name == "slalom" else (iso_3888_1(), 0.97)
    return path, steady_speed(path, a_y_max=limit, share=share)


@cache
def learnt(seed: int) -> AxleModel:
    """Return the model that was learnt on the dry road.

    Parameters
    ----------
    seed : of the learning drive.
    """
    car = sedan()
    history = identify(learning_drive(DRY, seed), car, AxleDesign.for_vehicle(car))
    model = history.freeze(LEARNING_TIME)
    assert isinstance(model, AxleModel)
    return model


def run(case: Case) -> tuple[Drive, Learner | None]:
    """Drive a case.

    Parameters
    ----------
    case : what to drive.
    """
    vehicle, (path, speed) = sedan(), course(case.course)
    change = FrictionChange(scale=WET, at_place=case.place)
    car = DoubleTrackCar(vehicle, friction=Friction(scale=DRY, changes=(change,)))
    model, learner = learnt(case.seed), None
    tire = tire_model(vehicle if case.tires == "linear" else model)
    if case.tires == "oracle":
        tire = oracle_tire(vehicle, plant().tire, DRY)
    if case.tires == "learning":
        design = AxleDesign.for_vehicle(vehicle, dt=car.period)
        learner = Learner(Supervisor(OnlineIdentifier(design, vehicle, car.period, model), tire))
    lag = vehicle.require_chassis().steering_lag
    beside: Any = Told(case.place) if case.tires == "oracle" else learner
    driven = drive(
        path,
        car,
        Tracker(tire, period=car.period, delay=case.delay * car.period + lag),
        speed=speed,
        sensors=inertial_unit(),
        delay=case.delay,
        rng=np.random.default_rng([case.seed, 3]),
        learner=beside,
        plan_every=0,
        name=f"{case.course}, {case.tires}",
    )
    return driven, learner


def score(case: Case) -> Result:
    """Return what became of a drive.

    Parameters
    ----------
    case : to drive.
    """
    driven, learner = run(case)
    after = driven.X - case.place >= 0.0
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
    kept = [r.completed and r.peak <= WITHIN for r in results["learning"]]
    left = [r.peak > WITHIN for r in results["linear"]]
    saved = sum(a and b for a, b in zip(left, kept, strict=True))
    label = f"{name}: learning within {WITHIN} m where linear leaves it"
    targets.at_least(label, 10.0 * saved / len(kept), 9.0, "/10")
    jump = max(r.jump for r in results["learning"])
    usual = min(r.usual for r in results["learning"])
    targets.at_most(
        f"{name}: jump of the plan at a handover over its usual", jump / usual, 1.0, "-"
    )
    show("time from the drop to a lower friction, median and longest", _times(results["learning"]))


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
    figure, axes = plt.subplots(2, 1, figsize=(10.0, 6.0), sharey=True, layout="constrained")
    for ax, name in zip(axes, COURSES, strict=True):
        for k, tires in enumerate(TIRES):
            for seed in range(min(seeds, 3)):
                case = Case(name, tires, seed)
                driven, _ = run(case)
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


def main(out: File, seeds: int = SEEDS) -> list[str]:
    """Drive, print, draw; return the labels of the targets that were missed.

    Parameters
    ----------
    out : folder of the JSON and the figure.
    seeds : of each course and tires.
    """
    out.mkdir(parents=True, exist_ok=True)
    found, targets = drive_all(seeds), Targets()
    report(found, seeds, targets)
    rows = [{**case._asdict(), "place": case.place, **r._asdict()} for case, r in found.items()]
    (out / "mpc_friction_drop.json").write_text(json.dumps(rows, indent=1))
    draw(seeds, out / "mpc_friction_drop.png")
    print(f"wrote {out / 'mpc_friction_drop.json'}; missed: {targets.missed}")
    return targets.missed


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: mpc_friction_drop OUT [SEEDS]")
    main(File(sys.argv[1]), *(int(word) for word in sys.argv[2:]))
