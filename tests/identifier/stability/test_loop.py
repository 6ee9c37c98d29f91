import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

from identifier.paper.laws import LAWS, DrivingError, filter_rate, weight_rates
from identifier.paper.network import hidden_layer
from identifier.stability.loop import (
    INSTANTANEOUS,
    INTEGRAL,
    Loop,
    growth_rate,
    root_locus,
)

A_D = np.array([[-6.0, 2.5], [-0.7, -4.0]])


def frozen_identifier(law, feedback):
    """The identifier's own laws at an equilibrium of f_hat, differentiated by CasADi.

    Returns the (6, 6) Jacobian of (ξ̃, z, p)' with p = f_hat(x_bar frozen), and the G it must show.
    """
    rng = np.random.default_rng(5)
    n_h, n_in = 6, 4
    W, V = rng.standard_normal((2, n_h)), rng.standard_normal((n_h, n_in))
    x_bar, eta_W, eta_V = rng.standard_normal(n_in), 30.0, 2.0
    xi_tilde, z = ca.SX.sym("xi_tilde", 2), ca.SX.sym("z", 2)
    W_now, V_now = ca.SX.sym("W", 2, n_h), ca.SX.sym("V", n_h, n_in)
    sigma = hidden_layer(V_now, x_bar)
    rates = weight_rates(
        drive=law.error(0.3).drive(z, xi_tilde),
        xi_tilde=xi_tilde,
        W=W_now,
        V=V_now,
        x_bar=ca.DM(x_bar),
        sigma=sigma,
        A_d=ca.DM(A_D),
        eta_W=eta_W,
        eta_V=eta_V,
        rho_W=0.0,
        rho_V=0.0,
    )
    weights = ca.vertcat(ca.vec(W_now), ca.vec(V_now))
    weights_dot = ca.vertcat(ca.vec(rates.W_dot), ca.vec(rates.V_dot))
    p_dot = ca.jtimes(W_now @ sigma, weights, weights_dot)  # rate of f_hat by the laws
    state = ca.vertcat(xi_tilde, z)
    jacobian = ca.Function("J", [state, weights], [ca.jacobian(p_dot, state)])
    at = ca.vertcat(ca.vec(ca.DM(W)), ca.vec(ca.DM(V)))
    learning = np.array(jacobian(np.zeros(4), at))
    filter_jacobian = ca.Function("F", [state], [ca.jacobian(filter_rate(3.0, z, xi_tilde), state)])
    top = np.hstack([A_D + feedback, np.zeros((2, 2)), -np.eye(2)])
    middle = np.hstack([np.array(filter_jacobian(np.zeros(4))), np.zeros((2, 2))])
    bottom = np.hstack([learning, -0.4 * np.eye(2)])
    s = np.tanh(V @ x_bar)
    slope = W * (1.0 - s**2)
    G = eta_W * (s @ s) * np.eye(2) + eta_V * (x_bar @ x_bar) * slope @ slope.T
    return np.vstack([top, middle, bottom]), G


@pytest.mark.parametrize("law", LAWS.values())
def test_the_loop_matrix_is_the_jacobian_of_the_laws_of_the_identifier(law):
    feedback = np.array([[0.3, -0.1], [0.2, 0.5]])
    jacobian, G = frozen_identifier(law, feedback)
    loop = Loop(
        A_d=A_D, forgetting=3.0, law=law.error(0.3), G=G, leakage=0.4, input_feedback=feedback
    )
    np.testing.assert_allclose(loop.matrix(), jacobian, rtol=1e-9, atol=1e-9)


def test_a_transpose_forgotten_in_the_gradient_would_be_seen():
    jacobian, G = frozen_identifier(LAWS["integral"], np.zeros((2, 2)))
    loop = Loop(A_d=A_D, forgetting=3.0, law=INTEGRAL, G=G, leakage=0.4)
    wrong = loop.matrix()
    wrong[4:, 2:4] = -G @ np.linalg.inv(A_D)
    assert np.abs(wrong - jacobian).max() > 1.0


def test_growth_is_that_of_the_powers_of_the_step_or_of_the_matrix_exponential():
    M = Loop(A_d=A_D, forgetting=3.0, law=INTEGRAL, G=40.0 * np.eye(2)).matrix()
    for step, dt in ((np.eye(6) + 0.02 * M, 0.02), (expm(0.02 * M), None)):
        radius = np.abs(np.linalg.eigvals(step)).max()
        assert growth_rate(M, dt) == pytest.approx(np.log(radius) / 0.02, rel=1e-8)


def test_a_law_gives_the_coefficients_of_its_driving_error():
    assert LAWS["integral"].error(0.2) == INTEGRAL == (1.0, 0.0)
    assert LAWS["instantaneous"].error(0.2) == INSTANTANEOUS == (0.0, 1.0)
    assert LAWS["pi_lead"].error(0.2) == DrivingError(1.0, 0.2) == (1.0, 0.2)


def test_the_root_locus_begins_at_the_poles_of_the_open_loop_and_keeps_its_center():
    loop = Loop(A_d=A_D, forgetting=3.0, law=INTEGRAL, G=np.eye(2), leakage=0.2)
    locus = root_locus(loop, [0.0, 1.0, 1e4])
    poles = [*np.linalg.eigvals(A_D), -3.0, -3.0, -0.2, -0.2]
    np.testing.assert_allclose(np.poly(locus[0]), np.poly(poles), rtol=1e-9)
    np.testing.assert_allclose(locus.sum(axis=1), np.trace(loop.matrix()), rtol=1e-9)
