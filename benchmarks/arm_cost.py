"""What exported C costs on Arm processors, measured in QEMU, beside the targets."""

from benchmarks.targets import Targets, show
from identifier.export.figures import measure
from identifier.export.package import build_package
from identifier.export.processor import CROSS_COMPILER, compiler_version, missing_tools
from identifier.methods import DEFAULT, REFERENCE, make_method
from models.vehicle import sedan

METHODS = {REFERENCE: "paper, n_h = 10", DEFAULT: "default, axle curves"}
SMALL = "Cortex-M4F"


def print_arm_costs(targets: Targets) -> None:
    """Print flash, RAM, stack and instructions; targets are for the paper's network on an M4F."""
    absent = missing_tools()
    if absent:
        show("costs on Arm", f"not measured, missing: {', '.join(absent)}")
        return
    car = sedan()
    print(f"on Arm, {compiler_version(CROSS_COMPILER)}, -O2, QEMU counts instructions:")
    print("method                processor   precision   flash    RAM  stack  a step  largest")
    costs = {name: measure(build_package(make_method(name, car), car)) for name in METHODS}
    for name, found in costs.items():
        for cost in found:
            run = cost.replay
            print(
                f"{METHODS[name]:22}{cost.processor:12}{'float' if cost.single else 'double':9}"
                f"{cost.flash:8}{run.state + run.params:7}{run.stack:7}{run.instructions:8}"
                f"{run.most_instructions:9}"
            )
    small = next(cost for cost in costs[REFERENCE] if cost.processor == SMALL and cost.single)
    run = small.replay
    for label, value, limit in (
        ("instructions of the longest step", run.most_instructions, 2000),
        ("flash [B]", small.flash, 7168),
        ("stack [B]", run.stack, 800),
        ("RAM [B]", run.state + run.params, 400),
    ):
        targets.at_most(f"{METHODS[REFERENCE]}, {SMALL}, float: {label}", value, limit, "")
