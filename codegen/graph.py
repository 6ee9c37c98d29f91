"""The scalars of an SX function as a graph in which equal expressions are one node."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from codegen.errors import TireidError

OPERATIONS: Mapping[int, str] = {
    getattr(ca, name): name[3:].lower() for name in dir(ca) if name.startswith("OP_")
}


def _as_casadi(number: int) -> Callable[..., Any]:
    def build(*arguments: Any) -> Any:  # in a seventh of the time of a + b
        make = ca.SX.unary if len(arguments) == 1 else ca.SX.binary
        return make(number, *arguments)

    return build


# Of every operation that CasADi has, and of ours.
BUILDERS: Mapping[str, Callable[..., Any]] = {
    **{name: _as_casadi(number) for number, name in OPERATIONS.items()},
    "select": ca.if_else,
    "if_else_zero": lambda c, a: ca.if_else(c, a, 0),  # no product is drawn into it
}


class UnknownOperationError(TireidError, ValueError):
    """A function holds an operation that has no plain C of its own."""


class Node(NamedTuple):
    """An operation on earlier nodes; or a constant; or an entry, by columns, of an input."""

    op: str
    args: tuple[int, ...] = ()
    value: float = 0.0
    port: int = -1
    entry: int = -1


class Graph:
    """Nodes, each after those that it reads, and which node every entry of every output is."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.outputs: list[list[int]] = []
        self._known: dict[Node, int] = {}

    def add(self, node: Node) -> int:
        """Return the place of a node, which is added unless it is there.
        node : its `args` are places in this graph.
        """
        place = self._known.setdefault(node, len(self.nodes))
        if place == len(self.nodes):
            self.nodes.append(node)
        return place

    def constant(self, value: float) -> int:
        """Return the place of a number."""
        return self.add(Node("const", value=value + 0.0))  # -0 becomes 0

    def reached(self) -> list[int]:
        """Return the places that outputs depend on, rising."""
        needed = {place for entries in self.outputs for place in entries}
        for place in range(len(self.nodes) - 1, -1, -1):
            if place in needed:
                needed.update(self.nodes[place].args)
        return sorted(needed)

    def needed(self) -> dict[int, int]:
        """Return how many operations each entry of an output takes, by its place."""
        uses, found = self.uses(), dict[int, int]()
        ends = {place for entries in self.outputs for place in entries}
        cones: dict[int, int] = {}  # of each place a bit for each place that it needs
        for place, node in enumerate(self.nodes):
            if place not in uses:
                continue
            cone = 1 << place if node.args else 0
            for argument in node.args:
                cone |= cones[argument]
                uses[argument] -= 1
                if uses[argument] == 0:
                    del cones[argument]
            cones[place] = cone
            if place in ends:
                found[place] = cone.bit_count()
        return found

    def uses(self) -> dict[int, int]:
        """Return how often each place that outputs depend on is read."""
        reached = self.reached()
        count = dict.fromkeys(reached, 0)
        for place in reached:
            for argument in self.nodes[place].args:
                count[argument] += 1
        for entries in self.outputs:
            for place in entries:
                count[place] += 1
        return count


def graph_of(function: ca.Function) -> Graph:
    """Return the graph of an SX function with dense outputs."""
    graph, work = Graph(), dict[int, int]()
    graph.outputs = [[-1] * function.numel_out(i) for i in range(function.n_out())]
    for k in range(function.n_instructions()):
        op = OPERATIONS[function.instruction_id(k)]
        read, written = function.instruction_input(k), function.instruction_output(k)
        if op == "output":
            graph.outputs[written[0]][written[1]] = work[read[0]]
        elif op == "const":
            work[written[0]] = graph.constant(function.instruction_constant(k))
        elif op == "input":
            work[written[0]] = graph.add(Node("input", port=read[0], entry=read[1]))
        else:
            work[written[0]] = graph.add(_canonical(graph, op, tuple(work[i] for i in read)))
    return graph


def rebuilt(graph: Graph, change: Callable[["Graph", int, Node, Mapping[int, int]], int]) -> Graph:
    """Return a graph with some nodes changed.
    change : of the new graph, a place in the old one, its node with arguments in the new one, and
        new places by old ones; returns the new place.
    """
    result, place_of = Graph(), dict[int, int]()
    for place, node in enumerate(graph.nodes):
        args = tuple([place_of[a] for a in node.args])
        place_of[place] = change(result, place, node._replace(args=args), place_of)
    result.outputs = [[place_of[p] for p in entries] for entries in graph.outputs]
    return result


