"""Sources of the project as trees: several tests walk all of them."""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


@cache
def texts_of(folder):
    """The Python of a folder of the project, by its path there."""
    paths = sorted((ROOT / folder).rglob("*.py"))
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}


@cache
def tree_of(source):
    """The tree of a source, parsed once in a process."""
    return ast.parse(source)


@cache
def nodes_of(source):
    """All nodes of it, in the order of `ast.walk`."""
    return tuple(ast.walk(tree_of(source)))
