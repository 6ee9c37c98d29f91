"""C source text to a shared library: built once, found again by its content.

Messages go to the logger `tireid`: a build at level INFO, a missing compiler once at level WARNING
(which Python prints even where no logging is set up).
"""

import ctypes
import hashlib
import logging
import os
import shlex
import shutil
import subprocess
import tempfile
import time
from functools import cache
from pathlib import Path

from codegen.cache import cache_folder, keep, kept

log = logging.getLogger("tireid.codegen")

# -ffp-contract=off and no -march: the same bits on every machine. The three -fno options keep NaN
# guards, which -Ofast would delete. Without interposition the small functions of generated code are
# inlined although the library could be preloaded against.
FLAGS = (
    "-std=c99",
    "-O2",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-ffp-contract=off",
    "-fno-semantic-interposition",
    "-fPIC",
    "-shared",
)
# Before all other flags: words of $CC such as -ffast-math must not delete the guards either.
KEEP_GUARDS = ("-fno-fast-math", "-fno-finite-math-only")


class CompilationError(RuntimeError):
    """The C compiler refused generated code; the message holds its first lines."""


@cache
def find_compiler() -> tuple[str, ...] | None:
    """Return the C compiler's command, `$CC` or gcc or cc; None, said once, where there is none.

    `$CC` may hold several words, as in "ccache gcc".
    """
    for command in (os.environ.get("CC") or "", "gcc", "cc"):
        words = shlex.split(command)
        found = shutil.which(words[0]) if words else None
        if found:
            return (found, *words[1:])
    log.warning("no C compiler (gcc) found: running in the CasADi virtual machine, more slowly")
    return None


@cache
def _version(compiler: tuple[str, ...]) -> str:
    answer = subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False)
    return answer.stdout.splitlines()[0] if answer.stdout else "unknown"


def load_library(
    source: str, name: str, flags: tuple[str, ...] | None = None
) -> ctypes.CDLL | None:
    """Build C source as `build_library` does and load it; where that fails build anew, once.

    Parameters
    ----------
    source : the whole text of one C99 file; it may include <math.h> and <string.h> only.
    name : beginning of the file's name and of the messages.
    flags : of the compiler; None takes `FLAGS`.

    Returns
    -------
    The library, or None where there is no compiler.

    Raises
    ------
    CompilationError
        Where the compiler refuses the source.
    OSError
        Where the library can be neither written nor loaded.
    """
    library = build_library(source, name, flags)
    if library is None:
        return None
    try:
        return ctypes.CDLL(str(library))
    except OSError as error:
        log.info("%s cannot be loaded (%s): building it anew", library, error)
        library.unlink(missing_ok=True)
        rebuilt = build_library(source, name, flags)
        return None if rebuilt is None else ctypes.CDLL(str(rebuilt))


def build_library(source: str, name: str, flags: tuple[str, ...] | None = None) -> Path | None:
    """Compile C source to a shared library in the cache folder, or find it there.

    Parameters
    ----------
    source : the whole text of one C99 file; it may include <math.h> and <string.h> only.
    name : beginning of the file's name and of the messages.
    flags : of the compiler; None takes `FLAGS`.

    Returns
    -------
    The library's path, or None where there is no compiler.

    Raises
    ------
    CompilationError
        Where the compiler refuses the source.
    OSError
        Where the compiler cannot be run or its result cannot be written.
    """
    compiler = find_compiler()
    if compiler is None:
        return None
    flags = FLAGS if flags is None else flags
    words = [*compiler, *KEEP_GUARDS, *flags]
    made_of = "\0".join((source, _version(compiler), *words))
    stem = f"{name}-{hashlib.sha256(made_of.encode()).hexdigest()[:20]}"
    found = kept(stem, ".so")
    if found is not None:
        return found
    folder = cache_folder()
    log.info("compiling %s (once, kept in %s)", name, folder)
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        c_file, built = Path(scratch) / f"{name}.c", Path(scratch) / name
        c_file.write_text(source)
        command = [*words, str(c_file), "-o", str(built), "-lm"]
        answer = subprocess.run(command, capture_output=True, text=True, check=False)
        if answer.returncode != 0:
            first_lines = "\n".join(answer.stderr.splitlines()[:5])
            raise CompilationError(
                f"{' '.join(compiler)} refused the generated code of {name}:\n{first_lines}"
            )
        library = keep(stem, ".so", built.read_bytes())
    log.info("compiled %s in %.1f s", name, time.perf_counter() - start)
    return library
