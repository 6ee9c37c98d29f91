"""The compiled loop, the virtual machine and a loop written by hand compute the same."""

import casadi as ca
import numpy as np
import pytest

import codegen.scan
from codegen import CompilationError, Scan, Stepper
from tests.codegen.conftest import leaky_step


def by_hand(M, s, u, c):
    rows = []
    for row in u:
        rows.append((M, s, M @ np.exp(row), M[0, 1], 2 * M))
        M, s = 0.9 * M + c * np.outer(np.sin(s), row), 0.5 * s + M @ row
    return {"M_final": M, "s_final": s}, rows


@pytest.mark.parametrize("n", [1, 7, 8])
@pytest.mark.parametrize("every", [1, 3])
def test_scan_repeats_the_loop_by_hand(scan, values, n, every):
    values["u"] = values["u"][:n]
    before = {port: value.copy() for port, value in values.items()}
    expected, rows = by_hand(**values)
    record = scan(n, values, every=every)
    for k, port in enumerate(("M", "s", "y", "corner", "twice")):
        found = record[port][:, 0] if port == "corner" else record[port]
        column = [row[k] for row in rows[::every]]
        np.testing.assert_allclose(found, column, rtol=1e-13, err_msg=port)
    for port, value in expected.items():
        np.testing.assert_allclose(record[port], value, rtol=1e-13)
    for port, value in before.items():
        np.testing.assert_array_equal(values[port], value)


@pytest.mark.sweep("compiled-1-ports[02]", "compiled-3-ports[13]")
@pytest.mark.parametrize("ports", [(), ("s",), ("corner",), ("M", "y")])
@pytest.mark.parametrize("every", [1, 3])
def test_what_is_recorded_alone_has_the_bits_that_it_has_among_all(scan, values, ports, every):
    everything, some = scan(8, values, every=every), scan(8, values, every=every, ports=ports)
    assert {"M_final", "s_final"} <= set(some)
    assert {p.removesuffix("_final").removesuffix("_all") for p in some} == {"M", "s", *ports}
    assert {p for p in ("M", "s", "y", "corner") if p in some} == set(ports)
    for port, array in some.items():
        np.testing.assert_array_equal(array, everything[port], err_msg=port)


@pytest.mark.parametrize(
    ("n", "change", "said"),
    [
        (8, {"u": np.zeros((3, 8))}, r"u must have shape \(8, 3\)"),
        (8, {"M": np.zeros((3, 2))}, r"M must have shape \(2, 3\)"),
        (8, {"M": np.zeros(6)}, r"M must have shape \(2, 3\)"),
        (8, {"s": np.zeros(3)}, r"s must have shape \(2, 1\)"),
        (8, {"c": None}, r"missing inputs \['c'\]"),
        (1, {"u": np.zeros(4)}, r"u must have shape \(1, 3\)"),
    ],
)
def test_wrong_shapes_and_names_are_refused(scan, values, n, change, said):
    given = {port: value for port, value in (values | change).items() if value is not None}
    with pytest.raises(ValueError, match=said):
        scan(n, given)


def test_ports_that_there_are_not_are_refused(scan, values):
    with pytest.raises(ValueError, match=r"records no \['u'\], only \['M', 'corner', 's',"):
        scan(8, values, ports=("u", "M"))
    with pytest.raises(ValueError, match="no output 'u_next'"):
        Scan(leaky_step(), carry=("u",), over=())


def no_compiler(*_):
    raise CompilationError("gcc refused\nthe code")


def no_space(*_):
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("failure", [no_compiler, no_space])
def test_a_build_that_fails_is_one_warning_and_the_same_numbers(
    monkeypatch, cache, caplog, values, failure
):
    monkeypatch.setattr(codegen.scan, "load_library", failure)
    scan = Scan(leaky_step(), carry=("M", "s"), over=("u",))
    with caplog.at_level("WARNING", logger="tireid"):
        for _ in range(2):
            record = scan(8, values)
    np.testing.assert_allclose(record["M_final"], by_hand(**values)[0]["M_final"], rtol=1e-13)
    assert len(caplog.messages) == 1
    assert "virtual machine" in caplog.messages[0]
    assert "\n" not in caplog.messages[0]


def test_a_matrix_for_each_sample_is_laid_out_by_columns_in_one_row(cache, rng):
    s, A = ca.SX.sym("s", 2), ca.SX.sym("A", 2, 3)
    step = ca.Function("turned", [s, A], [A[:, :2] @ s, A], ["s", "A"], ["s_next", "seen"])
    matrices = rng.normal(size=(5, 2, 3))
    rows = np.array([matrix.ravel(order="F") for matrix in matrices])
    compiled, machine = (Scan(step, carry=("s",), over=("A",)) for _ in range(2))
    machine.__dict__["loop"] = None
    expected = np.array([1.0, -2.0])
    for matrix in matrices:
        expected = matrix[:, :2] @ expected
    for scan in (compiled, machine):
        record = scan(5, {"s": np.array([1.0, -2.0]), "A": rows})
        np.testing.assert_allclose(record["seen"], matrices, rtol=1e-13)
        np.testing.assert_allclose(record["s_final"], expected, rtol=1e-12)
    with pytest.raises(ValueError, match=r"A must have shape \(5, 6\), not \(5, 2\)"):
        compiled(5, {"s": np.ones(2), "A": np.ones((5, 2))})


# A step taken sample by sample, or several at once, carries and tells the bits of the loop.


@pytest.mark.parametrize("samples", [1, 2, 4])
def test_steps_are_bit_equal_to_the_loop(scan, values, samples):
    whole, u = scan(8, values), values.pop("u")
    stepper = Stepper(scan, values, samples)
    for k in range(0, 8, samples):
        for port in ("M", "s"):
            np.testing.assert_array_equal(stepper.state()[port], whole[port][k])
        stepper.inputs["u"][:] = u[k : k + samples] if samples > 1 else u[k]
        stepper.advance()
        last, twice = k + samples - 1, stepper.outputs["twice"].reshape(3, 2).T
        np.testing.assert_array_equal(stepper.outputs["y"], whole["y"][last])
        np.testing.assert_array_equal(twice, whole["twice"][last])
        for port in ("M", "s"):
            np.testing.assert_array_equal(stepper.before(port), whole[port][last])
            np.testing.assert_array_equal(stepper.value(port), whole[f"{port}_all"][last + 1])


@pytest.mark.parametrize("samples", [1, 2])
def test_a_run_goes_on_from_another_state(scan, values, rng, samples):
    other, u = rng.normal(size=(2, 3)), values.pop("u")[:samples]
    stepper = Stepper(scan, values, samples)
    for _ in range(2):
        stepper.begin("M", other)
        stepper.begin("s", values["s"])
        stepper.inputs["u"][:] = u
        stepper.advance()
        expected = scan(samples, values | {"M": other, "u": u})
        np.testing.assert_array_equal(stepper.value("M"), expected["M_final"])
        np.testing.assert_array_equal(stepper.outputs["y"], expected["y"][-1])


def test_the_values_at_the_start_stay_the_callers(scan, values):
    start = values | {"M": np.asfortranarray(values["M"])}
    stepper = Stepper(scan, {port: start[port] for port in ("M", "s", "c")})
    kept = {port: start[port].copy() for port in ("M", "s")}
    stepper.inputs["u"][:] = 1.0
    state = stepper.state()
    stepper.advance()
    for port, value in kept.items():
        np.testing.assert_array_equal(start[port], value)
        np.testing.assert_array_equal(state[port], value)  # a copy, not a view
