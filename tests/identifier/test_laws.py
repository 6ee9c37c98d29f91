"""Equations (8)-(13) reached by other roads: derivatives, substitution and finite differences."""

import casadi as ca
import numpy as np
import pytest

from identifier.paper.laws import (
    LAWS,
    filter_rate,
    observer_rate,
    weight_rates,
)
from identifier.paper.network import SIGNALS, Network, hidden_layer, network_signals

RESIDUAL = 1e-12
N_H, N_IN = 5, 4


def numbers(expression):
    return np.array(ca.DM(expression))


@pytest.fixture
def case(rng):
    """Random values of everything in the laws; A_d is not symmetric, so that transposes matter."""
    return {
        "xi": rng.normal(size=2), "xi_hat": rng.normal(size=2), "z": rng.normal(size=2),
        "W": rng.normal(size=(2, N_H)), "V": rng.normal(size=(N_H, N_IN)),
        "x_bar": rng.normal(size=N_IN), "A_d": np.array([[-6.0, 4.0], [0.5, -3.0]]),
    }  # fmt: skip


def rates(case, *, drive, rho=(0.0, 0.0), laws=weight_rates):
    sigma = np.tanh(case["V"] @ case["x_bar"])
    W_dot, V_dot = laws(
        drive=ca.DM(drive),
        xi_tilde=ca.DM(case["xi"] - case["xi_hat"]),
        W=ca.DM(case["W"]),
        V=ca.DM(case["V"]),
        x_bar=ca.DM(case["x_bar"]),
        sigma=ca.DM(sigma),
        A_d=ca.DM(case["A_d"]),
        eta_W=3.0,
        eta_V=2.0,
        rho_W=rho[0],
        rho_V=rho[1],
    )
    return numbers(W_dot), numbers(V_dot)


def static_error(A_d, f, W, V, x_bar):
    """The error at rest: 0 = A_d ξ̃ + f - f̂, so ξ̃ = -A_d⁻¹ (f - W tanh(V x̄))."""
    return -ca.solve(A_d, f - W @ hidden_layer(V, x_bar))


def descent(case, drive, eta):
    """-η times the gradient, by automatic differentiation, of driveᵀ ξ̃(W, V) at rest."""
    W, V = ca.SX.sym("W", 2, N_H), ca.SX.sym("V", N_H, N_IN)
    f, x_bar = ca.DM([0.3, -0.7]), ca.DM(case["x_bar"])
    loss = ca.dot(ca.DM(drive), static_error(ca.DM(case["A_d"]), f, W, V, x_bar))
    evaluate = ca.Function("gradients", [W, V], [ca.jacobian(loss, s) for s in (W, V)])
    return [
        -rate * numbers(g).reshape(s.shape, order="F")
        for rate, g, s in zip(eta, evaluate(case["W"], case["V"]), (W, V), strict=True)
    ]


def check_descent(case, laws=weight_rates):
    W_dot, V_dot = rates(case, drive=case["z"], laws=laws)
    W_expected, V_expected = descent(case, case["z"], (3.0, 2.0))
    np.testing.assert_allclose(W_dot, W_expected, rtol=RESIDUAL, atol=RESIDUAL)
    np.testing.assert_allclose(V_dot, V_expected, rtol=RESIDUAL, atol=RESIDUAL)


def test_laws_descend_the_static_loss(case):
    """(11)-(13) without leakage are the gradient of zᵀ ξ̃ through the error at rest, W and V."""
    check_descent(case)


def without_transpose(*, A_d, **others):
    """Planted: solve(A_d, z) for solve(A_d.T, z) is another direction: A_d is not symmetric."""
    return weight_rates(A_d=A_d.T, **others)


def opposite_error(*, drive, **others):
    """Planted: ξ̂ - ξ in place of ξ - ξ̂ climbs the loss."""
    return weight_rates(drive=-drive, **others)


def without_slope(*, sigma, V, x_bar, **others):
    """Planted: (13) without its slope 1 - σ², as if the hidden layer were linear."""
    W_dot, _ = weight_rates(sigma=sigma, V=V, x_bar=x_bar, **others)
    _, V_dot = weight_rates(sigma=0 * sigma, V=V, x_bar=x_bar, **others)
    return W_dot, V_dot


@pytest.mark.parametrize("planted", [without_transpose, opposite_error, without_slope])
def test_a_planted_error_of_the_laws_is_caught(case, planted):
    with pytest.raises(AssertionError):
        check_descent(case, laws=planted)


def test_leakage_pulls_weights_back_in_proportion_to_the_error(case):
    W_still, V_still = rates(case, drive=case["z"])
    W_dot, V_dot = rates(case, drive=case["z"], rho=(0.7, 0.4))
    size = np.linalg.norm(case["xi"] - case["xi_hat"])
    np.testing.assert_allclose(W_dot - W_still, -0.7 * size * case["W"], rtol=1e-10)
    np.testing.assert_allclose(V_dot - V_still, -0.4 * size * case["V"], rtol=1e-10)


