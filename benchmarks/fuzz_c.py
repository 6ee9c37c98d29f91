"""libFuzzer on the exported C: identifier and tracker, millions of steps of hostile drives.

Packages are written by the functions that `tireid export` calls, compiled by clang with libFuzzer,
AddressSanitizer and UndefinedBehaviorSanitizer (division of numbers by zero, casts that overflow
and the like among it), and driven by the harnesses in `fuzz_c/`: every input is a sequence of
calls, and what must hold is checked after each. The tracker plans two stages of the horizon, which
is all of its code; a hundredth of the steps is taken with forty.

    python -m benchmarks.fuzz_c [--steps 10_000_000] [--seed 1] [--single] [--only NAME] [--jobs 2]
"""

import argparse
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import NamedTuple

from identifier.axle import AxleIdentifier
from identifier.export.package import Package, build_package
from identifier.inertial import InertialIdentifier
from identifier.methods import make_method
from models.vehicle import sedan
from mpc.export.pair import build_pair
from mpc.problem import Problem

HARNESSES = Path(__file__).with_name("fuzz_c")
STEPS = 10_000_000  # of each package
SHORT, LONG = 2, 40  # stages
SHARE_LONG = 100  # of the steps, one in so many is taken with the long horizon
LAWS = ("axle", "integral")
SENSING = ("inertial",)  # identifiers alone
UNUSED = "float-divide-by-zero"  # by 0, of an innovation of 0, whose quotient is not used
LONGEST = 2048  # bytes of an input
BEGINNINGS = 16  # random inputs that the search begins with
SECONDS = 30  # of an input, before it counts as a hang
SANITIZERS = "fuzzer,address,undefined,float-divide-by-zero,float-cast-overflow"
# What AddressSanitizer sees too, and what takes five times as long to look at beside it.
LEFT_OUT = "null,object-size,pointer-overflow,alignment"
FLAGS = ("-std=c99", "-O2", "-g", "-ffp-contract=off", "-fno-sanitize-recover=all")
MISSING = (
    "clang with libFuzzer is needed: on Debian the packages clang and libclang-rt-dev"
    " (with older ones libclang-common-<version>-dev), on macOS `brew install llvm`"
)


class NoFuzzerError(RuntimeError):
    """There is no clang that links libFuzzer and its sanitizers."""


class Subject(NamedTuple):
    """What is fuzzed: files of a package, its name, the harness and macros for it.

    left_out : sanitizers that do not look at it, beside those that look at none.
    """

    files: Mapping[str, str]
    name: str
    harness: str
    macros: tuple[str, ...]
    left_out: str = ""


class Outcome(NamedTuple):
    """Steps and inputs that were taken, steps by status, seconds; what was found, or nothing."""

    steps: int
    inputs: int
    statuses: tuple[int, ...]
    seconds: float
    found: str


