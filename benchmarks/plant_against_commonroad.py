"""The plant against an independent program: the multi-body car of commonroad-vehicle-models.

    python -m benchmarks.plant_against_commonroad OUT [--record]

drives step steers and a slalom with both at 20 m/s on dry and on slippery road, prints two tables
and writes the figure OUT/plant_against_commonroad.png. The multi-body car has 29 states and its own
authors; both get the same parameters (its BMW 320i), tires, steering and speed controller.
The first table is against the program as published, the second with its two contradictions removed
(see `benchmarks.commonroad_multibody`): what remains is the difference of the models.
The lateral velocity passes through zero near this speed, so that its error in percent of its own
rms says little; the table gives it as an angle of side slip too. It does not decide about passing.
Targets: steady values against either, transients against the repaired program.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.commonroad_bmw import CommonRoadTire, bmw, bmw_320i, bmw_parameters
from benchmarks.commonroad_multibody import MultiBody, drive
from benchmarks.targets import Targets, keeps
from codegen.arrays import Array
from models.friction import Friction
from models.maneuvers import Maneuver, Slalom, StepSteer
from models.plant import Driver, Plant

SPEED = 20.0  # [m/s]
ONSET = 0.5  # [s]
STEP_LENGTH, STEADY_LENGTH = 10.0, 3.0  # near the limit both cars take seconds to settle [s]
TRANSIENT_LENGTH = 2.0  # after the onset of a step [s]
DRIVER = Driver(gain=2.0, integral_gain=0.0, acceleration_limit=3.0)
SIGNALS = ("a_y", "r", "v_y")
UNITS = {"a_y": "m/s²", "r": "rad/s", "v_y": "m/s"}
STEADY_LIMIT, TRANSIENT_LIMIT = 0.05, 0.10


class Comparison(NamedTuple):
    """One maneuver driven by both: signals (n,) over t, errors relative to the multi-body car."""

    name: str
    t: Array
    plant: dict[str, Array]
    reference: dict[str, Array]
    steady: dict[str, float]
    transient: dict[str, float]
    side_slip: float  # rms error of v_y / v_x [rad]

    @property
    def passed(self) -> bool:
        """Whether a_y and r keep both limits."""
        steady = all(abs(error) <= STEADY_LIMIT for error in self.steady.values())
        return steady and all(self.transient[key] <= TRANSIENT_LIMIT for key in ("a_y", "r"))


def maneuvers() -> Iterator[tuple[str, Maneuver]]:
    """Give the maneuvers: three step steers and a slalom."""
    for degrees in (1.0, 2.0, 3.0):
        step = StepSteer(
            amplitude=np.radians(degrees), onset=ONSET, rate_limit=0.4, duration=STEP_LENGTH
        )
        yield f"step {degrees:.0f}°", step
    slalom = Slalom(
        amplitude=np.radians(2.0), frequency=0.5, onset=ONSET, rate_limit=0.4, duration=6.5
    )
    yield "slalom 2° 0.5 Hz", slalom


def compare(name: str, maneuver: Maneuver, scale: float, *, repaired: bool) -> Comparison:
    """Drive a maneuver with both cars.

    Parameters
    ----------
    name : of the maneuver.
    maneuver : the steering.
    scale : friction over the tire's own [-].
    repaired : remove the two contradictions in their program.
    """
    parameters = bmw_parameters(scale, repaired=repaired)
    run = Plant(bmw(), CommonRoadTire.read(), driver=DRIVER).simulate(
        maneuver, speed=SPEED, friction=Friction(scale=scale)
    )
    plant = {"a_y": run.a_y, "r": run.r, "v_y": run.v_y}
    equations = MultiBody(repaired=repaired)
    reference = drive(equations, parameters, maneuver, speed=SPEED, driver=DRIVER)
    steady = {}
    if isinstance(maneuver, StepSteer):
        end = run.t > maneuver.duration - STEADY_LENGTH
        for key in ("a_y", "r"):
            steady[key] = float(np.mean(plant[key][end]) / np.mean(reference[key][end]) - 1.0)
    moving = (run.t > ONSET) & (run.t < ONSET + (TRANSIENT_LENGTH if steady else maneuver.duration))
    transient = {key: _distance(plant[key][moving], reference[key][moving]) for key in SIGNALS}
    error = (plant["v_y"] - reference["v_y"])[moving] / SPEED
    return Comparison(
        name=f"{name}, friction {scale}",
        t=run.t,
        plant=plant,
        reference=reference,
        steady=steady,
        transient=transient,
        side_slip=float(np.sqrt(np.mean(error**2))),
    )


def _distance(plant: Array, reference: Array) -> float:
    return float(np.sqrt(np.mean((plant - reference) ** 2) / np.mean(reference**2)))


def print_table(title: str, comparisons: list[Comparison]) -> None:
    """Print errors relative to the multi-body car, in percent, and of side slip in degrees.

    Parameters
    ----------
    title : first line.
    comparisons : one for each line.
    """
    print(f"{title}; errors in % of it")
    print(f"{'':32s}{'steady':>14s}{'transient rms':>25s}{'side slip':>11s}")
    print(f"{'':32s}{'a_y':>7s}{'r':>7s}{'a_y':>11s}{'r':>7s}{'v_y':>7s}{'rms [°]':>11s}")
    for c in comparisons:
        steady = "".join(
            f"{100 * c.steady[k]:+7.1f}" if k in c.steady else f"{'':7s}" for k in ("a_y", "r")
        )
        transient = "".join(f"{100 * c.transient[k]:7.1f}" for k in SIGNALS)
        verdict = "pass" if c.passed else "no"
        print(f"{c.name:32s}{steady}    {transient}{np.degrees(c.side_slip):11.3f}  {verdict}")


def draw(published: list[Comparison], repaired: list[Comparison], path: Path) -> None:
    """Draw the cars over each other.

    Parameters
    ----------
    published, repaired : one for each column.
    path : the PNG file.
    """
    figure, axes = plt.subplots(
        len(SIGNALS),
        len(repaired),
        figsize=(3.0 * len(repaired), 6.5),
        sharey="row",
        layout="constrained",
    )
    for column, p, c in zip(axes.T, published, repaired, strict=True):
        column[0].set_title(c.name, fontsize=9)
        column[-1].set_xlabel("t [s]")
        for ax, key in zip(column, SIGNALS, strict=True):
            ax.plot(p.t, p.reference[key], color="C1", lw=1, label="multi-body, as published")
            ax.plot(c.t, c.reference[key], color="0.6", lw=3, label="multi-body, repaired")
            ax.plot(c.t, c.plant[key], color="C0", lw=1, label="plant")
            ax.grid(alpha=0.3)
            ax.set_xlim(0.0, 6.5)
    for ax, key in zip(axes[:, 0], SIGNALS, strict=True):
        ax.set_ylabel(f"{key} [{UNITS[key]}]")
    axes[0, 0].legend(fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def judge(published: list[Comparison], repaired: list[Comparison], targets: Targets) -> None:
    """Hold the largest errors against their targets.

    Parameters
    ----------
    published, repaired : every maneuver against the program in either state.
    targets : collects what is missed.
    """
    for name, comparisons in {"published": published, "repaired": repaired}.items():
        steps = [c for c in comparisons if c.steady]
        slaloms = [c for c in comparisons if not c.steady]
        steady = 100.0 * max(abs(error) for c in steps for error in c.steady.values())
        label = f"{name}: steady a_y and r, largest error"
        targets.at_most(label, steady, 100.0 * STEADY_LIMIT, key=f"{name}/steady")
        for key in ("a_y", "r"):
            for kind, some in {"steps": steps, "slaloms": slaloms}.items():
                errors = [100.0 * c.transient[key] for c in some]
                targets.record(f"{name}/{kind}/{key}/least", min(errors), "%")
                targets.record(f"{name}/{kind}/{key}/most", max(errors), "%")
        transient = 100.0 * max(c.transient[key] for c in comparisons for key in ("a_y", "r"))
        if name == "repaired":
            label = "repaired: transient a_y and r, largest rms error"
            targets.at_most(label, transient, 100.0 * TRANSIENT_LIMIT, key="repaired/transient")
        targets.record(f"{name}/r/most", 100.0 * max(c.transient["r"] for c in comparisons), "%")
        slip = max(float(np.degrees(c.side_slip)) for c in comparisons)
        targets.record(f"{name}/side_slip", slip, "deg")
    theirs = bmw_320i()
    behind = (theirs.m_ur * theirs.b - theirs.m_uf * theirs.a) / theirs.m
    print(f"their unsprung masses put the center of gravity {1e3 * behind:.1f} mm behind")
    targets.record("center_of_gravity_behind", 1e3 * behind, "mm")


def main(out: Path, *, keep: bool = False) -> int:
    """Compare, print and draw; return 1 where a target is missed.

    Parameters
    ----------
    out : folder of the figure.
    keep : write what was measured to benchmarks/results.
    """
    targets = Targets("plant_against_commonroad")
    out.mkdir(parents=True, exist_ok=True)
    published, repaired = (
        [
            compare(name, maneuver, scale, repaired=state)
            for scale in (1.0, 0.7)
            for name, maneuver in maneuvers()
        ]
        for state in (False, True)
    )
    print_table("against the multi-body car as published", published)
    print()
    print_table("against the multi-body car, repaired", repaired)
    judge(published, repaired, targets)
    figure = out / "plant_against_commonroad.png"
    draw(published, repaired, figure)
    print(f"wrote {figure}")
    return targets.finish(keep=keep)


if __name__ == "__main__":
    keep = keeps()
    if len(sys.argv) != 2:
        sys.exit("usage: plant_against_commonroad.py OUT")
    sys.exit(main(Path(sys.argv[1]), keep=keep))
