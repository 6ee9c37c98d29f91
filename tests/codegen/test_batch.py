"""Many runs in lanes have the bits of each run alone, with and without a compiler."""

import casadi as ca
import numpy as np
import pytest

import codegen.batch
import codegen.lanes
from codegen import BatchScan, CompilationError, Scan

N = 23
CARRY, OVER = ("M", "s"), ("u", "w")


def busy_step() -> ca.Function:
    """A step with every kind of port, branches, comparisons and functions of libm."""
    M, s = ca.SX.sym("M", 2, 3), ca.SX.sym("s", 2)
    u, w, c, D = ca.SX.sym("u", 3), ca.SX.sym("w"), ca.SX.sym("c"), ca.SX.sym("D", 2, 2)
    turning = ca.logic_and(u[0] > w, ca.logic_not(u[1] <= c))
    push = ca.if_else(ca.logic_or(turning, ca.fabs(s[0]) >= 2.0), ca.tanh(M @ u), D @ s / 3.0)
    M_next = 0.9 * M + c * push @ u.T + ca.sign(u[2]) * 1e-3
    s_next = ca.fmax(ca.fmin(0.5 * s + push, 1.5), -1.5) + ca.sqrt(ca.exp(-(w**2))) * 0.1
    told = ca.vertcat(ca.atan2(s[0], 1 + w**2), ca.norm_2(s), ca.if_else(s[0] == s[1], 1, w))
    return ca.Function(
        "busy",
        [M, s, u, w, c, D],
        [M_next, s_next, told, M.T @ D],
        ["M", "s", "u", "w", "c", "D"],
        ["M_next", "s_next", "told", "turned"],
    )


def random_values(rng, runs, lanes_over):
    shapes = {"M": (2, 3), "s": (2,), "u": (N, 3), "w": (N,), "c": (), "D": (2, 2)}
    return {
        port: rng.normal(size=(runs, *shape) if port in lanes_over else shape)
        for port, shape in shapes.items()
    }


def one_by_one(values, lanes_over, keep, runs):
    scan = Scan(busy_step(), carry=CARRY, over=OVER)
    records = []
    for i in range(runs):
        own = {port: v[i] if port in lanes_over else v for port, v in values.items()}
        record = scan(N, own)
        kept = {port: record[port][list(keep)] for port in ("M", "s", "told", "turned")}
        records.append(kept | {port: record[port] for port in ("M_final", "s_final")})
    return {port: np.stack([record[port] for record in records]) for port in records[0]}


@pytest.fixture(params=["lanes", "no C++", "virtual machine"])
def engine(request, monkeypatch):
    def refuse(*_):
        raise CompilationError("no C++ here")

    if request.param != "lanes":
        monkeypatch.setattr(codegen.batch, "load_library", refuse)
    if request.param == "virtual machine":
        monkeypatch.setattr(codegen.scan, "load_library", lambda *_: None)
    return request.param


EVERY_LANE = ("M", "s", "u", "w", "c", "D")


@pytest.mark.parametrize("lanes_over", [("c",), ("D", "M"), ("u", "s"), EVERY_LANE])
@pytest.mark.parametrize(("runs", "workers"), [(1, 1), (7, 1), (21, 3)])
def test_each_lane_has_the_bits_of_a_run_alone(rng, engine, lanes_over, runs, workers):
    values = random_values(rng, runs, lanes_over)
    keep = (0, 5, N - 1)
    batch = BatchScan(busy_step(), carry=CARRY, over=OVER, lanes_over=lanes_over)
    record = batch(N, values, keep=keep, workers=workers)
    alone = one_by_one(values, lanes_over, keep, runs)
    assert set(record) == set(alone)
    for port, value in alone.items():
        assert record[port].shape == value.shape, port
        np.testing.assert_array_equal(record[port], value, err_msg=port)