def tasks(steps: int) -> Iterator[tuple[str, int]]:
    """Yield the name of what is fuzzed, with its steps.

    Parameters
    ----------
    steps : of each package.
    """
    for law in (*LAWS, *SENSING):
        yield f"identifier/{law}", steps
        if law in LAWS:
            yield f"tracker/{law}/{SHORT}", steps
            yield f"tracker/{law}/{LONG}", max(1, steps // SHARE_LONG)


def subject(name: str) -> Subject:
    """Return what is fuzzed by a name.

    Parameters
    ----------
    name : one of `tasks`.
    """
    _, law, *stages = name.split("/")
    package = _package(law)
    if stages:
        tracker = build_pair(package, Problem(horizon=int(stages[0]))).tracker
        return Subject(tracker.files, tracker.name, "tracker_fuzz.c", ())
    macros = ("LEARNT=W", *_boxes(package))
    left_out = UNUSED if law in SENSING else ""
    return Subject(package.files, package.specialized.name, "identifier_fuzz.c", macros, left_out)


@cache
def _package(law: str) -> Package:
    return build_package(make_method(law, sedan()), sedan())


def _boxes(package: Package) -> tuple[str, ...]:
    """Return the boxes of axle curves and what is learnt beside them as macros, if any."""
    method = package.specialized.method
    if not isinstance(method, AxleIdentifier | InertialIdentifier):
        return ()
    b, rounding = method.bounds, 1.0 + 2e-7  # float has not all of these numbers
    rows = [
        ((0.0, b.compliance * rounding), (0.0, 1.0), (-offset * rounding, offset * rounding))
        for offset in (b.steering, b.v_y)
    ]
    grip = f"{b.least_grip / rounding!r},{b.most_grip * rounding!r}"
    boxes = ("BOXES=1", f"LARGEST={b.weight!r}", f"GRIP={grip}")
    if isinstance(method, InertialIdentifier):
        return boxes
    own = ",".join(repr(limit) for row in rows for pair in row for limit in pair)
    return (*boxes, f"OWN={own}")


def build(subject: Subject, folder: Path, *, single: bool = False) -> Path:
    """Compile the harness with its package; return the program.

    Parameters
    ----------
    subject : what is fuzzed.
    folder : to write to.
    single : whether to compute in float.

    Raises
    ------
    NoFuzzerError
        Where clang has no libFuzzer.
    """
    if not has_fuzzer():
        raise NoFuzzerError(MISSING)
    for path, text in subject.files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
    for file in ("reader.h", subject.harness):
        (folder / file).write_bytes((HARNESSES / file).read_bytes())
    sources = sorted(path for path in subject.files if re.fullmatch(r"src/.*\.c", path))
    macros = [f"-D{subject.name.upper()}_SINGLE={int(single)}", *(f"-D{m}" for m in subject.macros)]
    left_out = ",".join(one for one in (LEFT_OUT, subject.left_out) if one)
    sanitized = [f"-fsanitize={SANITIZERS}", f"-fno-sanitize={left_out}"]
    words = [*FLAGS, *sanitized, *macros, "-Iinclude", "-Isrc", *sources, subject.harness]
    command = ["clang", *words, "-lm", "-o", "fuzz"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    return folder / "fuzz"


@cache
def has_fuzzer() -> bool:
    """Return whether clang links libFuzzer with its sanitizers."""
    if shutil.which("clang") is None:
        return False
    with tempfile.TemporaryDirectory() as scratch:
        empty = Path(scratch) / "empty.c"
        empty.write_text(
            "int LLVMFuzzerTestOneInput(const char *d, unsigned long n);\n"
            "int LLVMFuzzerTestOneInput(const char *d, unsigned long n)\n"
            "{ return (d == 0) && (n > 0); }\n",
            encoding="utf-8",
        )
        words = ["clang", f"-fsanitize={SANITIZERS}", str(empty), "-o", str(empty.with_suffix(""))]
        return subprocess.run(words, capture_output=True, check=False).returncode == 0


def fuzz(program: Path, steps: int, seed: int) -> Outcome:
    """Run until there were so many steps, or something was found.

    Parameters
    ----------
    program : of `build`.
    steps : to take.
    seed : of libFuzzer, positive.
    """
    corpus = program.with_name("corpus")
    corpus.mkdir()
    rng = random.Random(seed)
    for k in range(BEGINNINGS):  # else what is hostile comes late, from an empty input on
        (corpus / f"{k}").write_bytes(rng.randbytes(LONGEST))
    options = {"seed": seed, "max_len": LONGEST, "len_control": 0, "timeout": SECONDS}
    words = [str(program), str(corpus), *(f"-{name}={value}" for name, value in options.items())]
    start = time.perf_counter()
    answer = subprocess.run(
        words,
        cwd=program.parent,
        env={"FUZZ_STEPS": str(steps)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    seconds = time.perf_counter() - start
    told = re.search(r"^steps (\d+) inputs (\d+) statuses([ \d]+)$", answer.stdout, re.M)
    if told is None or answer.returncode != 0:
        return Outcome(0, 0, (), seconds, _complaint(answer.stdout))
    counts = tuple(int(word) for word in told[3].split())
    return Outcome(int(told[1]), int(told[2]), counts, seconds, "")


def _complaint(printed: str) -> str:
    """Return what a rule or a sanitizer said, and the input in base 64."""
    telling = ("BROKEN", "runtime error", "ERROR:", "SUMMARY", "Base64", "fuzz")
    lines = [line for line in printed.splitlines() if any(word in line for word in telling)]
    return "\n".join(lines) or printed[-2000:] or "ended without a word"


def main(words: Sequence[str] | None = None) -> int:
    """Print a line for each package; return 1 where something was found.

    Parameters
    ----------
    words : of the command.
    """
    parser = argparse.ArgumentParser(prog="benchmarks.fuzz_c", description=__doc__)
    parser.add_argument("--steps", type=int, default=STEPS, help="of each package (%(default)s)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--single", action="store_true", help="in float")
    parser.add_argument("--only", default="", help="packages whose name begins so")
    parser.add_argument("--jobs", type=int, default=2, help="processes at once (%(default)s)")
    asked = parser.parse_args(words)
    if not has_fuzzer():
        print(f"fuzz_c: {MISSING}", file=sys.stderr)
        return 2
    failed = 0
    chosen = [
        (name, steps, subject(name))
        for name, steps in tasks(asked.steps)
        if name.startswith(asked.only)
    ]

    def driven(task: tuple[str, int, Subject]) -> Outcome:
        with tempfile.TemporaryDirectory() as scratch:
            return fuzz(build(task[2], Path(scratch), single=asked.single), task[1], asked.seed)

    with ThreadPoolExecutor(asked.jobs) as pool:
        for (name, steps, _), outcome in zip(chosen, pool.map(driven, chosen), strict=True):
            counts = " ".join(map(str, outcome.statuses)).rstrip(" 0")
            print(f"{name}: {outcome.seconds:.0f} s, {outcome.inputs} inputs, by status {counts}")
            if outcome.found:
                print(outcome.found)
            failed += bool(outcome.found) or outcome.steps < steps
            sys.stdout.flush()
    print(f"{failed} of {len(chosen)} packages failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
