"""The package of a tracker: C sources, self-test, build file, README and manifest, by path."""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen import package as packaging
from codegen.arrays import Array
from codegen.package import rows
from codegen.template import Values, Words, filled
from identifier.frozen import vehicle_numbers
from mpc.prediction import build_stage, state_size
from mpc.problem import Problem, size_of
from mpc.realtime import Measurement, Status, Tracker
from mpc.realtime.c_source import PREFIX, c_sources
from mpc.realtime.tracker import TOLERANCE as SOLVER_TOLERANCE
from mpc.tires import PredictionTire
from mpc.tires.tire import ALL

_STEPS = 200  # of the drive of the self-test
_SPEED = 20.0  # m/s
_HEAVIER = 1.08  # mass of the car that is driven, over that of the prediction
_LATERAL = 4.0  # m/s^2, peak of what the path asks for
_LANE_CHANGE = 1.5  # s
_DIGITS = 9  # of its numbers
_OFF_PATH = 120  # step at which sensors show a car off the path
_OFF_MAP = 140  # step at which they show a motion beyond the limits
_SLOW = 10  # steps before the end, the road ahead wants a halt at one place
# rad, largest difference of the steering that the self-test allows: in double compilers differ
# by nothing
_TOLERANCE_DOUBLE = 1e-9
_TOLERANCE_SINGLE = 1e-3  # rad, likewise: float solves each problem to a tolerance of its own

_Params = NDArray[np.void]
MACROS = {"tolerance": "TOLERANCE"}  # members that are other in float


def _plain_params(params: _Params) -> dict[str, Any]:
    """Return the numbers by name, ready for JSON."""
    return {name: params[name].tolist() for name in params.dtype.names or ()}


def _initializer(value: NDArray[Any]) -> str:
    if value.ndim:
        return "{ " + ", ".join(map(_initializer, value)) + " }"
    if np.issubdtype(value.dtype, np.integer):
        return f"{int(value)}U"
    return f"R({float(value)!r})"


FAULTS: dict[int, dict[str, float]] = {
    _OFF_PATH: {"e_y": 9.0},
    _OFF_PATH + 1: {"e_psi": -2.0},
    _OFF_MAP: {"r": 8.0},
    _OFF_MAP + 1: {"v_y": -30.0},
}


class Vectors(NamedTuple):
    """Measurements e_y, e_psi, v_y, r (n, 4), steering [rad] and status (n, 2), road.

    The road is curvature [1/m] and speed [m/s] each period, (m, 2). Step k reads row k as now, and
    row k + offset + stride j as stage j.
    """

    measured: Array
    expected: Array
    road: Array
    offset: int
    stride: int

    def measurement(self, k: int, horizon: int) -> Measurement:
        rows = np.append(k, k + self.offset + self.stride * np.arange(horizon))
        e_y, e_psi, v_y, r = map(float, self.measured[k])
        kappa, v_x = self.road[rows].T
        return Measurement(e_y, e_psi, v_y, r, kappa, v_x)


def record(tracker: Tracker, steps: int = _STEPS) -> Vectors:
    """Return a drive of a heavier car through a lane change, with faults of the sensors in between.

    Numbers are rounded, and the car is computed without a function of a library: the record does
    not depend on the machine.
    tracker : in double; it is reset before, and steers.
    """
    tracker.reset()
    problem, period = tracker.problem, tracker.period
    stride = max(1, round(problem.dt / period))
    offset = round(float(tracker.times[1]) / period)
    size = size_of(tracker.tire.vehicle)
    pace = math.sqrt(size)  # of times and speeds
    road = _road(steps + offset + stride * problem.horizon, period, pace)
    road[steps - _SLOW + offset + stride * (problem.horizon - 1), 1] = pace
    blank = np.zeros((steps, 4)), np.zeros((steps, 2))
    vectors = Vectors(*blank, road, offset, stride)
    car = _Car(tracker)
    car.x[0] = 0.3 * size
    for k in range(steps):
        vectors.measured[k] = np.round(car.x[:4], _DIGITS)
        for name, value in FAULTS.get(k, {}).items():
            vectors.measured[k, Measurement._fields.index(name)] = value
        command = tracker.step(vectors.measurement(k, problem.horizon))
        vectors.expected[k] = command.steering, int(command.status)
        car.advance(command.steering, road[k, 0], _SPEED * pace)
    tracker.reset()
    return vectors


