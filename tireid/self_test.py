"""The self-test of an exported package, compiled and run as an embedded engineer would."""

import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

from codegen import find_compiler

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-Iinclude", "-Isrc")


class SelfTestError(RuntimeError):
    """A package does not compile or fails its own test; the message holds what was printed."""


class Verdict(NamedTuple):
    """What a self-test printed: version and precision, the largest difference, "passed"."""

    version: str
    difference: str
    verdict: str


def self_test(folder: Path, name: str, *, single: bool) -> Verdict | None:
    """Compile and run the self-test of a package; None where there is no C compiler.

    Parameters
    ----------
    folder : with the package.
    name : prefix of its symbols.
    single : whether to compute in float.

    Raises
    ------
    SelfTestError
        Where it does not compile or does not pass.
    """
    compiler = find_compiler()
    if compiler is None:
        return None
    sources = [str(p.relative_to(folder)) for p in sorted((folder / "src").glob("*.c"))]
    with tempfile.TemporaryDirectory(prefix="tireid-") as scratch:
        program = Path(scratch) / "self_test"
        own = [f"-D{name.upper()}_SINGLE={int(single)}", *sources, f"tests/test_{name}.c"]
        build = [*compiler, *FLAGS, *own, "-o", str(program), "-lm"]
        for command in (build, [str(program)]):
            answer = subprocess.run(
                command, cwd=folder, capture_output=True, text=True, check=False
            )
            if answer.returncode != 0:
                lines = (answer.stdout + answer.stderr).splitlines()
                raise SelfTestError(f"the package {folder} fails its self-test: {lines[:5]}")
    return Verdict(*answer.stdout.splitlines()[-3:])
