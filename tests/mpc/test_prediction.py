"""The stage against other roads: autodiff of plain RK4, a car in the plane, costs by hand."""

import casadi as ca
import numpy as np
import pytest

from codegen.graph import OPERATIONS
from identifier.paper.network import Network
from models.vehicle import sedan
from mpc.prediction import build_dynamics, build_end, build_rk4, build_stage, state_size
from mpc.problem import Cost
from mpc.tires import PredictionTire, oracle_tire, prediction_tire
from mpc.tires.axles import LadderAxles, curve_weights
from mpc.tires.tire import ALL, valid_slip
from tests.identifier.conftest import network_model

CAR, DT, MOST = sedan(), 0.05, (0.06, 0.05)  # situations lie on both sides of these slips


def network(seed=0, hidden=10):
    return network_model(CAR, Network(hidden=hidden), np.random.default_rng(seed))


def ladder():
    """Axle curves with compliance, so that the lag depends on the slip, and with offsets."""
    scales = 1.0 / np.array([[0.016, 0.064, 0.128, 0.256]] * 2)
    W = np.array([[0.05, 0.5, 0.5, -0.15], [0.02, 0.6, 0.6, -0.3]])
    give = 7000.0 * np.array([8e-6, 1e-5])
    sensors = (0.01, 0.03, 0.1, -0.01)
    weights = curve_weights(
        np.hstack([scales, W]), sensors=sensors, loads=7000.0, give=give, shortest=0.003
    )
    return PredictionTire(LadderAxles(units=4), weights, CAR)


TIRES = {
    "linear": prediction_tire(CAR),
    "network": prediction_tire(network()),
    "ladder": ladder(),
    "oracle": oracle_tire(CAR),
}


def situations(tire, count=60):
    """Arguments of the stage without q: random states, inputs, curvatures and speeds."""
    rng = np.random.default_rng(1)
    n_x = state_size(tire.structure)
    for _ in range(count):
        x = rng.normal(0.0, 1.0, n_x) * [0.5, 0.15, 1.0, 0.4, 0.08, *[0.06] * (n_x - 5)]
        v_x = rng.uniform(8.0, 40.0)
        yield [
            x,
            rng.normal(),
            rng.normal(0, 0.02),
            v_x,
            DT,
            tire.car,
            tire.weights,
            *valid_slip(tire, MOST),
        ]


def differentiated(structure):
    """x_next, A and B by CasADi's own derivatives of the plain step."""
    step = build_rk4(structure)
    ports = [ca.SX.sym(step.name_in(i), *step.size_in(i)) for i in range(step.n_in())]
    x_next = step(*ports)
    slopes = [ca.jacobian(x_next, port) for port in ports[:2]]
    return ca.Function("differentiated", ports, [x_next, *slopes])


def worst(tire, reference, count=60):
    """Largest difference of the stage's x_next, A, B to a reference, over a typical size of 1."""
    stage, q = build_stage(tire.structure), Cost().numbers()
    return max(
        np.abs(np.array(mine) - np.array(theirs)).max()
        for given in situations(tire, count)
        for mine, theirs in zip(stage(*given, q)[:3], reference(*given), strict=True)
    )


@pytest.mark.sweep("lagged magic", "ladder", "network", "oracle")
@pytest.mark.parametrize("kind", TIRES)
def test_the_stage_is_the_derivative_of_plain_runge_kutta(kind):
    assert worst(TIRES[kind], differentiated(TIRES[kind].structure)) < 1e-10


@pytest.mark.parametrize("kind", ["network", "ladder"])
def test_a_wrong_sensitivity_would_be_seen(kind):
    plain = differentiated(TIRES[kind].structure)

    def at_other_weights(*given):
        return plain(*given[:6], given[6] * (1.0 + 1e-6), *given[7:])

    def first_order(*given):
        x_next, A, B = plain(*given)
        return x_next, A, B * 1.001

    assert worst(TIRES[kind], at_other_weights, 10) > 1e-8
    assert worst(TIRES[kind], first_order, 10) > 1e-6


