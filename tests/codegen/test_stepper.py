"""A step taken sample by sample carries and tells the bits of the loop over all of them."""

import casadi as ca
import numpy as np
import pytest

import codegen.scan
from codegen import Scan, Stepper


@pytest.fixture(params=["compiled", "virtual machine"])
def scan(request, monkeypatch, tmp_path):
    monkeypatch.setenv("TIREID_CACHE", str(tmp_path))
    if request.param == "virtual machine":
        monkeypatch.setattr(codegen.scan, "load_library", lambda *_: None)
    M, s, u, c = ca.SX.sym("M", 2, 3), ca.SX.sym("s", 2), ca.SX.sym("u", 3), ca.SX.sym("c")
    step = ca.Function(
        "stepped",
        [M, s, u, c],
        [0.9 * M + c * ca.sin(s) @ u.T, 0.5 * s + M @ u, M @ ca.exp(u), 2 * M],
        ["M", "s", "u", "c"],
        ["M_next", "s_next", "y", "twice"],
    )
    return Scan(step, carry=("M", "s"), over=("u",))


@pytest.mark.parametrize("n", [1, 8, 9])
def test_steps_are_bit_equal_to_the_loop(scan, rng, n):
    start = {"M": rng.normal(size=(2, 3)), "s": rng.normal(size=2), "c": np.array(0.1)}
    u = rng.normal(size=(n, 3))
    whole = scan(n, {**start, "u": u})
    stepper = Stepper(scan, start)
    for k in range(n):
        for port in ("M", "s"):
            np.testing.assert_array_equal(stepper.state()[port], whole[port][k])
        stepper.inputs["u"][:] = u[k]
        stepper.advance()
        np.testing.assert_array_equal(stepper.outputs["y"], whole["y"][k])
        np.testing.assert_array_equal(stepper.outputs["twice"].reshape(3, 2).T, whole["twice"][k])
    np.testing.assert_array_equal(stepper.state()["M"], whole["M_final"])
    np.testing.assert_array_equal(stepper.state()["s"], whole["s_final"])


@pytest.mark.parametrize("samples", [2, 3])
def test_several_samples_at_once_are_bit_equal_to_the_loop(scan, rng, samples):
    start = {"M": rng.normal(size=(2, 3)), "s": rng.normal(size=2), "c": np.array(0.1)}
    u = rng.normal(size=(6, 3))
    whole = scan(6, {**start, "u": u})
    stepper = Stepper(scan, start, samples)
    for k in range(0, 6, samples):
        stepper.inputs["u"][:] = u[k : k + samples]
        stepper.advance()
        last = k + samples - 1
        np.testing.assert_array_equal(stepper.outputs["y"], whole["y"][last])
        for port in ("M", "s"):
            np.testing.assert_array_equal(stepper.before(port), whole[port][last])
            np.testing.assert_array_equal(stepper.value(port), whole[f"{port}_all"][last + 1])


@pytest.mark.parametrize("samples", [1, 2])
def test_a_run_goes_on_from_another_state(scan, rng, samples):
    start = {"M": rng.normal(size=(2, 3)), "s": rng.normal(size=2), "c": np.array(0.1)}
    other, u = rng.normal(size=(2, 3)), rng.normal(size=(samples, 3))
    stepper = Stepper(scan, start, samples)
    for _ in range(2):
        stepper.begin("M", other)
        stepper.begin("s", start["s"])
        stepper.inputs["u"][:] = u
        stepper.advance()
        expected = scan(samples, {**start, "M": other, "u": u})
        np.testing.assert_array_equal(stepper.value("M"), expected["M_final"])
        np.testing.assert_array_equal(stepper.outputs["y"], expected["y"][-1])


def test_the_values_at_the_start_stay_the_callers(scan, rng):
    start = {"M": np.asfortranarray(rng.normal(size=(2, 3))), "s": rng.normal(size=2)}
    kept = {port: value.copy() for port, value in start.items()}
    stepper = Stepper(scan, {**start, "c": np.array(0.1)})
    stepper.inputs["u"][:] = 1.0
    state = stepper.state()
    stepper.advance()
    for port, value in kept.items():
        np.testing.assert_array_equal(start[port], value)
        np.testing.assert_array_equal(state[port], value)  # a copy, not a view


def test_a_wrong_shape_is_refused_at_the_start(scan):
    with pytest.raises(ValueError, match=r"s must have shape \(2, 1\)"):
        Stepper(scan, {"M": np.zeros((2, 3)), "s": np.zeros(3), "c": np.array(0.1)})
