"""A step function folded over samples, in one compiled loop.

Without a C compiler that works the CasADi virtual machine does the same, more slowly.
"""

import ctypes
import logging
from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from codegen.compiler import CompilationError, load_library

log = logging.getLogger("tireid.codegen")

# k runs over samples. Carried ports alternate between two buffers; every other output is written
# straight into the record on recorded samples and into scratch memory on the others. Ports without
# a record are not recorded.
LOOP = """
#include <string.h>

int {name}_scan(long n, long every, const double** arg, const long* arg_step,
                long n_carry, const long* carry_arg, const long* carry_res, const long* carry_size,
                double** carry_now, double** carry_next, double** carry_record,
                long n_out, const long* out_res, const long* out_size, double** out_record,
                double** out_scratch, const double** call_arg, double** call_res,
                casadi_int* iw, double* w) {{
  long k, i, row;
  double* swap;
  for (k = 0; k < n; ++k) {{
    const int keep = (k % every) == 0;
    row = k / every;
    for (i = 0; arg_step[i] >= 0; ++i) call_arg[i] = arg[i] + k * arg_step[i];
    for (i = 0; i < n_carry; ++i) {{
      call_arg[carry_arg[i]] = carry_now[i];
      call_res[carry_res[i]] = carry_next[i];
      if (keep && carry_record[i])
        memcpy(carry_record[i] + row * carry_size[i], carry_now[i],
               (size_t)carry_size[i] * sizeof(double));
    }}
    for (i = 0; i < n_out; ++i)
      call_res[out_res[i]] =
          keep && out_record[i] ? out_record[i] + row * out_size[i] : out_scratch[i];
    if ({name}(call_arg, call_res, iw, w, 0)) return 1;
    for (i = 0; i < n_carry; ++i) {{
      swap = carry_now[i];
      carry_now[i] = carry_next[i];
      carry_next[i] = swap;
    }}
  }}
  return 0;
}}
"""


_Longs: TypeAlias = "ctypes.Array[ctypes.c_long]"


_ADDRESSES = ("loop", "layout")  # of a scan, found when they are asked for


class _Layout(NamedTuple):
    """What is alike in every call of a compiled loop: places and sizes of ports, for C."""

    arg_step: _Longs
    carry_arg: _Longs
    carry_res: _Longs
    carry_size: _Longs
    out_res: _Longs
    out_size: _Longs
    sz_arg: int
    sz_res: int
    sz_iw: int
    sz_w: int


