"""A step function folded over samples for many runs at once: one in each lane, lanes by threads.

The generated code is that of `Scan`, compiled with vectors in place of numbers, so that every run
has the same bits as alone. Only what is asked for is recorded: writing every state of every run
to memory would take longer than computing it. What is summed up over samples (a mean square, a
peak) is best carried by the step itself.
"""

import logging
import math
import os
from collections.abc import Mapping, Sequence
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen.compiler import CompilationError, load_library
from codegen.lane_run import CompiledLoop, in_threads, run_lanes
from codegen.lanes import CPP_FLAGS, find_target, lanes_source
from codegen.scan import Scan

Array = NDArray[np.float64]

log = logging.getLogger("tireid.codegen")


class BatchScan:
    """A step function run over samples for many runs at once, which differ in some inputs.

    Parameters
    ----------
    step : SX function with named, dense ports. An input `p` named in `carry` has an output
        `p_next` of the same shape. Its name becomes part of a C identifier.
    carry : inputs whose value is handed from one sample to the next.
    over : inputs with one row a sample. Every other input is constant.
    lanes_over : inputs, of any kind, that differ from run to run; all runs share the others.

    Raises
    ------
    ValueError
        Where the ports do not fit together.
    """

    def __init__(
        self,
        step: ca.Function,
        *,
        carry: tuple[str, ...],
        over: tuple[str, ...],
        lanes_over: tuple[str, ...],
    ) -> None:
        self.scan = Scan(step, carry=carry, over=over)
        unknown = [port for port in lanes_over if port not in step.name_in()]
        if unknown or not lanes_over:
            raise ValueError(
                f"{step.name()}: lanes_over must name inputs among {list(step.name_in())}, "
                f"it names {list(lanes_over)}"
            )
        self.lanes_over = lanes_over

    @cached_property
    def _loop(self) -> CompiledLoop | None:
        """The compiled loop, or None where it cannot be had; then the log says why."""
        step = self.scan.step
        try:
            target = find_target()
            if target is None:
                return None
            source = lanes_source(step, self.scan.carry, target.lanes)
            library = load_library(source, f"{step.name()}_lanes", (*CPP_FLAGS, *target.flags))
        except (CompilationError, OSError, ValueError) as error:
            reason = " ".join(str(error).split())
            log.warning("running one at a time, more slowly: %s", reason)
            return None
        if library is None:
            return None
        return CompiledLoop(library[f"{step.name()}_lanes"], target.lanes)

    def __call__(
        self,
        n: int,
        values: Mapping[str, Array],
        *,
        keep: Sequence[int] = (),
        workers: int | None = None,
    ) -> dict[str, Array]:
        """Run `n` samples of every run.

        Parameters
        ----------
        n : number of samples.
        values : one array for every input, shaped as for `Scan`; those of `lanes_over` have a
            first axis more, one entry a run.
        keep : samples to record, rising; none records only where the runs end.
        workers : threads; None takes one for each processor that may be used.

        Returns
        -------
        For each carried port `p` its value before each kept sample (runs, n_kept, *shape) and, as
        `p_final`, after the last sample (runs, *shape); for each other output its value at each
        kept sample (runs, n_kept, *shape). Column vectors have the shape (size,).

        Raises
        ------
        ValueError
            Where a value is missing, unknown, or has the wrong shape, or `keep` does not rise.
        """
        kept = np.array(keep, dtype=np.int64)
        if kept.size and not (kept[0] >= 0 and kept[-1] < n and (np.diff(kept) > 0).all()):
            raise ValueError(f"keep must rise within 0 ... {n - 1}, it is {list(keep)}")
        runs, packed = self._pack(n, values)
        workers = workers or processors()
        if self._loop is None:
            return self._run_one_by_one(n, packed, kept, runs, workers)
        step = self.scan.step
        size = {p: step.size_in(p) for p in self.scan.carry}
        size |= {f"{p}_final": step.size_in(p) for p in self.scan.carry}
        size |= {p: step.size_out(p) for p in self.scan.outputs}
        record = run_lanes(
            self._loop,
            self.scan,
            n,
            {p: self._flat(p, value) for p, value in packed.items()},
            lanes_over=self.lanes_over,
            kept=kept,
            runs=runs,
            workers=workers,
        )
        return {port: _shaped(flat, size[port]) for port, flat in record.items()}

    def _pack(self, n: int, values: Mapping[str, Array]) -> tuple[int, dict[str, Array]]:
        """Return the number of runs, and values (runs, rows, columns) or (rows, columns)."""
        step = self.scan.step
        if set(values) != set(step.name_in()):
            raise ValueError(
                f"{step.name()} has the inputs {list(step.name_in())}, given are {list(values)}"
            )
        runs = next(iter(np.shape(values[self.lanes_over[0]])), 0)
        packed = {}
        for port, value in values.items():
            array = np.asarray(value, dtype=np.float64)
            rows, columns = step.size_in(port)
            leading = (runs,) if port in self.lanes_over else ()
            shape = (
                *leading,
                *((n, rows * columns) if port in self.scan.over else (rows, columns)),
            )
            begins = array.shape[: len(leading)] == leading
            if begins and array.ndim < len(shape) and array.size == math.prod(shape):
                array = array.reshape(shape)  # a column given flat, a scalar given bare
            if array.shape != shape or not runs:
                name, given = step.name(), np.shape(value)
                raise ValueError(f"{name}: {port} must have shape {shape}, not {given}")
            packed[port] = array
        return runs, packed

    def _flat(self, port: str, value: Array) -> Array:
        """Flatten matrices by columns, as CasADi stores them; samples stay as they are."""
        if port in self.scan.over:
            return np.ascontiguousarray(value)
        return np.ascontiguousarray(value.swapaxes(-1, -2).reshape(*value.shape[:-2], -1))

    def _run_one_by_one(
        self, n: int, packed: dict[str, Array], kept: NDArray[np.int64], runs: int, workers: int
    ) -> dict[str, Array]:
        """Do without vectors: each run by itself, compiled or in the virtual machine."""
        found: list[dict[str, Array]] = [{}] * runs

        def run(first: int, last: int) -> None:
            for i in range(first, last):
                values = {p: a[i] if p in self.lanes_over else a for p, a in packed.items()}
                record = self.scan(n, values)
                found[i] = {
                    **{p: record[p][kept] for p in (*self.scan.carry, *self.scan.outputs)},
                    **{f"{p}_final": record[f"{p}_final"] for p in self.scan.carry},
                }

        run(0, 1)  # compiles, which no second thread should do at the same time
        if runs > 1:
            in_threads(lambda first, last: run(first + 1, last + 1), runs - 1, workers)
        return {port: np.stack([one[port] for one in found]) for port in found[0]}


def _shaped(flat: Array, size: tuple[int, int]) -> Array:
    """Return column-major numbers in their matrix shape; column vectors stay flat."""
    rows, columns = size
    if columns == 1:
        return flat
    return flat.reshape(*flat.shape[:-1], columns, rows).swapaxes(-1, -2)


def processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
