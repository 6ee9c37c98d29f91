"""What a tracker costs on a Cortex-M7 in QEMU, and its time on this machine."""

import platform
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from codegen.processor import PROCESSORS, Cost, Program, cost_on, cost_table, missing_tools
from mpc.export.package import MpcPackage
from mpc.realtime import Tracker
from mpc.realtime.c_source import PREFIX

REPLAYED = Path(__file__).parent / "target" / "replayed.h"
PROCESSOR = PROCESSORS[-1]  # the one that computes in double
STEPS = 40  # of the self-test that are replayed


def vectors_program(package: MpcPackage, steps: int = STEPS) -> Program:
    """Return the vectors of the self-test, which are replayed through a package."""
    macros = (f"-DSTEPS={steps}U",)
    return Program(package.name, PREFIX, package.files, REPLAYED, macros=macros)


def measure_mpc(package: MpcPackage) -> list[Cost]:
    """Return what a package costs on a Cortex-M7, float and double; empty without the tools."""
    if missing_tools():
        return []
    program = vectors_program(package)
    return [cost_on(program, PROCESSOR, single=single) for single in (True, False)]


class Times(NamedTuple):
    """Solve times over the vectors on this machine [us]."""

    machine: str
    median: float
    p99: float


def time_here(package: MpcPackage) -> Times:
    """Return what a step takes on this machine, in double, by Python's tracker: the same C."""
    period, delay = float(package.params["period"]), float(package.params["delay"])
    tracker = Tracker(package.tire, package.problem, period=period, delay=delay)
    times, n = [], package.problem.horizon
    for _ in range(3):
        tracker.reset()
        for k in range(len(package.vectors.measured)):
            command = tracker.step(package.vectors.measurement(k, n))
            times += [command.solve_time_s] if command.iterations else []
    median, p99 = 1e6 * np.percentile(times, [50.0, 99.0])
    return Times(platform.machine(), float(median), float(p99))


def mpc_figures_text(costs: Sequence[Cost], times: Times) -> str:
    here = (
        f"A step took {times.median:.0f} us in double on the {times.machine} machine that exported "
        f"(median;\n99 of 100 took less than {times.p99:.0f} us)."
    )
    if not costs:
        return f"{here} Arm was not measured: {', '.join(missing_tools())} could not be found."
    about = (
        f"{STEPS} measurements of the self-test. The bound on instructions is\n"
        "`max_iterations` of the solver."
    )
    return f"{cost_table(costs, about)}\n\n{here}"
