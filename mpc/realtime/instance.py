"""One instance of the compiled C: its structures in memory, and its functions."""

import ctypes
import hashlib
import re
from dataclasses import fields, is_dataclass
from enum import IntEnum
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen import load_library
from codegen.arrays import Array
from codegen.compiler import NoCompilerError, keep, kept, wide_vectors
from codegen.package import source_digest
from mpc.prediction import state_size
from mpc.problem import Guards, Problem
from mpc.realtime.c_source import C, c_sizes, c_sources, python_file
from mpc.tires.tire import TireStructure


class Status(IntEnum):
    """What a step did; below QP_FAILED the plan is new, above the steering is a fall-back."""

    OK = 0
    ITERATION_LIMIT = 1
    QP_FAILED = 2
    NOT_FINITE = 3
    OFF_PATH = 4
    OFF_MAP = 5
    TOO_SLOW = 6
    LATE = 7
    BAD_CALL = 8


class Measurement(NamedTuple):
    """The car against the path, and the road ahead.

    e_y [m], e_psi [rad], v_y [m/s], r [rad/s]; curvature [1/m] and speed [m/s] at the tracker's
    times, (N + 1,).
    """

    e_y: float
    e_psi: float
    v_y: float
    r: float
    kappa: Array
    v_x: Array


class Command(NamedTuple):
    """What to steer with the front road wheels [rad], and the plan that it is from.

    status: of `Status`; plan_x (N + 1, n_x), plan_u (N,) [rad/s]; solve_time_s; iterations of the
    solver, zero where it was not asked.
    """

    steering: float
    status: int
    plan_x: Array
    plan_u: Array
    solve_time_s: float
    iterations: int


# The structures of the C tracker as NumPy types, read from its header: Python writes and reads them
# in place.

N_COMMANDS = 32  # of the past, which a delay may reach back
_STRUCTURE = re.compile(r"typedef struct \{([^}]*)\} tireid_mpc_(\w+);")
_MEMBER = re.compile(r"(\w+)\s+(\w+)((?:\[[^]]+\])*);")
_MACRO = re.compile(r"#define TIREID_MPC_(\w+) (\d+)U\b")


@cache
def c_types(
    structure: TireStructure, horizon: int, *, single: bool
) -> dict[str, np.dtype[np.void]]:
    text = re.sub(r"/\*.*?\*/", "", (C / "tireid_mpc.h").read_text(encoding="utf-8"), flags=re.S)
    sizes = {f"TIREID_MPC_{name}": int(value) for name, value in _MACRO.findall(text)}
    sizes |= {f"TIREID_MPC_{key}": n for key, (n, _) in c_sizes(structure, horizon).items()}
    kinds = {"tireid_mpc_real": np.float32 if single else np.float64, "uint32_t": np.uint32}

    def shape(dimensions: str) -> tuple[int, ...]:
        sums = [one.split("+") for one in re.findall(r"\[([^]]+)\]", dimensions)]
        return tuple(
            sum(sizes.get(part.strip()) or int(part.strip(" U")) for part in one) for one in sums
        )

    return {
        name: np.dtype(
            [(member, kinds[kind], shape(of)) for kind, member, of in _MEMBER.findall(members)],
            align=True,
        )
        for members, name in _STRUCTURE.findall(text)
        if name in ("params", "input", "state")
    }


def set_params(params: NDArray[Any], problem: Problem, guards: Guards) -> None:
    """Write what is to be solved and guarded; tire, timing, solver and fall-back stay."""
    cost, limits = problem.cost, problem.limits
    params["cost"], params["cost_end"] = cost.numbers(), cost.terminal_numbers()
    params["cost_rate"], params["stage_time"] = cost.R, problem.dt
    params["max_steering"], params["max_rate"] = limits.steering, limits.steering_rate
    params["max_e_y"], params["max_slip"] = limits.e_y, limits.slip
    params["soft_e_y"], params["soft_slip"] = limits.soft_e_y, limits.soft_slip
    params["widest_e_y"], params["widest_e_psi"] = guards.e_y, guards.e_psi
    params["max_v_y"], params["max_yaw_rate"] = guards.v_y, guards.yaw_rate
    for name in ("min_speed", "max_speed", "max_curvature", "hold_time"):
        params[name] = getattr(guards, name)


