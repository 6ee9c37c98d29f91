"""A package on a Cortex-M7 in QEMU, and on this machine: the same bits, and what a step costs."""

import platform
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from codegen.package import manifest_with_figures, renamed
from codegen.processor import (
    CROSS_COMPILER,
    EMULATOR,
    FLAGS,
    PROCESSORS,
    compile_in,
    compiler_version,
    emulation,
    printed,
    size_on,
)
from codegen.writing import write_file
from identifier.export.processor import TARGET as BOARD
from identifier.export.processor import missing_tools
from mpc.export.package import MpcPackage
from mpc.realtime import Tracker
from mpc.realtime.c_source import PREFIX

TARGET = Path(__file__).parent / "target"
PROCESSOR = PROCESSORS[-1]  # the one that computes in double
STEPS = 40  # of the self-test that are replayed


class Replay(NamedTuple):
    """What a machine made of the vectors.

    hash : of every state and status.   steps : of the tracker.
    state, params, work : sizes [bytes].   stack : of one step [bytes].
    instructions, most_instructions : of a step, mean of those that plan, and largest; 0 where the
    machine does not count.
    """

    hash: str
    steps: int
    state: int
    params: int
    work: int
    stack: int
    instructions: int
    most_instructions: int


def replay_on_processor(package: MpcPackage, *, single: bool, steps: int = STEPS) -> Replay:
    """Run vectors through a package on a Cortex-M7 in QEMU.

    Parameters
    ----------
    single : whether to compute in float.

    Raises
    ------
    CompilationError
        Where the compiler refuses a file.
    ReplayError
        Where the program does not come to its end.
    """
    board = ["-std=gnu99", "-ffreestanding", "-nostartfiles", "-T", "mps2.ld", "board.c"]
    libraries = ["--specs=nosys.specs", "-Wl,--no-warnings", "-lm"]
    compiler = [CROSS_COMPILER, *FLAGS, *PROCESSOR.flags, *board, *libraries]
    return _replayed(package, compiler, emulation(PROCESSOR), single=single, steps=steps)


def replay_here(
    package: MpcPackage,
    compiler: str,
    *,
    single: bool,
    steps: int = STEPS,
    flags: Sequence[str] = FLAGS,
) -> Replay:
    """Run vectors through a package on this machine.

    Parameters
    ----------
    single : whether to compute in float.

    Raises
    ------
    CompilationError
        Where the compiler refuses a file.
    ReplayError
        Where the program does not come to its end.
    """
    words = [compiler, *flags, "host.c", "-lm"]
    return _replayed(package, words, ["./replay"], single=single, steps=steps)


def _replayed(
    package: MpcPackage,
    compiler: Sequence[str],
    command: Sequence[str],
    *,
    single: bool,
    steps: int,
) -> Replay:
    name = package.name
    with tempfile.TemporaryDirectory(prefix="tireid-") as scratch:
        folder = Path(scratch)
        for path, text in package.files.items():
            (folder / path).parent.mkdir(exist_ok=True)
            write_file(folder / path, text)
        for board in ("board.c", "host.c", "machine.h", "mps2.ld"):
            source = (BOARD / board).read_text(encoding="utf-8")
            write_file(folder / board, source)
        replay = (TARGET / "replay.c").read_text(encoding="utf-8")
        write_file(folder / "replay.c", renamed(replay, {PREFIX: name}))
        sources = sorted(path for path in package.files if path.startswith("src/"))
        macros = [f"-D{name.upper()}_SINGLE={int(single)}", f"-DSTEPS={steps}U"]
        own = [*macros, "-Iinclude", "-Isrc", "-Itests", "-I."]
        files = [path for path in sources if path.endswith(".c")]
        first, *words = compiler
        compile_in(folder, [first, *own, *files, "replay.c", *words, "-o", "replay"])
        return Replay(**printed(command, folder, Replay._fields))


# Flash, RAM, stack and instructions of a tracker on a Cortex-M7, and its time on this machine.


class MpcCost(NamedTuple):
    """What a package costs on a processor, built by a compiler; flash: code, constants [bytes]."""

    processor: str
    compiler: str
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
    """Return what a package costs on a Cortex-M7, float and double; empty without the tools."""
    if missing_tools():
        return []
    compiler, costs = compiler_version(CROSS_COMPILER), []
    for single in (True, False):
        size = size_on(PROCESSOR, package.name, package.files, single=single)
        replay = replay_on_processor(package, single=single)
        cost = MpcCost(PROCESSOR.name, compiler, single, size.flash, size.static_ram, replay)
        costs.append(cost)
    return costs


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
        f"{head}{rows}\n{costs[0].compiler}, -O2; instructions\nand stack by "
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
            "compiler": cost.compiler,
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
    return manifest_with_figures(manifest, figures)
