"""Processor in the loop without hardware: a package on the Arm boards of QEMU, and on this machine.

A recording runs through the package; what comes back is a hash of every state and status on the way
and, from QEMU, what a step costs. QEMU lets one instruction take 1 ns, and SysTick counts.
"""

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from codegen.package import manifest_with_figures, renamed
from codegen.processor import (
    CROSS_COMPILER,
    EMULATOR,
    FLAGS,
    PROCESSORS,
    SIZE,
    Processor,
    compile_in,
    compiler_version,
    emulation,
    printed,
    size_on,
    written,
)
from codegen.writing import write_file
from identifier.export.c_source import PREFIX
from identifier.export.package import Package, synthetic_samples

TARGET = Path(__file__).parent / "target"
WRAPPED = tuple(f"-Wl,--wrap=__aeabi_{name}" for name in ("dadd", "dsub", "drsub"))


class Replay(NamedTuple):
    """What a machine made of a recording.

    hash : of every state and status.   steps : samples.   faults : steps that were refused.
    state, params : sizes [bytes].   stack : of one step [bytes].
    instructions, most_instructions : of a step, mean while driving and largest; 0 where the machine
    does not count.
    """

    hash: str
    steps: int
    faults: int
    state: int
    params: int
    stack: int
    instructions: int
    most_instructions: int


def missing_tools() -> tuple[str, ...]:
    """Return which of the tools for Arm are not there."""
    missing = [t for t in (CROSS_COMPILER, SIZE, EMULATOR) if shutil.which(t) is None]
    if CROSS_COMPILER not in missing and not _has_newlib():
        missing.append(f"newlib of {CROSS_COMPILER}")
    return tuple(missing)


@cache
def _has_newlib() -> bool:
    command = [
        CROSS_COMPILER,
        "-print-file-name=nosys.specs",
    ]  # answers with a path where there is one
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    return "/" in answer.stdout


def replay_on(
    processor: Processor,
    name: str,
    files: Mapping[str, str],
    samples: Array,
    *,
    single: bool,
    corrected: bool = False,
) -> Replay:
    """Run a recording through a package on a processor in QEMU.

    Parameters
    ----------
    samples : (n, k) in the order of the inputs, SI.
    corrected : whether sums of doubles that are computed in software are those of `soft_add.c`, for
        comparisons, and not those of libgcc, for costs.

    Raises
    ------
    CompilationError
        Where the compiler refuses a file.
    ReplayError
        Where the program does not come to its end.
    """
    with tempfile.TemporaryDirectory(prefix="tireid-") as scratch:
        folder = Path(scratch)
        extra = ["soft_add.c", *WRAPPED] if corrected and not processor.has_double else []
        board = ["-ffreestanding", "-Wno-unused", "-nostartfiles", "-T", "mps2.ld", *extra]
        libraries = ["board.c", "--specs=nosys.specs", "-Wl,--no-warnings", "-lm"]
        command = [CROSS_COMPILER, *processor.flags, "-std=gnu99", *board, *libraries]
        _build(folder, name, files, samples, [*command[:1], *FLAGS, *command[1:]], single=single)
        return _result(emulation(processor), folder)


def replay_here(
    compiler: str,
    name: str,
    files: Mapping[str, str],
    samples: Array,
    *,
    single: bool,
    flags: Sequence[str] = FLAGS,
) -> Replay:
    """Run a recording through a package on this machine.

    Parameters
    ----------
    samples : (n, k) in the order of the inputs, SI.

    Raises
    ------
    CompilationError
        Where the compiler refuses a file.
    ReplayError
        Where the program does not come to its end.
    """
    with tempfile.TemporaryDirectory(prefix="tireid-") as scratch:
        folder = Path(scratch)
        _build(folder, name, files, samples, [compiler, *flags, "host.c", "-lm"], single=single)
        return _result([str(folder / "replay")], folder)


