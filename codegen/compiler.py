"""C source text to a shared library: built once, found again by its content.

Messages go to the logger `tireid`: a build at level INFO, a missing compiler once at level WARNING
(which Python prints even where no logging is set up).
"""

import hashlib
import logging
import os
import shutil
import subprocess
import tempfile
import time
from functools import cache
from pathlib import Path

from codegen.cache import cache_folder

log = logging.getLogger("tireid.codegen")

# -ffp-contract=off and no -march: the same bits on every machine. The three -fno options keep NaN
# guards, which -Ofast would delete.
FLAGS = (
    "-std=c99",
    "-O2",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-ffp-contract=off",
    "-fPIC",
    "-shared",
)


class CompilationError(RuntimeError):
    """The C compiler refused generated code; the message holds its first lines."""


@cache
def find_compiler() -> str | None:
    """Return the C compiler, `$CC` or gcc or cc, or None; where there is none, say so once."""
    for name in (os.environ.get("CC"), "gcc", "cc"):
        found = shutil.which(name) if name else None
        if found:
            return found
    log.warning("no C compiler (gcc) found: running in the CasADi virtual machine, more slowly")
    return None


@cache
def _version(compiler: str) -> str:
    answer = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=False)
    return answer.stdout.splitlines()[0] if answer.stdout else "unknown"


def build_library(source: str, name: str) -> Path | None:
    """Compile C source to a shared library in the cache folder, or find it there.

    Parameters
    ----------
    source : the whole text of one C99 file; it may include <math.h> only.
    name : beginning of the file's name and of the messages.

    Returns
    -------
    The library's path, or None where there is no compiler.

    Raises
    ------
    CompilationError
        Where the compiler refuses the source.
    """
    compiler = find_compiler()
    if compiler is None:
        return None
    content = "\0".join((source, _version(compiler), *FLAGS))
    digest = hashlib.sha256(content.encode()).hexdigest()[:20]
    library = cache_folder() / f"{name}-{digest}.so"
    if library.exists():
        return library
    log.info("compiling %s (once, kept in %s)", name, library.parent)
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(dir=library.parent) as scratch:
        c_file = Path(scratch) / f"{name}.c"
        built = Path(scratch) / library.name
        c_file.write_text(source)
        command = [compiler, *FLAGS, str(c_file), "-o", str(built), "-lm"]
        answer = subprocess.run(command, capture_output=True, text=True, check=False)
        if answer.returncode != 0:
            first_lines = "\n".join(answer.stderr.splitlines()[:5])
            raise CompilationError(
                f"{compiler} refused the generated code of {name}:\n{first_lines}"
            )
        built.replace(library)  # atomic: two processes may build the same library at once
    log.info("compiled %s in %.1f s", name, time.perf_counter() - start)
    return library
