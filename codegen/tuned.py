"""A function with fewer operations: decided once where it can be, constants gathered."""

from functools import lru_cache
from typing import NamedTuple

import casadi as ca

from codegen.clean_c import EXPANDED, recognized
from codegen.graph import Graph, assumed, decision, function_of, graph_of, simplifying
from codegen.simplify import simplified

_WORTHWHILE = 0.5  # share of nodes that the smaller part may have, else nothing is decided
KEPT = 16  # functions whose forms are kept: who exports again often asks for the same ones


class Tuned(NamedTuple):
    """A function in the form in which it is exported; all have the ports of the original.
    function : everything; it equals the original up to rounding, and the C to the last bit.
    condition : 1 where `where_true` holds, else 0; it reads the sampled ports only.
    where_true, where_false : what `function` returns in either case; the second is None where
        there is nothing to decide.
    """

    function: ca.Function
    condition: ca.Function
    where_true: ca.Function
    where_false: ca.Function | None


def tuned(function: ca.Function, *, sampled: tuple[str, ...]) -> Tuned:
    """Return a function with our own tanh, exp and atan and without needless operations.
    sampled : inputs that may decide which part of the function is computed.
    """
    return _tuned(function.serialize(), sampled)


@lru_cache(KEPT)
@simplifying(False)
def _tuned(serialized: str, sampled: tuple[str, ...]) -> Tuned:
    function = ca.Function.deserialize(serialized)
    graph = recognized(graph_of(function))
    names = function.name_in()
    place = decision(graph, {names.index(port) for port in sampled})
    true, false = (
        simplified(graph if place is None else assumed(graph, place, holds))
        for holds in (True, False)
    )
    if len(false.reached()) > _WORTHWHILE * len(true.reached()):
        place, true = None, simplified(graph)
        false = true
    where_true, where_false = (function_of(part, function, EXPANDED) for part in (true, false))
    condition = _condition(graph, graph.constant(1.0) if place is None else place, function)
    ports = [ca.SX.sym(port, *function.size_in(port)) for port in names]
    holds, results = condition(*ports), where_true.call(ports)
    if place is not None:
        others = where_false.call(ports)
        results = [ca.if_else(holds, a, b) for a, b in zip(results, others, strict=True)]
    whole = ca.Function(function.name(), ports, results, names, function.name_out())
    return Tuned(whole, condition, where_true, where_false if place is not None else None)


def _condition(graph: Graph, place: int, function: ca.Function) -> ca.Function:
    single = Graph()
    single.nodes, single.outputs = graph.nodes, [[place]]
    ports = [ca.SX.sym(port, *function.size_in(port)) for port in function.name_in()]
    like = ca.Function(function.name(), ports, [ca.SX(0)], function.name_in(), ["holds"])
    return function_of(single, like, EXPANDED)
