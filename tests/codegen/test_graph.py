"""Functions as graphs: read and rebuilt, our own functions found again, decided, simplified."""

import casadi as ca
import numpy as np
import pytest

from codegen import clean_c as recognize
from codegen.clean_c import EXPANDED, recognized
from codegen.elementary import atan, exp, sin, tanh
from codegen.graph import (
    assumed,
    decision,
    function_of,
    graph_of,
    lifted,
    simplifying,
)
from codegen.simplify import simplified
from codegen.tuned import tuned


def operations(graph):
    return [graph.nodes[place].op for place in graph.reached()]


def learning_step():
    """A step like the identifier's: gains are constants, and a standing car does not learn."""
    W, s, z, v = ca.SX.sym("W", 2, 5), ca.SX.sym("s", 5), ca.SX.sym("z", 2), ca.SX.sym("v")
    moves = ca.logic_and(v >= 1.0, v <= 90.0)
    rate = -3.0 * z @ tanh(s).T - 0.7 * ca.norm_2(z) * W
    ahead = ca.if_else(moves, 0.01, 0)
    force = ca.if_else(moves, W @ tanh(s) / ca.fmax(v, 1.0), 0)
    ports = ["W", "s", "z", "v"]
    return ca.Function(
        "step", [W, s, z, v], [W + ahead * rate, force], ports, ["W_next", "force"], {"cse": True}
    )


def arguments(rng, v):
    return rng.normal(size=(2, 5)), rng.normal(size=5), rng.normal(size=2), v


def compare(one, other, rng, exact):
    for v in (0.5, 20.0, 100.0):
        given = arguments(rng, v)
        for a, b in zip(one(*given), other(*given), strict=True):
            if exact:
                np.testing.assert_array_equal(np.array(a), np.array(b))
            else:
                np.testing.assert_allclose(np.array(a), np.array(b), rtol=1e-13, atol=1e-15)


def test_constants_that_are_told_give_the_same_bits(rng):
    step = learning_step()
    told, constants = lifted(step)
    compare(step, lambda *given: told(*given, constants), rng, exact=True)
    given = arguments(rng, 20.0)
    assert (np.array(told(*given, 1.1 * constants)[0]) != np.array(step(*given)[0])).all()


def test_functions_that_differ_in_their_constants_alone_become_one():
    def spring(stiffness, damping):
        x, v = ca.SX.sym("x"), ca.SX.sym("v")
        force = -stiffness * x - damping * v / 3.0
        return ca.Function("spring", [x, v], [force], ["x", "v"], ["F"])

    one, of_one = lifted(spring(2000.0, 30.0))
    other, of_other = lifted(spring(1500.0, 40.0))
    assert one.serialize() == other.serialize() and sorted(of_one) == [-2000.0, 3.0, 30.0]
    assert other(0.1, 2.0, of_other) == spring(1500.0, 40.0)(0.1, 2.0)


def test_our_own_functions_are_found_again_and_those_of_libraries_replaced(rng):
    x = ca.SX.sym("x", 4)
    own = ca.Function("f", [x], [tanh(x[0]) + exp(x[1]) * atan(x[2]) - sin(x[3])])
    library = ca.Function("f", [x], [ca.tanh(x[0]) + ca.exp(x[1]) * ca.atan(x[2]) - ca.sin(x[3])])
    with simplifying(False):
        as_written = ca.Function("f", [x], [tanh(x[0]) + exp(x[1]) * atan(x[2]) - sin(x[3])])
    for function in (own, library, as_written):
        found = operations(recognized(graph_of(function)))
        names = ("tanh", "exp", "atan", "sin", "div", "floor")
        assert [found.count(op) for op in names] == [1, 1, 1, 1, 0, 0]
    given = rng.normal(size=4)
    rebuilt = function_of(recognized(graph_of(library)), library, EXPANDED)
    assert float(rebuilt(given)) == float(own(given))