@pytest.mark.parametrize("target", codegen.lanes.TARGETS, ids=lambda t: f"{t.lanes} lanes")
def test_narrow_and_wide_registers_give_the_same_bits(rng, monkeypatch, target):
    widest = codegen.lanes.find_target()
    if widest is None or target.lanes > widest.lanes:
        pytest.skip(f"needs a compiler and registers of {target.lanes} doubles")
    monkeypatch.setattr(codegen.batch, "find_target", lambda: target)
    values = random_values(rng, 11, EVERY_LANE)
    batch = BatchScan(busy_step(), carry=CARRY, over=OVER, lanes_over=EVERY_LANE)
    record = batch(N, values, keep=range(N), workers=2)
    for port, value in one_by_one(values, EVERY_LANE, range(N), 11).items():
        np.testing.assert_array_equal(record[port], value, err_msg=port)


def test_a_fused_instruction_would_be_noticed(rng, monkeypatch):
    target = codegen.lanes.find_target()
    if target is None or target.lanes < 4:
        pytest.skip("needs a processor that can fuse multiplication and addition")
    monkeypatch.delenv("TIREID_OPTIMIZE", raising=False)  # a lower level fuses nothing
    monkeypatch.setattr(codegen.batch, "CPP_FLAGS", (*codegen.lanes.CPP_FLAGS, "-mfma"))
    lanes_over, keep = ("c", "M"), (N - 1,)
    values = random_values(rng, 8, lanes_over)
    alone = one_by_one(values, lanes_over, keep, 8)

    def record():
        return BatchScan(busy_step(), carry=CARRY, over=OVER, lanes_over=lanes_over)(N, values)

    np.testing.assert_array_equal(record()["M_final"], alone["M_final"])
    contracting = (*codegen.batch.CPP_FLAGS, "-ffp-contract=fast")
    monkeypatch.setattr(codegen.batch, "CPP_FLAGS", contracting)
    fused = record()["M_final"]
    assert not np.array_equal(fused, alone["M_final"])
    np.testing.assert_allclose(fused, alone["M_final"], rtol=1e-9)


SPECIAL = np.array([0.0, -0.0, 1.0, -2.5, np.inf, -np.inf, np.nan, 5e-324])


def test_numbers_that_are_none_take_the_same_branch_as_alone():
    x, y, k = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("k")
    told = [
        ca.if_else(x, y, 3),
        ca.if_else(x < y, x, y),
        ca.if_else(ca.logic_not(x >= y), 1, ca.if_else(x != y, 2, 3)),
        ca.logic_or(x > 0, y),
        ca.logic_and(x, y == 0),
        ca.fmax(x, y),
        ca.fmin(x, y),
        ca.fabs(x),
        ca.sign(x),
        ca.sqrt(x),
        ca.floor(x) + ca.ceil(y),
        -x / y,
        x**y,
    ]
    step = ca.Function(
        "special", [k, x, y], [k + 1, ca.vertcat(*told)], ["k", "x", "y"], ["k_next", "told"]
    )
    xs, ys = (grid.ravel() for grid in np.meshgrid(SPECIAL, SPECIAL))
    batch = BatchScan(step, carry=("k",), over=(), lanes_over=("x", "y"))
    record = batch(1, {"k": np.zeros(1), "x": xs, "y": ys}, keep=[0])
    scan = Scan(step, carry=("k",), over=())
    pairs = zip(xs, ys, strict=True)
    alone = [scan(1, {"k": np.zeros(1), "x": a, "y": b})["told"] for a, b in pairs]
    np.testing.assert_array_equal(record["told"], np.array(alone))
    np.testing.assert_array_equal(record["k_final"], np.ones((xs.size, 1)))


def test_one_warning_tells_that_there_are_no_lanes(engine, rng, caplog):
    values = random_values(rng, 3, ("c",))
    batch = BatchScan(busy_step(), carry=CARRY, over=OVER, lanes_over=("c",))
    with caplog.at_level("WARNING", logger="tireid"):
        batch(N, values)
        batch(N, values)
    told = [message for message in caplog.messages if "one at a time" in message]
    assert len(told) == (0 if engine == "lanes" else 1)


def test_what_is_given_is_not_changed(rng):
    values = random_values(rng, 5, EVERY_LANE)
    before = {port: value.copy() for port, value in values.items()}
    BatchScan(busy_step(), carry=CARRY, over=OVER, lanes_over=EVERY_LANE)(N, values, workers=1)
    for port, value in before.items():
        np.testing.assert_array_equal(values[port], value)


