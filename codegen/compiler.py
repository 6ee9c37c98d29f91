"""C source text to a shared library: built once, found again by its content.

Messages go to the logger `tireid`: a build at level INFO, a missing compiler once at level WARNING
(which Python prints even where no logging is set up).
"""

import atexit
import ctypes
import hashlib
import logging
import os
import shlex
import shutil
import stat
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

from codegen.errors import TireidError
from codegen.writing import write_file

# Where compiled code is kept between runs: what is found there, this user put there.
#
# What is loaded runs with all rights of who loads it. So the folder and the file must belong to
# this user and be writable by nobody else, and the file must have the hash that its name ends with.

log = logging.getLogger("tireid.codegen")


def cache_folder() -> Path:
    """Return the folder of compiled libraries, which exists afterwards.

    `$TIREID_CACHE` if set, else `$XDG_CACHE_HOME/tireid`, else `~/.cache/tireid`. Its files are
    named by their content, so that it may be deleted at any time. Where it cannot be written, or
    another user could write it, a temporary folder stands in until the process ends, and the log
    says so once.
    """
    try:
        folder = _chosen_folder()
        if not folder.is_dir():
            folder.parent.mkdir(parents=True, exist_ok=True)
            folder.mkdir(mode=0o700, exist_ok=True)
        reason = _distrust(folder.resolve())
    except (OSError, RuntimeError) as error:  # RuntimeError: this user has no home
        return _temporary_folder(str(error))
    if not os.access(folder, os.W_OK | os.X_OK):
        return _temporary_folder(f"{folder} cannot be written")
    return folder if reason is None else _temporary_folder(reason)


def _distrust(path: Path) -> str | None:
    """Return why another user could have written a file or into a folder; None if none could."""
    if not hasattr(os, "getuid"):  # Windows keeps a user's folders to the user
        return None
    found = path.lstat()
    if stat.S_ISLNK(found.st_mode):
        return f"{path} is a link"
    if found.st_uid != os.getuid():
        return f"{path} belongs to another user"
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"{path} can be written by other users: chmod go-w it, or delete it"
    return None


def keep(stem: str, ending: str, content: bytes) -> Path:
    """Keep a file for `kept`; return its path, which ends with the hash of its content."""
    folder = cache_folder()
    file = folder / f"{stem}.{_digest(content)}{ending}"
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        part = Path(scratch) / file.name
        write_file(part, content)
        part.chmod(0o600)
        part.replace(file)  # atomic: two processes may keep the same file at once
    return file


def kept(stem: str, ending: str) -> Path | None:
    """Return a file that was kept, whole and by this user; None where there is none.

    What is damaged, or not to be trusted, is said and removed.
    """
    for file in sorted(cache_folder().glob(f"{stem}.*{ending}")):
        try:
            reason = _distrust(file)
            if reason is None and file.name == f"{stem}.{_digest(file.read_bytes())}{ending}":
                return file
        except OSError as error:
            reason = str(error)
        if reason is None:
            log.info("%s is damaged: building it anew", file)
        else:
            log.warning("%s: it is not loaded, but built anew", reason)
        with suppress(OSError):
            file.unlink()
    return None


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]


def _chosen_folder() -> Path:
    chosen = os.environ.get("TIREID_CACHE")
    if chosen:
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tireid"


@cache
def _temporary_folder(reason: str) -> Path:
    log.warning("no cache of compiled code (%s): compiling for this run only", reason)
    folder = tempfile.mkdtemp(prefix="tireid-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


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
_LEVELS = ("0", "1", "2", "3")
LONG = 50_000  # characters of a source, beyond which to optimize it takes longer than a test runs
# Before all other flags: words of $CC such as -ffast-math must not delete the guards either.
KEEP_GUARDS = ("-fno-fast-math", "-fno-finite-math-only")


class CompilationError(TireidError, RuntimeError):
    """The C compiler refused generated code; the message holds its first lines."""


class NoCompilerError(TireidError, RuntimeError):
    """There is no C compiler to build a package or the tracker with."""


@cache
def wide_vectors() -> tuple[str, ...]:
    """Return the flag for vectors of four where this processor has them; the bits stay the same."""
    cpu = Path("/proc/cpuinfo")  # of Linux; elsewhere vectors stay short
    return ("-mavx2",) if cpu.exists() and " avx2 " in cpu.read_text(encoding="utf-8") else ()


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


def _at_level(flags: tuple[str, ...], source: str) -> tuple[str, ...]:
    """Return the flags with the level of optimization that $TIREID_OPTIMIZE asks for, if it does.

    Two levels, as in 1,0, are one for short sources and one for long ones. The bits are the same at
    each; tests, which run little of much that is compiled, take low ones.
    """
    requested = os.environ.get("TIREID_OPTIMIZE", "")
    if not requested:
        return flags
    levels = requested.split(",")
    if len(levels) > 2 or not set(levels) <= set(_LEVELS):
        raise CompilationError(
            f"TIREID_OPTIMIZE must be one of {', '.join(_LEVELS)}, or two of them, for short and "
            f"for long sources, it is {requested!r}"
        )
    level = levels[-1] if len(source) > LONG else levels[0]
    return tuple(f"-O{level}" if flag in ("-O1", "-O2", "-O3") else flag for flag in flags)


def run_compiler(command: Sequence[str], folder: Path | None, what: str) -> None:
    """Compile in a folder.   what : is compiled, for an error."""
    answer = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if answer.returncode != 0:
        first_lines = "\n".join(answer.stderr.splitlines()[:5])
        raise CompilationError(f"{command[0]} refused {what}:\n{first_lines}")


def load_library(
    source: str, name: str, flags: tuple[str, ...] | None = None
) -> ctypes.CDLL | None:
    """Build C source as `build_library` does and load it; where that fails build anew, once.

    Returns None where there is no compiler; an OSError is also that it cannot be loaded.
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
    """Compile C source to a shared library in the cache folder, or find it there; return its path.

    None where there is no compiler.
    source : the whole text of one C99 file; it may include <math.h> and <string.h> only.
    flags : of the compiler; None takes `FLAGS`.
    """
    compiler = find_compiler()
    if compiler is None:
        return None
    flags = FLAGS if flags is None else flags
    words = [*compiler, *KEEP_GUARDS, *_at_level(flags, source)]
    made_of = "\0".join((source, _version(compiler), *words))
    stem = f"{name}-{hashlib.sha256(made_of.encode()).hexdigest()[:20]}"
    found = kept(stem, ".so")
    if found is not None:
        return found
    folder = cache_folder()
    log.info("compiling %s (once, cached in %s)", name, folder)
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        c_file, built = Path(scratch) / f"{name}.c", Path(scratch) / name
        write_file(c_file, source)
        command = [*words, str(c_file), "-o", str(built), "-lm"]
        run_compiler(command, None, f"the generated code of {name}")
        library = keep(stem, ".so", built.read_bytes())
    log.info("compiled %s in %.1f s", name, time.perf_counter() - start)
    return library
