"""Slopes over parameters that run along with a compiled loop, by the chain rule, stage by stage.

A stage has few inputs and is differentiated once. What depends on states has a row of slopes over
all parameters: factors times rows before it, those of the states before the sample among them, and
slopes that no state enters. The step tells the factors; the rows are loops over the columns that
are asked for. So one compiled step serves any choice of them, and several columns are computed at
once.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from codegen.arrays import Array


class Dual(NamedTuple):
    """A value with its slopes: over the parameters, (1, p), and over rows of a `Tape`."""

    value: Any
    slopes: Any
    rows: Mapping[int, Any] = {}


class _Row(NamedTuple):
    """A row of slopes, by numbers of factors.
    terms : rows and their factors; -1 - k is the row of state k before the sample.
    slopes : parameters and the slopes over them.
    """

    terms: Mapping[int, int]
    slopes: Mapping[int, int]


class Tape:
    """What stages make of duals: rows of slopes, each from those before it.
    parameters : how many there are, p.
    """

    def __init__(self, parameters: int) -> None:
        self._p = parameters
        self._rows: list[Dual] = []

    def state(self, k: int, value: Any) -> Dual:
        """Return state k before the sample."""
        return Dual(value, ca.SX(1, self._p), {-1 - k: ca.SX(1)})

    def parameter(self, k: int, value: Any) -> Dual:
        slopes = ca.SX(1, self._p)
        slopes[0, k] = 1
        return Dual(value, slopes)

    def constant(self, value: Any) -> Dual:
        return Dual(value, ca.SX(1, self._p))

    def staged(self, equations: Callable[..., Sequence[Any]], *inputs: Dual) -> list[Dual]:
        """Return what equations make of a few inputs, differentiated once, and its slopes.
        equations : of symbols in place of the inputs, and of others, which have no slopes.
        """
        if not any(one.rows or one.slopes.nnz() for one in inputs):
            return [self.constant(one) for one in equations(*(one.value for one in inputs))]
        symbols = [ca.SX.sym(f"stage_{i}") for i in range(len(inputs))]
        x, y = ca.vertcat(*symbols), ca.vertcat(*equations(*symbols))
        names = {one.name() for one in symbols}
        free = ca.vertcat(*(one for one in ca.symvar(y) if one.name() not in names))
        stage = ca.Function("stage", [x, free], [y, ca.jacobian(y, x)])
        value, J = stage(ca.vertcat(*(one.value for one in inputs)), free)
        slopes = ca.mtimes(J, ca.vertcat(*(one.slopes for one in inputs)))
        found = []
        for i in range(value.shape[0]):
            rows: dict[int, Any] = {}
            for k, one in enumerate(inputs):
                if J.sparsity().has_nz(i, k):
                    for row, factor in one.rows.items():
                        rows[row] = rows.get(row, 0) + J[i, k] * factor
            dual = Dual(value[i], slopes[i, :], rows)
            found.append(self._row(dual) if rows else dual)
        return found

    def _row(self, dual: Dual) -> Dual:
        self._rows.append(dual)
        return Dual(dual.value, ca.SX(1, self._p), {len(self._rows) - 1: ca.SX(1)})

    def finished(self, states: Sequence[Dual], shown: Sequence[Dual]) -> tuple[Any, "Program"]:
        """Return the factors (k,), and how rows are made of them; what nothing reads is left out.
        states : after the sample.   shown : whose slopes come out.
        """
        ends = [next(iter((one if one.rows else self._row(one)).rows)) for one in (*states, *shown)]
        alive = set(ends)
        for row in reversed(range(len(self._rows))):
            if row in alive:
                alive |= {one for one in self._rows[row].rows if one >= 0}
        factors: list[Any] = []
        place = {row: k for k, row in enumerate(sorted(alive))}

        def numbered(values: Mapping[int, Any]) -> dict[int, int]:
            first = len(factors)
            factors.extend(values.values())
            return {key: first + k for k, key in enumerate(values)}

        rows = []
        for row in sorted(alive):
            dual = self._rows[row]
            slopes = ca.sparsify(dual.slopes)
            columns = slopes.sparsity().get_triplet()[1]
            terms = {place.get(one, one): factor for one, factor in dual.rows.items()}
            over = {column: slopes.nz[k] for k, column in enumerate(columns)}
            rows.append(_Row(numbered(terms), numbered(over)))
        places = [place[row] for row in ends]
        return ca.vertcat(*factors), Program(rows, places[: len(states)], places[len(states) :])


class Program(NamedTuple):
    """Rows in the order in which they are made.
    states : rows of the states after a sample.   shown : rows that come out.
    """

    rows: Sequence[_Row]
    states: Sequence[int]
    shown: Sequence[int]

    def width(self, n: int) -> int:
        """Return how wide rows of n columns are: whole vectors of a processor."""
        return -(-n // _VECTOR) * _VECTOR

    def columns(self, some: Sequence[int]) -> NDArray[np.int64]:
        """Return what `NAME_rows` reads: n, the width m, where the slopes of each row begin, and
        of each slope its place in the rows and its factor.
        some : parameters by column, (n,).
        """
        column, m = {of: k for k, of in enumerate(some)}, self.width(len(some))
        listed = [
            [(k * m + column[of], one + 1) for of, one in row.slopes.items() if of in column]
            for k, row in enumerate(self.rows)
        ]
        begins = np.cumsum([0, *map(len, listed)])
        places = np.array([pair for row in listed for pair in row]).reshape(-1, 2)
        return np.concatenate([[len(some), m], begins, *places.T]).astype(np.int64)

    def source(self, name: str) -> str:
        """Return NAME_rows in C: the rows after a sample from factors and the rows before it.

        The first factor says whether there are slopes at all.
        """

        def read(row: int) -> str:
            return f"y[{row} * m + j]" if row >= 0 else f"x[{self.states[-1 - row]} * m + j]"

        lines = []
        for k, (terms, _) in enumerate(self.rows):
            total = " + ".join(f"c[{one + 1}] * {read(row)}" for row, one in terms.items()) or "0"
            lines.append(_ROW.format(k=k, total=total))
        few = len(self.shown)
        lines += [
            f"  for (j = 0; j < n; ++j) out[{few} * j + {i}] = y[{row} * m + j];"
            for i, row in enumerate(self.shown)
        ]
        text = "\n".join(lines)
        return _ROWS.format(name=name, rows=len(self.rows), shown=few, lines=text, last=_VECTOR - 1)

    def follow(self, c: Array, x: Array, y: Array, out: Array, columns: NDArray[np.int64]) -> None:
        """Do the same as the C, in Python.
        c : factors.   x, y : rows before and after the sample, flat.   out : (shown n,).
        """
        n, m, begins = columns[0], columns[1], columns[2 : 3 + len(self.rows)]
        places, of = columns[3 + len(self.rows) :].reshape(2, -1)
        before, after = x.reshape(-1, m), y.reshape(-1, m)
        y[:] = 0.0
        for k, (terms, _) in enumerate(self.rows if c[0] > 0.0 else ()):
            for row, one in terms.items():
                source = after[row] if row >= 0 else before[self.states[-1 - row]]
                after[k] += c[one + 1] * source
            some = slice(begins[k], begins[k + 1])
            y[places[some]] += c[of[some]]
        out[:] = after[list(self.shown), :n].ravel(order="F")


_VECTOR = 4  # numbers of the longest vector that compilers are asked for
_ROW = """\
#pragma GCC ivdep
  for (j = 0; j < m; ++j) y[{k} * m + j] = {total};
  for (j = begins[{k}]; j < begins[{k} + 1]; ++j) y[places[j]] += c[of[j]];"""
_ROWS = """
static void {name}_rows(const double* c, const double* x, double* y, double* out,
                        const long long* columns) {{
  const long n = (long)columns[0], m = (long)columns[1] & ~{last}L;
  const long long *begins = columns + 2, *places = begins + {rows} + 1;
  const long long *of = places + begins[{rows}];
  long j;
  if (!(c[0] > 0)) {{
    memset(y, 0, (size_t)({rows} * m) * sizeof(double));
    memset(out, 0, (size_t)({shown} * n) * sizeof(double));
    return;
  }}
{lines}
}}
"""
