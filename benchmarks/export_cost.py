"""What does a step cost? On this machine, and in exported C on Arm processors in QEMU.

    python -m benchmarks.export_cost [--quick] [--record]

On this machine: the compiled step of each method over 45 s of a slalom of the sedan, as `tireid
compare` times it. On Arm: packages of `tireid export` in float and double, and the tracker of
`--mpc`: flash, RAM, stack, and instructions of the longest step. Without the cross compiler and
QEMU that part is left out.
"""

import sys

import numpy as np

from benchmarks.targets import Table, Targets, Values, parse, show
from codegen.processor import missing_tools
from identifier.compare.course import step_times
from identifier.export.package import build_package
from identifier.export.processor import measure
from identifier.methods import LIVE, REFERENCE, WITHOUT_V_Y, make_method
from models.maneuvers import Slalom
from models.plant import Plant
from models.vehicle import sedan
from mpc.export.pair import build_pair
from mpc.export.processor import measure_mpc

SLALOM = Slalom(amplitude=np.radians(4.0), frequency=0.5, onset=1.0, rate_limit=1.0, duration=44.99)
WITH_A_Y = f"{LIVE} with a_y"
METHODS = (REFERENCE, LIVE, WITHOUT_V_Y)
PACKAGES = (REFERENCE, LIVE, WITH_A_Y, WITHOUT_V_Y)
SMALL = "Cortex-M4F"
MOST = {  # in float on the small processor
    REFERENCE: {"instructions": 2000, "flash_B": 7168, "stack_B": 800, "ram_B": 400},
    WITHOUT_V_Y: {"instructions": 8000},
}
MOST_TIME = 5.0  # us, of a step of the last of `METHODS` on this machine
TRACKER = "tracker"
FIGURES = ("instructions", "flash_B", "stack_B", "ram_B")  # of the costliest step


def on_arm(targets: Targets) -> None:
    """Judge the packages and the tracker on every processor.

    Parameters
    ----------
    targets : collects what is missed.
    """
    car = sedan()
    packages = {
        name: build_package(
            make_method(name.partition(" ")[0], car), car, with_a_y=name == WITH_A_Y
        )
        for name in PACKAGES
    }
    costs = {name: measure(package) for name, package in packages.items()}
    costs[TRACKER] = measure_mpc(build_pair(packages[LIVE]).tracker)
    for name, some in costs.items():
        for cost in some:
            run = cost.replay
            found = dict(
                zip(FIGURES, (run.most_instructions, cost.flash, run.stack, cost.ram), strict=True)
            )
            key = f"arm/{name}/{cost.processor}/{cost.precision}"
            show(key, str(found))
            limits = MOST.get(name, {}) if cost.processor == SMALL and cost.single else {}
            for what, value in found.items():
                targets.record(f"{key}/{what}", value)
                if what in limits:
                    targets.at_most(f"{name}, {SMALL}, float: {what}", value, limits[what], "")


def canary() -> Values:
    """Return how many operations and carried numbers the step of each package has."""
    car, found = sedan(), {}
    for name in (REFERENCE, LIVE):
        step = build_package(make_method(name, car), car).specialized
        found[f"{name}/operations"] = step.function.n_instructions()
        found[f"{name}/carried"] = sum(one.size for one in step.carry.values())
    return found


def tables(v: Values) -> dict[str, Table]:
    """Return the tables of the documents.

    Parameters
    ----------
    v : recorded values.
    """
    arm = []
    for key in (one for one in v if one.endswith("/instructions")):
        _, name, *where, _ = key.split("/")
        cost = [int(v[key.replace("instructions", what)]) for what in FIGURES[1:]]
        kilo = [f"{1e-3 * value:.1f}" for value in cost]
        arm.append([f"{name}", ", ".join(where), f"{int(v[key]):,}".replace(",", " "), *kilo])
    header = ("exported C", "processor, precision", "instructions of the longest step",
              "flash [kB]", "stack [kB]", "RAM [kB]")  # fmt: skip
    pc = [[f"`{name}`", f"{v[f'step/{name}']:.2f}"] for name in METHODS]
    return {
        "export_cost": Table(("method, compiled on a PC", "time of a step [µs]"), pc),
        "export_cost/arm": Table(header, arm),
    }


def main() -> int:
    """Print the tables; return 1 where a target is missed."""
    targets, options = Targets("export_cost"), parse("export_cost", __doc__)
    car = sedan()
    drive = Plant(car).simulate(SLALOM, speed=20.0).recording()
    methods = {name: make_method(name, car) for name in METHODS}
    times = step_times(methods, car, drive, repeats=2 if options.quick else 50)
    for name, seconds in times.items():
        targets.record(f"step/{name}", 1e6 * seconds)
        show(f"a step of {name}", f"{1e6 * seconds:.3f} us")
    slow = 1e6 * times[WITHOUT_V_Y]
    targets.at_most(f"a step of {WITHOUT_V_Y}", slow, MOST_TIME, "us")
    if absent := missing_tools():
        show("costs on Arm", f"not measured, missing: {', '.join(absent)}")
    elif not options.quick:
        on_arm(targets)
    return targets.finish(canary, keep=options.record and not absent)


if __name__ == "__main__":
    sys.exit(main())