def test_wrong_shapes_names_and_samples_are_refused(rng):
    batch = BatchScan(busy_step(), carry=CARRY, over=OVER, lanes_over=("c", "M"))
    good = random_values(rng, 4, ("c", "M"))
    with pytest.raises(ValueError, match=r"M must have shape \(4, 2, 3\), not \(3, 2, 3\)"):
        batch(N, good | {"M": good["M"][:3]})
    with pytest.raises(ValueError, match=r"u must have shape \(23, 3\), not \(22, 3\)"):
        batch(N, good | {"u": good["u"][1:]})
    with pytest.raises(ValueError, match=r"must have shape \(0, "):
        batch(N, good | {"c": np.zeros(())})
    everywhere = BatchScan(busy_step(), carry=CARRY, over=OVER, lanes_over=EVERY_LANE)
    with pytest.raises(ValueError, match=r"must have shape \(0, "):
        everywhere(N, random_values(rng, 0, EVERY_LANE))
    with pytest.raises(ValueError, match="has the inputs"):
        batch(N, {port: value for port, value in good.items() if port != "D"})
    for keep in ((3, 2), (1, 1), (-1,), (N,)):
        with pytest.raises(ValueError, match=r"keep must rise within 0 \.\.\. 22"):
            batch(N, good, keep=keep)
    with pytest.raises(ValueError, match="lanes_over must name inputs"):
        BatchScan(busy_step(), carry=CARRY, over=OVER, lanes_over=("told",))
    with pytest.raises(ValueError, match="lanes_over must name inputs"):
        BatchScan(busy_step(), carry=CARRY, over=OVER, lanes_over=())


def test_a_function_that_is_not_straight_line_code_runs_one_at_a_time(caplog):
    a, b = ca.MX.sym("a", 2), ca.MX.sym("b", 2, 2)
    step = ca.Function("matrices", [a, b], [b @ a], ["a", "b"], ["a_next"])
    batch = BatchScan(step, carry=("a",), over=(), lanes_over=("b",))
    b_values = np.array([np.eye(2), 2.0 * np.eye(2)])
    with caplog.at_level("WARNING", logger="tireid"):
        record = batch(3, {"a": np.ones(2), "b": b_values})
    np.testing.assert_array_equal(record["a_final"], [[1.0, 1.0], [8.0, 8.0]])
    assert "must be an SX function" in caplog.text


@pytest.mark.parametrize("everywhere", [True, False])
def test_samples_that_are_matrices_come_by_columns_as_in_a_run_alone(rng, everywhere):
    s, A = ca.SX.sym("s", 2), ca.SX.sym("A", 2, 3)
    step = ca.Function("matrix", [s, A], [0.5 * s + A @ ca.DM([1, 2, 3]), A.T @ s],
                       ["s", "A"], ["s_next", "y"])  # fmt: skip
    runs, n = 3, 5
    start, matrices = rng.normal(size=(runs, 2)), rng.normal(size=(runs, n, 2, 3))
    flat = matrices.swapaxes(-1, -2).reshape(runs, n, 6)
    if not everywhere:
        flat, matrices = flat[0], np.broadcast_to(matrices[:1], matrices.shape)
    batch = BatchScan(step, carry=("s",), over=("A",), lanes_over=("s", "A")[: 1 + everywhere])
    record = batch(n, {"s": start, "A": flat}, keep=range(n))
    for i in range(runs):
        state = start[i]
        for k in range(n):
            np.testing.assert_allclose(record["y"][i, k], matrices[i, k].T @ state, rtol=1e-12)
            state = 0.5 * state + matrices[i, k] @ [1.0, 2.0, 3.0]
        np.testing.assert_allclose(record["s_final"][i], state, rtol=1e-12)
    with pytest.raises(ValueError, match=r"A must have shape"):
        batch(n, {"s": start, "A": flat[..., :2]})


def test_numbers_of_the_right_count_in_the_wrong_order_are_refused(rng):
    batch = BatchScan(busy_step(), carry=CARRY, over=OVER, lanes_over=("c", "s"))
    good = random_values(rng, 5, ("c", "s"))
    with pytest.raises(ValueError, match=r"s must have shape \(5, 2, 1\), not \(2, 5\)"):
        batch(N, good | {"s": good["s"].T})
