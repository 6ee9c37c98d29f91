"""The compiled loop, the virtual machine and a loop written by hand compute the same."""

import casadi as ca
import numpy as np
import pytest

import codegen.scan
from codegen import CompilationError, Scan


def leaky_step() -> ca.Function:
    """A matrix and a vector state, a sample input and a constant."""
    M, s, u, c = ca.SX.sym("M", 2, 3), ca.SX.sym("s", 2), ca.SX.sym("u", 3), ca.SX.sym("c")
    M_next = 0.9 * M + c * s @ u.T
    s_next = 0.5 * s + M @ u
    return ca.Function(
        "leaky",
        [M, s, u, c],
        [M_next, s_next, M @ u, M[0, 1]],
        ["M", "s", "u", "c"],
        ["M_next", "s_next", "y", "corner"],
    )


def by_hand(M, s, u, c):
    states, outputs = [], []
    for row in u:
        states.append((M, s))
        outputs.append(M @ row)
        M, s = 0.9 * M + c * np.outer(s, row), 0.5 * s + M @ row
    return states, outputs, M, s


@pytest.fixture(params=["compiled", "virtual machine"])
def scan(request, monkeypatch, tmp_path):
    monkeypatch.setenv("TIREID_CACHE", str(tmp_path))
    if request.param == "virtual machine":
        monkeypatch.setattr(codegen.scan, "load_library", lambda *_: None)
    return Scan(leaky_step(), carry=("M", "s"), over=("u",))


@pytest.mark.parametrize("n", [1, 7, 8])
@pytest.mark.parametrize("every", [1, 3])
def test_scan_repeats_the_loop_by_hand(scan, rng, n, every):
    M, s, u = rng.normal(size=(2, 3)), rng.normal(size=2), rng.normal(size=(n, 3))
    states, outputs, M_final, s_final = by_hand(M, s, u, 0.1)
    record = scan(n, {"M": M, "s": s, "u": u, "c": np.array(0.1)}, every=every)
    np.testing.assert_allclose(record["M"], [m for m, _ in states][::every], rtol=1e-13)
    np.testing.assert_allclose(record["s"], [v for _, v in states][::every], rtol=1e-13)
    np.testing.assert_allclose(record["y"], outputs[::every], rtol=1e-13)
    np.testing.assert_allclose(record["corner"][:, 0], [m[0, 1] for m, _ in states][::every])
    np.testing.assert_allclose(record["M_final"], M_final, rtol=1e-13)
    np.testing.assert_allclose(record["s_final"], s_final, rtol=1e-13)


@pytest.mark.parametrize("ports", [(), ("s",), ("corner",), ("M", "y")])
@pytest.mark.parametrize("every", [1, 3])
def test_what_is_recorded_alone_has_the_bits_that_it_has_among_all(scan, rng, ports, every):
    M, s, u = rng.normal(size=(2, 3)), rng.normal(size=2), rng.normal(size=(8, 3))
    values = {"M": M, "s": s, "u": u, "c": np.array(0.1)}
    everything, some = scan(8, values, every=every), scan(8, values, every=every, ports=ports)
    assert {"M_final", "s_final"} <= set(some)
    assert {p.removesuffix("_final").removesuffix("_all") for p in some} == {"M", "s", *ports}
    assert {p for p in ("M", "s", "y", "corner") if p in some} == set(ports)
    for port, array in some.items():
        np.testing.assert_array_equal(array, everything[port], err_msg=port)


def test_scan_does_not_change_what_it_is_given(scan, rng):
    M, s, u = rng.normal(size=(2, 3)), rng.normal(size=2), rng.normal(size=(5, 3))
    before = M.copy(), s.copy(), u.copy()
    scan(5, {"M": M, "s": s, "u": u, "c": np.array(0.1)})
    for now, then in zip((M, s, u), before, strict=True):
        np.testing.assert_array_equal(now, then)


