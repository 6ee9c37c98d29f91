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
from typing import Any, NamedTuple

import numpy as np

from codegen import CompilationError
from codegen.arrays import Array
from codegen.errors import TireidError
from codegen.package import manifest_with_figures, renamed
from codegen.writing import write_file
from identifier.export.c_source import PREFIX
from identifier.export.package import Package, synthetic_samples

TARGET = Path(__file__).parent / "target"
CROSS_COMPILER, SIZE, EMULATOR = "arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm"
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno")
WRAPPED = tuple(f"-Wl,--wrap=__aeabi_{name}" for name in ("dadd", "dsub", "drsub"))
TIMEOUT = 120.0  # s


class Processor(NamedTuple):
    """A processor: name, machine of QEMU, flags of the compiler, whether it computes in double."""

    name: str
    machine: str
    flags: tuple[str, ...]
    has_double: bool


PROCESSORS = (
    Processor(
        "Cortex-M4F",
        "mps2-an386",
        ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"),
        False,
    ),
    Processor(
        "Cortex-M7",
        "mps2-an500",
        ("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16"),
        True,
    ),
)


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


class ReplayError(TireidError, RuntimeError):
    """A machine did not come to the end of a recording."""


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
    processor : one of `PROCESSORS`.
    samples : (n, k) in the order of the inputs, SI.
    single : whether to compute in float.
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


def emulation(processor: Processor) -> list[str]:
    """Return the command that runs the program `replay` on a processor in QEMU.

    Parameters
    ----------
    processor : one of `PROCESSORS`; an instruction takes 1 ns.
    """
    machine = ["-M", processor.machine, "-nographic", "-monitor", "none", "-icount", "shift=0"]
    semihosting = ["-semihosting-config", "enable=on,target=native"]
    return [EMULATOR, *machine, *semihosting, "-kernel", "replay"]


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
    single : whether to compute in float.

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


class Size(NamedTuple):
    """Memory of a package itself [bytes]: code and constants, and data that may change."""

    flash: int
    static_ram: int


def size_on(
    processor: Processor, name: str, files: Mapping[str, str], *, single: bool, level: str = "-O2"
) -> Size:
    """Return the memory that a package takes on a processor, instances not included.

    Parameters
    ----------
    processor : one of `PROCESSORS`.
    single : whether to compute in float.

    Raises
    ------
    CompilationError
        Where the compiler refuses a file.
    """
    with tempfile.TemporaryDirectory(prefix="tireid-") as scratch:
        folder = Path(scratch)
        sources = _write(folder, files)
        define = f"-D{name.upper()}_SINGLE={int(single)}"
        for source in sources:
            words = [*processor.flags, *FLAGS, level, define, "-Iinclude", "-Isrc", "-c", source]
            compile_in(folder, [CROSS_COMPILER, *words])
        objects = [Path(source).with_suffix(".o").name for source in sources]
        answer = subprocess.run(
            [SIZE, *objects], cwd=folder, capture_output=True, text=True, check=True
        )
        rows = [line.split() for line in answer.stdout.splitlines()[1:]]
        text, data, bss = (sum(int(row[i]) for row in rows) for i in range(3))
        return Size(flash=text + data, static_ram=data + bss)


@cache
def compiler_version(command: str) -> str:
    """Return the first line of what a compiler says about itself."""
    answer = subprocess.run([command, "--version"], capture_output=True, text=True, check=True)
    return answer.stdout.splitlines()[0]


def _write(folder: Path, files: Mapping[str, str]) -> list[str]:
    """Write headers and sources of a package; return the paths of its C files."""
    wanted = {
        path: text for path, text in files.items() if path.split("/")[0] in ("include", "src")
    }
    for path, text in wanted.items():
        (folder / path).parent.mkdir(exist_ok=True)
        write_file(folder / path, text)
    return sorted(path for path in wanted if path.endswith(".c"))


def _build(
    folder: Path,
    name: str,
    files: Mapping[str, str],
    samples: Array,
    command: Sequence[str],
    *,
    single: bool,
) -> None:
    sources = _write(folder, files)
    for path in TARGET.iterdir():
        text = renamed(path.read_text(encoding="utf-8"), {PREFIX: name})
        write_file(folder / path.name, text)
    write_file(folder / "samples.bin", np.ascontiguousarray(samples, dtype="<f8").tobytes())
    own = [f"-D{name.upper()}_SINGLE={int(single)}", "-Iinclude", "-Isrc", "-I."]
    compiler, *words = command
    files_and_words = [*sources, "replay.c", "samples.S", *words]
    compile_in(folder, [compiler, *own, *files_and_words, "-o", "replay"])


def compile_in(folder: Path, command: Sequence[str]) -> None:
    """Compile files of a package.

    Raises
    ------
    CompilationError
        Where the compiler refuses a file.
    """
    answer = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if answer.returncode != 0:
        first_lines = "\n".join(answer.stderr.splitlines()[:5])
        raise CompilationError(f"{command[0]} refused the package:\n{first_lines}")


def _result(command: Sequence[str], folder: Path) -> Replay:
    return Replay(**printed(command, folder, Replay._fields))


def printed(command: Sequence[str], folder: Path, wanted: Sequence[str]) -> dict[str, Any]:
    """Run a replay; return its hash and the numbers that it prints by name.

    Raises
    ------
    ReplayError
        Where the program does not come to its end.
    """
    try:
        answer = subprocess.run(
            command,
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
            timeout=TIMEOUT,
            stdin=subprocess.DEVNULL,
        )
    except subprocess.TimeoutExpired as error:
        raise ReplayError(f"{command[0]} did not end within {TIMEOUT:g} s") from error
    found = dict(
        line.split()
        for line in (answer.stdout + answer.stderr).splitlines()
        if line.count(" ") == 1
    )
    if answer.returncode != 0 or "hash" not in found:
        raise ReplayError(f"{command[0]} ended with {answer.returncode}: {answer.stderr[:200]}")
    return {key: found[key] if key == "hash" else int(found[key], 16) for key in wanted}


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
    """Return what a package costs on every processor, float and double; empty without the tools.

    Parameters
    ----------
    progress : called with the share that is done.
    """
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
    """Return the costs as Markdown.

    Parameters
    ----------
    costs : from `measure`.
    """
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
    """Return <name>.json with the costs; its hashes are of the rest.

    Parameters
    ----------
    manifest : text of the JSON file.
    costs : from `measure`.
    """
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
