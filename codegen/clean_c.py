"""Scalars as plain C99 statements: real float or double, no library calls but exact ones.

Literals and functions go through macros of the prefix, `PREFIX_C(1.0)` and `PREFIX_SQRT(x)`, so
that one text serves both precisions. Every compound operand is in parentheses.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import casadi as ca

from codegen.elementary import atan, exp, sin, tanh
from codegen.graph import (
    BUILDERS,
    CONDITIONS,
    Graph,
    Node,
    UnknownOperationError,
    graph_of,
    rebuilt,
    simplifying,
)

# Finding again, in the scalars of a function, what a person would have written there.
#
# a·[c] + b·[not c] is a choice, and so is the derivative of fmax and fmin; the scalars of our own
# tanh, exp, atan and sin are one call each. Those of C libraries become calls of our own: they
# would differ from machine to machine.

REPLACED: Mapping[str, Callable[[Any], Any]] = {"tanh": tanh, "exp": exp, "atan": atan, "sin": sin}
EXPANDED = {**BUILDERS, **REPLACED}


def recognized(graph: Graph, *, whole: bool = True) -> Graph:
    """Return a graph with choices and our own functions as nodes.
    whole : False leaves our own functions as the scalars that they are made of.
    """
    result = rebuilt(
        graph, lambda new, _, node, __: new.add(_choice(new, node) or _slope(new, node) or node)
    )

    def replaced(new: Graph, place: int, node: Node, place_of: Mapping[int, int]) -> int:
        made = _by_sines(new, node)
        for name, template, leaf in _templates().get(result.nodes[place].op, ()):
            argument = _argument(result, place, template, leaf)
            if argument is not None:
                made = new.add(Node(name, (place_of[argument],)))
        return made

    return rebuilt(result, replaced) if whole else result


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
def _templates() -> Mapping[str, list[tuple[str, Graph, int]]]:
    """Return our own functions by their last operation: name, scalars, place of the argument.

    Each twice: simplified by CasADi, as where a person calls it, and as written, as in `tuned`.
    """
    found = dict[str, list[tuple[str, Graph, int]]]()
    for on in (True, False):
        with simplifying(on):
            for name, function_of in REPLACED.items():
                x = ca.SX.sym("x")
                function = ca.Function(name, [x], [function_of(x)])
                graph = recognized(graph_of(function), whole=False)
                leaf = next(i for i, node in enumerate(graph.nodes) if node.op == "input")
                last = graph.nodes[graph.outputs[0][0]].op
                found.setdefault(last, []).append((name, graph, leaf))
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


# The statements.

Place = Callable[[int, int], str]  # (port, entry by columns) -> C expression

_FLOAT_MIN, _FLOAT_MAX = 1.2e-38, 3.4e38  # normal numbers of float
LONGEST = 72  # characters of an expression that is not given a name
_ATOMIC = ("const", "input")  # they are read where they stand
TWICE = ("sq", "fmin", "fmax", "sign")  # they write an argument twice

BINARY: Mapping[str, str] = {
    "add": "+",
    "sub": "-",
    "mul": "*",
    "div": "/",
    "lt": "<",
    "le": "<=",
    "eq": "==",
    "ne": "!=",
    "and": "&&",
    "or": "||",
}
MACROS: Mapping[str, str] = {"sqrt": "SQRT", "fabs": "FABS", "floor": "FLOOR"}


def literal(value: float, prefix: str) -> str:
    """Return a number in C, which reads back as the same double; in float the nearest there is.
    value : finite.
    """
    size = abs(value)
    in_float = math.copysign(min(max(size, _FLOAT_MIN), _FLOAT_MAX), value) if size else 0.0
    if in_float != value:
        return f"{prefix.upper()}_PICK({_digits(in_float)}, {_digits(value)})"
    return f"{prefix.upper()}_C({_digits(value)})"


def _digits(value: float) -> str:
    text = repr(float(value))
    if "." in text:
        return text
    mantissa, _, exponent = text.partition("e")
    return f"{mantissa}.0e{exponent}" if exponent else f"{mantissa}.0"


class Statements:
    """Statements that compute the outputs of a graph.
    graph : the scalars; choices and our own functions are nodes.
    read : C expression of an entry of an input.   write : C lvalue of an entry of an output.
    sums : whether the sum of all that is written is returned, which is finite only where all is.
    """

    def __init__(
        self,
        graph: Graph,
        *,
        prefix: str,
        read: Place,
        write: Place,
        returns: bool = False,
        sums: bool = False,
    ) -> None:
        self.graph, self.prefix, self.read = graph, prefix, read
        self.uses = graph.uses()
        for place in graph.reached():
            if graph.nodes[place].op in TWICE:
                for argument in graph.nodes[place].args:
                    self.uses[argument] += 1
        results = [place for entries in graph.outputs for place in entries]
        self.results = {place for place in results if self.uses[place] == 1}  # named by their place
        self.text: dict[int, str] = {}
        self.lines: list[str] = []
        self.groups = _groups(graph)
        self.members = {place: group for group in self.groups for place in group}
        self.called: set[str] = set()
        self.names = 0
        if returns:
            self.lines.append(f"return {_bare(self._condition(graph.outputs[0][0]))};")
            return
        # Results that need least come first: few numbers wait for the others meanwhile.
        needed, outputs = graph.needed(), enumerate(graph.outputs)
        wanted = [(place, port, entry) for port, row in outputs for entry, place in enumerate(row)]
        for place, *at in sorted(wanted, key=lambda one: needed[one[0]]):
            self.lines.append(f"{write(*at)} = {_bare(self._real(place))};")
            if sums:
                self.lines.append(f"sum += {write(*at)};")
        if sums:
            self.lines.insert(0, f"{prefix}_real sum = {literal(0.0, prefix)};")
            self.lines.append("return sum;")

    def block(self, indent: int = 4) -> str:
        """Return the statements, one a line."""
        return "".join(f"{' ' * indent}{line}\n" for line in self.lines)

    def _real(self, place: int) -> str:
        """Return a node as a number."""
        text = self._expression(place)
        if self.graph.nodes[place].op in CONDITIONS:
            return f"({text} ? {literal(1.0, self.prefix)} : {literal(0.0, self.prefix)})"
        return text

    def _condition(self, place: int) -> str:
        """Return a node as a truth value."""
        text = self._expression(place)
        if self.graph.nodes[place].op in CONDITIONS:
            return text
        return f"({text} != {literal(0.0, self.prefix)})"

    def _expression(self, place: int) -> str:
        if place in self.text:
            return self.text[place]
        waiting = [place]  # not by recursion: graphs are deep
        while waiting:
            now = waiting[-1]
            if now in self.text:
                waiting.pop()
                continue
            missing = [a for a in self._needs(now) if a not in self.text]
            if missing:
                waiting += reversed(missing)
                continue
            self._name_or_inline(waiting.pop())
        return self.text[place]

    def _needs(self, place: int) -> Sequence[int]:
        if place in self.members:
            return [self.graph.nodes[p].args[0] for p in self.members[place]]
        return self.graph.nodes[place].args

    def _name_or_inline(self, place: int) -> None:
        node = self.graph.nodes[place]
        if place in self.members:
            self._call_group(self.members[place], node.op)
            return
        text = self._plain(node)
        long = len(text) > LONGEST and place not in self.results
        if node.op not in _ATOMIC and (self.uses[place] > 1 or long):
            kind = "bool" if node.op in CONDITIONS else f"{self.prefix}_real"
            name = self._new("c" if node.op in CONDITIONS else "t")
            self.lines.append(f"const {kind} {name} = {_bare(text)};")
            text = name
        self.text[place] = text

    def _new(self, letter: str) -> str:
        self.names += 1
        return f"{letter}{self.names}"

    def _call_group(self, group: Sequence[int], op: str) -> None:
        """Call one of our own functions on several numbers in one loop."""
        name, size = self._new("h"), len(group)
        self.called.add(op)
        self.lines.append(f"{self.prefix}_real {name}[{size}];")
        for i, place in enumerate(group):
            argument = self._real(self.graph.nodes[place].args[0])
            self.lines.append(f"{name}[{i}] = {_bare(argument)};")
        self.lines.append(f"{self.prefix}_{op}({name}, {size}U);")
        self.text.update({place: f"{name}[{i}]" for i, place in enumerate(group)})

    def _plain(self, node: Node) -> str:
        op, args = node.op, node.args
        if op == "const":
            return literal(node.value, self.prefix)
        if op == "input":
            return self.read(node.port, node.entry)
        if op in ("and", "or"):
            return f"({self._condition(args[0])} {BINARY[op]} {self._condition(args[1])})"
        if op in BINARY:
            return f"({self._real(args[0])} {BINARY[op]} {self._real(args[1])})"
        if op in MACROS:
            return f"{self.prefix.upper()}_{MACROS[op]}({_bare(self._real(args[0]))})"
        rules = {
            "not": lambda: f"(!{self._condition(args[0])})",
            "neg": lambda: f"(-{self._real(args[0])})",
            "inv": lambda: f"({literal(1.0, self.prefix)} / {self._real(args[0])})",
            "sq": lambda: f"({self._real(args[0])} * {self._real(args[0])})",
            "twice": lambda: f"({literal(2.0, self.prefix)} * {self._real(args[0])})",
            "sign": lambda: self._sign(args[0]),
            "fmin": lambda: self._smaller("<", *args),
            "fmax": lambda: self._smaller(">", *args),
            "select": lambda: self._choice(args[0], args[1], self._short(args[2])),
            "if_else_zero": lambda: self._choice(args[0], args[1], literal(0.0, self.prefix)),
        }
        if op not in rules:
            raise UnknownOperationError(f"{self.prefix}: there is no plain C for {op}")
        return rules[op]()

    def _choice(self, condition: int, chosen: int, other: str) -> str:
        return f"({self._condition(condition)} ? {self._short(chosen)} : {other})"

    def _short(self, place: int) -> str:
        """Return a node as a number of one word: in a choice no operator stands beside another."""
        text = self._real(place)
        if " " not in text:
            return text
        name = self._new("t")
        self.lines.append(f"const {self.prefix}_real {name} = {_bare(text)};")
        if self.graph.nodes[place].op not in CONDITIONS:
            self.text[place] = name
        return name

    def _smaller(self, sign: str, a: int, b: int) -> str:
        """Return fmin or fmax; NaN in a gives b, as in C, NaN in b gives b."""
        one, other = self._real(a), self._real(b)
        return f"(({one} {sign} {other}) ? {one} : {other})"

    def _sign(self, a: int) -> str:
        """Return -1 or 1, and 0 and NaN as they are."""
        text, zero, one = self._short(a), *(literal(x, self.prefix) for x in (0.0, 1.0))
        positive = f"(({zero} < {text}) ? {one} : {text})"
        return f"(({text} < {zero}) ? (-{one}) : {positive})"


def _bare(text: str) -> str:
    """Return an expression without its outer parentheses, if they belong together."""
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = 0
    for character in text[:-1]:
        depth += (character == "(") - (character == ")")
        if depth == 0:
            return text
    return text[1:-1]


def _groups(graph: Graph) -> list[list[int]]:
    """Return calls of our own functions that do not need one another, those of a layer together."""
    level: dict[int, int] = {}
    found: dict[tuple[str, int], list[int]] = {}
    for place in graph.reached():
        node = graph.nodes[place]
        level[place] = max((level[a] for a in node.args), default=0)
        if node.op in REPLACED:
            level[place] += 1
            found.setdefault((node.op, level[place]), []).append(place)
    return list(found.values())
