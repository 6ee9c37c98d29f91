"""A step function folded over samples, in one compiled loop.

Without a C compiler that works the CasADi virtual machine does the same, more slowly.
"""

import ctypes
import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array
from codegen.compiler import CompilationError, load_library
from codegen.slopes import Program

log = logging.getLogger("tireid.codegen")

TANGENT, SLOPES, FACTORS = "tangent", "slopes", "factors"  # ports of slopes that run along
_BEYOND = 2  # of them at most behind the arguments of a step, and behind its results

# k runs over samples. Carried ports alternate between two buffers; every other output is written
# straight into the record on recorded samples and into scratch memory on the others. Ports without
# a record are not recorded.
LOOP = """
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
    {rows}
    for (i = 0; i < n_carry; ++i) {{
      swap = carry_now[i];
      carry_now[i] = carry_next[i];
      carry_next[i] = swap;
    }}
  }}
  return 0;
}}
"""


class _Memory(NamedTuple):
    """Where a run reads and writes, flat arrays by columns.
    packed : of each input.   now, following : of carried ports, before and after a sample; they
        change places at each.
    spare : of the outputs, where they are not recorded.   record : of ports that are recorded.
    """

    packed: Mapping[str, Array]
    now: Sequence[Array]
    following: Sequence[Array]
    spare: Sequence[Array]
    record: Mapping[str, Array]


