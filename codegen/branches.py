"""Two functions for one that decides: where a condition holds, and where it does not."""

from codegen.graph import Graph, Node

CONDITIONS = ("lt", "le", "eq", "ne", "and", "or", "not")


def decision(graph: Graph, ports: set[int]) -> int | None:
    """Return the condition on some inputs alone that most choices depend on, or None.

    Parameters
    ----------
    graph : the scalars.
    ports : numbers of the inputs that the condition may read.
    """
    own: set[int] = set()
    count: dict[int, int] = {}
    for place in graph.reached():
        node = graph.nodes[place]
        if node.op == "const" or (
            all(a in own for a in node.args) if node.args else node.port in ports
        ):
            own.add(place)
        if node.op in ("select", "if_else_zero") and node.args[0] in own:
            condition = graph.nodes[node.args[0]]
            if condition.op in CONDITIONS and condition.op != "not" and node.args[0] in own:
                count[node.args[0]] = count.get(node.args[0], 0) + 1
    return max(count, key=lambda place: (count[place], -place)) if count else None


def assumed(graph: Graph, condition: int, holds: bool) -> Graph:
    """Return the graph where a condition is known; its choices are taken when it is simplified.

    Parameters
    ----------
    graph : the scalars.
    condition : place of the condition.
    holds : whether it holds.
    """
    known = {condition: holds}
    waiting = [condition]
    while waiting:  # a and b holds: so do a and b
        node = graph.nodes[waiting.pop()]
        if node.op == "and" and holds:
            known |= dict.fromkeys(node.args, True)
            waiting += node.args
    at_least = {graph.nodes[p].args for p, value in known.items() if value and _is_le(graph, p)}
    result, place_of = Graph(), dict[int, int]()
    for place, node in enumerate(graph.nodes):
        if place in known:
            place_of[place] = result.constant(float(known[place]))
        elif node.op == "fmax" and (node.args in at_least or node.args[::-1] in at_least):
            larger = node.args[1] if node.args in at_least else node.args[0]
            place_of[place] = place_of[larger]
        else:
            moved = Node(
                node.op, tuple(place_of[a] for a in node.args), node.value, node.port, node.entry
            )
            place_of[place] = result.add(moved)
    result.outputs = [[place_of[p] for p in entries] for entries in graph.outputs]
    return result


def _is_le(graph: Graph, place: int) -> bool:
    return graph.nodes[place].op == "le"
