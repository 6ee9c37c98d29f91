"""A step function folded over samples for many runs at once: one in each lane, lanes by threads.

The generated code is that of `Scan`, compiled with vectors in place of numbers, so that every run
has the same bits as alone. Only what is asked for is recorded: writing every state of every run
to memory would take longer than computing it. What is summed up over samples (a mean square, a
peak) is best carried by the step itself.
"""

import ctypes
import logging
import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from codegen.compiler import CompilationError, load_library
from codegen.lanes import CPP_FLAGS, find_target, lanes_source, scratch_size
from codegen.scan import Scan, longs, shaped

# Arrays to blocks of lanes and back, and the compiled loop over blocks in several threads.
#
# A block holds as many runs as a register has lanes. Its arrays end in (size, lanes): the lanes of
# one number lie side by side. A last block that is not full repeats the last run.

ALIGNMENT = 64  # bytes, of the widest vector
PARTS = 4  # of the work, for each thread


class CompiledLoop(NamedTuple):
    """The loop over samples and blocks, and the number of its lanes."""

    function: "ctypes._NamedFuncPointer"
    lanes: int


def run_lanes(
    loop: CompiledLoop,
    scan: Scan,
    n: int,
    values: Mapping[str, Array],
    *,
    lanes_over: tuple[str, ...],
    kept: NDArray[np.int64],
    runs: int,
    workers: int,
) -> dict[str, Array]:
    """Return what `BatchScan` records, matrices flat by columns.

    Parameters
    ----------
    n : number of samples.
    values : of every input: (size,), (n, size) for one that is sampled, with a first axis of runs
        for those of `lanes_over`; contiguous.
    kept : samples to record, rising.

    Raises
    ------
    RuntimeError
        Where the step reports a failure.
    """
    step, lanes = scan.step, loop.lanes
    n_blocks = -(-runs // lanes)
    names_in, names_out = list(step.name_in()), list(step.name_out())
    arrays, block_step, sample_step, shared = [], [], [], []
    for port in names_in:
        differs = port in lanes_over
        array = _to_blocks(values[port], lanes) if differs else values[port]
        arrays.append(array)
        block_step.append(array[0].size if differs else 0)
        sample_step.append(
            step.numel_in(port) * (lanes if differs else 1) if port in scan.over else 0
        )
        shared.append(int(not differs))
    states = {p: _aligned(n_blocks, kept.size, step.numel_in(p), lanes) for p in scan.carry}
    final = {p: _aligned(n_blocks, step.numel_in(p), lanes) for p in scan.carry}
    outputs = {p: _aligned(n_blocks, kept.size, step.numel_out(p), lanes) for p in scan.outputs}
    before = (
        _pointers(arrays),
        longs(block_step),
        longs(sample_step),
        longs(shared),
        ctypes.c_long(kept.size),
        longs(kept.tolist()),
        _pointers([states.get(p) for p in names_in]),
        _pointers([final.get(p) for p in names_in]),
        _pointers([outputs.get(p) for p in names_out]),
    )

    def run(first: int, last: int) -> None:
        scratch = _aligned(scratch_size(step), lanes)
        span = ctypes.c_long(n), ctypes.c_long(first), ctypes.c_long(last)
        if loop.function(*span, *before, scratch.ctypes.data_as(ctypes.c_void_p)):
            raise RuntimeError(f"{step.name()} reported a failure")

    in_threads(run, n_blocks, workers)
    record = {p: _from_blocks(a, runs) for p, a in states.items()}
    record |= {f"{p}_final": _from_blocks(a, runs) for p, a in final.items()}
    return record | {p: _from_blocks(a, runs) for p, a in outputs.items()}


def in_threads(work: Callable[[int, int], None], n: int, workers: int) -> None:
    """Do `work(first, last)` on parts of range(n); whoever is done early takes another part.

    Parameters
    ----------
    work : lets go of the interpreter's lock, as compiled code does.
    workers : threads; 1 stays in this one.
    """
    parts = min(n, PARTS * workers if workers > 1 else 1)
    bounds = [n * i // parts for i in range(parts + 1)]
    if parts == 1:
        work(0, n)
        return
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(work, bounds[:-1], bounds[1:]))


def _to_blocks(array: Array, lanes: int) -> Array:
    """(runs, ..., size) to (blocks, ..., size, lanes)."""
    missing = -len(array) % lanes
    filled = np.concatenate([array, np.repeat(array[-1:], missing, axis=0)]) if missing else array
    by_block = np.moveaxis(filled.reshape(-1, lanes, *array.shape[1:]), 1, -1)
    blocks = _aligned(*by_block.shape)
    blocks[...] = by_block
    return blocks


def _from_blocks(blocks: Array, runs: int) -> Array:
    """(blocks, ..., size, lanes) to (runs, ..., size)."""
    by_run = np.moveaxis(blocks, -1, 1)
    rows = by_run.shape[0] * by_run.shape[1]
    return np.ascontiguousarray(by_run.reshape(rows, *by_run.shape[2:])[:runs])


def _aligned(*shape: int) -> Array:
    """Return an empty array that begins where a vector may."""
    size = math.prod(shape)
    spare = np.empty(size + ALIGNMENT // 8)
    start = -spare.ctypes.data % ALIGNMENT // 8
    return spare[start : start + size].reshape(shape)


def _pointers(arrays: Sequence[Array | None]) -> "ctypes.Array[ctypes.c_void_p]":
    return (ctypes.c_void_p * len(arrays))(*(None if a is None else a.ctypes.data for a in arrays))


log = logging.getLogger("tireid.codegen")


class BatchScan:
    """A step function run over samples for many runs at once, which differ in some inputs.

    Parameters
    ----------
    step : SX function with named, dense ports. An input `p` named in `carry` has an output
        `p_next` of the same shape. Its name becomes part of a C identifier.
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
        return {port: shaped(flat, size[port]) for port, flat in record.items()}

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


def processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
