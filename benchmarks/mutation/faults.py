"""What a planted fault is: a few bytes of one file, exchanged for others; and where it is."""

import ast
import difflib
import hashlib
from bisect import bisect_right
from functools import cache
from pathlib import Path
from typing import NamedTuple

PACKAGES = ("codegen", "models", "identifier", "mpc", "tireid")
TOP = "<module>"


class Fault(NamedTuple):
    """One change of one file.

    file : path from the root of the tree.   kind : name of the operator that made it.
    start, end : bytes that are replaced.   new : what stands there instead.
    """

    file: str
    kind: str
    start: int
    end: int
    new: str

    def planted(self, source: bytes) -> bytes:
        """Return the file with the fault in it.

        Parameters
        ----------
        source : the file without it.
        """
        return source[: self.start] + self.new.encode() + source[self.end :]

    def line(self, source: bytes) -> int:
        """Return the line of the file that it begins in, from 1.

        Parameters
        ----------
        source : the file without it.
        """
        return source.count(b"\n", 0, self.start) + 1

    def key(self, source: bytes) -> str:
        """Return a name that is the same as long as its file is.

        Parameters
        ----------
        source : the file without it.
        """
        text = f"{self.file}\0{self.kind}\0{self.start}\0{self.end}\0{self.new}\0".encode()
        return hashlib.sha256(text + source).hexdigest()[:16]

    def diff(self, root: Path) -> str:
        """Return the lines that change, with - and +.

        Parameters
        ----------
        root : of the tree.
        """
        source = (root / self.file).read_bytes()
        old, new = (text.decode().splitlines() for text in (source, self.planted(source)))
        lines = list(difflib.unified_diff(old, new, lineterm="", n=0))[2:]
        return "\n".join(line for line in lines if not line.startswith("@@"))


@cache
def spans(path: str) -> tuple[tuple[int, int, str], ...]:
    """Return first line, last line and qualified name of every function, outer ones first.

    Parameters
    ----------
    path : of a Python file.
    """
    found: list[tuple[int, int, str]] = []

    def visit(node: ast.AST, names: tuple[str, ...]) -> None:
        for child in ast.iter_child_nodes(node):
            inner = names
            if isinstance(child, ast.FunctionDef | ast.ClassDef):
                inner = (*names, child.name)
            if isinstance(child, ast.FunctionDef):
                # The line of `def` runs when the file is imported, the body when it is called.
                found.append((child.body[0].lineno, child.end_lineno or 0, ".".join(inner)))
            visit(child, inner)

    visit(ast.parse(Path(path).read_text(encoding="utf-8")), ())
    return tuple(sorted(found, key=lambda span: (span[0], -span[1])))


def function_at(path: str, line: int) -> str:
    """Return the qualified name of the innermost function that a line is in.

    Parameters
    ----------
    path : of a Python file.
    line : counted from 1.
    """
    starts = spans(path)
    for first, last, name in reversed(starts[: bisect_right(starts, (line, 1 << 30, ""))]):
        if first <= line <= last:
            return name
    return TOP