def in_the_plane(tire, x, u, radius, v_x, seconds):
    """e_y, e_psi, v_y, r, δ of a car that is integrated in X, Y, psi about a circle's center."""
    C_f, C_r = tire.weights
    m, I_z, l_f, l_r = tire.car
    e_y, e_psi, v_y, r, delta = x
    X, Y, psi = 0.0, -radius + e_y, e_psi  # the path starts at (0, -radius), along +x
    n = 20000
    h = seconds / n
    for _ in range(n):
        F_f = C_f * (delta - (v_y + l_f * r) / v_x)
        F_r = -C_r * (v_y - l_r * r) / v_x
        X += h * (v_x * np.cos(psi) - v_y * np.sin(psi))
        Y += h * (v_x * np.sin(psi) + v_y * np.cos(psi))
        psi += h * r
        v_y, r = v_y + h * ((F_f + F_r) / m - v_x * r), r + h * (l_f * F_f - l_r * F_r) / I_z
        delta += h * u
    turned = np.arctan2(X, -Y)  # along the circle
    return np.array([radius - np.hypot(X, Y), psi - turned, v_y, r, delta])


@pytest.mark.parametrize("radius", [60.0, 30.0])
def test_it_goes_where_a_car_in_the_plane_goes(radius):
    tire, v_x, u = TIRES["linear"], 15.0, 0.02
    x = np.array([0.3, -0.05, 0.2, v_x / radius, 0.05])
    stage, q, seconds = build_stage(tire.structure), Cost().numbers(), 1.0
    expected = in_the_plane(tire, x, u, radius, v_x, seconds)
    for kappa, same in ((1.0 / radius, True), (-1.0 / radius, False)):
        predicted = x
        for _ in range(round(seconds / 0.01)):
            given = (predicted, u, kappa, v_x, 0.01, tire.car, tire.weights, *ALL, q)
            predicted = np.array(stage(*given)[0]).ravel()
        assert np.allclose(predicted, expected, rtol=2e-3, atol=1e-3) == same


def test_other_weights_need_no_other_function():
    one, other = (prediction_tire(network(seed)) for seed in (0, 1))
    stage = build_stage(one.structure)
    assert build_stage(other.structure) is stage
    given = next(situations(one))
    before, after = (
        np.array(stage(*given[:6], tire.weights, *ALL, Cost().numbers())[1])
        for tire in (one, other)
    )
    assert not np.allclose(before, after)
    expected = differentiated(other.structure)(*given[:6], other.weights, *ALL)[1]
    np.testing.assert_allclose(after, np.array(expected), atol=1e-10)
    assert build_stage(prediction_tire(network(hidden=8)).structure) is not stage


def test_a_lag_too_short_for_the_stage_is_half_of_it():
    tire, x = TIRES["oracle"], np.eye(7)[5] * 0.01
    dynamics = build_dynamics(tire.structure)
    for v_x, lag in ((40.0, 0.025), (10.0, 0.06)):  # 0.6 m are 15 ms and 60 ms; half of 50 ms
        x_dot = dynamics(x, 0.0, 0.0, v_x, 0.05, tire.car, tire.weights, *ALL)
        assert float(x_dot[5]) == pytest.approx(-0.01 / lag)


def test_the_shortest_lag_decays_within_a_stage():
    weights = curve_weights(np.array([[10.0, 0.0]] * 2), shortest=0.1)
    tire = PredictionTire(LadderAxles(units=1), weights, CAR)
    given = [np.zeros(7), 0.0, 0.0, 40.0, 0.05, tire.car, tire.weights, *ALL, np.zeros(7)]
    A = np.array(build_stage(tire.structure)(*given)[1])
    z = -2.0  # a stage over half of it
    expected = 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24
    np.testing.assert_allclose(A[[5, 6], [5, 6]], expected, rtol=1e-12)
    assert abs(expected) < 0.4


