"""The C files of a tracker: header, prediction, quadratic program, iteration, guards."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path

import casadi as ca

from codegen.clean_c import OWN, Statements, recognized
from codegen.graph import graph_of
from codegen.template import Values, Words, filled
from codegen.tuned import tuned
from mpc.prediction import build_end, build_rk4, build_stage, state_size
from mpc.problem import N_ERRORS
from mpc.realtime.fall_back import N_GAINS, N_SPEEDS
from mpc.tires.tire import TireStructure

TEMPLATES = Path(__file__).parents[1] / "c"
FILES: Mapping[str, str] = {  # template: path in a package
    "name.h": "include/{}.h",
    "equations.h": "src/{}_equations.h",
    "qp.h": "src/{}_qp.h",
    "riccati.h": "src/{}_riccati.h",
    "iteration.h": "src/{}_iteration.h",
    "equations.c": "src/{}_equations.c",
    "riccati.c": "src/{}_riccati.c",
    "qp.c": "src/{}_qp.c",
    "iteration.c": "src/{}_iteration.c",
    "name.c": "src/{}.c",
}
MACROS: Mapping[str, tuple[str, str]] = {  # in float and in double
    "PICK": ("PICK(x, y) x##F", "PICK(x, y) y"),
    "SQRT": ("SQRT(x) sqrtf(x)", "SQRT(x) sqrt(x)"),
    "FABS": ("FABS(x) fabsf(x)", "FABS(x) fabs(x)"),
    "FLOOR": ("FLOOR(x) floorf(x)", "FLOOR(x) floor(x)"),
}
READ: Mapping[str, str] = {
    "x": "x[{}]",
    "u": "u",
    "kappa": "kappa",
    "v_x": "v_x",
    "dt": "params->stage_time",
    "car": "params->car[{}]",
    "w": "params->weights[{}]",
    "max_slip": "params->max_slip[{}]",
    "rise": "params->rise[{}]",
    "q": "q[{}]",
}


def c_sources(
    structure: TireStructure,
    *,
    horizon: int,
    name: str,
    single: bool = False,
    about: Values,
) -> dict[str, str]:
    """Return the C files by their path in a package; they depend on nothing but these arguments.

    Parameters
    ----------
    structure : of the prediction tire.
    horizon : number of stages.
    name : beginning of every symbol and file name.
    single : whether float is the default precision.
    about : title, version and version_text.
    """
    stage, called = _body(build_stage(structure), name, READ, "stage->{}[{}]")
    end, called_at_end = _body(build_end(structure), name, READ, "stage->{}[{}]")
    predict, called_ahead = _body(
        _free_motion(structure), name, {**READ, "dt": "dt"}, "x_next[{1}]"
    )
    n_x = state_size(structure)
    functions = _functions(name, called | called_at_end | called_ahead)
    values: dict[str, str | Words] = {
        **about,
        "name": name,
        "NAME": name.upper(),
        "single": str(int(single)),
        "horizon": str(horizon),
        "states": str(n_x),
        "lagged_states": ", lagged slip in front and at the rear" if n_x > 5 else "",
        "weights": str(structure.n_weights),
        "errors": str(N_ERRORS),
        "speeds": str(N_SPEEDS),
        "gains": str(N_GAINS),
        "stage": stage,
        "end": end,
        "predict": predict,
        "functions": functions,
    }
    values |= _macros(name, functions + stage + end + predict)
    return {path.format(name): _filled(template, values) for template, path in FILES.items()}


def one_file(files: Mapping[str, str], *, name: str, single: bool) -> str:
    """Return C files as one, with what Python asks of it.

    Parameters
    ----------
    files : of `c_sources`.
    name : beginning of every symbol.
    single : whether to compute in float.
    """
    text = "".join(_alone(path, files[path.format(name)]) for path in FILES.values())
    return (
        f"#define {name.upper()}_SINGLE {int(single)}\n"
        + re.sub(r'^#include "[^"]*"$', "", text, flags=re.M)
        + _filled("glue.c", {"name": name})
    )


def _alone(path: str, text: str) -> str:
    """Return a file of the package with its own macros undefined at its end."""
    if not path.endswith(".c"):
        return text
    own = re.findall(r"^#define (\w+)", text, flags=re.M)
    own_types = "\n".join(f"#undef {macro}" for macro in own)
    return f"{text}{own_types}\n"


def _filled(template: str, values: Values) -> str:
    return filled(TEMPLATES / template, values)


def _free_motion(structure: TireStructure) -> ca.Function:
    """Return a step of the prediction without an input, tuned as the stage is."""
    rk4 = build_rk4(structure)
    names = [port for port in rk4.name_in() if port != "u"]
    ports = {port: ca.SX.sym(port, *rk4.size_in(port)) for port in names}
    x_next = rk4(*({**ports, "u": ca.SX(0)}[port] for port in rk4.name_in()))
    function = ca.Function("predict", list(ports.values()), [ca.densify(x_next)], names, ["x_next"])
    return tuned(function, sampled=()).function


def _body(
    function: ca.Function, name: str, read: Mapping[str, str], write: str
) -> tuple[str, set[str]]:
    ports, results = function.name_in(), function.name_out()
    members = {"x_next": "c"}

    def written(port: int, entry: int) -> str:
        return write.format(members.get(results[port], results[port]), entry)

    statements = Statements(
        recognized(graph_of(function)),
        prefix=name,
        read=lambda port, entry: read[ports[port]].format(entry),
        write=written,
    )
    return statements.block(), statements.called


def _functions(name: str, called: set[str]) -> str:
    """Return those of our own that are called, each over an array, written from one expression."""
    texts = []
    for own in sorted(called):
        x = ca.SX.sym("x")
        graph = recognized(graph_of(ca.Function(own, [x], [OWN[own](x)])), whole=False)
        entry: Callable[[int, int], str] = lambda *_: "x[i]"  # noqa: E731
        statements = Statements(graph, prefix=name, read=entry, write=entry)
        texts.append(
            f"static void {name}_{own}({name}_real *x, uint32_t n)\n{{\n    uint32_t i;\n"
            f"    for (i = 0U; i < n; i++) {{\n{statements.block(indent=8)}    }}\n}}\n\n"
        )
    return "".join(texts)


def _macros(name: str, text: str) -> dict[str, str]:
    """Return the definitions of the macros that a text uses, in float and in double."""
    used = [key for key in MACROS if f"{name.upper()}_{key}(" in text]
    return {
        f"macros_{kind}": "".join(f"#define {name.upper()}_{MACROS[key][i]}\n" for key in used)
        for i, kind in enumerate(("single", "double"))
    }
