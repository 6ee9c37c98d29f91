"""The C files of a specialized step: the real C of `c/` under its name, and what is generated.

Generated are `<name>_config.h` (switches, numbers, structures), `<name>_tables.h` (where the state
starts, what weights must keep) and `<name>_equations.c`.
"""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

import casadi as ca
import numpy as np

from codegen.clean_c import Statements, literal, recognized
from codegen.graph import graph_of
from codegen.package import (
    c_files,
    defines,
    equations_file,
    generated,
    header,
    in_comment,
    precision,
    used_macros,
)
from codegen.template import Values
from identifier.export.layout import (
    SLACK,
    Member,
    carried_members,
    covariance_order,
    initializer,
    output_members,
    ranges,
    read_expression,
    rules,
    write_expression,
)
from identifier.export.specialize import SpecializedStep
from identifier.refused import GATE, NOWHERE, STALE_TIME

C = Path(__file__).parent / "c"
PREFIX = "tireid"  # of the C as it lies there
MOST_UNSUMMED = 150  # numbers that equations tell; more they sum up while these are at hand
LIBRARY: Mapping[str, str] = {"tireid.h": "include", "tireid_equations.h": "src", "tireid.c": "src"}
PROGRAMS: Mapping[str, str] = {"main.c": "examples", "test_tireid.c": "tests"}
# Of the library as one file, headers first.
ORDER = (
    *("include/{}_config.h", "include/{}.h", "src/{}_equations.h", "src/{}_tables.h"),
    *("src/{}_equations.c", "src/{}.c"),
)


def c_sources(specialized: SpecializedStep, *, single: bool, about: Values) -> dict[str, str]:
    """Return the C files of the library by their path in the package.
    single : whether float is the default precision.
    """
    if not specialized.carry:
        kind = type(specialized.method).__name__
        raise ValueError(f"{kind} is a formula without state: nothing to export")
    for value in specialized.carry.values():
        for number in value[~np.isfinite(value)]:
            raise ValueError(f"a carried value must be finite to be exported, it is {number}")
    name = specialized.name
    return {
        **c_files(C, LIBRARY, {PREFIX: name}),
        f"include/{name}_config.h": _config(specialized, single=single, about=about),
        f"src/{name}_tables.h": _tables(specialized, about),
        f"src/{name}_equations.c": _equations(specialized, about),
    }


# Switches, numbers and structures.


def _config(specialized: SpecializedStep, *, single: bool, about: Values) -> str:
    name, learnt, others = specialized.name, *_weights_and_others(specialized)
    title = f"{in_comment(about['title'])} ({about['method']}): switches, numbers, structures."
    stale = f"{name.upper()}_STALE_TIME"
    inputs = [Member(port, (1, 1), False) for port in specialized.inputs]
    return header(
        f"{name}_config.h",
        f"{title}\n\n{generated(about)}",
        [
            precision(name, single=single),
            defines(name, _switches(specialized)),
            defines(name, _numbers(specialized, about)),
            "/* Time [s] without a sample that could be taken after which no force is output any\n"
            f" * more; may be set when the library is compiled. */\n#ifndef {stale}\n"
            f"#define {stale} ({_number(STALE_TIME)})\n#endif\n",
            _structure(f"{name}_input", _declarations(inputs, name)),
            _structure(f"{name}_output", _declarations(output_members(specialized), name)),
            _structure(f"{name}_weights", _declarations(learnt, name), "What is identified."),
            _structure(f"{name}_signals", _declarations(others, name), "Other states."),
            _structure(
                f"{name}_values",
                (f"    {name}_weights weights;\n" if learnt else "")
                + f"    {name}_signals signals;\n",
                "The state.",
            ),
        ],
    )


def _switches(specialized: SpecializedStep) -> dict[str, tuple[object, str]]:
    learnt, _ = _weights_and_others(specialized)
    if specialized.believed not in (None, GATE):
        raise ValueError(
            f"the C looks for the last plausible sample in {GATE}, not {specialized.believed}"
        )
    count, order = len(rules(learnt)), covariance_order(learnt)
    ruled = {
        "COVARIANCE": (f"{order}U", "rows of a covariance among the weights"),
        "SLACK": (SLACK, "of a variance, in parts, to zero"),
    }
    band = {
        "TELLS_BAND": (1, "half_band is an output: half the width of the band around axle_force")
    }
    return {
        "LEARNS": (int(bool(learnt)), "there are weights, which adaptation moves"),
        "JUDGES": (int(specialized.believed is not None), "the step has a gate of its own"),
        "DECIDES": (
            int(specialized.parts.where_false is not None),
            "equations at rest are others than those of driving",
        ),
        "READS_A_Y": (int(specialized.reads_a_y), "a_y is an input, NaN where there is none"),
        "TELLS_V_Y": (
            len(specialized.side_slip),
            "v_y is an output, as an input it may be NaN; 2: so is v_y_sd; 3: and whether it is "
            "observable",
        ),
        "RESTS_FIRST": (
            int(specialized.rests_first),
            "the first sample of all is one to rest at before it is taken",
        ),
        **(band if specialized.tells_band else {}),
        "SUMS": (int(_sums(specialized)), "equations return the sum of all numbers that they tell"),
        "RULES": (f"{count}U", "of weights that are taken over"),
        "RANGES": (f"{len(specialized.ranges)}U", "likewise, that numbers must lie in"),
        **(ruled if order else {"COVARIANCE": ruled["COVARIANCE"]} if count else {}),
    }