@pytest.mark.parametrize("kind", ["linear", "ladder"])
def test_the_cost_is_expanded_as_gauss_and_newton_did(kind):
    tire = TIRES[kind]
    q = Cost(e_psi=0.3, course=0.2, v_y=0.1, yaw_rate=0.4, steering=0.5, progress=0.6).numbers()
    stage, n_x = build_stage(tire.structure), state_size(tire.structure)

    def errors(x, kappa, v_x):
        e_y, e_psi, v_y, r, delta = x[:5]
        s_dot = (v_x * np.cos(e_psi) - v_y * np.sin(e_psi)) / (1.0 - kappa * e_y)
        course = e_psi + v_y / v_x
        return np.array([e_y, e_psi, course, v_y, r - kappa * v_x, delta, 1.0 - s_dot / v_x])

    for given in situations(tire, 10):
        x, _, kappa, v_x = given[:4]
        step = 1e-6
        C = np.column_stack(
            [
                (errors(x + d, kappa, v_x) - errors(x - d, kappa, v_x)) / (2 * step)
                for d in step * np.eye(n_x)
            ]
        )
        H, h = (np.array(value) for value in stage(*given, q)[3:5])
        np.testing.assert_allclose(H, C.T @ np.diag(q) @ C, atol=1e-6 * np.abs(H).max())
        y = errors(x, kappa, v_x)
        np.testing.assert_allclose(h.ravel(), C.T @ (q * y), atol=1e-6 * np.abs(h).max())
        end = build_end(tire.structure)(x, kappa, v_x, *given[5:], 3.0 * q)
        np.testing.assert_allclose(np.array(end[0]), 3.0 * H, rtol=1e-12, atol=1e-9)
        np.testing.assert_allclose(np.array(end[1]), 3.0 * h, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("kind", TIRES)
def test_slips_and_their_slopes_are_those_of_the_tire(kind):
    tire = TIRES[kind]
    stage, n_x = build_stage(tire.structure), state_size(tire.structure)
    for given in situations(tire, 5):
        slip, slope = (np.array(value) for value in stage(*given, np.ones(7))[5:])
        for i in range(n_x):
            step = 1e-6 * np.eye(n_x)[i]
            ahead, behind = (
                np.array(stage(given[0] + d, *given[1:], np.ones(7))[5]) for d in (step, -step)
            )
            np.testing.assert_allclose(slope[:, i], (ahead - behind)[:, 0] / 2e-6, atol=1e-7)
        v_y, r, delta = given[0][2:5]
        v_x, (_, _, l_f, l_r) = given[3], given[5]
        expected = [delta - np.arctan((v_y + l_f * r) / v_x), -np.arctan((v_y - l_r * r) / v_x)]
        np.testing.assert_allclose(slip[:, 0], expected, atol=0.03)


@pytest.mark.parametrize("kind", TIRES)
def test_nothing_of_a_library_is_called(kind):
    exact = {"sqrt", "fabs", "floor", "fmin", "fmax", "sign"}
    for function in (build_stage(TIRES[kind].structure), build_end(TIRES[kind].structure)):
        count = function.n_instructions()
        used = {OPERATIONS[function.instruction_id(k)] for k in range(count)}
        assert not used & {"sin", "cos", "tan", "atan", "tanh", "exp", "log", "atan2", "pow"}
        assert used <= exact | {
            *("input", "output", "const", "add", "sub", "mul", "div", "neg", "inv", "sq", "twice"),
            *("lt", "le", "eq", "ne", "not", "and", "or", "if_else_zero"),
        }


def test_ten_units_cost_few_operations():
    """14-28 µs for 40 stages when measured; a count does not depend on the machine."""
    assert build_stage(TIRES["network"].structure).n_instructions() < 4000
    assert build_stage(TIRES["oracle"].structure).n_instructions() < 7250