def check_observer(case, rng, rate=observer_rate):
    A_xi, B_xi = rng.normal(size=(2, 2)), np.diag(rng.normal(size=2))
    u, f, f_hat = rng.normal(size=2), rng.normal(size=2), rng.normal(size=2)
    xi, xi_hat, A_d = case["xi"], case["xi_hat"], case["A_d"]
    xi_dot = A_xi @ xi + B_xi @ u + f  # (7)
    xi_hat_dot = rate(A_d, A_xi, B_xi, xi, xi_hat, u, f_hat)  # (8)
    expected = A_d @ (xi - xi_hat) + f - f_hat
    np.testing.assert_allclose(xi_dot - xi_hat_dot, expected, atol=RESIDUAL)


def test_observer_error_obeys_the_prescribed_dynamics(case, rng):
    """(7) minus (8): dξ̃/dt = A_d ξ̃ + f - f̂, whatever A_ξ, B_ξ and the steering are."""
    check_observer(case, rng)


@pytest.mark.parametrize(
    "planted",
    [
        lambda A_d, *others: observer_rate(A_d.T, *others),
        lambda *p: observer_rate(*p) + p[1] @ (p[4] - p[3]),  # the model evaluated at ξ̂
        lambda *p: observer_rate(*p[:-1], 0 * p[-1]),  # the network's force left out
    ],
    ids=["transposed", "at the estimate", "without network"],
)
def test_planted_errors_of_the_observer_are_caught(case, rng, planted):
    with pytest.raises(AssertionError):
        check_observer(case, rng, rate=planted)


def test_filter_is_the_exponentially_weighted_integral():
    """(10) for ξ̃ = sin ωt against its integral in closed form: the filter's rate is its slope."""
    lam, w = 3.0, 2.0

    def z(t):  # ∫ exp(-λ (t - τ)) sin ωτ dτ from 0 to t
        numerator = lam * np.sin(w * t) - w * np.cos(w * t) + w * np.exp(-lam * t)
        return numerator / (lam**2 + w**2)

    for t in (0.1, 0.7, 2.0):
        slope = (lam * w * np.cos(w * t) + w**2 * np.sin(w * t) - lam * w * np.exp(-lam * t)) / (
            lam**2 + w**2
        )
        assert filter_rate(lam, z(t), np.sin(w * t)) == pytest.approx(slope, abs=RESIDUAL)


def test_a_law_without_a_share_of_an_error_costs_no_operation_for_it():
    """0 ξ̃ and 1 z leave no trace in the compiled step."""
    z, xi_tilde, lead = (ca.SX.sym(name) for name in ("z", "xi_tilde", "lead"))
    expected = {"integral": z, "instantaneous": xi_tilde, "pi_lead": z + lead * xi_tilde}
    assert set(LAWS) == set(expected)
    for name, law in LAWS.items():
        assert ca.is_equal(law.error(lead).drive(z, xi_tilde), expected[name], 2), name


# The network: what it may read, and weights that follow from a seed.


def test_every_signal_can_be_read(car):
    """Slip angles among them, in the paper's sign; each divided by its scale."""
    p = car.bicycle
    network = Network(hidden=3, inputs=tuple(SIGNALS))
    x, u, v_x = np.array([0.4, 0.2]), np.array([0.05, -0.01]), 15.0
    x_bar = network.normalized_input(network_signals(p, v_x, ca.DM(x), ca.DM(u)))
    alpha = u - np.array([x[0] + p.l_f * x[1], x[0] - p.l_r * x[1]]) / v_x
    raw = np.concatenate([x, u, [v_x], alpha])
    np.testing.assert_allclose(np.array(x_bar)[:, 0], raw / list(SIGNALS.values()), rtol=1e-14)


def test_initial_weights_follow_from_the_generator():
    network = Network(hidden=7)
    one = network.initial_weights(np.random.default_rng(3))
    same = network.initial_weights(np.random.default_rng(3))
    other = network.initial_weights(np.random.default_rng(4))
    np.testing.assert_array_equal(one.V, same.V)
    assert np.abs(one.V - other.V).max() > 0.1
    assert one.W.shape == (2, 7)
    assert one.V.shape == (7, 4)


@pytest.mark.parametrize(
    "wrong",
    [
        {"hidden": 0}, {"inputs": ("v_y", "speed")}, {"inputs": ("v_y", "v_y")}, {"inputs": ()},
        {"scale": (1.0, 2.0)}, {"scale": (1.0, 2.0, 0.0, 1.0)},
    ],
)  # fmt: skip
def test_impossible_structures_are_refused(wrong):
    with pytest.raises(ValueError, match="must"):
        Network(**wrong)


def test_a_list_of_scales_makes_the_same_network_as_a_tuple():
    one = Network(inputs=["v_y", "r"], scale=[2.0, 3.0])
    two = Network(inputs=("v_y", "r"), scale=(2.0, 3.0))
    assert one == two and hash(one) == hash(two)