def _build(
    folder: Path,
    name: str,
    files: Mapping[str, str],
    samples: Array,
    command: Sequence[str],
    *,
    single: bool,
) -> None:
    sources = written(folder, files)
    for path in TARGET.iterdir():
        text = renamed(path.read_text(encoding="utf-8"), {PREFIX: name})
        write_file(folder / path.name, text)
    write_file(folder / "samples.bin", np.ascontiguousarray(samples, dtype="<f8").tobytes())
    own = [f"-D{name.upper()}_SINGLE={int(single)}", "-Iinclude", "-Isrc", "-I."]
    compiler, *words = command
    files_and_words = [*sources, "replay.c", "samples.S", *words]
    compile_in(folder, [compiler, *own, *files_and_words, "-o", "replay"])


def _result(command: Sequence[str], folder: Path) -> Replay:
    return Replay(**printed(command, folder, Replay._fields))


# Flash, RAM, stack and instructions of a package, measured where the tools for Arm are there.


class Cost(NamedTuple):
    """What a package costs on a processor.

    compiler : what it says of itself.   flash : code and constants [bytes].
    replay : what a replay tells.
    static_ram : data that may change and is not the caller's [bytes].
    """

    processor: str
    compiler: str
    single: bool
    flash: int
    replay: Replay
    static_ram: int = 0

    @property
    def ram(self) -> int:
        """Static data, state and parameters of one instance [bytes]."""
        return self.static_ram + self.replay.state + self.replay.params


def measure(package: Package, progress: Callable[[float], None] | None = None) -> list[Cost]:
    """Return what a package costs on every processor, float and double; empty without the tools."""
    if missing_tools():
        return []
    name, samples = package.specialized.name, synthetic_samples(package.specialized)
    compiler, costs = compiler_version(CROSS_COMPILER), []
    for processor in PROCESSORS:
        for single in (True, False):
            size = size_on(processor, name, package.files, single=single)
            replay = replay_on(processor, name, package.files, samples, single=single)
            cost = Cost(processor.name, compiler, single, size.flash, replay, size.static_ram)
            costs.append(cost)
            if progress is not None:
                progress(len(costs) / (2 * len(PROCESSORS)))
    return costs


def figures_text(costs: list[Cost]) -> str:
    """Return the costs as Markdown."""
    if not costs:
        return f"Not measured: {', '.join(missing_tools())} could not be found."
    head = (
        "| processor | precision | flash [B] | RAM: static + state + params [B] "
        "| stack of a step [B] | instructions a step, mean | largest |\n"
        "|---|---|---|---|---|---|---|\n"
    )
    rows = "".join(
        f"| {cost.processor} | {'float' if cost.single else 'double'} | {cost.flash} | "
        f"{cost.static_ram} + {cost.replay.state} + {cost.replay.params} | {cost.replay.stack} | "
        f"{cost.replay.instructions} | {cost.replay.most_instructions} |\n"
        for cost in costs
    )
    return (
        f"{head}{rows}\n{costs[0].compiler}, -O2; instructions\nand stack by "
        f"{EMULATOR} over the samples of the self-test. Each instance has a state of its\nown; "
        "parameters may be shared, or lie in flash."
    )


def with_figures(manifest: str, costs: Sequence[Cost]) -> str:
    """Return <name>.json with the costs; its hashes are of the rest."""
    figures = [
        {
            "processor": cost.processor,
            "precision": "float" if cost.single else "double",
            "compiler": cost.compiler,
            "flash_B": cost.flash,
            "ram_B": cost.ram,
            "static_ram_B": cost.static_ram,
            "state_B": cost.replay.state,
            "params_B": cost.replay.params,
            "stack_B": cost.replay.stack,
            "instructions_mean": cost.replay.instructions,
            "instructions_largest": cost.replay.most_instructions,
        }
        for cost in costs
    ]
    return manifest_with_figures(manifest, figures)
