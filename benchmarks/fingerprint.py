"""What a record measured: the code that its benchmark runs, as a hash for each package.

Python counts as the syntax tree of the script and of all modules that it imports, directly or not;
comments, docstrings and layout do not. A script that starts `-m tireid` in a process of its own
runs all commands. The C of a package counts without comments and layout.
`targets.finish` writes the hashes into a record, and `python -m benchmarks.documents` lists the
records that are older than the code in docs/benchmarks.md. That list is for readers: nobody runs
two hours of benchmarks because a line of a package changed. A record whose own script changed
may not stand in README.md: what it measures may be another thing today.
"""

import ast
import hashlib
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = "benchmarks"
RIVALS = "tireid_rivals"
PACKAGES = (SCRIPTS, "codegen", "identifier", "models", "mpc", "tireid", RIVALS)
BOOKS = {f"{SCRIPTS}.{name}" for name in ("targets", "fingerprint")}  # write down, measure nothing
OWN = "script"
COMMANDS = "tireid.__main__"
SILENT = {"kind", "type_comment", "type_ignores", "ctx"}  # fields of a node that say nothing
C_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.S)
DIGITS = 12  # of a hash


def fingerprint(script: str, root: Path = ROOT) -> dict[str, str]:
    """Return a hash of the code that a benchmark runs, by package; "script" is its own file.

    Parameters
    ----------
    script : name of the benchmark.
    root : of the checkout.
    """
    found: dict[str, list[str]] = {}
    own = {f"{SCRIPTS}.{script}", f"{SCRIPTS}.{script}.__main__"}
    for name in sorted(modules(f"{SCRIPTS}.{script}", root)):
        package = OWN if name in own else name.partition(".")[0]
        path = _path(name, root)
        if path is not None:
            found.setdefault(package, []).append(f"{name} {_source(path, name).said}")
    for package, lines in found.items():
        if package not in (OWN, SCRIPTS):
            lines += [
                f"{path.relative_to(root).as_posix()} {_said_in_c(path)}"
                for path in sorted((root / package).rglob("*.[ch]"))
            ]
    return {package: _hash("\n".join(lines)) for package, lines in sorted(found.items())}


def changed(code: Mapping[str, str], script: str, root: Path = ROOT) -> tuple[str, ...]:
    """Return the packages whose code is not what a record measured.

    Parameters
    ----------
    code : hashes of the record.
    script : name of its benchmark.
    root : of the checkout.
    """
    now = fingerprint(script, root)
    return tuple(name for name in sorted({*code, *now}) if code.get(name) != now.get(name))


def modules(first: str, root: Path = ROOT) -> set[str]:
    """Return a module and all of the project that it imports, directly or not.

    Parameters
    ----------
    first : name of the module.
    root : of the checkout.
    """
    found: set[str] = set()
    waiting = [first, f"{first}.__main__"]
    while waiting:
        name = waiting.pop()
        path = _path(name, root)
        if name in found or name in BOOKS or path is None:
            continue
        found.add(name)
        parents = [".".join(name.split(".")[:k]) for k in range(1, name.count(".") + 1)]
        waiting += [*parents, *_source(path, name).imports]
        if name == COMMANDS:
            inside = (root / "tireid").rglob("*.py")
            waiting += [".".join(path.relative_to(root).with_suffix("").parts) for path in inside]
    return found


@cache
def _path(name: str, root: Path) -> Path | None:
    """Return the file of a module of the project; None where there is none."""
    if name.partition(".")[0] not in PACKAGES:
        return None
    parts = name.split(".")
    place = root.joinpath(*(["benchmarks", "rivals"] if parts[0] == RIVALS else []), *parts)
    files = (place.with_suffix(".py"), place / "__init__.py", place / "__main__.py")
    return next((path for path in files if path.is_file()), None)


class Source(NamedTuple):
    """A Python file: a hash of what it says, and the names that it imports, modules or not."""

    said: str
    imports: tuple[str, ...]


@cache
def _source(path: Path, name: str) -> Source:
    words: list[str] = []
    imports: list[ast.AST] = []
    _tell(ast.parse(path.read_text(encoding="utf-8")), words, imports)
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    names = tuple(one for node in imports for one in _imported(node, package))
    return Source(_hash(" ".join(words)), names)


def _imported(node: ast.AST, package: str) -> Iterator[str]:
    """Yield the names that a statement imports, or that a command starts."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        above = package.split(".")[: len(package.split(".")) + 1 - node.level]
        home = ".".join([*(above if node.level else []), *filter(None, [node.module])])
        yield home
        yield from (f"{home}.{alias.name}" for alias in node.names)
    elif isinstance(node, ast.List) and package.partition(".")[0] == SCRIPTS:
        words = [one.value for one in node.elts if isinstance(one, ast.Constant)]
        if "-m" in words and "tireid" in words:
            yield COMMANDS


@cache
def _said_in_c(path: Path) -> str:
    return _hash(" ".join(C_COMMENT.sub(" ", path.read_text(encoding="utf-8")).split()))


def _tell(node: ast.AST, words: list[str], imports: list[ast.AST]) -> None:
    """Append a syntax tree as words, the same of all versions of Python, and what may import.

    What is empty is left out, as are docstrings.
    """
    kind = type(node)
    words.append(kind.__name__)
    if kind in (ast.Import, ast.ImportFrom, ast.List):
        imports.append(node)
    for name in node._fields:
        value = getattr(node, name, None)
        if value is None or value == [] or name in SILENT:
            continue
        words.append(name)
        if isinstance(value, list):
            first = 1 if name == "body" and _is_text(value[0]) else 0
            for one in value[first:]:
                if isinstance(one, ast.AST):
                    _tell(one, words, imports)
                else:
                    words.append(repr(one))
        elif isinstance(value, ast.AST):
            _tell(value, words, imports)
        else:
            words.append(repr(value))
    words.append(".")


def _is_text(node: ast.AST) -> bool:
    """Whether a statement is a text alone: a docstring."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]