@pytest.mark.parametrize("simplify", [False, True])
def test_who_asks_first_does_not_decide_what_is_found(simplify):
    """The forms to look for are made once, under whichever option then holds."""
    recognize._templates.cache_clear()
    x = ca.SX.sym("x")
    own = ca.Function("f", [x], [exp(x) * atan(x)])
    with simplifying(simplify):
        assert {"exp", "atan"} <= set(operations(recognized(graph_of(own))))
    assert {"exp", "atan"} <= set(operations(recognized(graph_of(own))))


def test_cosine_and_tangent_are_made_of_sines(rng):
    x = ca.SX.sym("x", 2)
    function = ca.Function("f", [x], [ca.vertcat(ca.cos(x[0]), ca.tan(x[1]))])
    graph = recognized(graph_of(function))
    assert not {"cos", "tan"} & set(operations(graph))
    rebuilt = function_of(graph, function, EXPANDED)
    given = rng.normal(size=2)
    np.testing.assert_allclose(
        np.array(rebuilt(given)).ravel(), [np.cos(given[0]), np.tan(given[1])], rtol=1e-11
    )


def test_a_constant_in_a_divisor_goes_to_the_other_side_as_its_inverse():
    """Divisors that are read once, read twice, and inputs; with constants above and below."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    wave = ca.sin(y) + 2
    quotients = [
        x / (3 * ca.cos(y)),
        5 * x / (4 * ca.sin(2 * y)),
        x / (-7 * y),
        1 / (6 * ca.tan(y)),
        8 / (9 * wave),
        (11 * x) / (13 * wave),
        (x / 3) / 5,
    ]
    with simplifying(False):
        function = ca.Function("f", [x, y], [ca.vertcat(*quotients)])
    told = np.array(function_of(simplified(graph_of(function)), function)(1.7, 0.6)).ravel()
    s = np.sin(0.6) + 2
    expected = [1.7 / (3 * np.cos(0.6)), 8.5 / (4 * np.sin(1.2)), -1.7 / 4.2]
    expected += [1 / (6 * np.tan(0.6)), 8 / (9 * s), 18.7 / (13 * s), 1.7 / 15]
    np.testing.assert_allclose(told, expected, rtol=1e-14)


@pytest.mark.parametrize("seed", range(30))
def test_a_random_formula_keeps_its_value(seed):
    """Every operation that has a rule, on nodes that are read once and often."""
    rng = np.random.default_rng(seed)
    symbols = [ca.SX.sym(name) for name in "abcd"]
    given = rng.uniform(0.5, 2.0, 4) * rng.choice([-1.0, 1.0], 4)
    with simplifying(False):
        nodes, values = list(symbols), list(given)
        while len(nodes) < 40:
            i, j = rng.integers(len(nodes), size=2)
            c = float(rng.choice([-3.0, -1.0, 0.5, 1.0, 2.0, 7.0]))
            kind = rng.integers(10)
            (x, u), (y, v) = (nodes[i], values[i]), (nodes[j], values[j])
            made, value = (
                (x + y, u + v),
                (x - y, u - v),
                (x * y, u * v),
                (x / (c * y), u / (c * v)),
                (c / y, c / v),
                (c * x, c * u),
                (-x, -u),
                (ca.sin(x), np.sin(u)),
                (x * x, u * u),
                (2 * x + c, 2 * u + c),
            )[kind]
            if 1e-2 < abs(value) < 1e2:
                nodes.append(made)
                values.append(value)
        function = ca.Function("f", symbols, [ca.vertcat(*nodes[-8:])])
    told = function_of(simplified(graph_of(function)), function)(*given)
    np.testing.assert_allclose(np.array(told).ravel(), values[-8:], rtol=1e-7)


def test_gains_meet_in_one_factor_for_all_weights():
    """W + h (-3 z σ - 0.7 |z| W): per weight two products and one sum."""
    step = learning_step()
    graph = recognized(graph_of(step))
    driving = simplified(assumed(graph, decision(graph, {3}), True))
    driving.outputs = driving.outputs[:1]
    found = operations(driving)
    per_weight = 3 * 10
    others = found.count("tanh") + found.count("sq") + found.count("sqrt")
    arithmetic = sum(found.count(op) for op in ("add", "sub", "mul", "neg", "div"))
    assert arithmetic <= per_weight + 6
    assert others == 5 + 2 + 1


def test_a_matrix_times_its_inverse_leaves_no_rounding():
    x = ca.SX.sym("x", 2)
    K = ca.DM([[0.62, 0.61], [0.46, -0.6]])
    there_and_back = ca.Function("f", [x], [K @ (ca.inv(K) @ x)])
    graph = simplified(graph_of(there_and_back))
    assert operations(graph) == ["input", "input"]


def test_known_conditions_decide():
    step = learning_step()
    graph = recognized(graph_of(step))
    place = decision(graph, {3})
    driving, resting = (simplified(assumed(graph, place, holds)) for holds in (True, False))
    for part in (driving, resting):
        assert not {"select", "if_else_zero", "and", "le"} & set(operations(part))
    assert set(operations(resting)) <= {"input", "const"}  # W as it is, no force


def test_tuned_parts_are_the_whole(rng):
    step = learning_step()
    parts = tuned(step, sampled=("v",))
    compare(step, parts.function, rng, exact=False)
    for v, part in ((0.5, parts.where_false), (20.0, parts.where_true)):
        given = arguments(rng, v)
        assert float(parts.condition(*given)) == (v > 1.0)
        for a, b in zip(part(*given), parts.function(*given), strict=True):
            np.testing.assert_array_equal(np.array(a), np.array(b))


@pytest.mark.parametrize("turned", [False, True])
def test_a_choice_in_two_halves_is_one_choice_whichever_comes_first(turned, rng):
    c, a, b = (ca.SX.sym(name) for name in "cab")
    halves = [ca.if_else(c > 0, a, 0), ca.if_else(ca.logic_not(c > 0), b, 0)]
    one, two = reversed(halves) if turned else halves
    function = ca.Function("choose", [c, a, b], [one + two])
    graph = recognized(graph_of(function))
    assert "select" in operations(graph)
    assert "if_else_zero" not in operations(graph)
    for sign in (1.0, -1.0):
        first, second = rng.normal(size=2)
        chosen = float(function_of(graph, function)(sign, first, second))
        assert chosen == (first if sign > 0.0 else second)


@pytest.mark.parametrize(
    ("extreme", "wanted"), [(ca.fmax, (0.0, 0.5, 1.0)), (ca.fmin, (1.0, 0.5, 0.0))]
)
def test_the_slope_of_an_extreme_is_chosen_and_not_divided(extreme, wanted):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    slope = ca.Function("slope", [x, y], [ca.densify(ca.jacobian(extreme(x, y), x))])
    graph = recognized(graph_of(slope))
    assert "div" in operations(graph_of(slope))
    assert "div" not in operations(graph)
    again = function_of(graph, slope)
    for value, expected in zip((-1.0, 0.3, 2.0), wanted, strict=True):
        assert float(again(value, 0.3)) == float(slope(value, 0.3)) == expected
    assert np.isnan(float(slope(np.nan, 0.3)))  # 0/0
    assert float(again(np.nan, 0.3)) == 0.0


def test_what_only_looks_like_tanh_or_such_a_slope_is_left_alone():
    x, y, z = (ca.SX.sym(name) for name in "xyz")
    tanh_nearly, slope_nearly = 1.5 * x / (1 + x * x), (x <= y) / ((x <= y) + (z <= x))
    for near in (tanh_nearly, slope_nearly):
        found = operations(recognized(graph_of(ca.Function("near", [x, y, z], [near]))))
        assert "tanh" not in found and "div" in found