def _numbers(specialized: SpecializedStep, about: Values) -> dict[str, tuple[object, str]]:
    limits = specialized.limits
    numbers = {
        "SAMPLE_TIME": (specialized.dt, "from one sample to the next [s]"),
        "MIN_SPEED": (specialized.min_speed, "below it forces read zero and learning rests [m/s]"),
        "MAX_SPEED": (limits.speed, "default of what is accepted [m/s]"),
        "MAX_YAW_RATE": (limits.yaw_rate, "likewise [rad/s]"),
        "MAX_STEERING": (limits.steering, "likewise [rad]"),
        "MAX_FORCE": (limits.force, "likewise [N]"),
        **({"NOWHERE": (NOWHERE, "speed of no car [m/s]")} if specialized.believed else {}),
    }
    said: dict[str, tuple[object, str]] = {
        key: (f"({_number(value)})", words) for key, (value, words) in numbers.items()
    }
    return said | {"VERSION": (f'"{about["version_text"]}"', "name, hash, version of tireid")}


def _number(value: float) -> str:
    return literal(value, "x").removeprefix("X_C(").removesuffix(")")


def _sums(specialized: SpecializedStep) -> bool:
    """Return whether the equations sum up what they tell, while it is at hand."""
    return specialized.function.nnz_out() > MOST_UNSUMMED


def _weights_and_others(specialized: SpecializedStep) -> tuple[list[Member], list[Member]]:
    members = carried_members(specialized)
    return [m for m in members if m.learnt], [m for m in members if not m.learnt]


def _declarations(members: Sequence[Member], name: str) -> str:
    return "".join(member.declaration(f"{name}_real") for member in members)


def _structure(name: str, members: str, about: str = "") -> str:
    words = f"/* {about} */\n" if about else ""
    return f"{words}typedef struct {{\n{members}}} {name};\n" if members else ""


# Where the state starts, and rules of weights, as data.


def _tables(specialized: SpecializedStep, about: Values) -> str:
    name, learnt, others = specialized.name, *_weights_and_others(specialized)
    outputs = output_members(specialized)
    zeros = ", ".join(initializer(np.zeros(m.shape), m.dimensions, name) for m in outputs)
    capital = name.upper()
    kept = "".join(
        f"    {{ {capital}_{rule.kind}, {rule.first}U, {rule.order}U }},\n"
        for rule in rules(learnt)
    )
    body = (
        f"static const {name}_values {name}_start = {{\n"
        f"{_start(specialized, learnt, others)}\n}};\n\n"
        f"static const {name}_output {name}_no_output = {{ {zeros} }};\n"
    )
    table = f"static const {name}_rule {name}_rules[{capital}_RULES] = {{\n{kept}}};\n"
    lines, shares = ranges(specialized)
    if lines:
        listed = _wrapped(", ".join(literal(one, name) for one in shares), "    ")
        body += (
            f"\nstatic const {name}_real {name}_shares[{len(shares)}] = {{\n{listed}\n}};\n\n"
            f"static const {name}_range {name}_ranges[{capital}_RANGES] = {{\n"
            + "".join(f"    {line},\n" for line in lines)
            + "};\n"
        )
    return header(
        f"{name}_tables.h",
        f"Where the state starts, and what weights must keep.\n\n{generated(about)}",
        [
            f'#include "{name}_equations.h"\n',
            used_macros(name, body).removesuffix("\n"),
            body,
            table if kept else "",
        ],
    )


def _start(specialized: SpecializedStep, learnt: list[Member], others: list[Member]) -> str:
    def lines(members: list[Member], indent: str) -> str:
        texts = (
            initializer(specialized.carry[m.signal.name], m.dimensions, specialized.name)
            for m in members
        )
        return ",\n".join(_by_rows(text, indent) for text in texts)

    parts = [lines(members, "        ") for members in (learnt, others) if members]
    return ",\n".join(f"    {{\n{part} }}" for part in parts)


def _by_rows(text: str, indent: str) -> str:
    """Return the initializer of a matrix with its rows below one another."""
    if not text.startswith("{ {"):
        return _wrapped(text, indent)
    lines = [f"{{ {row} }}" for row in text[4:-4].split(" }, { ")]
    return f"{indent}{{\n" + ",\n".join(_wrapped(line, f"{indent}    ") for line in lines) + " }"


def _wrapped(text: str, indent: str) -> str:
    return textwrap.fill(
        text,
        100,
        initial_indent=indent,
        subsequent_indent=indent + "  " * text.startswith("{"),
        break_long_words=False,
        break_on_hyphens=False,
    )


# The equations.


def _equations(specialized: SpecializedStep, about: Values) -> str:
    name, parts = specialized.name, specialized.parts
    learnt, _ = _weights_and_others(specialized)
    known, learns = (f"const {name}_weights *known, ", f" {name}_weights *learnt,")
    moves = f"({known if learnt else ''}const {name}_signals *now, const {name}_input *in,"
    moves += f"\n   {learns if learnt else ''} {name}_signals *next, {name}_output *out)"
    real = f"{name}_real"
    functions = {f"{real} {name}_driving{moves}": _statements(specialized, parts.where_true)}
    if parts.where_false is not None:
        condition = _statements(specialized, parts.condition, returns=True)
        functions[f"bool {name}_drives(const {name}_input *in)"] = condition
        elsewhere = _statements(specialized, parts.where_false)
        functions[f"{real} {name}_elsewhere{moves}"] = elsewhere
    return equations_file(name, f"The equations. {generated(about)}", functions)


def _statements(
    specialized: SpecializedStep, function: ca.Function, *, returns: bool = False
) -> Statements:
    statements = Statements(
        recognized(graph_of(function)),
        prefix=specialized.name,
        read=lambda port, entry: read_expression(specialized, port, entry),
        write=lambda port, entry: "" if returns else write_expression(specialized, port, entry),
        returns=returns,
        sums=_sums(specialized) and not returns,
    )
    if not returns and not _sums(specialized):
        statements.lines.append(f"return {literal(0.0, specialized.name)};")
    return statements
