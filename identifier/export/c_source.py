"""The C files of a folded step: header, equations, state and guards."""

import re
from collections.abc import Mapping
from pathlib import Path

import casadi as ca
import numpy as np

from codegen.clean_c import Statements, literal
from codegen.graph import graph_of
from codegen.recognize import OWN, recognized
from identifier.export.fold import FoldedStep
from identifier.export.layout import (
    Member,
    carried_members,
    initializer,
    output_members,
    read_expression,
    sum_expression,
    write_expression,
)

TEMPLATES = Path(__file__).parent / "c"
KEY = re.compile(r"@(\w+)@")


def filled(template: str, values: Mapping[str, str]) -> str:
    """Return a template with every `@key@` replaced, in what replaces it too.

    Parameters
    ----------
    template : name of a file beside this one.
    values : by key.
    """
    text = (TEMPLATES / template).read_text(encoding="utf-8")
    while KEY.search(text):
        text = KEY.sub(lambda found: values[found[1]], text)
    return text


def c_sources(folded: FoldedStep, *, single: bool, about: Mapping[str, str]) -> dict[str, str]:
    """Return the C files by their path in the package.

    Parameters
    ----------
    folded : the step.
    single : whether float is the default precision.
    about : title, method, version and hash, as text.
    """
    name = folded.name
    values = {**about, **_pieces(folded, single=single)}
    return {
        f"include/{name}.h": filled("name.h", values),
        f"src/{name}_equations.h": filled("equations.h", values),
        f"src/{name}_equations.c": filled("equations.c", values),
        f"src/{name}.c": filled("name.c", values),
    }


def _pieces(folded: FoldedStep, *, single: bool) -> dict[str, str]:
    name, real = folded.name, f"{folded.name}_real"
    carried, told = carried_members(folded), output_members(folded)
    learnt = [member for member in carried if member.learnt]
    others = [member for member in carried if not member.learnt]
    driving, called = _body(folded, folded.parts.where_true)
    decided, called_elsewhere = _decided(folded)
    limits = folded.limits
    parts = (sum_expression(carried, name, "values->"), sum_expression(told, name, "out->"))
    total = "\n        + ".join(parts)
    return {
        "single": str(int(single)),
        "dt": _number(folded.dt),
        "min_speed": _number(folded.min_speed),
        "max_speed": _number(limits.speed),
        "max_yaw_rate": _number(limits.yaw_rate),
        "max_steering": _number(limits.steering),
        "max_force": _number(limits.force),
        "input_members": "".join(
            f"    {real} {port.name}; /* {port.description} [{port.unit}] */\n"
            for port in folded.inputs
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
        "weights_prototypes": _template("weights.h") if learnt else "",
        "weights_functions": _template("weights.c") if learnt else "",
        "functions": _functions(name, called | called_elsewhere),
        "driving": driving,
        **decided,
        "start": _start(folded, learnt, others),
        "zeros": _zeros(told, name),
        "sum": total,
        "sum_function": _template("sum.c") if f"{name}_sum(" in total else "",
        "weights_sum": sum_expression(
            [member._replace(learnt=False) for member in learnt], name, "weights->"
        ),
        "keep": _keep(name, bool(learnt)),
        "hold": (
            "        if (state->adapts == 0U) {\n"
            "            next.weights = state->values.weights;\n"
            "        }\n"
            if learnt
            else ""
        ),
        "begin": _template("begin.c") if folded.rests_first else "",
        "first": (
            "        if (state->started == 0U) {\n"
            f"            {name}_begin(state, params, input, &next, &out);\n"
            "        }\n"
            if folded.rests_first
            else ""
        ),
    }


def _template(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


def _number(value: float) -> str:
    return literal(value, "x").removeprefix("X_C(").removesuffix(")")


def _declarations(members: list[Member], real: str) -> str:
    return "".join(member.declaration(real) for member in members)


def _body(folded: FoldedStep, function: ca.Function) -> tuple[str, set[str]]:
    statements = Statements(
        recognized(graph_of(function)),
        prefix=folded.name,
        read=lambda port, entry: read_expression(folded, port, entry),
        write=lambda port, entry: write_expression(folded, port, entry),
    )
    return statements.block(), statements.called


def _decided(folded: FoldedStep) -> tuple[dict[str, str], set[str]]:
    """Return the pieces that decide between driving and rest, where the method does."""
    if folded.parts.where_false is None:
        nothing = dict.fromkeys(("decided_prototypes", "decided_functions"), "")
        step = _template("undecided_step.c")
        return {**nothing, "compute": step, "at_rest": "driving"}, set()
    elsewhere, called = _body(folded, folded.parts.where_false)
    condition = Statements(
        recognized(graph_of(folded.parts.condition)),
        prefix=folded.name,
        read=lambda port, entry: read_expression(folded, port, entry),
        write=lambda _port, _entry: "",
        returns=True,
    )
    functions = _template("decided.c").replace("@drives@", condition.block())
    return {
        "decided_prototypes": _template("decided.h"),
        "decided_functions": functions.replace("@elsewhere@", elsewhere),
        "compute": _template("decided_step.c"),
        "at_rest": "elsewhere",
    }, called | condition.called


def _functions(name: str, called: set[str]) -> str:
    """Return our own tanh, exp and atan, each over an array, written from their one expression."""
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


def _start(folded: FoldedStep, learnt: list[Member], others: list[Member]) -> str:
    def lines(members: list[Member]) -> list[str]:
        return [
            initializer(folded.carry[m.signal.name], m.dimensions, folded.name) for m in members
        ]

    parts = lines(others)
    if learnt:
        parts = ["{ " + ",\n      ".join(lines(learnt)) + " }", *parts]
    return "    " + ",\n    ".join(parts)


def _zeros(members: list[Member], name: str) -> str:
    return ", ".join(initializer(np.zeros(m.shape), m.dimensions, name) for m in members)


def _keep(name: str, learns: bool) -> str:
    if not learns:
        return f"        state->values = {name}_start;\n"
    return (
        f"        const {name}_weights weights = state->values.weights;\n"
        f"        state->values = {name}_start;\n"
        "        state->values.weights = weights;\n"
    )
