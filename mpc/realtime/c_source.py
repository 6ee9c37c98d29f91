"""The C files of a tracker: the real C of `mpc/c` under its name, and what is generated.

Generated are `<name>_config.h`, sizes and precision, and `<name>_equations.c`, the prediction.
"""

from collections.abc import Mapping
from pathlib import Path

import casadi as ca

from codegen import package
from codegen.clean_c import Statements, recognized
from codegen.graph import graph_of
from codegen.template import Values
from codegen.tuned import tuned
from mpc.prediction import build_axles, build_end, build_rk4, build_stage, state_size
from mpc.problem import N_ERRORS
from mpc.realtime.caution import N_GRIPS
from mpc.realtime.fall_back import N_GAINS, N_SPEEDS
from mpc.tires.tire import N_DOUBTS, TireStructure

C = Path(__file__).parents[1] / "c"
PREFIX = "tireid_mpc"  # of the C as it lies there
# Of the tracker as one file, headers first.
ORDER = (
    *("include/{}_config.h", "include/{}.h"),
    *("src/{}_equations.h", "src/{}_qp.h", "src/{}_riccati.h", "src/{}_active.h"),
    *("src/{}_iteration.h", "src/{}_caution.h", "src/{}_numbers.h", "src/{}_equations.c"),
    *("src/{}_numbers.c", "src/{}_riccati.c", "src/{}_active.c", "src/{}_qp.c"),
    *("src/{}_caution.c", "src/{}_iteration.c", "src/{}.c"),
)
PLACES = {  # of what lies there
    file: folder
    for folder, file in (one.format(PREFIX).split("/") for one in ORDER)
    if not file.endswith(("_config.h", "_equations.c"))
}
READ: Mapping[str, str] = {
    "x": "x[{}]", "u": "u", "kappa": "kappa", "v_x": "v_x", "dt": "params->stage_time",
    "car": "params->car[{}]", "w": "params->weights[{}]", "max_slip": "params->max_slip[{}]",
    "rise": "params->rise[{}]", "grip": "grip", "q": "q[{}]",
}  # fmt: skip


def c_sources(
    structure: TireStructure, *, horizon: int, name: str, single: bool = False, about: Values
) -> dict[str, str]:
    """Return the C files by their path in a package; they depend on nothing but these arguments.
    single : whether float is the default precision.
    """
    counts = c_sizes(structure, horizon)
    sizes = {key: (f"{count}U", words) for key, (count, words) in counts.items()}
    version = f'"{about["version_text"]}"'
    return {
        **package.c_files(C, PLACES, {PREFIX: name}),
        f"include/{name}_config.h": package.header(
            f"{name}_config.h",
            f"{package.in_comment(about['title'])}: precision and sizes.\n\n"
            f"{package.generated(about)}",
            [
                package.precision(name, single=single),
                package.defines(
                    name, {**sizes, "VERSION": (version, "name, hash, version of tireid")}
                ),
            ],
        ),
        f"src/{name}_equations.c": _equations(structure, name, package.generated(about)),
    }


def python_file(files: Mapping[str, str], *, name: str, single: bool) -> str:
    (glue,) = package.c_files(C, {"glue.c": "."}, {PREFIX: name}).values()
    texts = [*(files[path.format(name)] for path in ORDER), glue]
    return package.one_file(texts, defines={f"{name.upper()}_SINGLE": int(single)})


def c_sizes(structure: TireStructure, horizon: int) -> dict[str, tuple[int, str]]:
    """Return the sizes of a tracker and what they count, by the end of their macro."""
    n_x = state_size(structure)
    lagged = ", lagged slip in front and at the rear" if n_x > 5 else ""
    return {
        "HORIZON": (horizon, "stages of the plan"),
        "STATES": (n_x, f"e_y, e_psi, v_y, r, delta{lagged}"),
        "WEIGHTS": (structure.n_weights, "numbers of the tire"),
        "ERRORS": (N_ERRORS, "e_y, e_psi, course, v_y, yaw rate, delta, progress"),
        "SPEEDS": (N_SPEEDS, "of the fall-back's table"),
        "GAINS": (N_GAINS, "a speed: of e_y, e_psi, v_y, r, wheels; delta, v_y of a turn"),
        "GRIPS": (N_GRIPS, "frictions that are possible"),
        "DOUBTS": (N_DOUBTS, "slips at which the uncertainty of the forces is given"),
    }


def _equations(structure: TireStructure, name: str, sentence: str) -> str:
    real, params = f"{name}_real", f"const {name}_params *params"
    rk4 = build_rk4(structure)  # whose step without an input is tuned as the stage is
    ports = {port: ca.SX.sym(port, *rk4.size_in(port)) for port in rk4.name_in() if port != "u"}
    x_next = ca.densify(rk4(*({**ports, "u": ca.SX(0)}[port] for port in rk4.name_in())))
    free = ca.Function("predict", list(ports.values()), [x_next], list(ports), ["x_next"])
    bodies = {
        f"void {name}_linearize({params}, const {real} *q,\n    const {real} *x, {real} u, {real} "
        f"kappa, {real} v_x, {real} grip, {name}_stage *stage)": _body(
            build_stage(structure), name, READ, "stage->{}[{}]"
        ),
        f"void {name}_linearize_end({params}, const {real} *q, const {real} *x,\n    {real} kappa, "
        f"{real} v_x, {name}_stage *stage)": _body(
            build_end(structure), name, READ, "stage->{}[{}]"
        ),
        f"void {name}_predict({params}, const {real} *x, {real} kappa,\n    {real} v_x, {real} dt, "
        f"{real} grip, {real} *x_next)": _body(
            tuned(free, sampled=()).function, name, {**READ, "dt": "dt"}, "x_next[{1}]"
        ),
        f"void {name}_axles({params}, const {real} *x,\n    {real} v_x, {real} grip, {real} "
        "force[2], "
        f"{real} slip[2], {real} length[2])": _body(build_axles(structure), name, READ, "{}[{}]"),
    }
    return package.equations_file(name, f"The prediction and its derivatives. {sentence}", bodies)


def _body(function: ca.Function, name: str, read: Mapping[str, str], write: str) -> Statements:
    ports, results = function.name_in(), function.name_out()
    members = {"x_next": "c"}

    def written(port: int, entry: int) -> str:
        return write.format(members.get(results[port], results[port]), entry)

    return Statements(
        recognized(graph_of(function)),
        prefix=name,
        read=lambda port, entry: read[ports[port]].format(entry),
        write=written,
    )
