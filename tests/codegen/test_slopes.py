"""Slopes that run along a scan are the Jacobian of the whole run, unrolled by CasADi."""

import casadi as ca
import numpy as np
import pytest

import codegen.scan
from codegen import Scan
from codegen.slopes import Tape

N, CARRY = 6, ("state",)


def stages(tape, state, p, u):
    """Two states, one of which knows no state; three parameters."""
    (force,) = tape.staged(lambda x, a: [a * ca.sin(x) * u], state[0], p[0])
    (x,) = tape.staged(lambda x, force, b: [0.5 * x + b * force], state[0], force, p[1])
    (y,) = tape.staged(lambda c: [c * c * u], p[2])
    (e,) = tape.staged(lambda x, y: [x * y], x, state[1])
    return [x, y], [e, force]


def made():
    ports = {name: ca.SX.sym(name, n) for name, n in (("state", 2), ("u", 2), ("p", 3))}
    tape = Tape(3)
    state = [tape.state(k, ports["state"][k]) for k in range(2)]
    p = [tape.parameter(k, ports["p"][k]) for k in range(3)]
    u, on = ca.vertsplit(ports["u"])
    after, shown = stages(tape, state, p, u)
    factors, program = tape.finished(after, shown)
    out = {
        "state_next": on * ca.vertcat(*(one.value for one in after)),
        "shown": on * ca.vertcat(*(one.value for one in shown)),
        "factors": ca.vertcat(on, factors),
    }
    step = ca.Function("sloped", [*ports.values()], [*out.values()], [*ports], [*out])
    return step, program


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("some", [(0, 1, 2), (2, 0)])
def test_slopes_of_chosen_parameters_are_those_of_the_whole_run(monkeypatch, compiled, some):
    if not compiled:
        monkeypatch.setattr(codegen.scan, "load_library", lambda *_: None)
    step, program = made()
    scan = Scan(step, carry=CARRY, over=("u",), slopes=(program, some))
    rng = np.random.default_rng(1)
    u = np.column_stack([rng.standard_normal(N), [1, 1, 1, 0, 1, 1]])  # a sample that is left out
    p = rng.standard_normal(3)
    found = scan(N, {**scan.zeros(), "state": np.array([0.3, 0.7]), "u": u, "p": p})
    symbols, state, shown = ca.SX.sym("p", 3), ca.SX([0.3, 0.7]), []
    for row in u:
        state, out, _ = step(state, row, symbols)
        shown.append(out)
    for k, out in enumerate(shown):
        J = ca.Function("J", [symbols], [ca.jacobian(out, symbols)])(p)
        np.testing.assert_allclose(found["slopes"][k], np.array(J)[:, some], atol=1e-14)
    every = scan(N, {**scan.zeros(), "state": np.array([0.3, 0.7]), "u": u, "p": p}, every=2)
    np.testing.assert_array_equal(every["slopes"], found["slopes"][::2])