def _canonical(graph: Graph, op: str, args: tuple[int, ...]) -> Node:
    """Return the one form of operations that CasADi writes in two."""
    if op == "mul" and args[0] == args[1]:
        return Node("sq", args[:1])
    if op == "div" and graph.nodes[args[0]] == Node("const", value=1.0):
        return Node("inv", args[1:])
    return Node(op, args)


@contextmanager
def simplifying(on: bool) -> Iterator[None]:
    """Build SX expressions with or without CasADi's own simplifications, such as c/x for c (1/x).
    on : whether CasADi simplifies.
    """
    before = ca.GlobalOptions.getSimplificationOnTheFly()
    ca.GlobalOptions.setSimplificationOnTheFly(on)
    try:
        yield
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(before)


@simplifying(False)
def function_of(
    graph: Graph, like: ca.Function, builders: Mapping[str, Callable[..., Any]] = BUILDERS
) -> ca.Function:
    """Return an SX function of a graph."""
    ports = [ca.SX.sym(name, *like.size_in(name)) for name in like.name_in()]
    entries = [ca.vertsplit(ca.vec(port)) if port.numel() else [] for port in ports]
    made: dict[int, Any] = {}
    for place in graph.reached():
        node = graph.nodes[place]
        if node.op == "const":
            made[place] = ca.SX(node.value)
        elif node.op == "input":
            made[place] = entries[node.port][node.entry]
        else:
            made[place] = builders[node.op](*(made[a] for a in node.args))
    results = [
        ca.reshape(ca.vertcat(*(made[p] for p in places)), *like.size_out(i))
        for i, places in enumerate(graph.outputs)
    ]
    return ca.Function(like.name(), ports, results, like.name_in(), like.name_out())


# Two functions for one that decides: where a condition holds, and where it does not.

CONDITIONS = ("lt", "le", "eq", "ne", "and", "or", "not")


def decision(graph: Graph, ports: set[int]) -> int | None:
    """Return the condition on some inputs alone that most choices depend on, or None."""
    of_ports: set[int] = set()
    count: dict[int, int] = {}
    for place in graph.reached():
        node = graph.nodes[place]
        if node.op == "const" or (
            all(a in of_ports for a in node.args) if node.args else node.port in ports
        ):
            of_ports.add(place)
        if node.op in ("select", "if_else_zero") and node.args[0] in of_ports:
            condition = node.args[0]
            if graph.nodes[condition].op in CONDITIONS[:-1]:
                count[condition] = count.get(condition, 0) + 1
    return max(count, key=lambda place: (count[place], -place)) if count else None


def assumed(graph: Graph, condition: int, holds: bool) -> Graph:
    """Return the graph where a condition is known; its choices are taken when it is simplified.
    holds : whether it holds.
    """
    known = {condition: holds}
    waiting = [condition]
    while waiting:  # a and b holds: so do a and b
        node = graph.nodes[waiting.pop()]
        if node.op == "and" and holds:
            known |= dict.fromkeys(node.args, True)
            waiting += node.args

    def change(result: Graph, place: int, node: Node, _: Mapping[int, int]) -> int:
        return result.constant(float(known[place])) if place in known else result.add(node)

    return rebuilt(graph, change)


# A function whose numbers are an input: one library for all cars that are built alike.


@simplifying(False)
def lifted(function: ca.Function) -> tuple[ca.Function, Array]:
    """Return a function that is given its constants, and the constants.

    It computes the same bits, operation by operation; functions that differ in their constants
    alone become the same function.
    The input `constants` (n,) is added as the last; in their order in `function`.
    """
    graph, n_in = graph_of(function), function.n_in()
    constants = [place for place in graph.reached() if graph.nodes[place].op == "const"]
    values = np.array([graph.nodes[place].value for place in constants])
    for entry, place in enumerate(constants):
        graph.nodes[place] = Node("input", port=n_in, entry=entry)
    names = [*function.name_in(), "constants"]
    ports = [ca.SX.sym(name, *function.size_in(name)) for name in function.name_in()]
    results = [ca.SX(*function.size_out(i)) for i in range(function.n_out())]
    ports.append(ca.SX.sym("constants", values.size))
    like = ca.Function(function.name(), ports, results, names, function.name_out())
    return function_of(graph, like), values
