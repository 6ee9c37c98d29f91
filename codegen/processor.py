"""Processors of QEMU: C of a package is compiled for them, run there, and what it takes is read.

QEMU lets one instruction take 1 ns, and SysTick counts.
"""

import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from codegen import CompilationError
from codegen.errors import TireidError
from codegen.writing import write_file

CROSS_COMPILER, SIZE, EMULATOR = "arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm"
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno")
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


class ReplayError(TireidError, RuntimeError):
    """A machine did not come to the end of a recording."""


def emulation(processor: Processor) -> list[str]:
    """Return the command that runs the program `replay` on a processor in QEMU.

    Parameters
    ----------
    processor : one of `PROCESSORS`; an instruction takes 1 ns.
    """
    machine = ["-M", processor.machine, "-nographic", "-monitor", "none", "-icount", "shift=0"]
    semihosting = ["-semihosting-config", "enable=on,target=native"]
    return [EMULATOR, *machine, *semihosting, "-kernel", "replay"]


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
        sources = written(folder, files)
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


def written(folder: Path, files: Mapping[str, str]) -> list[str]:
    """Write headers and sources of a package; return the paths of its C files."""
    wanted = {
        path: text for path, text in files.items() if path.split("/")[0] in ("include", "src")
    }
    for path, text in wanted.items():
        (folder / path).parent.mkdir(exist_ok=True)
        write_file(folder / path, text)
    return sorted(path for path in wanted if path.endswith(".c"))


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
