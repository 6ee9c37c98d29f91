"""Shared libraries of an FMU, for the machine at hand and, with MinGW, for Windows."""

import logging
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from codegen import CompilationError, find_compiler
from codegen.compiler import KEEP_GUARDS

log = logging.getLogger("tireid.export")

MINGW = "x86_64-w64-mingw32-gcc"
# As elsewhere: no contraction, the same bits on every machine; guards against NaN stay.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden")


class Target(NamedTuple):
    """A platform: its folder in FMI 2.0 and 3.0, ending of a library, and how it is built."""

    folder_2: str
    folder_3: str
    ending: str
    compiler: tuple[str, ...]
    flags: tuple[str, ...]


def targets() -> tuple[Target, ...]:
    """Return the platforms that can be built for here; none where there is no compiler."""
    found = []
    compiler = find_compiler()
    if compiler and (platform.system(), platform.machine()) == ("Linux", "x86_64"):
        found.append(
            Target("linux64", "x86_64-linux", ".so", compiler, ("-fPIC", "-shared", "-lm"))
        )
    mingw = shutil.which(MINGW)
    if mingw:
        flags = ("-shared", "-static-libgcc", "-Wl,--no-insert-timestamp", "-s")
        found.append(Target("win64", "x86_64-windows", ".dll", (mingw,), flags))
    return tuple(found)


def build_binary(target: Target, name: str, sources: Mapping[str, bytes]) -> bytes:
    """Compile sources to a shared library and return its content.

    Parameters
    ----------
    target : the platform.
    name : model identifier, name of the library.
    sources : content of C files and headers by name.

    Raises
    ------
    CompilationError
        Where the compiler refuses them.
    """
    with tempfile.TemporaryDirectory(prefix="tireid-") as scratch:
        folder = Path(scratch)
        for file, content in sources.items():
            (folder / file).write_bytes(content)
        c_files = [file for file in sources if file.endswith(".c")]
        library = f"{name}{target.ending}"
        command = [*target.compiler, *KEEP_GUARDS, *FLAGS, *c_files, "-o", library, *target.flags]
        answer = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if answer.returncode != 0:
            first_lines = "\n".join(answer.stderr.splitlines()[:5])
            raise CompilationError(
                f"{target.compiler[0]} refused the FMU's sources:\n{first_lines}"
            )
        log.info("compiled %s for %s", library, target.folder_2)
        return (folder / library).read_bytes()