class Scan:
    """A step function run over samples, `carry, outputs = step(carry, sample, constants)`.
    step : a function with named, dense ports. An input `p` named in `carry` has an output `p_next`
        of the same shape. Its name becomes part of a C identifier.
    over : inputs with one row a sample. Every other input is constant.
    flags : of the compiler; None takes `codegen.compiler.FLAGS`.
    """

    def __init__(
        self,
        step: ca.Function,
        *,
        carry: tuple[str, ...],
        over: tuple[str, ...],
        flags: tuple[str, ...] | None = None,
    ) -> None:
        names_in, names_out = list(step.name_in()), list(step.name_out())
        for port in (*carry, *over):
            if port not in names_in:
                raise ValueError(f"{step.name()} has no input {port!r}, only {names_in}")
        for port in carry:
            if f"{port}_next" not in names_out:
                raise ValueError(
                    f"{step.name()} has no output {port + '_next'!r}, only {names_out}"
                )
            if step.size_in(port) != step.size_out(f"{port}_next"):
                raise ValueError(
                    f"{step.name()}: {port} changes its shape from one step to the next"
                )
        for i in range(step.n_in()):
            if not step.sparsity_in(i).is_dense():
                raise ValueError(f"{step.name()}: input {names_in[i]!r} must be dense")
        for i in range(step.n_out()):
            if not step.sparsity_out(i).is_dense():
                raise ValueError(f"{step.name()}: output {names_out[i]!r} must be dense")
        self.step = step
        self.carry = carry
        self.over = over
        self.flags = flags
        self.constants = tuple(p for p in names_in if p not in carry and p not in over)
        self.outputs = tuple(p for p in names_out if p.removesuffix("_next") not in carry)
        self._size_in = {p: step.size_in(p) for p in names_in}
        self._size_out = {p: step.size_out(p) for p in names_out}

    def zeros(self) -> dict[str, Array]:
        """Return zeros of every carried port, in its shape."""
        sizes = {port: self._size_in[port] for port in self.carry}
        return {p: np.zeros(n if m == 1 else (n, m)) for p, (n, m) in sizes.items()}

    def __getstate__(self) -> dict[str, object]:
        """Return what it is made of: what points into this process is loaded anew in another."""
        return {name: value for name, value in vars(self).items() if name not in _ADDRESSES}

    @cached_property
    def loop(self) -> "ctypes._NamedFuncPointer | None":
        """The compiled loop, or None where it cannot be had; then the log says why."""
        name = self.step.name()
        generator = ca.CodeGenerator(f"{name}.c")
        generator.add(self.step)
        try:
            source = generator.dump() + LOOP.format(name=name)
            library = load_library(source, name, self.flags)
        except (CompilationError, OSError) as error:
            reason = " ".join(str(error).split())
            log.warning("running in the CasADi virtual machine, more slowly: %s", reason)
            return None
        return None if library is None else library[f"{name}_scan"]

    @cached_property
    def layout(self) -> _Layout:
        """Places and sizes of the ports, as the loop wants them."""
        step = self.step
        names_in, names_out = list(self._size_in), list(self._size_out)
        strides = [step.numel_in(p) if p in self.over else 0 for p in names_in]
        return _Layout(
            arg_step=_longs([*strides, -1]),
            carry_arg=_longs([names_in.index(p) for p in self.carry]),
            carry_res=_longs([names_out.index(f"{p}_next") for p in self.carry]),
            carry_size=_longs([step.numel_in(p) for p in self.carry]),
            out_res=_longs([names_out.index(p) for p in self.outputs]),
            out_size=_longs([step.numel_out(p) for p in self.outputs]),
            sz_arg=max(step.sz_arg(), len(names_in)),
            sz_res=max(step.sz_res(), len(names_out)),
            sz_iw=max(step.sz_iw(), 1),
            sz_w=max(step.sz_w(), 1),
        )

    def __call__(
        self,
        n: int,
        values: Mapping[str, Array],
        *,
        every: int = 1,
        ports: Collection[str] | None = None,
    ) -> dict[str, Array]:
        """Run `n` samples.
        n : number of samples.
        values : one array for every input of the step: carried ports their start, ports of `over`
            one row a sample (n, size), constants their value. Matrices have the port's shape.
        every : record each `every`-th sample.
        ports : carried ones and other outputs that are recorded; None records all. Memory that is
            written for the first time takes as long as a step does.

        Returns
        -------
        For each carried port `p` its value as `p_final` after the last step; for those that are
        recorded before each recorded step (n_recorded, *shape), and as `p_all` both (n_recorded +
        1, *shape); for each other output that is recorded its value (n_recorded, *shape). Column
        vectors have the shape (n_recorded, size).
        """
        packed = self.packed(n, values)
        if every < 1:
            raise ValueError(f"every must be at least 1, it is {every}")
        recorded = set(self.carry) | set(self.outputs)
        if ports is not None:
            if unknown := sorted(set(ports) - recorded):
                raise ValueError(
                    f"{self.step.name()} records no {unknown}, only {sorted(recorded)}"
                )
            recorded &= set(ports)
        return (
            self._run_virtual_machine(n, packed, every, recorded)
            if self.loop is None
            else self._run_compiled(self.loop, n, packed, every, recorded)
        )

    def packed(self, n: int, values: Mapping[str, Array]) -> dict[str, Array]:
        """Check shapes; flatten matrices by columns, as CasADi stores them.
        n : number of samples.
        """
        if values.keys() != self._size_in.keys():
            expected = set(self._size_in)
            missing, unknown = sorted(expected - set(values)), sorted(set(values) - expected)
            raise ValueError(
                f"{self.step.name()}: missing inputs {missing}, unknown inputs {unknown}"
            )
        packed = {}
        for port, value in values.items():
            rows, columns = self._size_in[port]
            array = np.asarray(value, dtype=np.float64)
            expected_shape = (n, rows * columns) if port in self.over else (rows, columns)
            if (
                array.ndim < 2
                and 1 in expected_shape
                and array.size == expected_shape[0] * expected_shape[1]
            ):
                array = array.reshape(expected_shape)  # a column given flat, a scalar given bare
            if array.shape != expected_shape:
                name = self.step.name()
                raise ValueError(
                    f"{name}: {port} must have shape {expected_shape}, not {array.shape}"
                )
            by_columns = array if port in self.over else array.ravel(order="F")
            packed[port] = np.ascontiguousarray(by_columns)
        return packed

    def _shape_all(self, record: dict[str, Array], last: dict[str, Array]) -> dict[str, Array]:
        """Return records, of carried ports with a row after the last, in the shapes of ports."""
        found = {f"{p}_final": _shaped(flat, self._size_in[p]) for p, flat in last.items()}
        for port, flat in record.items():
            if port in self.carry:
                flat[-1] = last[port]
                everything = _shaped(flat, self._size_in[port])
                found[f"{port}_all"] = everything
                found[port] = everything[:-1]
            else:
                found[port] = _shaped(flat, self._size_out[port])
        return found

    def _run_compiled(
        self,
        loop: "ctypes._NamedFuncPointer",
        n: int,
        packed: dict[str, Array],
        every: int,
        recorded: Collection[str],
    ) -> dict[str, Array]:
        n_rows = -(-n // every)
        now = [packed[p].copy() for p in self.carry]
        following = [np.empty_like(a) for a in now]
        record = {
            p: np.empty((n_rows + 1, a.size))
            for p, a in zip(self.carry, now, strict=True)
            if p in recorded
        } | {p: np.empty((n_rows, self.step.numel_out(p))) for p in self.outputs if p in recorded}
        scratch = [np.empty(self.step.numel_out(p)) for p in self.outputs]
        arguments, kept = self.arguments(n, every, packed, now, following, scratch, record)
        failed = loop(*arguments)
        del kept  # which the loop alone knows
        if failed:
            raise RuntimeError(f"{self.step.name()} reported a failure")
        last = dict(zip(self.carry, following if n % 2 else now, strict=True))
        return self._shape_all(record, last)

    def arguments(
        self,
        n: int,
        every: int,
        packed: Mapping[str, Array],
        now: Sequence[Array],
        following: Sequence[Array],
        scratch: Sequence[Array],
        record: Mapping[str, Array],
    ) -> tuple[list[object], list[NDArray[Any]]]:
        """Return the arguments of the compiled loop, and what must live as long as these.
        now, following : of carried ports, before and after a sample.   scratch : of the outputs.
        record : of ports that are recorded.
        """
        layout = self.layout
        kept: list[NDArray[Any]] = [np.empty(layout.sz_iw, dtype=np.int64), np.empty(layout.sz_w)]
        arguments: list[object] = [
            ctypes.c_long(n),
            ctypes.c_long(every),
            _pointers([packed[port] for port in self._size_in]),
            layout.arg_step,
            ctypes.c_long(len(self.carry)),
            layout.carry_arg,
            layout.carry_res,
            layout.carry_size,
            _pointers(now),
            _pointers(following),
            _pointers([record.get(port) for port in self.carry]),
            ctypes.c_long(len(self.outputs)),
            layout.out_res,
            layout.out_size,
            _pointers([record.get(port) for port in self.outputs]),
            _pointers(scratch),
            (ctypes.c_void_p * layout.sz_arg)(),
            (ctypes.c_void_p * layout.sz_res)(),
            *(one.ctypes.data_as(ctypes.c_void_p) for one in kept),
        ]
        return arguments, kept

    def _run_virtual_machine(
        self, n: int, packed: dict[str, Array], every: int, recorded: Collection[str]
    ) -> dict[str, Array]:
        step = self.step
        specialized = step.mapaccum(
            f"{step.name()}_{n}",
            n,
            [step.index_in(p) for p in self.carry],
            [step.index_out(f"{p}_next") for p in self.carry],
        )
        arguments = []
        for port in step.name_in():
            rows, columns = step.size_in(port)
            value = packed[port]
            if port in self.over:  # mapaccum lays samples side by side, (rows, n columns)
                arguments.append(value.reshape(n * columns, rows).T)
            else:
                start = value.reshape(columns, rows).T
                arguments.append(start if port in self.carry else np.tile(start, (1, n)))
        results = dict(
            zip(step.name_out(), specialized.call([ca.DM(a) for a in arguments]), strict=True)
        )
        record, last = {}, {}
        for port in self.carry:
            after = np.array(results[f"{port}_next"]).T.reshape(n, -1)
            last[port] = after[-1]
            if port in recorded:
                before = np.vstack([packed[port][None], after[:-1]])[::every]
                record[port] = np.vstack([before, after[-1:]])
        for port in (port for port in self.outputs if port in recorded):
            record[port] = np.array(results[port]).T.reshape(n, -1)[::every]
        return self._shape_all(record, last)


def _pointers(arrays: Sequence[Array | None]) -> "ctypes.Array[ctypes.c_void_p]":
    """Return where arrays begin, as C wants it.
    arrays : contiguous; the caller keeps them alive. None is nowhere.
    """
    places = (None if a is None else a.ctypes.data for a in arrays)
    return (ctypes.c_void_p * max(len(arrays), 1))(*places)


def _shaped(flat: Array, size: tuple[int, int]) -> Array:
    """Return rows of column-major numbers in their matrix shape; column vectors stay flat.
    flat : numbers (..., rows columns).   size : rows and columns of the port.
    """
    rows, columns = size
    if columns == 1:
        return flat
    return flat.reshape(*flat.shape[:-1], columns, rows).swapaxes(-1, -2)


def _longs(numbers: Sequence[int]) -> "ctypes.Array[ctypes.c_long]":
    """Return integers as C wants them."""
    return (ctypes.c_long * max(len(numbers), 1))(*numbers)


# A step function taken a few samples at a time: the compiled loop of a `Scan` with its memory kept.
#
# For what runs beside a car: nothing is laid out, checked or allocated anew at a sample.


class Stepper:
    """A run that goes on: write `inputs`, `advance`, read `outputs`; the bits of the `Scan`.

    Attributes `inputs` and `outputs` hold one array a port, always the same ones: of the ports of
    `over`, flat (size,) or, of several samples at once, one row a sample; and of the outputs that
    are not carried, those of the last sample, flat. Matrices lie by columns.
    values : start of the carried ports and the constants, by name.
    """

    def __init__(self, scan: Scan, values: Mapping[str, Array], samples: int = 1) -> None:
        step = scan.step
        rows = {port: np.zeros((samples, step.numel_in(port))) for port in scan.over}
        packed = scan.packed(samples, {**values, **rows})
        self._scan, self._constants = scan, {port: values[port] for port in scan.constants}
        self._sizes = {port: step.size_in(port) for port in scan.carry}
        self._samples, self._rows = samples, {port: packed[port] for port in scan.over}
        flat = samples == 1
        self.inputs = {port: row[0] if flat else row for port, row in self._rows.items()}
        self.outputs = {port: np.zeros(step.numel_out(port)) for port in scan.outputs}
        self._now = {port: packed[port].copy() for port in scan.carry}
        self._before = {port: np.empty_like(array) for port, array in self._now.items()}
        self._loop = scan.loop
        if self._loop is not None:
            now, before, out = (
                list(one.values()) for one in (self._now, self._before, self.outputs)
            )
            self._arguments, kept = scan.arguments(samples, samples, packed, now, before, out, {})
            self._kept = [*packed.values(), *kept]  # that only the loop knows

    def advance(self) -> None:
        """Take the samples that `inputs` holds; leave what the last one tells in `outputs`."""
        if self._loop is None:
            self._advance_slowly()
            return
        if self._loop(*self._arguments):
            raise RuntimeError(f"{self._scan.step.name()} reported a failure")
        if self._samples % 2:
            self._now, self._before = self._before, self._now

    def _advance_slowly(self) -> None:
        n = self._samples
        record = self._scan(n, {**self.state(), **self._rows, **self._constants})
        for port, array in self.outputs.items():
            array[:] = record[port][-1].ravel(order="F")
        for port, array in self._now.items():
            self._before[port][:] = record[port][-1].ravel(order="F")
            array[:] = record[f"{port}_final"].ravel(order="F")

    def begin(self, port: str, value: Array) -> None:
        """Go on from another value of a carried port.
        value : (rows, columns) of the port, flat where it is a column.
        """
        self._now[port][:] = np.ravel(value, order="F")

    def before(self, port: str) -> Array:
        """Return the value of one carried port before the last sample, in its shape; a copy."""
        return _shaped(self._before[port], self._sizes[port]).copy()

    def state(self) -> dict[str, Array]:
        """Return the carried values in effect, by port, in their shapes; copies."""
        return {port: self.value(port) for port in self._now}

    def value(self, port: str) -> Array:
        """Return the value of one carried port in effect, in its shape; a copy."""
        return _shaped(self._now[port], self._sizes[port]).copy()
