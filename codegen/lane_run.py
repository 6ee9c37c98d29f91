"""Arrays to blocks of lanes and back, and the compiled loop over blocks in several threads.

A block holds as many runs as a register has lanes. Its arrays end in (size, lanes): the lanes of
one number lie side by side. A last block that is not full repeats the last run.
"""

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from codegen.lanes import scratch_size
from codegen.scan import Scan

Array = NDArray[np.float64]
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
    loop : the compiled loop.
    scan : the step and what its ports are.
    n : number of samples.
    values : of every input: (size,), (n, size) for one that is sampled, with a first axis of runs
        for those of `lanes_over`; contiguous.
    lanes_over : inputs that differ from run to run.
    kept : samples to record, rising.
    runs : how many there are.
    workers : threads.

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
    carried = {p: _aligned(n_blocks, kept.size, step.numel_in(p), lanes) for p in scan.carry}
    final = {p: _aligned(n_blocks, step.numel_in(p), lanes) for p in scan.carry}
    told = {p: _aligned(n_blocks, kept.size, step.numel_out(p), lanes) for p in scan.outputs}
    before = (
        _pointers(arrays),
        _longs(block_step),
        _longs(sample_step),
        _longs(shared),
        ctypes.c_long(kept.size),
        _longs(kept.tolist()),
        _pointers([carried.get(p) for p in names_in]),
        _pointers([final.get(p) for p in names_in]),
        _pointers([told.get(p) for p in names_out]),
    )

    def run(first: int, last: int) -> None:
        scratch = _aligned(scratch_size(step), lanes)
        span = ctypes.c_long(n), ctypes.c_long(first), ctypes.c_long(last)
        if loop.function(*span, *before, scratch.ctypes.data_as(ctypes.c_void_p)):
            raise RuntimeError(f"{step.name()} reported a failure")

    in_threads(run, n_blocks, workers)
    record = {p: _from_blocks(a, runs) for p, a in carried.items()}
    record |= {f"{p}_final": _from_blocks(a, runs) for p, a in final.items()}
    return record | {p: _from_blocks(a, runs) for p, a in told.items()}


def in_threads(work: Callable[[int, int], None], n: int, workers: int) -> None:
    """Do `work(first, last)` on parts of range(n); whoever is done early takes another part.

    Parameters
    ----------
    work : lets go of the interpreter's lock, as compiled code does.
    n : how many there are.
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


def _longs(numbers: Sequence[int]) -> "ctypes.Array[ctypes.c_long]":
    return (ctypes.c_long * max(len(numbers), 1))(*numbers)
