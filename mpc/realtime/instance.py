"""One instance of the compiled C: its structures in memory, and its functions."""

import ctypes
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codegen import load_library
from mpc.motion import state_size
from mpc.realtime.layout import input_type, params_type, state_type
from mpc.realtime.messages import Status
from mpc.realtime.source_cache import tracker_source
from mpc.tires.structure import PredictionTire

# -O3 is twice as fast as -O2 here; the rest as in `codegen.compiler.FLAGS`.
FLAGS = (
    "-std=c99",
    "-O3",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-ffp-contract=off",
    "-fPIC",
    "-shared",
)


class NoCompilerError(RuntimeError):
    """There is no C compiler to build the tracker with."""


class Instance:
    """State, parameters, input and work memory, which the C reads and writes in place.

    Parameters
    ----------
    structure : of the prediction tire.
    horizon : number of stages.
    single : whether numbers are float.

    Raises
    ------
    NoCompilerError
        Where there is no C compiler.
    CompilationError
        Where the compiler refuses the code.
    """

    def __init__(self, structure: PredictionTire, horizon: int, *, single: bool) -> None:
        library = load_library(tracker_source(structure, horizon, single=single), "tracker", FLAGS)
        if library is None:
            raise NoCompilerError("no C compiler found: the tracker cannot be built")
        self._library: Any = library
        self._library.mpc_sizes.restype = ctypes.c_size_t
        self._real = ctypes.c_float if single else ctypes.c_double
        n_x = state_size(structure)
        self.params = np.zeros((), params_type(structure.n_weights, single=single))
        self.state = np.zeros((), state_type(horizon, n_x, single=single))
        self.input = np.zeros((), input_type(horizon, single=single))
        sizes = [library.mpc_sizes(i) for i in range(4)]
        own = [array.nbytes for array in (self.params, self.state, self.input)]
        assert sizes[:3] == own, f"structures of {own} bytes are {sizes[:3]} in C"
        self._work = np.zeros(sizes[3], np.uint8)
        self.steering = np.zeros((), self.state["u"].dtype)
        arrays = (self.state, self.params, self._work, self.input, self.steering)
        self._step = tuple(map(pointer, arrays))
        road = (self.input["kappa"][1:], self.input["v_x"][1:])
        self.start = np.zeros(n_x, self.state["u"].dtype)
        self.solve_arguments = (*self._step[:3], pointer(self.start), *map(pointer, road))
        self._library.mpc_init(self._step[0])

    def step(self) -> int:
        """Take the measurement in `input`; return the status, and set `steering`."""
        return int(self._library.mpc_step(*self._step))

    def solve(self) -> int:
        """Take one iteration from the plan as it is; return the status."""
        return int(self._library.mpc_solve(*self.solve_arguments))

    def shift(self) -> None:
        """Move the plan ahead by a period."""
        self._library.mpc_shift(*self._step[:2])

    def guess(self, x0: ArrayLike) -> None:
        """Set the plan to one without a solution.

        Parameters
        ----------
        x0 : state at its beginning (n_x,).
        """
        self.start[:] = x0
        self._library.mpc_guess(*self._step[:2], *self.solve_arguments[3:])

    def late(self, steering: float) -> None:
        """Say that the last command came too late.

        Parameters
        ----------
        steering : what was steered instead [rad].
        """
        self._library.mpc_late(self._step[0], self._real(steering))

    def reset(self, steering: float) -> Status:
        """Begin anew, with the faults kept.

        Parameters
        ----------
        steering : angle of the wheels [rad].
        """
        return Status(self._library.mpc_reset(self._step[0], self._real(steering)))


def pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    """Return where an array lies; it must outlive the pointer.

    Parameters
    ----------
    array : contiguous.
    """
    return ctypes.c_void_p(array.ctypes.data)
