"""Fewer operations for the same scalars: constants are gathered, shared factors are kept shared.

Sums are linear forms Σ c_k n_k of other nodes, so that constants meet: h (-η g σ - ρ e W) + W
becomes (1 - ρ h e) W - (h η g) σ, where (1 - ρ h e) and h η g serve many entries. A form reaches
through another sum where that makes it no longer. Results differ from those before by rounding.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping

from codegen.graph import Graph, Node

Form = dict[int, float]  # place: coefficient

_CANCELLED = 1e-14  # relative size of a coefficient that is rounding only


def simplified(graph: Graph) -> Graph:
    """Return a graph with the same outputs up to rounding, in fewer operations."""
    return _Simplifier(graph).run()


class _Simplifier:
    def __init__(self, graph: Graph) -> None:
        self.source, self.result = graph, Graph()
        self.source_uses = graph.uses()
        self.uses: Counter[int] = Counter()  # of places of the result, by source
        self.one = self.result.constant(1.0)
        self.form_of: dict[int, Form] = {}  # of places of the source
        self.place_of: dict[int, int] = {}  # of places of the source that had to be made
        self.shared_form: dict[int, Form] = {}  # of places of the result that are sums
        self.rules: Mapping[str, Callable[..., Form]] = {
            "add": lambda a, b: self._sum(a, 1.0, b),
            "sub": lambda a, b: self._sum(a, -1.0, b),
            "neg": lambda a: self._scaled(self._open(a), -1.0),
            "twice": lambda a: self._scaled(self._open(a), 2.0),
            "mul": self._product,
            "div": self._quotient,
            "inv": lambda a: self._quotient(None, a),
            "sq": self._square,
        }

    def run(self) -> Graph:
        for place in self.source.reached():
            node = self.source.nodes[place]
            if node.op == "const":
                self.form_of[place] = {self.one: node.value} if node.value else {}
            elif node.op == "input":
                self.form_of[place] = {self.result.add(node): 1.0}
            elif node.op in self.rules:
                self.form_of[place] = self.rules[node.op](*node.args)
            else:
                self.form_of[place] = self._other(node)
            if self.source_uses[place] > 1:
                self._make(place)
        self.result.outputs = [[self._make(p) for p in entries] for entries in self.source.outputs]
        return self.result

    # what a reader of a node sees

    def _open(self, place: int) -> Form:
        """Return the linear form of a node; a node that others read too is one term."""
        if place in self.place_of:
            made = self.place_of[place]
            value = self._constant(made)
            return {made: 1.0} if value is None else ({self.one: value} if value else {})
        return self.form_of[place]

    def _make(self, place: int) -> int:
        """Return the place in the result of a node of the source."""
        if place not in self.place_of:
            form = self.form_of[place]
            made = self._materialized(form)
            self.uses[made] += self.source_uses[place]
            self.place_of[place] = made
            if len(form) > 1:
                self.shared_form.setdefault(made, form)
        return self.place_of[place]

    def _constant(self, made: int) -> float | None:
        node = self.result.nodes[made]
        return node.value if node.op == "const" else None

    # rules

    @staticmethod
    def _scaled(form: Form, factor: float) -> Form:
        return {place: factor * c for place, c in form.items()}

    def _sum(self, a: int, sign: float, b: int) -> Form:
        plain = _merged(self._open(a), self._scaled(self._open(b), sign))
        through = self._through(plain)
        return through if len(through) <= len(plain) else plain

    def _through(self, form: Form) -> Form:
        """Return a form with shared sums replaced by their own forms."""
        total: Form = {}
        for place, c in form.items():
            _add(total, self._scaled(self.shared_form.get(place, {place: 1.0}), c))
        return total

    def _number(self, place: int) -> float | None:
        """Return the value of a node that is a constant, else None."""
        form = self._open(place)
        return form.get(self.one, 0.0) if set(form) <= {self.one} else None

    def _factor(self, place: int) -> tuple[float, int]:
        """Return a node as coefficient times place."""
        form = self._open(place)
        if len(form) == 1:
            ((made, c),) = form.items()
            return c, made
        return 1.0, self._make(place)

    def _product(self, a: int, b: int) -> Form:
        for scalar, other in ((a, b), (b, a)):
            value = self._number(scalar)
            if value is not None:
                return self._scaled(self._open(other), value) if value else {}
        (c, x), (d, y) = self._factor(a), self._factor(b)
        return {self.result.add(Node("mul", (x, y))): c * d}

    def _quotient(self, a: int | None, b: int) -> Form:
        divisor = self._number(b)
        if divisor:
            return self._scaled({self.one: 1.0} if a is None else self._open(a), 1.0 / divisor)
        d, y = self._factor(b) if divisor is None else (1.0, self.result.constant(0.0))
        value = 1.0 if a is None else self._number(a)
        if value is not None:
            return {self.result.add(Node("inv", (y,))): value / d} if value else {}
        assert a is not None
        c, x = self._factor(a)
        if self.uses[y] > 1 or self.result.nodes[y].op == "input":
            inverse = self.result.add(Node("inv", (y,)))
            return {self.result.add(Node("mul", (x, inverse))): c / d}
        return {self.result.add(Node("div", (x, y))): c / d}

    def _square(self, a: int) -> Form:
        value = self._number(a)
        if value is not None:
            return {self.one: value**2} if value else {}
        c, x = self._factor(a)
        return {self.result.add(Node("sq", (x,))): c * c}

    def _other(self, node: Node) -> Form:
        if node.op in ("if_else_zero", "select"):
            condition = self._number(node.args[0])
            if condition is not None:
                chosen = node.args[1:2] if condition else node.args[2:]
                return self._open(chosen[0]) if chosen else {}
        args = tuple(self._make(a) for a in node.args)
        values = [self._constant(a) for a in args]
        if node.op == "and" and 1.0 in values:
            return {args[1 - values.index(1.0)]: 1.0}
        return {self.result.add(Node(node.op, args)): 1.0}

    # a form as operations

    def _materialized(self, form: Form) -> int:
        form = dict(form)
        if not form:
            return self.result.constant(0.0)
        while (factor := self._common_factor(form)) is not None:
            rest: Form = {}
            for place in list(form):
                if place == factor:
                    rest = _merged(rest, {self.one: form.pop(place)})
                elif factor in self._factors(place):
                    pair = self._factors(place)
                    other = pair[1] if pair[0] == factor else pair[0]
                    rest = _merged(rest, {other: form.pop(place)})
            product = self.result.add(Node("mul", (self._materialized(rest), factor)))
            form = _merged({product: 1.0}, form)
        terms = sorted(form.items(), key=lambda term: term[1] < 0.0 or term[0] == self.one)
        (place, c), *others = terms
        total = self._term(place, c)
        for place, c in others:
            op = "add" if c > 0.0 else "sub"
            total = self.result.add(Node(op, (total, self._term(place, abs(c)))))
        return total

    def _term(self, place: int, c: float) -> int:
        """Return c times a node; in a product the factor that others read takes the constant."""
        if place == self.one:
            return self.result.constant(c)
        if c == 1.0:
            return place
        node = self.result.nodes[place]
        if node.op == "mul" and (value := self._constant(node.args[0])) is not None:
            return self._term(node.args[1], c * value)  # two constants are one
        if c == -1.0:
            return self.result.add(Node("neg", (place,)))
        factors = self._factors(place)
        if factors:
            busy, other = sorted(factors, key=lambda p: self.uses[p], reverse=True)
            if self.uses[busy] > 1:
                made = self._term(busy, c)
                self.uses[made] += 1
                return self.result.add(Node("mul", (made, other)))
        return self.result.add(Node("mul", (self.result.constant(c), place)))

    def _factors(self, place: int) -> tuple[int, ...]:
        node = self.result.nodes[place]
        if node.op != "mul" or self._constant(node.args[0]) is not None:
            return ()
        return node.args

    def _common_factor(self, form: Form) -> int | None:
        """Return a factor of at least two terms, the one with most; of equals the first."""
        count: Counter[int] = Counter()
        for place in form:
            count.update({place, *self._factors(place)} - {self.one})
        often = [place for place, n in count.items() if n > 1]
        return min(often, key=lambda place: (-count[place], place), default=None)


def _merged(one: Form, other: Form) -> Form:
    """Return the sum of two forms, without what cancels."""
    total = dict(one)
    _add(total, other)
    return total


def _add(total: Form, other: Form) -> None:
    """Add a form to another one in its place, which only who made it knows."""
    for place, c in other.items():
        if place not in total:
            if c:
                total[place] = c
            continue
        before = total[place]
        value = before + c
        if abs(value) <= _CANCELLED * (abs(before) + abs(c)):
            del total[place]
            continue
        near = float(round(value)) if math.isfinite(value) else value
        if near != value and abs(value - near) <= _CANCELLED * abs(near):
            value = near  # 0.9999999999999999 is 1
        total[place] = value
