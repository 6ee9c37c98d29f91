"""Processor in the loop without hardware: a package on the Arm boards of QEMU, and on this machine.

A recording runs through the package; what comes back is a hash of every state and status on the way
and, from QEMU, what a step costs. QEMU lets one instruction take 1 ns, and SysTick counts.
"""

import json
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from codegen.compiler import run_compiler
from codegen.errors import TireidError
from codegen.package import renamed
from codegen.writing import write_file

_TARGET = Path(__file__).parent / "target"
CROSS_COMPILER, SIZE, EMULATOR = "arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm"
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno")
_WRAPPED = tuple(f"-Wl,--wrap=__aeabi_{name}" for name in ("dadd", "dsub", "drsub"))
TIMEOUT = 120.0  # s
_PACKAGE = "the package"  # as errors name what is compiled


class _Processor(NamedTuple):
    """A processor: name, machine of QEMU, flags of the compiler, whether it computes in double."""

    name: str
    machine: str
    flags: tuple[str, ...]
    has_double: bool


PROCESSORS = (
    _Processor(
        "Cortex-M4F",
        "mps2-an386",
        ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"),
        False,
    ),
    _Processor(
        "Cortex-M7",
        "mps2-an500",
        ("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16"),
        True,
    ),
)


class Program(NamedTuple):
    """A package and what is replayed through it.
    name : of the package.   prefix : of its C as it lies in this repository.
    files : its texts by path.   replayed : the `replayed.h` of its kind.
    samples : rows of the inputs in double, as `replayed.h` reads them; None where it reads none.
    macros : for `replayed.h`.
    """

    name: str
    prefix: str
    files: Mapping[str, str]
    replayed: Path
    samples: bytes | None = None
    macros: tuple[str, ...] = ()


class Replay(NamedTuple):
    """What a machine made of a program.
    hash : of every state and status.   steps : taken.   faults : steps that were refused.
    state, params, work : sizes [bytes].   stack : of one step [bytes].
    instructions, most_instructions : of a step, mean while driving and largest; 0 where the machine
    does not count.
    """

    hash: str
    steps: int
    faults: int
    state: int
    params: int
    work: int
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
    words = [CROSS_COMPILER, "-print-file-name=nosys.specs"]  # answers with a path if there is one
    return "/" in subprocess.run(words, capture_output=True, text=True, check=False).stdout


def replay(
    program: Program,
    where: _Processor | str,
    *,
    single: bool,
    flags: Sequence[str] = FLAGS,
    corrected: bool = False,
) -> Replay:
    """Run a program on a processor in QEMU, or on this machine.
    where : one of `PROCESSORS`, or the C compiler of this machine.
    single : whether to compute in float.
    corrected : whether sums of doubles that are computed in software are those of `soft_add.c`, for
        comparisons, and not those of libgcc, for costs.
    """
    with tempfile.TemporaryDirectory(prefix="tireid-") as scratch:
        folder = Path(scratch)
        if isinstance(where, str):
            words, command = [where, *flags, "host.c", "-lm"], [str(folder / "replay")]
        else:
            extra = ["soft_add.c", *_WRAPPED] if corrected and not where.has_double else []
            board = ["-ffreestanding", "-Wno-unused", "-nostartfiles", "-T", "mps2.ld", *extra]
            libraries = ["board.c", "--specs=nosys.specs", "-Wl,--no-warnings", "-lm"]
            words = [CROSS_COMPILER, *flags, *where.flags, "-std=gnu99", *board, *libraries]
            machine = ["-M", where.machine, "-nographic", "-monitor", "none", "-icount", "shift=0"]
            semihosting = ["-semihosting-config", "enable=on,target=native"]
            command = [EMULATOR, *machine, *semihosting, "-kernel", "replay"]
        _build(folder, program, words, single=single)
        return _result(command, folder)


def _build(folder: Path, program: Program, words: Sequence[str], *, single: bool) -> None:
    sources = [*_write(folder, program.files), "replay.c"]
    for path in (*_TARGET.iterdir(), program.replayed):
        text = path.read_text(encoding="utf-8")
        write_file(folder / path.name, renamed(text, {program.prefix: program.name}))
    if program.samples is not None:
        write_file(folder / "samples.bin", program.samples)
        sources.append("samples.S")
    options = [f"-D{program.name.upper()}_SINGLE={int(single)}", *program.macros]
    options += ["-Iinclude", "-Isrc", "-Itests", "-I."]
    compiler, *others = words
    run_compiler([compiler, *options, *sources, *others, "-o", "replay"], folder, _PACKAGE)


def _write(folder: Path, files: Mapping[str, str]) -> list[str]:
    """Write headers and sources of a package; return the paths of its library's C files."""
    wanted = [path for path in files if path.endswith((".c", ".h"))]
    for path in wanted:
        (folder / path).parent.mkdir(exist_ok=True)
        write_file(folder / path, files[path])
    return sorted(path for path in wanted if path.endswith(".c") and path.startswith("src/"))


