"""The C files of a folded step: header, equations, state and guards."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

import casadi as ca
import numpy as np

from codegen.clean_c import OWN, Statements, literal, recognized
from codegen.graph import graph_of
from codegen.template import Values, Words, filled
from identifier.export.layout import (
    Member,
    carried_members,
    conditions,
    covariance_values,
    factor_values,
    has_amounts,
    initializer,
    output_members,
    read_expression,
    sum_terms,
    write_expression,
)
from identifier.export.specialize import SpecializedStep
from identifier.refused import NOWHERE, STALE_TIME

TEMPLATES = Path(__file__).parent / "c"
# Where a step begins anew, by whether it does so at the first sample of all.
_BEGINS: Mapping[bool, str] = {
    True: "(state->started == 0U) || (state->missed > 0U)",
    False: "(state->started != 0U) && (state->missed > 0U)",
}
MACROS: Mapping[str, tuple[str, str]] = {  # in float and in double
    "PICK": ("PICK(x, y) x##F", "PICK(x, y) y"),
    "SQRT": ("SQRT(x) sqrtf(x)", "SQRT(x) sqrt(x)"),
    "FABS": ("FABS(x) fabsf(x)", "FABS(x) fabs(x)"),
    "FLOOR": ("FLOOR(x) floorf(x)", "FLOOR(x) floor(x)"),
}


def c_sources(specialized: SpecializedStep, *, single: bool, about: Values) -> dict[str, str]:
    """Return the C files by their path in the package.

    Parameters
    ----------
    specialized : the step.
    single : whether float is the default precision.
    about : title, method, version and hash.

    Raises
    ------
    UnknownOperationError
        Where the method needs an operation that has no plain C.
    ValueError
        Where nothing is carried from step to step, or a carried value is not finite.
    """
    if not specialized.carry:
        kind = type(specialized.method).__name__
        raise ValueError(f"{kind} is a formula without state: nothing to export")
    for number in (number for value in specialized.carry.values() for number in value.ravel()):
        if not math.isfinite(number):
            raise ValueError(f"a carried value must be finite to be exported, it is {number}")
    name = specialized.name
    values: dict[str, str | Words] = {**about, **_pieces(specialized, single=single)}
    values |= _parts(specialized, values)
    equations, shell = _filled("equations.c", values), _filled("name.c", values)
    values |= _macros(name, equations + shell)
    return {
        f"include/{name}.h": _filled("name.h", values),
        f"src/{name}_equations.h": _filled("equations.h", values),
        f"src/{name}_equations.c": equations,
        f"src/{name}.c": shell,
    }


def _pieces(specialized: SpecializedStep, *, single: bool) -> dict[str, str]:
    name, real = specialized.name, f"{specialized.name}_real"
    state, told = carried_members(specialized), output_members(specialized)
    learnt = [member for member in state if member.learnt]
    others = [member for member in state if not member.learnt]
    driving, called = _body(specialized, specialized.parts.where_true)
    decided, called_elsewhere = _decided(specialized)
    limits = specialized.limits
    terms = (*sum_terms(state, name, "values->"), *sum_terms(told, name, "out->"))
    total = _sum(terms, " " * 8)
    return {
        "single": str(int(single)),
        "dt": _number(specialized.dt),
        "min_speed": _number(specialized.min_speed),
        "max_speed": _number(limits.speed),
        "max_yaw_rate": _number(limits.yaw_rate),
        "max_steering": _number(limits.steering),
        "max_force": _number(limits.force),
        "input_members": "".join(
            f"    {real} {port.name}; /* {port.description} [{port.unit}] */\n"
            for port in specialized.inputs
        ),
        "output_members": _declarations(told, real),
        "weights_type": (
            "/* What is learnt. */\ntypedef struct {\n"
            f"{_declarations(learnt, real)}}} {name}_weights;\n\n"
            if learnt
            else ""
        ),
        "carry_members": (f"    {name}_weights weights;\n" if learnt else "")
        + _declarations(others, real),
        "functions": _functions(name, called | called_elsewhere),
        "driving": driving,
        "at_rest": "driving",
        **decided,
        "start": _start(specialized, learnt, others),
        "zeros": _zeros(told, name),
        "sum": total,
        "weights_sum": _sum(
            sum_terms([member._replace(learnt=False) for member in learnt], name, "weights->"),
            " " * 12,
        ),
        "weights_rules": conditions(learnt, name),
        "keep": _keep(name, bool(learnt)),
        "hold": (
            "    if (state->adapts == 0U) {\n        next.weights = state->values.weights;\n    }\n"
            if learnt
            else ""
        ),
        "believed": specialized.believed or "",
        "first": (
            ""
            if specialized.believed
            else f"            if ({_BEGINS[specialized.rests_first]}) {{\n"
            f"                {name}_begin(state, params, input);\n"
            "            }\n"
        ),
        "stale_time": _number(STALE_TIME),
        "nowhere": literal(NOWHERE, name),
        "missed_params": f", const {name}_params *params" if specialized.believed else "",
        "missed_arguments": ", params" if specialized.believed else "",
    }


def _parts(specialized: SpecializedStep, values: Values) -> dict[str, str]:
    """Return the pieces that have a template of their own, filled; empty where not needed."""
    decides = specialized.parts.where_false is not None
    learns, judges = bool(specialized.learnt), bool(specialized.believed)
    wanted = {
        "weights_prototypes": ("weights.h", learns),
        "weights_functions": ("weights.c", learns),
        "sum_function": ("sum.c", f"{specialized.name}_sum(" in str(values["sum"])),
        "believed_function": ("believed.c", judges),
        "judge": ("judge.c", judges),
        "begin": ("begin.c", not judges),
        "pass": ("pass.c", judges),
        "decided_prototypes": ("decided.h", decides),
        "decided_functions": ("decided.c", decides),
    }
    weights = [member for member in carried_members(specialized) if member.learnt]
    covariance, factors = covariance_values(weights), factor_values(weights)
    inner = {
        "covariance_function": _filled("covariance.c", {**values, **covariance})
        if covariance
        else "",
        "factors_function": _filled("factors.c", {**values, **factors}) if factors else "",
        "amounts_function": _filled("not_negative.c", values) if has_amounts(weights) else "",
    }
    values = {**values, **inner}
    parts = {key: _filled(file, values) if there else "" for key, (file, there) in wanted.items()}
    step = "decided_step.c" if decides else "undecided_step.c"
    parts["compute"] = _filled(step, {**values, **parts})
    for part in ("advance", "missed"):
        parts[f"{part}_function"] = _filled(f"{part}.c", {**values, **parts})
    return parts


def _macros(name: str, text: str) -> dict[str, str]:
    """Return the definitions of the macros that a text uses, in float and in double."""
    used = [key for key in MACROS if f"{name.upper()}_{key}(" in text]
    return {
        f"macros_{kind}": "".join(f"#define {name.upper()}_{MACROS[key][i]}\n" for key in used)
        for i, kind in enumerate(("single", "double"))
    }


def _wrapped(text: str, indent: str, width: int = 100) -> str:
    return textwrap.fill(
        text,
        width,
        initial_indent=indent,
        subsequent_indent=indent + "  " * text.startswith("{"),
        break_long_words=False,
        break_on_hyphens=False,
    )


def _sum(terms: Sequence[str], indent: str) -> str:
    solid = " + ".join(term.replace(" ", "\xa0") for term in terms)
    return _wrapped(solid, indent).replace("\xa0", " ")


def _filled(template: str, values: Values) -> str:
    return filled(TEMPLATES / template, values)


def _number(value: float) -> str:
    return literal(value, "x").removeprefix("X_C(").removesuffix(")")


def _declarations(members: list[Member], real: str) -> str:
    return "".join(member.declaration(real) for member in members)


def _body(specialized: SpecializedStep, function: ca.Function) -> tuple[str, set[str]]:
    statements = Statements(
        recognized(graph_of(function)),
        prefix=specialized.name,
        read=lambda port, entry: read_expression(specialized, port, entry),
        write=lambda port, entry: write_expression(specialized, port, entry),
    )
    return statements.block(), statements.called


def _decided(specialized: SpecializedStep) -> tuple[dict[str, str], set[str]]:
    """Return the pieces that decide between driving and rest, where the method does."""
    if specialized.parts.where_false is None:
        return {}, set()
    elsewhere, called = _body(specialized, specialized.parts.where_false)
    condition = Statements(
        recognized(graph_of(specialized.parts.condition)),
        prefix=specialized.name,
        read=lambda port, entry: read_expression(specialized, port, entry),
        write=lambda _port, _entry: "",
        returns=True,
    )
    pieces = {"drives": condition.block(), "elsewhere": elsewhere, "at_rest": "elsewhere"}
    return pieces, called | condition.called


def _functions(name: str, called: set[str]) -> str:
    """Return those of our own that are called, each over an array, written from one expression."""
    texts = []
    for own in sorted(called):
        x = ca.SX.sym("x")
        graph = recognized(graph_of(ca.Function(own, [x], [OWN[own](x)])), whole=False)
        statements = Statements(graph, prefix=name, read=lambda *_: "x[i]", write=lambda *_: "x[i]")
        texts.append(
            f"static void {name}_{own}({name}_real *x, uint32_t n)\n{{\n    uint32_t i;\n"
            f"    for (i = 0U; i < n; i++) {{\n{statements.block(indent=8)}    }}\n}}\n\n"
        )
    return "".join(texts)


def _start(specialized: SpecializedStep, learnt: list[Member], others: list[Member]) -> str:
    def lines(members: list[Member], indent: str) -> str:
        texts = (
            initializer(specialized.carry[m.signal.name], m.dimensions, specialized.name)
            for m in members
        )
        return ",\n".join(_by_rows(text, indent) for text in texts)

    weights = f"    {{\n{lines(learnt, '        ')} }}" if learnt else ""
    return ",\n".join(part for part in (weights, lines(others, "    ")) if part)


def _by_rows(text: str, indent: str) -> str:
    """Return the initializer of a matrix with its rows below one another."""
    if not text.startswith("{ {"):
        return _wrapped(text, indent)
    rows = [f"{{ {row} }}" for row in text[4:-4].split(" }, { ")]
    return f"{indent}{{\n" + ",\n".join(_wrapped(row, f"{indent}    ") for row in rows) + " }"


def _zeros(members: list[Member], name: str) -> str:
    return ", ".join(initializer(np.zeros(m.shape), m.dimensions, name) for m in members)


def _keep(name: str, learns: bool) -> str:
    if not learns:
        return f"        state->values = {name}_start;\n"
    return (
        f"        {name}_weights weights;\n"
        "        weights = state->values.weights;\n"
        f"        state->values = {name}_start;\n"
        "        state->values.weights = weights;\n"
    )
