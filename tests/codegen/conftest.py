"""A step with a matrix and a vector as state, compiled and in the virtual machine."""

import casadi as ca
import numpy as np
import pytest

import codegen.scan
from codegen import Scan


def leaky_step() -> ca.Function:
    """A matrix and a vector state, a sample input and a constant."""
    M, s, u, c = ca.SX.sym("M", 2, 3), ca.SX.sym("s", 2), ca.SX.sym("u", 3), ca.SX.sym("c")
    M_next = 0.9 * M + c * ca.sin(s) @ u.T
    s_next = 0.5 * s + M @ u
    return ca.Function(
        "leaky",
        [M, s, u, c],
        [M_next, s_next, M @ ca.exp(u), M[0, 1], 2 * M],
        ["M", "s", "u", "c"],
        ["M_next", "s_next", "y", "corner", "twice"],
    )


@pytest.fixture
def cache(monkeypatch, tmp_path):
    monkeypatch.setenv("TIREID_CACHE", str(tmp_path))
    return tmp_path


@pytest.fixture(params=["compiled", "virtual machine"])
def scan(request, monkeypatch, cache):
    if request.param == "virtual machine":
        monkeypatch.setattr(codegen.scan, "load_library", lambda *_: None)
    return Scan(leaky_step(), carry=("M", "s"), over=("u",))


@pytest.fixture
def values(rng):
    """Where the step starts, and eight samples."""
    start = {"M": rng.normal(size=(2, 3)), "s": rng.normal(size=2), "c": np.array(0.1)}
    return start | {"u": rng.normal(size=(8, 3))}
