"""Plain C from scalars: compiled and compared with CasADi, bit by bit."""

import ctypes
import re

import casadi as ca
import numpy as np
import pytest

from codegen import clean_c, find_compiler, load_library
from codegen.clean_c import Statements, literal, recognized
from codegen.graph import UnknownOperationError, graph_of

PREAMBLE = """#include <math.h>
#include <stdbool.h>
#include <stdint.h>
typedef double t_real;
#define T_C(x) x
#define T_PICK(x, y) y
#define T_SQRT(x) sqrt(x)
#define T_FABS(x) fabs(x)
#define T_FLOOR(x) floor(x)
"""

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="needs a C compiler")


def statements(function, *, sums=False):
    return Statements(
        recognized(graph_of(function)),
        prefix="t",
        read=lambda port, entry: f"in[{entry}]",
        write=lambda port, entry: f"out[{entry}]",
        sums=sums,
    )


def run_in_c(function, given):
    text = statements(function).block()
    source = f"{PREAMBLE}void t_f(const double *in, double *out)\n{{\n{text}}}\n"
    library = load_library(source, "clean_c_test")
    out = np.empty(function.numel_out(0))
    pointers = [ctypes.c_void_p(a.ctypes.data) for a in (np.ascontiguousarray(given), out)]
    library.t_f(*pointers)
    return out


def everything():
    x = ca.SX.sym("x", 6)
    a, b, c, d, e, f = ca.vertsplit(x)
    yes = ca.logic_or(ca.logic_and(a < b, c <= d), ca.logic_not(e == f))
    return ca.Function(
        "f",
        [x],
        [
            ca.vertcat(
                a + b * c - d / (1 + e * e),
                ca.sqrt(ca.fabs(a)) - ca.fabs(b),
                ca.fmin(a, b) + 3 * ca.fmax(c, d),
                ca.if_else(yes, a * b, c),
                ca.if_else(a < b, a, 0),
                (a < b) * c + (c != d),
                -a / b + 1 / c,
                a**2 * 1e-300 / 1e-300,
                ca.if_else(a, b, c),
                ca.sign(a) * ca.floor(b) + ca.sign(c * d),
            )
        ],
    )


@needs_compiler
def test_every_operation_computes_what_casadi_does(rng):
    function = everything()
    for _ in range(200):
        given = rng.normal(size=6) * rng.integers(0, 3, size=6)
        given[given == 0.0] = rng.choice([0.0, 1.0, -2.0])
        with np.errstate(all="ignore"):
            np.testing.assert_array_equal(
                run_in_c(function, given), np.array(function(given)).ravel()
            )


@needs_compiler
def test_a_wrong_operator_would_be_seen(rng, monkeypatch):
    monkeypatch.setattr(clean_c, "BINARY", {**clean_c.BINARY, "sub": "+"})
    given = rng.normal(size=6)
    function = everything()
    assert (run_in_c(function, given) != np.array(function(given)).ravel()).any()


def test_deep_expressions_are_cut_into_named_pieces():
    x = ca.SX.sym("x")
    value = x
    for k in range(2000):
        value = (value + 0.001 * k) * 0.999
    lines = statements(ca.Function("f", [x], [value])).lines
    assert max(map(len, lines)) < 200


@pytest.mark.parametrize("value", [0.0, 1.0, -2.5, 1e-7, 123456789.0, 1e22, 0.1, 1 / 3, -1e-12])
def test_literals_read_back_as_the_same_number(value):
    text = re.fullmatch(r"T_C\((.*)\)", literal(value, "t"))[1]
    assert float(text) == value
    assert "." in text


def test_numbers_that_float_does_not_have_are_chosen_by_precision():
    assert literal(1e-300, "t") == "T_PICK(1.2e-38, 1.0e-300)"
    assert literal(-1e300, "t") == "T_PICK(-3.4e+38, -1.0e+300)"


def test_an_operation_without_plain_c_is_refused():
    x = ca.SX.sym("x")
    with pytest.raises(UnknownOperationError, match="no plain C for log"):
        statements(ca.Function("f", [x], [ca.log(x)]))


def many(n):
    """Many results, each a long sum of what the others read, too."""
    x = ca.SX.sym("x", 6)
    sums = [sum(ca.sin(float(i + k)) * x[k] * x[(i + k) % 6] for k in range(6)) for i in range(n)]
    return ca.Function("f", [x], [ca.vertcat(*(one / (1 + ca.sumsqr(x)) for one in sums))])


@pytest.mark.sweep("20")
@needs_compiler
@pytest.mark.parametrize("n", [20, 200])
def test_many_results_are_those_of_casadi_and_so_is_their_sum(n, rng):
    function, given = many(n), rng.normal(size=6)
    text = statements(function, sums=True).block()
    source = f"{PREAMBLE}double t_f(const double *in, double *out)\n{{\n{text}}}\n"
    library = load_library(source, "clean_c_sum")
    library.t_f.restype = ctypes.c_double
    out = np.empty(n)
    for changed in (given, np.where(np.arange(6) == 2, np.nan, given)):
        inputs = np.ascontiguousarray(changed)
        total = library.t_f(*(ctypes.c_void_p(a.ctypes.data) for a in (inputs, out)))
        np.testing.assert_array_equal(out, np.array(function(inputs)).ravel())
        assert total == pytest.approx(out.sum(), nan_ok=True)
        assert np.isfinite(total) == np.isfinite(out).all()


def test_of_many_results_those_that_need_least_are_written_first():
    x = ca.SX.sym("x", 3)
    deep = x[0]
    for _ in range(40):
        deep = 1 / (deep + x[1])
    shallow = [x[2] * float(i + 2) for i in range(200)]
    text = statements(ca.Function("f", [x], [ca.vertcat(deep, *shallow)])).block()
    assert text.index("out[200] = ") < text.index("out[0] = ")