NAME = "mpc"


def tracker_source(structure: TireStructure, horizon: int, *, single: bool) -> str:
    """Return the C of a tracker, generated or found again by everything that it depends on."""
    if not is_dataclass(structure):
        return _generated(structure, horizon, single)
    kind = type(structure)
    parts = [f"{field.name}={getattr(structure, field.name)!r}" for field in fields(structure)]
    about = [source_digest(), f"{kind.__module__}.{kind.__qualname__}", *parts, horizon, single]
    digest = hashlib.sha256("\0".join(map(str, about)).encode()).hexdigest()[:20]
    found = kept(f"tracker-{digest}", ".c")
    if found is not None:
        return found.read_text(encoding="utf-8")
    text = _generated(structure, horizon, single)
    keep(f"tracker-{digest}", ".c", text.encode())
    return text


def _generated(structure: TireStructure, horizon: int, single: bool) -> str:
    about = {"title": "The tracker", "version": "", "hash": "", "version_text": NAME}
    files = c_sources(structure, horizon=horizon, name=NAME, about=about)
    return python_file(files, name=NAME, single=single)


# -O3 is twice as fast as -O2 here; the rest as in `codegen.compiler.FLAGS`.
FLAGS = (
    "-std=c99", "-O3", "-fno-math-errno", "-fno-trapping-math", "-fno-signed-zeros",
    "-ffp-contract=off", "-fPIC", "-shared",
)  # fmt: skip


class Instance:
    """State, parameters, input and work memory, which the C reads and writes in place."""

    def __init__(self, structure: TireStructure, horizon: int, *, single: bool) -> None:
        source = tracker_source(structure, horizon, single=single)
        library = load_library(source, "tracker", (*FLAGS, *wide_vectors()))
        if library is None:
            raise NoCompilerError("no C compiler found: the tracker cannot be built")
        self._library: Any = library
        self._library.mpc_sizes.restype = ctypes.c_size_t
        self._real = ctypes.c_float if single else ctypes.c_double
        n_x = state_size(structure)
        types = c_types(structure, horizon, single=single)
        self.params, self.state, self.input = (
            np.zeros((), types[name]) for name in ("params", "state", "input")
        )
        sizes = [library.mpc_sizes(i) for i in range(4)]
        expected = [array.nbytes for array in (self.params, self.state, self.input)]
        assert sizes[:3] == expected, f"structures of {expected} bytes are {sizes[:3]} in C"
        self._work = np.zeros(sizes[3], np.uint8)
        self.steering = np.zeros((), self.state["u"].dtype)
        arrays = (self.state, self.params, self._work, self.input, self.steering)
        self._step = tuple(map(pointer, arrays))
        road = (self.input["kappa"][1:], self.input["v_x"][1:])
        self.start = np.zeros(n_x, self.state["u"].dtype)
        self.solve_arguments = (*self._step[:3], pointer(self.start), *map(pointer, road))
        library["mpc_init_f32" if single else "mpc_init"](self._step[0])

    @property
    def numbers(self) -> tuple[NDArray[Any], ...]:
        """State, parameters and input: all that the next solution depends on, unprepared."""
        return self.state, self.params, self.input

    def step(self) -> int:
        """Take the measurement in `input`; return the status, and set `steering`."""
        return int(self._library.mpc_step(*self._step))

    def prepare(self) -> Status:
        """Do ahead of a measurement what does not ask for it, on the road in `input`."""
        return Status(self._library.mpc_prepare(*self._step[:4]))

    def solve(self) -> int:
        """Take one iteration from the plan as it is; return the status."""
        return int(self._library.mpc_solve(*self.solve_arguments))

    def command(self, steering: float, status: int, elapsed: float) -> Command:
        """Return what to steer [rad] with the plan as it is, after a time of solving [s]."""
        state = self.state
        x, u = state["x"].astype(np.float64), state["u"].astype(np.float64)
        return Command(steering, status, x, u, elapsed, int(state["iterations"]))

    def reset(self, steering: float) -> Status:
        """Begin anew, with the faults kept.   steering : angle of the wheels [rad]."""
        return Status(self._library.mpc_reset(*self._step[:2], self._real(steering)))


def pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    """Return where an array lies; it must outlive the pointer."""
    return ctypes.c_void_p(array.ctypes.data)