class _Car:
    """The prediction with more mass, which commands reach after whole periods."""

    def __init__(self, tracker: Tracker) -> None:
        tire = tracker.tire
        self.step, self.period, self.weights = build_stage(tire.structure), tracker.period, tire
        self.x = np.zeros(state_size(tire.structure))
        self.car = tire.car * np.array([_HEAVIER, _HEAVIER, 1.0, 1.0])
        self.on_the_way = deque([0.0] * round(tracker.delay / tracker.period))

    def advance(self, command: float, kappa: float, v_x: float) -> None:
        self.on_the_way.append(command)
        self.x[4] = self.on_the_way.popleft()
        numbers = (0.0, kappa, v_x, self.period, self.car, self.weights.weights)
        self.x = np.array(self.step(self.x, *numbers, *ALL, ca.DM.zeros(7))[0]).ravel()


def _road(n: int, period: float, pace: float) -> Array:
    """Return a lane change and its way back, bent by cubics, (n, 2)."""
    t = period * np.arange(n) / pace
    kappa = np.zeros(n)
    for begin, sign in ((0.4, 1.0), (0.4 + _LANE_CHANGE, -1.0)):
        z = np.clip((t - begin) / _LANE_CHANGE, 0.0, 1.0)
        kappa += sign * (1.0 - 2.0 * z) * z * (1.0 - z)
    kappa *= _LATERAL / (_SPEED * pace) ** 2 / 0.0962  # the largest value of the cubic
    road = np.stack([kappa, pace * (_SPEED - 0.25 * t)], axis=1)
    return road.round(_DIGITS)


def vectors_header(name: str, found: Vectors) -> str:
    return packaging.header(
        f"{name}_vectors.h",
        "Generated. Measurements e_y, e_psi, v_y, r; steering [rad] and status that follow; "
        "curvature\nand speed each period: row k now, k + offset + stride j in stage j. SI.",
        [
            f"#define VECTORS {len(found.measured)}U\n"
            f"#define VECTOR_OFFSET {found.offset}U\n#define VECTOR_STRIDE {found.stride}U\n"
            f"#define VECTOR_TOLERANCE_DOUBLE {_TOLERANCE_DOUBLE:g} /* rad */\n"
            f"#define VECTOR_TOLERANCE_SINGLE {_TOLERANCE_SINGLE:g} /* rad */\n",
            f"static const double vector_input[VECTORS][4] = {{\n{rows(found.measured)}}};\n",
            f"static const double vector_output[VECTORS][2] = {{\n{rows(found.expected)}}};\n",
            f"static const double vector_road[{len(found.road)}][2] = {{\n{rows(found.road)}}};\n",
        ],
    )


C = Path(__file__).parent / "c"
PLACES: Mapping[str, str] = {
    "tireid_mpc_params.h": "include",
    "tireid_mpc_params.c": "src",
    "test_tireid_mpc.c": "tests",
}
UNTOLD = ("weights", "speeds", "gains", "doubt", "grips", "prior")  # in the manifest; gains: below
FORMAT = "tireid mpc package 1"
FLAGS = (  # of the library
    *("-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-fno-signed-zeros"),
)


class MpcPackage(NamedTuple):
    """A package before it is written.
    params : the numbers that it begins with, of `mpc.realtime.instance.c_types`.
    """

    name: str
    tire: PredictionTire
    problem: Problem
    params: _Params
    files: Mapping[str, str]
    vectors: Vectors
    about: Values


