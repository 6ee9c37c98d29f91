"""What a record measured: one hash of the code that its benchmark runs.

It takes the script, every module of the project that it imports, directly or not, and the C beside
them; a script that starts `-m tireid` runs all of tireid. Comments, docstrings, layout
and the words of errors do not count.
"""

import ast
import hashlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = {"tireid_rivals": "benchmarks/rivals"}  # of packages that are not in the root
PACKAGES = ("benchmarks", "codegen", "identifier", "models", "mpc", "tireid", *FOLDERS)
BOOKS = {"benchmarks.targets", "benchmarks.fingerprint"}  # write down, measure nothing
C_COMMENT = re.compile(r"/\*(?:.|\n)*?\*/|//.*$", re.M)
DIGITS = 12  # of a hash


def fingerprint(script: str, root: Path = ROOT) -> str:
    """Return the hash of the code that a benchmark runs.

    Parameters
    ----------
    script : name of the benchmark.
    root : of the checkout.
    """
    found = modules(f"benchmarks.{script}", root)
    packages = {name.partition(".")[0] for name in found} - {"benchmarks"}
    c = {path for name in packages for path in (root / name).rglob("*.[ch]")}
    texts = [_plain(path) for path in sorted({*found.values(), *c})]
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:DIGITS]


def modules(first: str, root: Path = ROOT) -> dict[str, Path]:
    """Return a module and all of the project that it imports, directly or not, and their files.

    Parameters
    ----------
    first : name of the module.
    root : of the checkout.
    """
    found: dict[str, Path] = {}
    waiting = [first]
    while waiting:
        name = waiting.pop()
        path = _file(name, root)
        if name in found or name in BOOKS or path is None:
            continue
        found[name] = path
        parts = name.split(".")
        waiting += [".".join(parts[:k]) for k in range(1, len(parts))]
        waiting += _imported(path)
        if name == "tireid.__main__":
            inside = (one.relative_to(root) for one in (root / "tireid").rglob("*.py"))
            waiting += [".".join(one.with_suffix("").parts) for one in inside]
    return found


def _file(name: str, root: Path) -> Path | None:
    """The file of a module of the project; None where there is none."""
    package, *_ = parts = name.split(".")
    if package not in PACKAGES:
        return None
    place = root.joinpath(FOLDERS.get(package, ""), *parts)
    files = (place.with_suffix(".py"), place / "__init__.py")
    return next((path for path in files if path.is_file()), None)


@cache
def _imported(path: Path) -> tuple[str, ...]:
    return tuple(_names(path.read_text(encoding="utf-8")))


def _names(source: str) -> Iterator[str]:
    """Names that a file imports, modules or not, and the command that it starts."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
    if '"-m", "tireid"' in source:
        yield "tireid.__main__"


@cache
def _plain(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        return " ".join(C_COMMENT.sub("", text).split())
    return ast.unparse(_Measured().visit(ast.parse(text)))


class _Measured(ast.NodeTransformer):
    """Takes out what no number hangs on."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        return None if isinstance(node.value, ast.Constant) else node

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        for one in ast.walk(node):
            if isinstance(one, ast.Constant) and isinstance(one.value, str):
                one.value = ""
        return node
