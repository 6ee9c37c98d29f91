"""What exported C costs on Arm processors, measured in QEMU, beside the targets."""

from benchmarks.targets import Targets, show
from codegen.processor import CROSS_COMPILER, Cost, compiler_version, missing_tools
from identifier.export.package import build_package
from identifier.export.processor import measure
from identifier.methods import LIVE, REFERENCE, WITHOUT_V_Y, make_method
from models.vehicle import sedan
from mpc.export.pair import build_pair
from mpc.export.processor import measure_mpc

WITH_A_Y = f"{LIVE}_a_y"
METHODS = {
    REFERENCE: "paper, n_h = 10",
    LIVE: "default, axle curves",
    WITH_A_Y: "default, with a_y",
    WITHOUT_V_Y: "inertial, tells v_y",
}
SMALL = "Cortex-M4F"
LIMITS = {  # in float on the small processor
    REFERENCE: {"instructions": 2000, "flash_B": 7168, "stack_B": 800, "ram_B": 400},
    WITHOUT_V_Y: {"instructions": 8000},
}


def print_arm_costs(targets: Targets) -> None:
    """Print flash, RAM, stack and instructions; targets are for float on an M4F."""
    absent = missing_tools()
    if absent:
        show("costs on Arm", f"not measured, missing: {', '.join(absent)}")
        return
    car = sedan()
    print(f"on Arm, {compiler_version(CROSS_COMPILER)}, -O2, QEMU counts instructions:")
    print("method                processor   precision   flash    RAM  stack  a step  largest")
    packages = {
        name: build_package(make_method(LIVE, car), car, with_a_y=True)
        if name == WITH_A_Y
        else build_package(make_method(name, car), car)
        for name in METHODS
    }
    costs = {name: measure(package) for name, package in packages.items()}
    for name, found in costs.items():
        for cost in found:
            run, precision = cost.replay, cost.precision
            print(
                f"{METHODS[name]:22}{cost.processor:12}{precision:9}"
                f"{cost.flash:8}{cost.ram:7}{run.stack:7}{run.instructions:8}"
                f"{run.most_instructions:9}"
            )
            limits = LIMITS.get(name, {}) if cost.processor == SMALL and cost.single else {}
            for key, value in _figures(cost).items():
                recorded = f"arm/{name}/{cost.processor}/{precision}/{key}"
                if key in limits:
                    label = f"{METHODS[name]}, {SMALL}, float: {key}"
                    targets.at_most(label, value, limits[key], "", key=recorded)
                else:
                    targets.record(recorded, value)


def print_tracker_costs(targets: Targets) -> None:
    """Print what the tracker of `tireid export --mpc` costs on a Cortex-M7, default tires.

    Parameters
    ----------
    targets : record what is measured.
    """
    if missing_tools():
        return
    car = sedan()
    pair = build_pair(build_package(make_method(LIVE, car), car))
    print("tracker              processor   precision   flash    RAM  stack  a step  largest")
    for cost in measure_mpc(pair.tracker):
        run, precision = cost.replay, cost.precision
        ram = cost.ram
        print(
            f"{'default, axle curves':21}{cost.processor:12}{precision:9}{cost.flash:8}{ram:7}"
            f"{run.stack:7}{run.instructions:9}{run.most_instructions:9}"
        )
        figures = {"instructions": run.instructions, "flash_B": cost.flash, "ram_B": ram}
        for key, value in figures.items():
            targets.record(f"arm/tracker/{cost.processor}/{precision}/{key}", value)


def _figures(cost: Cost) -> dict[str, int]:
    """What a step costs at most, by key."""
    return {
        "instructions": cost.replay.most_instructions,
        "flash_B": cost.flash,
        "stack_B": cost.replay.stack,
        "ram_B": cost.ram,
    }