def build_mpc_package(
    tire: PredictionTire,
    problem: Problem | None = None,
    *,
    period: float = 0.01,
    delay: float = 0.0,
    name: str = "tireid_mpc",
    single: bool = False,
    caution: float = 0.0,
) -> MpcPackage:
    """Return the package of a tracker; the same input gives the same bytes.
    period : between two steps [s].   delay : from a measurement until its command acts [s].
    single : whether float is the default precision.
    caution : of the tracker, from 0 to 1; a number of the parameters.
    """
    packaging.check_name(name, "_mpc")
    tracker = Tracker(tire, problem, period=period, delay=delay, caution=caution)
    params = tracker.params
    content = _ingredients(tracker, name, single=single)
    about: dict[str, str | Words] = {
        **packaging.about_package(content, f"Path tracking of the car {tire.vehicle.name}"),
        "tire": content["tire"]["kind"],
        "horizon": str(tracker.problem.horizon),
        "dt": f"{tracker.problem.dt:g}",
        "period": f"{period:g}",
        "delay": f"{delay:g}",
        "first_stage": f"{tracker.times[1]:g}",
    }
    files = c_sources(
        tire.structure, horizon=tracker.problem.horizon, name=name, single=single, about=about
    )
    vectors = record(tracker)
    files |= {
        **packaging.c_files(C, PLACES, {PREFIX: name}),
        f"src/{name}_tables.h": _tables(name, params, about),
        f"tests/{name}_vectors.h": vectors_header(name, vectors),
    }
    files |= packaging.cmake(
        files, about, flags=FLAGS, so_that="loops over all rows in vector registers"
    )
    files |= {f"{name}.json": packaging.manifest_text(content, files)}
    return MpcPackage(name, tire, tracker.problem, params, files, vectors, about)


def mpc_readme(package: MpcPackage, about_figures: str) -> str:
    p = _plain_params(package.params)
    rows = "".join(
        f"| `{name}` | {', '.join(f'{one:.6g}' for one in np.ravel(value))} |\n"
        for name, value in p.items()
        if name not in UNTOLD
    )
    return filled(
        C / "README.md",
        {
            "numbers_table": rows,
            "gains_table": "".join(
                f"| {speed:.3g} | {' | '.join(f'{gain:.3g}' for gain in row)} |\n"
                for speed, row in zip(p["speeds"], p["gains"], strict=True)
            ),
            "samples": str(len(package.vectors.measured)),
            "tolerance_double": f"{_TOLERANCE_DOUBLE:g}",
            "tolerance_single": f"{_TOLERANCE_SINGLE:g}",
            "figures": about_figures,
            **package.about,
        },
    )


def _ingredients(tracker: Tracker, name: str, *, single: bool) -> dict[str, Any]:
    structure = tracker.tire.structure
    numbers = (
        asdict(structure)
        if is_dataclass(structure) and not isinstance(structure, type)
        else {"text": repr(structure)}
    )
    return {
        **packaging.content_head(FORMAT, name, single=single),
        "tire": {"kind": type(structure).__name__, **packaging.plain(numbers)},
        "vehicle": packaging.plain(vehicle_numbers(tracker.tire.vehicle)),
        "problem": packaging.plain(asdict(tracker.problem)),
        "period_s": tracker.period,
        "delay_s": tracker.delay,
        "params": packaging.plain(_plain_params(tracker.params)),
        "statuses": {status.name: int(status) for status in Status},
    }


def _tables(name: str, params: _Params, about: Values) -> str:
    members = "".join(
        f"    /* {key} */ {MACROS.get(key) or _initializer(params[key])},\n"
        for key in params.dtype.names or ()
    )
    return packaging.header(
        f"{name}_tables.h",
        f"The numbers of the export.\n\n{packaging.generated(about)}",
        [
            f'#include "{name}.h"\n',
            f"#define R(x) (({name}_real)(x))\n",
            f"#if {name.upper()}_SINGLE\n"
            f"#define TOLERANCE R({SOLVER_TOLERANCE[True]!r}) /* the least that float comes to */\n"
            f"#else\n#define TOLERANCE R({float(params['tolerance'])!r})\n#endif\n",
            f"static const {name}_params {name}_exported = {{\n{members}}};\n",
        ],
    )