class Scan:
    """A step function run over samples, `carry, outputs = step(carry, sample, constants)`.
    step : a function with named, dense ports. An input `p` named in `carry` has an output `p_next`
        of the same shape. Its name becomes part of a C identifier.
    over : inputs with one row a sample. Every other input is constant.
    flags : of the compiler; None takes `codegen.compiler.FLAGS`.
    slopes : those that run along, of which the step's output `factors` makes rows, and the
        parameters that they are asked for, by column; None where there are none. The scan then
        carries `tangent` beside the states, and an output `slopes` comes out.
    """

    def __init__(
        self,
        step: ca.Function,
        *,
        carry: tuple[str, ...],
        over: tuple[str, ...],
        flags: tuple[str, ...] | None = None,
        slopes: tuple[Program, Sequence[int]] | None = None,
    ) -> None:
        name = step.name()
        self._size_in = {p: step.size_in(p) for p in step.name_in()}
        self._size_out = {p: step.size_out(p) for p in step.name_out()}
        for port in (*carry, *over):
            if port not in self._size_in:
                raise ValueError(f"{name} has no input {port!r}, only {[*self._size_in]}")
        for port in carry:
            if self._size_out.get(after := f"{port}_next") != self._size_in[port]:
                known = [*self._size_out]
                raise ValueError(f"{name} has no output {after!r} as large as {port}, only {known}")
        ports = [*map(step.sparsity_in, self._size_in), *map(step.sparsity_out, self._size_out)]
        if not all(port.is_dense() for port in ports):
            raise ValueError(f"{name}: inputs and outputs must be dense")
        self._place_in = {p: step.index_in(p) for p in self._size_in}
        self._place_out = {p: step.index_out(p) for p in self._size_out}
        self._program = None if slopes is None else slopes[0]
        if slopes is not None:  # their ports stand behind those of the step, which knows nothing
            program, some = slopes
            self._columns = program.columns(some)
            size = len(program.rows) * int(self._columns[1])
            self._size_in[TANGENT] = self._size_out[f"{TANGENT}_next"] = size, 1
            self._size_out[SLOPES] = len(program.shown), len(some)
            self._place_in[TANGENT] = max(step.sz_arg(), step.n_in())
            self._place_out[f"{TANGENT}_next"] = max(step.sz_res(), step.n_out())
            self._place_out[SLOPES] = self._place_out[f"{TANGENT}_next"] + 1
            carry = (*carry, TANGENT)
        self.step = step
        self.carry = carry
        self.over = over
        self.flags = flags
        self.constants = tuple(p for p in self._size_in if p not in carry and p not in over)
        self.outputs = tuple(p for p in self._size_out if p.removesuffix("_next") not in carry)

    def zeros(self) -> dict[str, Array]:
        """Return zeros of every carried port, in its shape."""
        sizes = {port: self._size_in[port] for port in self.carry}
        return {p: np.zeros(n if m == 1 else (n, m)) for p, (n, m) in sizes.items()}

    def __getstate__(self) -> dict[str, object]:
        """Return what it is made of: the loop of this process is loaded anew in another."""
        return {name: value for name, value in vars(self).items() if name != "loop"}

    @cached_property
    def loop(self) -> "ctypes._NamedFuncPointer | None":
        """The compiled loop, or None where it cannot be had; then the log says why."""
        name = self.step.name()
        generator = ca.CodeGenerator(f"{name}.c")
        generator.add(self.step)
        try:
            source, rows = generator.dump() + "#include <string.h>\n", ""
            if self._program is not None:
                source += self._program.source(name)
                at, out = self._place_in[TANGENT], self._place_out
                columns = f"(const long long*)call_arg[{at + 1}]"
                rows = f"{name}_rows(call_res[{out[FACTORS]}], call_arg[{at}], "
                rows += f"call_res[{out[TANGENT + '_next']}], call_res[{out[SLOPES]}], {columns});"
            source += LOOP.format(name=name, rows=rows)
            library = load_library(source, name, self.flags)
        except (CompilationError, OSError) as error:
            reason = " ".join(str(error).split())
            log.warning("running in the CasADi virtual machine, more slowly: %s", reason)
            return None
        return None if library is None else library[f"{name}_scan"]

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
        packed, step = self.packed(n, values), self.step
        recorded = (set(self.carry) | set(self.outputs)) - {FACTORS}
        if ports is not None:
            if unknown := sorted(set(ports) - recorded):
                raise ValueError(f"{step.name()} records no {unknown}, only {sorted(recorded)}")
            recorded &= set(ports)
        rows = -(-n // every)
        sizes = {p: (rows + 1, packed[p].size) for p in self.carry}
        sizes |= {p: (rows, self._numel(p)) for p in self.outputs}
        record = {p: np.empty(size) for p, size in sizes.items() if p in recorded}
        now = [packed[p].copy() for p in self.carry]
        following = [np.empty_like(a) for a in now]
        spare = [np.empty(self._numel(p)) for p in self.outputs]
        self.runner(n, _Memory(packed, now, following, spare, record), every)()
        last = dict(zip(self.carry, following if n % 2 else now, strict=True))
        return self._shape_all(record, last)

    def _numel(self, output: str) -> int:
        rows, columns = self._size_out[output]
        return rows * columns

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
            shape = (n, rows * columns) if port in self.over else (rows, columns)
            if array.ndim < 2 and 1 in shape and array.size == shape[0] * shape[1]:
                array = array.reshape(shape)  # a column given flat, a scalar given bare
            if array.shape != shape:
                name = self.step.name()
                raise ValueError(f"{name}: {port} must have shape {shape}, not {array.shape}")
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

    def runner(self, n: int, memory: _Memory, every: int = 1) -> Callable[[], None]:
        """Return what runs samples in this memory; the next call goes on where one ended."""
        step, loop = self.step, self.loop
        if loop is None:
            return self._virtual_machine(n, memory, every)
        packed, now, following, spare, record = memory
        carry, outputs = self.carry, self.outputs
        work = np.empty(max(step.sz_iw(), 1), dtype=np.int64), np.empty(max(step.sz_w(), 1))
        given: list[tuple[int, NDArray[Any], bool]] = [
            (self._place_in[p], packed[p], p in self.over) for p in self._size_in
        ]
        if self._program is not None:
            given.append((self._place_in[TANGENT] + 1, self._columns, False))
        begins: list[NDArray[Any] | None] = [None] * (max(place for place, *_ in given) + 1)
        strides = [0] * len(begins)
        for place, values, each in given:
            begins[place], strides[place] = values, values.shape[1] if each else 0
        arguments: list[object] = [
            ctypes.c_long(n),
            ctypes.c_long(every),
            _pointers(begins),
            _longs([*strides, -1]),
            ctypes.c_long(len(carry)),
            _longs([self._place_in[p] for p in carry]),
            _longs([self._place_out[f"{p}_next"] for p in carry]),
            _longs([packed[p].size for p in carry]),
            _pointers(now),
            _pointers(following),
            _pointers([record.get(p) for p in carry]),
            ctypes.c_long(len(outputs)),
            _longs([self._place_out[p] for p in outputs]),
            _longs([self._numel(p) for p in outputs]),
            _pointers([record.get(p) for p in outputs]),
            _pointers(spare),
            (ctypes.c_void_p * (max(step.sz_arg(), step.n_in()) + _BEYOND))(),
            (ctypes.c_void_p * (max(step.sz_res(), step.n_out()) + _BEYOND))(),
            *(one.ctypes.data_as(ctypes.c_void_p) for one in work),
        ]

        def run(_alive: object = (memory, work)) -> None:  # as long as the pointers
            if loop(*arguments):
                raise RuntimeError(f"{step.name()} reported a failure")

        return run

    def _virtual_machine(self, n: int, memory: _Memory, every: int) -> Callable[[], None]:
        """Return what does the same as the compiled loop, statement by statement of `LOOP`."""
        step = self.step
        packed, now, following, spare, record = memory
        made: Any = step.buffer()
        buffer, evaluate = made

        def run() -> None:
            nonlocal now, following
            for k in range(n):
                row, skipped = divmod(k, every)
                for port in (*self.over, *self.constants):
                    value = packed[port][k] if port in self.over else packed[port]
                    buffer.set_arg(step.index_in(port), value.data)
                for port, before, after in zip(self.carry, now, following, strict=True):
                    if port != TANGENT:
                        buffer.set_arg(step.index_in(port), before.data)
                        buffer.set_res(step.index_out(f"{port}_next"), after.data)
                    if not skipped and port in record:
                        record[port][row] = before
                out = dict(zip(self.outputs, spare, strict=True))
                out |= {port: record[port][row] for port in out if port in record and not skipped}
                for port, here in out.items():
                    if port != SLOPES:
                        buffer.set_res(step.index_out(port), here.data)
                evaluate()
                if self._program is not None:  # its tangent is carried last
                    program, c = self._program, out[FACTORS]
                    program.follow(c, now[-1], following[-1], out[SLOPES], self._columns)
                now, following = following, now

        return run


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
        self._sizes = {port: step.size_in(port) for port in scan.carry}
        self._samples = samples
        flat = samples == 1
        self.inputs = {p: packed[p][0] if flat else packed[p] for p in scan.over}
        self.outputs = {port: np.zeros(step.numel_out(port)) for port in scan.outputs}
        self._now = {port: packed[port].copy() for port in scan.carry}
        self._before = {port: np.empty_like(array) for port, array in self._now.items()}
        now, before, spare = (list(a.values()) for a in (self._now, self._before, self.outputs))
        self._run = scan.runner(samples, _Memory(packed, now, before, spare, {}))

    def advance(self) -> None:
        """Take the samples that `inputs` holds; leave what the last one tells in `outputs`."""
        self._run()
        if self._samples % 2:
            self._now, self._before = self._before, self._now

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