def test_wrong_shapes_and_names_are_refused(scan):
    good = {"M": np.zeros((2, 3)), "s": np.zeros(2), "u": np.zeros((4, 3)), "c": np.array(0.1)}
    with pytest.raises(ValueError, match=r"u must have shape \(4, 3\)"):
        scan(4, good | {"u": np.zeros((3, 4))})
    with pytest.raises(ValueError, match=r"M must have shape \(2, 3\)"):
        scan(4, good | {"M": np.zeros((3, 2))})
    with pytest.raises(ValueError, match=r"missing inputs \['c'\]"):
        scan(4, {k: v for k, v in good.items() if k != "c"})
    with pytest.raises(ValueError, match=r"records no \['u'\], only \['M', 'corner', 's', 'y'\]"):
        scan(4, good, ports=("u", "M"))
    with pytest.raises(ValueError, match="no output 'u_next'"):
        Scan(leaky_step(), carry=("u",), over=())


def test_a_library_is_built_once(monkeypatch, tmp_path, caplog):
    monkeypatch.setenv("TIREID_CACHE", str(tmp_path))
    inputs = {"M": np.zeros((2, 3)), "s": np.zeros(2), "u": np.zeros((4, 3)), "c": np.array(0.1)}
    with caplog.at_level("INFO", logger="tireid"):
        for _ in range(2):
            Scan(leaky_step(), carry=("M", "s"), over=("u",))(4, inputs)
    assert sum("compiling leaky" in message for message in caplog.messages) == 1
    assert len(list(tmp_path.glob("leaky-*.so"))) == 1


def no_compiler(*_):
    raise CompilationError("gcc refused\nthe code")


def no_space(*_):
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("failure", [no_compiler, no_space])
def test_a_build_that_fails_is_one_warning_and_the_same_numbers(
    monkeypatch, tmp_path, caplog, rng, failure
):
    monkeypatch.setenv("TIREID_CACHE", str(tmp_path))
    M, s, u = rng.normal(size=(2, 3)), rng.normal(size=2), rng.normal(size=(5, 3))
    monkeypatch.setattr(codegen.scan, "load_library", failure)
    scan = Scan(leaky_step(), carry=("M", "s"), over=("u",))
    with caplog.at_level("WARNING", logger="tireid"):
        for _ in range(2):
            record = scan(5, {"M": M, "s": s, "u": u, "c": np.array(0.1)})
    np.testing.assert_allclose(record["M_final"], by_hand(M, s, u, 0.1)[2], rtol=1e-13)
    assert len(caplog.messages) == 1
    assert "virtual machine" in caplog.messages[0]
    assert "\n" not in caplog.messages[0]


def test_a_compiler_that_cannot_compile_is_no_error(monkeypatch, tmp_path, caplog):
    monkeypatch.setenv("TIREID_CACHE", str(tmp_path))
    monkeypatch.setenv("CC", "false")
    codegen.find_compiler.cache_clear()
    inputs = {"M": np.zeros((2, 3)), "s": np.zeros(2), "u": np.zeros((4, 3)), "c": np.array(0.1)}
    try:
        with caplog.at_level("WARNING", logger="tireid"):
            Scan(leaky_step(), carry=("M", "s"), over=("u",))(4, inputs)
    finally:
        codegen.find_compiler.cache_clear()
    assert "false refused the generated code of leaky" in caplog.messages[0]


def test_a_single_sample_may_come_flat_and_one_too_many_is_refused(scan, rng):
    M, s, u = rng.normal(size=(2, 3)), rng.normal(size=2), rng.normal(size=3)
    values = {"M": M, "s": s, "u": u, "c": np.array(0.1)}
    np.testing.assert_allclose(scan(1, values)["y"], [M @ u], rtol=1e-13)
    with pytest.raises(ValueError, match=r"u must have shape \(1, 3\)"):
        scan(1, values | {"u": np.zeros(4)})
    with pytest.raises(ValueError, match=r"M must have shape \(2, 3\)"):
        scan(1, values | {"M": np.zeros(6)})
    with pytest.raises(ValueError, match=r"s must have shape \(2, 1\)"):
        scan(1, values | {"s": np.zeros(3)})


def test_a_matrix_for_each_sample_is_laid_out_by_columns_in_one_row(monkeypatch, tmp_path, rng):
    monkeypatch.setenv("TIREID_CACHE", str(tmp_path))
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
