"""Benchmarks measure what users get: the functions that they call are called by the product too."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.sources import nodes_of, tree_of

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("codegen", "models", "identifier", "mpc", "tireid")
Name = tuple[str, str]  # module, name in it

# Formulas that a benchmark checks against another road; no number of a user comes from them.
CHECKED = {
    ("models.recordings.reader", "runs"),  # of the library, for a user's own loop over them
}


@cache
def imported(source: str) -> tuple[Name, ...]:
    """Names of the product that a file imports."""
    return tuple(_imported(source))


def _imported(source: str) -> Iterator[Name]:
    for node in nodes_of(source):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in PACKAGES:
            for alias in node.names:
                yield str(node.module), alias.name


@cache
def source_of(module: str, root: Path) -> str:
    path = root / module.replace(".", "/")
    files = (path.with_suffix(".py"), path / "__init__.py")
    return next((file.read_text(encoding="utf-8") for file in files if file.is_file()), "")


def defined_in(name: Name, root: Path) -> Name:
    """Where a name is defined, behind what only hands it on."""
    for module, other in imported(source_of(name[0], root)):
        if other == name[1]:
            return defined_in((module, other), root)
    return name


def reads(node: ast.AST, name: str) -> bool:
    """Whether code reads the name of its module, not a variable of a function of that name."""
    if isinstance(node, ast.FunctionDef):
        if node.name == name:
            return False
        inside = list(ast.walk(node))
        stored = {n.id for n in inside if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
        if name in stored | {n.arg for n in inside if isinstance(n, ast.arg)}:
            return False
    if isinstance(node, ast.Name):
        return node.id == name and isinstance(node.ctx, ast.Load)
    return any(reads(child, name) for child in ast.iter_child_nodes(node))


def used_at_home(name: Name, root: Path) -> bool:
    """Whether the module that defines a name uses it as well."""
    return reads(tree_of(source_of(name[0], root)), name[1])


def is_function(name: Name, root: Path) -> bool:
    tree = tree_of(source_of(name[0], root))
    return any(isinstance(n, ast.FunctionDef) and n.name == name[1] for n in tree.body)


def only_in_benchmarks(root: Path) -> set[Name]:
    """Functions of the product that nothing but a benchmark calls."""
    product = [f for folder in PACKAGES for f in (root / folder).rglob("*.py")]
    used = {
        defined_in(name, root)
        for file in product
        if file.name != "__init__.py"
        for name in imported(file.read_text(encoding="utf-8"))
    }
    called = {
        defined_in(name, root)
        for file in (root / "benchmarks").glob("*.py")
        for name in imported(file.read_text(encoding="utf-8"))
    }
    return {
        name for name in called - used if is_function(name, root) and not used_at_home(name, root)
    }


@pytest.mark.heavy
def test_benchmarks_call_what_the_product_calls():
    assert only_in_benchmarks(ROOT) <= CHECKED


def test_a_wrapper_that_only_a_benchmark_uses_is_caught(tmp_path):
    for folder in ("mpc", "tireid", "benchmarks"):
        (tmp_path / folder).mkdir()
    (tmp_path / "mpc" / "__init__.py").write_text("from mpc.held import held, learnt\n")
    home = tmp_path / "mpc" / "held.py"
    home.write_text(
        "LIMIT = 1\ndef held():\n    return held()\n"
        "def learnt():\n    held = [1]\n    return held\n"
    )
    (tmp_path / "tireid" / "drive.py").write_text("from mpc import learnt\n")
    (tmp_path / "benchmarks" / "worth.py").write_text("from mpc import held, learnt, LIMIT\n")
    assert only_in_benchmarks(tmp_path) == {("mpc.held", "held")}
    (tmp_path / "tireid" / "drive.py").write_text("from mpc import held, learnt\n")
    assert only_in_benchmarks(tmp_path) == set()
