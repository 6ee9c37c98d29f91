"""Sources of the project as trees: several tests walk all of them."""

import ast
from functools import cache


@cache
def tree_of(source):
    """The tree of a source, parsed once in a process."""
    return ast.parse(source)


@cache
def nodes_of(source):
    """All nodes of it, in the order of `ast.walk`."""
    return tuple(ast.walk(tree_of(source)))