def _result(command: Sequence[str], folder: Path) -> Replay:
    """Run a replay; return the hash and the numbers that it prints by name."""
    words: dict[str, Any] = {"cwd": folder, "capture_output": True, "text": True, "check": False}
    try:
        answer = subprocess.run(command, timeout=TIMEOUT, stdin=subprocess.DEVNULL, **words)
    except subprocess.TimeoutExpired as error:
        raise ReplayError(f"{command[0]} did not end within {TIMEOUT:g} s") from error
    lines = (answer.stdout + answer.stderr).splitlines()
    found = dict(line.split() for line in lines if line.count(" ") == 1)
    if answer.returncode != 0 or "hash" not in found:
        raise ReplayError(f"{command[0]} ended with {answer.returncode}: {answer.stderr[:200]}")
    numbers = {key: int(found[key], 16) for key in Replay._fields if key != "hash"}
    return Replay(hash=found["hash"], **numbers)


class _Size(NamedTuple):
    """Memory of a package itself [bytes]: code and constants, and data that may change."""

    flash: int
    static_ram: int


def _size_on(processor: _Processor, name: str, files: Mapping[str, str], *, single: bool) -> _Size:
    """Return the memory that a package takes on a processor, instances not included.
    single : whether to compute in float.
    """
    with tempfile.TemporaryDirectory(prefix="tireid-") as scratch:
        folder = Path(scratch)
        sources = _write(folder, files)
        define = f"-D{name.upper()}_SINGLE={int(single)}"
        for source in sources:
            words = [*processor.flags, *FLAGS, define, "-Iinclude", "-Isrc", "-c", source]
            run_compiler([CROSS_COMPILER, *words], folder, _PACKAGE)
        objects = [Path(source).with_suffix(".o").name for source in sources]
        answer = subprocess.run(
            [SIZE, *objects], cwd=folder, capture_output=True, text=True, check=True
        )
        rows = [line.split() for line in answer.stdout.splitlines()[1:]]
        text, data, bss = (sum(int(row[i]) for row in rows) for i in range(3))
        return _Size(flash=text + data, static_ram=data + bss)


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
    def precision(self) -> str:
        """The C type that it computes in."""
        return "float" if self.single else "double"

    @property
    def ram(self) -> int:
        """Static data, and state, parameters and work space of one instance [bytes]."""
        run = self.replay
        return self.static_ram + run.state + run.params + run.work

    @property
    def words(self) -> str:
        """The cost in words, without the processor."""
        return (
            f"{self.replay.instructions} instructions a step, {self.flash} B flash, {self.ram} B "
            f"RAM, {self.replay.stack} B stack"
        )


def cost_on(program: Program, processor: _Processor, *, single: bool) -> Cost:
    """Return what a program costs on a processor.
    single : whether to compute in float.
    """
    size = _size_on(processor, program.name, program.files, single=single)
    run = replay(program, processor, single=single)
    words = [CROSS_COMPILER, "--version"]
    told = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    return Cost(processor.name, told.splitlines()[0], single, size.flash, run, size.static_ram)


def cost_table(costs: Sequence[Cost], about: str) -> str:
    """Return costs as Markdown; a line that they were not measured where there are none.
    about : over what instructions and stack were measured, and what else is to be said.
    """
    if not costs:
        lacking = ", ".join(missing_tools())
        return f"Not measured: {lacking} could not be found." if lacking else "Not measured."
    works = costs[0].replay.work > 0
    head = (
        f"| processor | precision | flash [B] | RAM: static + state + params{' + work' * works} [B]"
        " | stack of a step [B] | instructions a step, mean | largest |\n"
        "|---|---|---|---|---|---|---|\n"
    )
    rows = "".join(
        f"| {cost.processor} | {cost.precision} | {cost.flash} | {cost.static_ram} + "
        f"{run.state} + {run.params}{f' + {run.work}' * works} | {run.stack} | "
        f"{run.instructions} | {run.most_instructions} |\n"
        for cost in costs
        for run in (cost.replay,)
    )
    version = f"{costs[0].compiler}, -O2; instructions"
    return f"{head}{rows}\n{version}\nand stack by {EMULATOR} over {about}"


def with_figures(manifest: str, costs: Sequence[Cost]) -> str:
    """Return <name>.json with the costs; its hashes are of the rest.
    manifest : text of the JSON file.
    """
    figures = [
        {
            "processor": cost.processor,
            "precision": cost.precision,
            "compiler": cost.compiler,
            "flash_B": cost.flash,
            "ram_B": cost.ram,
            "static_ram_B": cost.static_ram,
            "state_B": cost.replay.state,
            "params_B": cost.replay.params,
            **({"work_B": cost.replay.work} if cost.replay.work else {}),
            "stack_B": cost.replay.stack,
            "instructions_mean": cost.replay.instructions,
            "instructions_largest": cost.replay.most_instructions,
        }
        for cost in costs
    ]
    return json.dumps({**json.loads(manifest), "figures": figures}, indent=2) + "\n"
