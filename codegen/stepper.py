"""A step function taken one sample at a time: the compiled loop of a `Scan`, with its memory kept.

For what runs beside a car: nothing is laid out, checked or allocated anew at a sample.
"""

import ctypes
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from codegen.scan import Scan, longs, pointers

Array = NDArray[np.float64]


class Stepper:
    """A run that goes on: write `inputs`, `advance`, read `outputs`; the bits of the `Scan`.

    Attributes `inputs` and `outputs` hold one flat array a port, always the same ones: of the
    ports of `over`, and of the outputs that are not carried. Matrices lie by columns.

    Parameters
    ----------
    scan : the compiled step.
    values : start of the carried ports and the constants, by name.

    Raises
    ------
    ValueError
        Where a value is missing, unknown, or has the wrong shape.
    """

    def __init__(self, scan: Scan, values: Mapping[str, Array]) -> None:
        step = scan.step
        samples = {port: np.zeros((1, step.numel_in(port))) for port in scan.over}
        packed = scan.packed(1, {**values, **samples})
        self._scan, self._constants = scan, {port: values[port] for port in scan.constants}
        self._samples = {port: packed[port] for port in scan.over}
        self.inputs = {port: packed[port].reshape(-1) for port in scan.over}
        self.outputs = {port: np.zeros(step.numel_out(port)) for port in scan.outputs}
        self._now = {port: packed[port].copy() for port in scan.carry}
        self._following = {port: np.empty_like(array) for port, array in self._now.items()}
        self._loop = scan.loop
        if self._loop is not None:
            self._arguments = self._laid_out(packed)

    def _laid_out(self, packed: dict[str, Array]) -> list[object]:
        """Return the arguments of the loop, for one sample; the loop swaps the carried arrays."""
        scan, step = self._scan, self._scan.step
        names_in, names_out = list(step.name_in()), list(step.name_out())
        size = [step.numel_in(port) for port in scan.carry]
        self._kept = [  # arrays that only the loop knows
            *packed.values(),
            *(before := [np.empty(n) for n in size]),
            work := np.empty(max(step.sz_w(), 1)),
        ]
        self._integer_work = np.empty(max(step.sz_iw(), 1), dtype=np.int64)
        told = pointers(list(self.outputs.values()))
        return [
            ctypes.c_long(1),
            ctypes.c_long(1),
            pointers([packed[port] for port in names_in]),
            longs([*(step.numel_in(p) if p in scan.over else 0 for p in names_in), -1]),
            ctypes.c_long(len(scan.carry)),
            longs([names_in.index(port) for port in scan.carry]),
            longs([names_out.index(f"{port}_next") for port in scan.carry]),
            longs(size),
            pointers(list(self._now.values())),
            pointers(list(self._following.values())),
            pointers(before),
            ctypes.c_long(len(scan.outputs)),
            longs([names_out.index(port) for port in scan.outputs]),
            longs([step.numel_out(port) for port in scan.outputs]),
            told,
            told,
            (ctypes.c_void_p * max(step.sz_arg(), len(names_in)))(),
            (ctypes.c_void_p * max(step.sz_res(), len(names_out)))(),
            self._integer_work.ctypes.data_as(ctypes.c_void_p),
            work.ctypes.data_as(ctypes.c_void_p),
        ]

    def advance(self) -> None:
        """Take the sample that `inputs` holds; leave what it tells in `outputs`.

        Raises
        ------
        RuntimeError
            Where the step reports a failure.
        """
        if self._loop is None:
            self._advance_slowly()
            return
        if self._loop(*self._arguments):
            raise RuntimeError(f"{self._scan.step.name()} reported a failure")
        self._now, self._following = self._following, self._now

    def _advance_slowly(self) -> None:
        record = self._scan(1, {**self.carried(), **self._samples, **self._constants})
        for port, array in self.outputs.items():
            array[:] = record[port].ravel(order="F")
        for port, array in self._now.items():
            array[:] = record[f"{port}_final"].ravel(order="F")

    def carried(self) -> dict[str, Array]:
        """Return the carried values in effect, by port, in their shapes; copies."""
        return {port: self.value(port) for port in self._now}

    def value(self, port: str) -> Array:
        """Return the value of one carried port in effect, in its shape; a copy.

        Parameters
        ----------
        port : one of those that are carried.
        """
        return self._scan.shaped(self._now[port], self._scan.step.size_in(port)).copy()
