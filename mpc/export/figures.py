"""Flash, RAM, stack and instructions of a tracker on a Cortex-M7, and its time on this machine."""

import json
import platform
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identifier.export.processor import (
    CROSS_COMPILER,
    EMULATOR,
    compiler_version,
    missing_tools,
    size_on,
)
from mpc.export.package import MpcPackage
from mpc.export.processor import PROCESSOR, STEPS, Replay, replay_on_processor
from mpc.realtime import Tracker


class MpcCost(NamedTuple):
    """What a package costs on a processor; flash: code and constants [bytes]."""

    processor: str
    single: bool
    flash: int
    static_ram: int
    replay: Replay


class Times(NamedTuple):
    """Solve times over the vectors on this machine [us]."""

    machine: str
    median: float
    p99: float


def measure_mpc(package: MpcPackage) -> list[MpcCost]:
    """Return what a package costs on a Cortex-M7, float and double; empty without the tools.

    Parameters
    ----------
    package : of the tracker.
    """
    if missing_tools():
        return []
    costs = []
    for single in (True, False):
        size = size_on(PROCESSOR, package.name, package.files, single=single)
        replay = replay_on_processor(package, single=single)
        costs.append(MpcCost(PROCESSOR.name, single, size.flash, size.static_ram, replay))
    return costs


def time_here(package: MpcPackage) -> Times:
    """Return what a step takes on this machine, in double, by Python's tracker: the same C.

    Parameters
    ----------
    package : of the tracker.
    """
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


def mpc_figures_text(costs: Sequence[MpcCost], times: Times) -> str:
    """Return costs and times as Markdown.

    Parameters
    ----------
    costs : from `measure_mpc`.
    times : from `time_here`.
    """
    here = (
        f"A step took {times.median:.0f} us in double on the {times.machine} machine that exported "
        f"(median;\n99 of 100 took less than {times.p99:.0f} us)."
    )
    if not costs:
        return f"{here} Arm was not measured: {', '.join(missing_tools())} could not be found."
    head = (
        "| processor | precision | flash [B] | RAM: static + state + params + work [B] "
        "| stack of a step [B] | instructions a step, mean | largest |\n"
        "|---|---|---|---|---|---|---|\n"
    )
    rows = "".join(
        f"| {c.processor} | {'float' if c.single else 'double'} | {c.flash} | {c.static_ram} + "
        f"{c.replay.state} + {c.replay.params} + {c.replay.work} | {c.replay.stack} | "
        f"{c.replay.instructions} | {c.replay.most_instructions} |\n"
        for c in costs
    )
    return (
        f"{head}{rows}\n{compiler_version(CROSS_COMPILER)}, -O2; instructions\nand stack by "
        f"{EMULATOR} over {STEPS} measurements of the self-test. The bound on instructions is\n"
        f"`max_iterations` of the solver.\n\n{here}"
    )


def with_mpc_figures(manifest: str, costs: Sequence[MpcCost]) -> str:
    """Return <name>.json with the costs; its hashes are of the rest.

    Parameters
    ----------
    manifest : text of the JSON file.
    costs : from `measure_mpc`.
    """
    figures = [
        {
            "processor": cost.processor,
            "precision": "float" if cost.single else "double",
            "compiler": compiler_version(CROSS_COMPILER),
            "flash_B": cost.flash,
            "static_ram_B": cost.static_ram,
            "state_B": cost.replay.state,
            "params_B": cost.replay.params,
            "work_B": cost.replay.work,
            "stack_B": cost.replay.stack,
            "instructions_mean": cost.replay.instructions,
            "instructions_largest": cost.replay.most_instructions,
        }
        for cost in costs
    ]
    return json.dumps({**json.loads(manifest), "figures": figures}, indent=2) + "\n"
