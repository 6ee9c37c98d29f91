"""How the ports of a step lie in the structures of the exported C."""

from collections.abc import Iterator, Sequence
from math import isqrt
from typing import NamedTuple

from codegen.arrays import Array
from codegen.clean_c import literal
from identifier.export.specialize import SAMPLED, Signal, SpecializedStep
from identifier.method import COVARIANCE, FACTORS, NOT_NEGATIVE

FEW = 8  # entries that are summed one by one
READS = {"x": ("v_y", "r"), "u": ("delta_f", "delta_r"), "v_x": ("v_x",)}


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
    def path(self) -> str:
        """Place in the structure of carried values."""
        return f"weights.{self.signal.name}" if self.learnt else self.signal.name

    def declaration(self, real: str) -> str:
        """Return what declares it, with a comment.

        Parameters
        ----------
        real : type of a number.
        """
        sizes = "".join(f"[{size}]" for size in self.dimensions)
        unit, description = self.signal.unit, self.signal.description
        code, words = f"    {real} {self.signal.name}{sizes};", f"/* {description} [{unit}] */"
        line = f"{code} {words}\n"
        return line if len(line) <= 100 else f"    {words}\n{code}\n"

    def element(self, entry: int) -> str:
        """Return the C index of an entry.

        Parameters
        ----------
        entry : counted by columns, as CasADi does.
        """
        row, column = entry % self.shape[0], entry // self.shape[0]
        pair = zip((row, column), self.shape, strict=True)
        return "".join(f"[{index}]" for index, size in pair if size > 1)

    @property
    def first(self) -> str:
        """C index of the first number, in memory."""
        return "[0]" * len(self.dimensions)


def carried_members(specialized: SpecializedStep) -> list[Member]:
    """Return the carried ports in their order.

    Parameters
    ----------
    specialized : the step.
    """
    return [
        Member(signal, specialized.function.size_in(signal.name), signal.name in specialized.learnt)
        for signal in specialized.state
    ]


def output_members(specialized: SpecializedStep) -> list[Member]:
    """Return the outputs in their order.

    Parameters
    ----------
    specialized : the step.
    """
    return [
        Member(signal, specialized.function.size_out(signal.name), False)
        for signal in specialized.outputs
    ]


def read_expression(specialized: SpecializedStep, port: int, entry: int) -> str:
    """Return the C expression of an entry of an input of the step.

    Parameters
    ----------
    specialized : the step.
    port : number of the input.
    entry : counted by columns.
    """
    name = specialized.function.name_in(port)
    if name in SAMPLED:
        return f"in->{READS[name][entry]}"
    member = carried_members(specialized)[port]
    return f"now->{member.path}{member.element(entry)}"


def write_expression(specialized: SpecializedStep, port: int, entry: int) -> str:
    """Return the C lvalue of an entry of an output of the step.

    Parameters
    ----------
    specialized : the step.
    port : number of the output.
    entry : counted by columns.
    """
    state = carried_members(specialized)
    if port < len(state):
        return f"next->{state[port].path}{state[port].element(entry)}"
    told = output_members(specialized)[port - len(state)]
    return f"out->{told.signal.name}{told.element(entry)}"


def initializer(value: Array, dimensions: tuple[int, ...], prefix: str) -> str:
    """Return a nested initializer by rows.

    Parameters
    ----------
    value : the numbers (of any shape).
    dimensions : of the C array.
    prefix : of the macro of literals.
    """
    if not dimensions:
        return literal(float(value.ravel()[0]), prefix)
    rows: Iterator[Array] = iter(value.reshape(dimensions[0], -1))
    return "{ " + ", ".join(initializer(row, dimensions[1:], prefix) for row in rows) + " }"


def sum_terms(members: list[Member], prefix: str, base: str) -> list[str]:
    """Return terms whose sum is that of all numbers of members, and finite where they are.

    Parameters
    ----------
    members : of one structure.
    prefix : of the functions.
    base : expression of the structure with its dot or arrow.
    """
    terms = []
    for member in members:
        place, size = f"{base}{member.path}", member.shape[0] * member.shape[1]
        if size > FEW:
            terms.append(f"{prefix}_sum(&{place}{member.first}, {size}U)")
        else:
            terms += [f"{place}{member.element(entry)}" for entry in range(size)]
    return terms


# What weights must be to be taken over, in C: covariances and amounts that are not negative.

# What a variance may miss to zero by rounding, as a share of its own: float keeps seven digits, and
# both precisions accept what they have learnt themselves.
SLACK = "1e-3"


def ruled(members: Sequence[Member]) -> list[Member]:
    """Return the members that have a rule.

    Parameters
    ----------
    members : of the weights.
    """
    return [member for member in members if member.signal.rule]


def conditions(members: Sequence[Member], prefix: str) -> str:
    """Return C expressions, each behind `&&`, that hold where weights keep their rules.

    Parameters
    ----------
    members : of the weights.
    prefix : of the functions.
    """
    calls = []
    for member in ruled(members):
        place, (rows, columns) = f"weights->{member.signal.name}", member.shape
        if member.signal.rule == NOT_NEGATIVE:
            size = f"{rows * columns}U"
            calls.append(f"{prefix}_are_not_negative(&{place}{member.first}, {size})")
        elif member.signal.rule == FACTORS:
            calls += [f"{prefix}_are_factors({place}[{row}])" for row in range(rows)]
        elif rows == columns:
            calls.append(f"{prefix}_is_covariance(&{place}{member.first})")
        else:
            calls += [f"{prefix}_is_covariance({place}[{row}])" for row in range(rows)]
    return "".join(f"\n            && {call}" for call in calls)


def covariance_values(members: Sequence[Member]) -> dict[str, str] | None:
    """Return order and layout of the covariances of a method for the template; None for none.

    Parameters
    ----------
    members : of the weights.
    """
    shapes = {member.shape for member in members if member.signal.rule == COVARIANCE}
    if not shapes:
        return None
    ((rows, columns),) = shapes
    square = rows == columns
    return {
        "order": str(rows if square else _order(columns)),
        "skip": "i" if square else "0U",
        "layout": "It lies in the whole matrix." if square else "It lies alone.",
        "slack": SLACK,
    }


def factor_values(members: Sequence[Member]) -> dict[str, str] | None:
    """Return the order of the factored covariances of a method for the template; None for none.

    Parameters
    ----------
    members : of the weights.
    """
    orders = {_order(member.shape[1]) for member in members if member.signal.rule == FACTORS}
    return {"order": str(*orders)} if orders else None


def _order(size: int) -> int:
    """Return the rows of a matrix whose upper triangle has so many numbers."""
    return (isqrt(8 * size + 1) - 1) // 2


def has_amounts(members: Sequence[Member]) -> bool:
    """Tell whether numbers of a method must not be negative.

    Parameters
    ----------
    members : of the weights.
    """
    return any(member.signal.rule == NOT_NEGATIVE for member in members)
