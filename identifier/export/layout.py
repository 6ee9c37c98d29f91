"""How the ports of a step lie in the structures of the exported C."""

from collections.abc import Sequence
from math import isqrt
from typing import NamedTuple

from codegen.arrays import Array
from codegen.clean_c import literal
from identifier.export.specialize import SAMPLED, Signal, SpecializedStep
from identifier.setup import COVARIANCE, FACTORS, NOT_NEGATIVE

READS = {"x": ("v_y", "r"), "u": ("delta_f", "delta_r"), "v_x": ("v_x",), "a_y": ("a_y",)}


class Member(NamedTuple):
    """A member of a structure: what it is, its matrix shape, whether it is among the weights."""

    signal: Signal
    shape: tuple[int, int]
    learnt: bool

    @property
    def dimensions(self) -> tuple[int, ...]:
        """Sizes of the C array: none for a scalar, one for a row or column."""
        return tuple(size for size in self.shape if size > 1)

    @property
    def size(self) -> int:
        return self.shape[0] * self.shape[1]

    @property
    def path(self) -> str:
        """Place in the structure of carried values."""
        return f"{'weights' if self.learnt else 'signals'}.{self.signal.name}"

    def declaration(self, real: str) -> str:
        sizes = "".join(f"[{size}]" for size in self.dimensions)
        unit, description = self.signal.unit, self.signal.description
        code, words = f"    {real} {self.signal.name}{sizes};", f"/* {description} [{unit}] */"
        line = f"{code} {words}\n"
        return line if len(line) <= 100 else f"    {words}\n{code}\n"

    def element(self, entry: int) -> str:
        row, column = entry % self.shape[0], entry // self.shape[0]
        pair = zip((row, column), self.shape, strict=True)
        return "".join(f"[{index}]" for index, size in pair if size > 1)


def carried_members(specialized: SpecializedStep) -> list[Member]:
    return [
        Member(signal, specialized.function.size_in(signal.name), signal.name in specialized.learnt)
        for signal in specialized.state
    ]


def output_members(specialized: SpecializedStep) -> list[Member]:
    return [
        Member(signal, specialized.function.size_out(signal.name), False)
        for signal in specialized.outputs
    ]


def read_expression(specialized: SpecializedStep, port: int, entry: int) -> str:
    name = specialized.function.name_in(port)
    if name in SAMPLED:
        return f"in->{READS[name][entry]}"
    member = carried_members(specialized)[port]
    part = "known" if member.learnt else "now"
    return f"{part}->{member.signal.name}{member.element(entry)}"


def write_expression(specialized: SpecializedStep, port: int, entry: int) -> str:
    state = carried_members(specialized)
    if port < len(state):
        part = "learnt" if state[port].learnt else "next"
        return f"{part}->{state[port].signal.name}{state[port].element(entry)}"
    given = output_members(specialized)[port - len(state)]
    return f"out->{given.signal.name}{given.element(entry)}"


def initializer(value: Array, dimensions: tuple[int, ...], prefix: str) -> str:
    """Return a nested initializer by rows.   value : the numbers (of any shape)."""
    if not dimensions:
        return literal(float(value.ravel()[0]), prefix)
    rows = iter(value.reshape(dimensions[0], -1))
    return "{ " + ", ".join(initializer(row, dimensions[1:], prefix) for row in rows) + " }"


# What weights must be to be taken over, in C: covariances and amounts that are not negative.

# What a variance may miss to zero by rounding, as a share of its own: float keeps seven digits, and
# both precisions accept what they have learnt themselves.
SLACK = 1e-3


class Rule(NamedTuple):
    """A row of the table of rules: its kind in C, first number of the weights, rows of a matrix."""

    kind: str
    first: int
    order: int


def rules(members: Sequence[Member]) -> list[Rule]:
    """Return what numbers of the weights must keep to be taken over.
    members : of the weights, in the order in which they lie in memory.
    """
    found, first = list[Rule](), 0
    for member in members:
        found += _rules_of(member, first)
        first += member.size
    return found


def ranges(specialized: SpecializedStep) -> tuple[list[str], list[float]]:
    """Return the rows of the table of ranges in C, and the shares that they point into."""
    prefix, first, at, shares = specialized.name, 0, dict[str, int](), list[float]()
    for member in carried_members(specialized):
        at[member.signal.name], first = first, first + member.size * member.learnt
    starts = dict[tuple[float, ...], int]()
    for one in specialized.ranges:
        if one.shares not in starts:
            starts[one.shares] = len(shares)
            shares += one.shares
    return [
        f"{{ {literal(one.low, prefix)}, {literal(one.high, prefix)}, "
        f"{at[one.port] + one.first}U, {len(one.shares)}U, {starts[one.shares]}U }}"
        for one in specialized.ranges
    ], shares


def covariance_order(members: Sequence[Member]) -> int:
    """Return the rows of the covariances among weights, 0 where there is none."""
    orders = {rule.order for rule in rules(members) if rule.kind in ("MATRIX", "TRIANGLE")}
    if len(orders) > 1:
        raise ValueError(f"covariances among weights must have one size, they have {orders}")
    return max(orders, default=0)


def _rules_of(member: Member, first: int) -> list[Rule]:
    rows, columns = member.shape
    starts = [first + row * columns for row in range(rows)]
    match member.signal.rule:
        case "":
            return []
        case rule if rule == NOT_NEGATIVE:
            return [Rule("NOT_NEGATIVE", first, member.size)]
        case rule if rule == FACTORS:
            return [Rule("FACTORS", start, _order(columns)) for start in starts]
        case rule if rule == COVARIANCE and rows == columns:
            return [Rule("MATRIX", first, rows)]
        case rule if rule == COVARIANCE:
            return [Rule("TRIANGLE", start, _order(columns)) for start in starts]
        case unknown:
            raise ValueError(f"there is no C for the rule {unknown!r}")


def _order(size: int) -> int:
    """Return the rows of a matrix whose upper triangle has so many numbers."""
    return (isqrt(8 * size + 1) - 1) // 2
