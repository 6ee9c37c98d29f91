"""Finding again, in the scalars of a function, what a person would have written there.

a·[c] + b·[not c] is a choice, and so is the derivative of fmax and fmin; the scalars of our own
tanh, exp, atan and sin are one call each. Those of C libraries become calls of our own: they would
differ from machine to machine.
"""

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import casadi as ca

from codegen.elementary import atan, exp, sin
from codegen.graph import BUILDERS, Graph, Node, graph_of, simplifying
from codegen.tanh import tanh

OWN: Mapping[str, Callable[[Any], Any]] = {"tanh": tanh, "exp": exp, "atan": atan, "sin": sin}
EXPANDED = {**BUILDERS, **OWN}


def recognized(graph: Graph, *, whole: bool = True) -> Graph:
    """Return a graph with choices and our own functions as nodes.

    Parameters
    ----------
    graph : of single operations.
    whole : False leaves our own functions as the scalars that they are made of.
    """
    if not whole:
        return _with_choices(graph)
    result, found = _with_choices(graph), Graph()
    place_of: dict[int, int] = {}
    for place, node in enumerate(result.nodes):
        place_of[place] = _by_sines(found, _mapped(node, place_of))
        for name, template, leaf in _templates():
            argument = _argument(result, place, template, leaf)
            if argument is not None:
                place_of[place] = found.add(Node(name, (place_of[argument],)))
    found.outputs = [[place_of[p] for p in entries] for entries in result.outputs]
    return found


def _mapped(node: Node, place_of: Mapping[int, int]) -> Node:
    return node._replace(args=tuple(place_of[a] for a in node.args))


def _with_choices(graph: Graph) -> Graph:
    result, place_of = Graph(), dict[int, int]()
    for place, node in enumerate(graph.nodes):
        moved = _mapped(node, place_of)
        place_of[place] = result.add(_choice(result, moved) or _slope(result, moved) or moved)
    result.outputs = [[place_of[p] for p in entries] for entries in graph.outputs]
    return result


def _choice(graph: Graph, node: Node) -> Node | None:
    """Return [c] a + [not c] b as one choice."""
    if node.op != "add":
        return None
    one, other = (graph.nodes[a] for a in node.args)
    if one.op == other.op == "if_else_zero":
        for first, second in ((one, other), (other, one)):
            negated = graph.nodes[second.args[0]]
            if negated.op == "not" and negated.args[0] == first.args[0]:
                return Node("select", (first.args[0], first.args[1], second.args[1]))
    return None


def _slope(graph: Graph, node: Node) -> Node | None:
    """Return CasADi's derivative of fmax or fmin, [a <= b]/([a <= b] + [b <= a]), as choices.

    Half where a is b, and zero in place of 0/0 where one is NaN.
    """
    if node.op != "div":
        return None
    holds, both = (graph.nodes[a] for a in node.args)
    if holds.op != "le" or both.op != "add" or node.args[0] not in both.args:
        return None
    other = both.args[1] if both.args[0] == node.args[0] else both.args[0]
    if graph.nodes[other] != Node("le", holds.args[::-1]):
        return None
    half, one = graph.constant(0.5), graph.constant(1.0)
    slope = graph.add(Node("select", (other, half, one)))
    return Node("select", (node.args[0], slope, graph.constant(0.0)))


def _by_sines(graph: Graph, node: Node) -> int:
    """Add a node, cos x as sin(x + π/2) and tan x as their quotient; return its place."""
    if node.op not in ("cos", "tan"):
        return graph.add(node)
    ahead = graph.add(Node("add", (*node.args, graph.constant(0.5 * math.pi))))
    cosine = graph.add(Node("sin", (ahead,)))
    if node.op == "cos":
        return cosine
    return graph.add(Node("div", (graph.add(Node("sin", node.args)), cosine)))


@cache
def _templates() -> list[tuple[str, Graph, int]]:
    """Return our own functions: name, scalars, place of the argument.

    Each twice: simplified by CasADi, as where a person calls it, and as written, as in `tuned`.
    """
    found = []
    for on in (True, False):
        with simplifying(on):
            for name, own in OWN.items():
                x = ca.SX.sym("x")
                graph = _with_choices(graph_of(ca.Function(name, [x], [own(x)])))
                leaf = next(i for i, node in enumerate(graph.nodes) if node.op == "input")
                found.append((name, graph, leaf))
    return found


def _argument(graph: Graph, place: int, template: Graph, leaf: int) -> int | None:
    """Return what the function is called with where this place is its result, else None."""
    bound: dict[int, int] = {}

    def fits(there: int, here: int) -> bool:
        if here in bound or here == leaf:
            return bound.setdefault(here, there) == there
        wanted, node = template.nodes[here], graph.nodes[there]
        if (wanted.op, wanted.value, len(wanted.args)) != (node.op, node.value, len(node.args)):
            return False
        bound[here] = there
        return all(map(fits, node.args, wanted.args))

    return bound[leaf] if fits(place, template.outputs[0][0]) else None
