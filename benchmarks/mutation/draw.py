"""Which faults are planted: drawn by a seed from all that the rules know, nobody chooses.

Packages are folders of two levels, as `identifier/motion`, and what lies beside them, `identifier`.
They, and the C files of two, share the faults as they share the lines of code. In a package a kind
of fault is drawn by the square root of how many there are, so that many swapped arguments do not
drown few turned conditions; then one of its kind, all alike, none twice.
"""

import math
from collections import defaultdict
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.mutation.c_faults import c_faults, changes_tokens
from benchmarks.mutation.faults import PACKAGES, Fault
from benchmarks.mutation.python_faults import changes_bytecode, python_faults

C_FOLDERS = (
    "identifier/export/c",
    "identifier/export/c_fmu",
    "mpc/c",
    "mpc/export/c",
)


def package_of(file: str) -> str:
    """Return the package that a file is drawn in.

    Parameters
    ----------
    file : path from the root of the tree.
    """
    if file.endswith(".c"):
        return f"{file.split('/')[0]}, C"
    return "/".join(file.split("/")[:-1][:2])


def strata(root: Path, only: str | None = None) -> dict[str, list[str]]:
    """Return the files whose faults are drawn together, by the name of their package.

    Parameters
    ----------
    root : of the tree.
    only : a file, or a folder whose files alone are returned; None takes all.
    """
    paths = [path for name in PACKAGES for path in sorted((root / name).rglob("*.py"))]
    paths += [path for folder in C_FOLDERS for path in sorted((root / folder).glob("*.c"))]
    found: dict[str, list[str]] = {}
    for file in (path.relative_to(root).as_posix() for path in paths):
        if only is None or f"{file}/".startswith(f"{only.rstrip('/')}/"):
            found.setdefault(package_of(file), []).append(file)
    return found


def faults_of(root: Path, file: str) -> list[Fault]:
    """Return every fault that the rules know of a file, those that change nothing included.

    Parameters
    ----------
    root : of the tree.
    file : path from there.
    """
    return list(_faults_in(file, (root / file).read_bytes()))


@cache
def _faults_in(file: str, source: bytes) -> tuple[Fault, ...]:
    rules = python_faults if file.endswith(".py") else c_faults
    return tuple(rules(file, source))


def changes(root: Path, fault: Fault) -> bool:
    """Return whether a fault makes another program, one that compiles where it is Python.

    Parameters
    ----------
    root : of the tree.
    fault : to be planted there.
    """
    source = (root / fault.file).read_bytes()
    judge = changes_bytecode if fault.file.endswith(".py") else changes_tokens
    return judge(source, fault.planted(source))


def shares(sizes: dict[str, int], count: int) -> dict[str, int]:
    """Return how many of `count` each gets, by its size, largest remainders first.

    Parameters
    ----------
    sizes : by name.
    count : to share.
    """
    exact = {name: count * size / sum(sizes.values()) for name, size in sizes.items()}
    given = {name: math.floor(value) for name, value in exact.items()}
    by_rest = sorted(exact, key=lambda name: (given[name] - exact[name], name))
    for name in by_rest[: count - sum(given.values())]:
        given[name] += 1
    return given


def draw(root: Path, *, seed: int, count: int, only: str | None = None) -> list[Fault]:
    """Draw faults of a tree; the same seed and tree give the same ones.

    Parameters
    ----------
    root : of the tree.
    seed : of the generator.
    count : number of faults.
    only : the file or folder to draw from; None takes all.

    Raises
    ------
    ValueError
        Where there is no such file, or there are fewer faults.
    """
    rng = np.random.default_rng(seed)
    files = strata(root, only)
    if not files:
        raise ValueError(f"{only} is no file or folder of the packages")
    sizes = {
        name: sum(len((root / file).read_bytes().splitlines()) for file in members)
        for name, members in files.items()
    }
    drawn = []
    for name, number in shares(sizes, count).items():
        drawn += _draw_some(root, files[name], number, rng)
    return drawn


def _draw_some(root: Path, files: list[str], number: int, rng: np.random.Generator) -> list[Fault]:
    by_kind = defaultdict(list)
    for file in files:
        for fault in faults_of(root, file):
            by_kind[fault.kind].append(fault)
    kinds = sorted(by_kind)
    weights = np.sqrt([len(by_kind[kind]) for kind in kinds])
    drawn: list[Fault] = []
    while len(drawn) < number:
        if not any(by_kind.values()):
            raise ValueError(f"{number} faults are more than the rules know of {len(files)} files")
        left = by_kind[kinds[rng.choice(len(kinds), p=weights / weights.sum())]]
        if left:
            fault = left.pop(rng.integers(len(left)))
            if changes(root, fault) and not _same_place(fault, drawn):
                drawn.append(fault)
    return drawn


def _same_place(fault: Fault, drawn: list[Fault]) -> bool:
    """Whether a fault replaces the very bytes that another one does."""
    return any(fault[:1] + fault[2:4] == other[:1] + other[2:4] for other in drawn)
