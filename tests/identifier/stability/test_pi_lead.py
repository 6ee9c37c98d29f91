from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from identifier.paper.laws import LAWS, Gains
from identifier.stability import Operation, certify
from identifier.stability.loop import INTEGRAL, Loop, direction_matrix
from identifier.stability.lyapunov import lyapunov
from identifier.stability.margins import drift_frequency, gain_margin
from identifier.stability.sampled_bound import Disturbance
from tests.identifier.stability.storage import (
    Storage,
    lead_time,
    pi_lead,
    scalar_storage,
    storage,
    storage_residual,
)

SKEWED = np.array([[-4.0, 6.0], [-0.5, -3.0]])


def test_the_storage_of_one_channel_satisfies_its_balance_symbolically():
    a, lam, tau, xi_tilde, z, force = (ca.SX.sym(n) for n in ("a", "l", "t", "x", "z", "e"))
    state = ca.vertcat(xi_tilde, z)
    P = ca.vertcat(ca.horzcat(tau / a, 1 / a), ca.horzcat(1 / a, (a + lam) / a))
    Q = ca.diag(ca.vertcat(2 * (tau - 1 / a), 2 * lam * (a + lam) / a))
    stored = state.T @ P @ state / 2
    rate = ca.jtimes(stored, state, ca.vertcat(-a * xi_tilde + force, xi_tilde - lam * z))
    y = (z + tau * xi_tilde) / a
    balance = rate - (y * force - state.T @ Q @ state / 2)
    every = ca.vertcat(a, lam, tau, xi_tilde, z, force)
    left = ca.Function("left", [every], [balance, ca.hessian(balance, every)[0]])
    rng = np.random.default_rng(0)
    for _ in range(50):
        value, hessian = left(rng.uniform(0.5, 3.0, 6))
        assert abs(float(value)) < 1e-11
        assert np.abs(np.array(hessian)).max() < 1e-9
    numbers = scalar_storage(a=2.0, lam=3.0, tau=0.7)
    filled = ca.Function("filled", [a, lam, tau], [P, Q])(2.0, 3.0, 0.7)
    np.testing.assert_allclose(numbers.M, np.array(filled[0]))
    np.testing.assert_allclose(numbers.N, np.array(filled[1]))


def test_the_substitution_catches_a_storage_that_is_slightly_wrong():
    a, lam, tau = 2.0, 3.0, 0.7
    output = np.array([[tau / a, 1.0 / a]])
    right = scalar_storage(a=a, lam=lam, tau=tau)
    assert storage_residual(right, A_d=-a, forgetting=lam, output=output) < 1e-14
    planted = Storage(M=right.M + np.diag([0.0, 1e-3]), N=right.N)
    assert storage_residual(planted, A_d=-a, forgetting=lam, output=output) > 1e-4


def test_the_law_is_passive_exactly_from_a_lead_of_one_over_a_on():
    assert scalar_storage(a=4.0, lam=3.0, tau=0.2500001).proves_passivity
    assert not scalar_storage(a=4.0, lam=3.0, tau=0.2499).proves_passivity
    A_d = -4.0 * np.eye(2)
    assert drift_frequency(A_d=A_d, forgetting=3.0, law=pi_lead(0.25)) == np.inf
    assert drift_frequency(A_d=A_d, forgetting=3.0, law=pi_lead(0.2499)) < 1e4


def test_the_lead_removes_the_gain_limit_that_the_integral_law_has():
    for law, limited in ((INTEGRAL, True), (pi_lead(0.25), False)):
        loop = Loop(A_d=-4.0 * np.eye(2), forgetting=3.0, law=law, G=np.eye(2))
        assert np.isfinite(gain_margin(loop).factor) is np.bool_(limited)


def test_the_storage_for_any_hurwitz_matrix_satisfies_the_positive_real_lemma():
    rng = np.random.default_rng(4)
    for _ in range(30):
        A_d = -rng.uniform(2.0, 8.0) * np.eye(2) + 2.5 * rng.standard_normal((2, 2))
        if np.linalg.eigvals(A_d).real.max() > -0.2:
            continue
        root = rng.standard_normal((2, 2))
        pair, lam = lyapunov(A_d, root @ root.T + 0.1 * np.eye(2)), rng.uniform(0.5, 8.0)
        tau = lead_time(pair, forgetting=lam)
        stored = storage(pair, forgetting=lam, tau=1.0001 * tau)
        output = np.hstack([1.0001 * tau * pair.P, pair.P])
        assert storage_residual(stored, A_d=A_d, forgetting=lam, output=output) < 1e-10
        assert stored.proves_passivity
        assert not storage(pair, forgetting=lam, tau=0.999 * tau).proves_passivity


def test_the_general_law_is_the_printed_direction_where_error_dynamics_are_symmetric():
    A_d = np.array([[-3.0, 1.0], [1.0, -5.0]])
    pair = lyapunov(A_d, 2.0 * np.eye(2))
    np.testing.assert_allclose(pair.P, -np.linalg.inv(A_d), rtol=1e-12)
    slowest = -np.linalg.eigvalsh(A_d)[-1]
    assert lead_time(pair, forgetting=2.0) == pytest.approx(1.0 / slowest, rel=1e-9)


def test_with_skewed_error_dynamics_the_printed_direction_has_a_limit_even_with_lead():
    pair = lyapunov(SKEWED, 2.0 * np.eye(2))
    law = pi_lead(1.01 * lead_time(pair, forgetting=3.0))
    printed = Loop(A_d=SKEWED, forgetting=3.0, law=law, G=np.eye(2))
    passive = Loop(A_d=SKEWED, forgetting=3.0, law=law, G=np.eye(2), direction=pair.P)
    assert np.isfinite(gain_margin(printed).factor)
    assert gain_margin(passive).factor == np.inf


def test_the_law_that_runs_goes_along_p_of_the_lyapunov_equation():
    rng = np.random.default_rng(7)
    for _ in range(50):
        A_d = -rng.uniform(1.0, 8.0) * np.eye(2) + 2.0 * rng.standard_normal((2, 2))
        if np.linalg.eigvals(A_d).real.max() > -0.1:
            continue
        P = direction_matrix(LAWS["pi_lead"], A_d)
        np.testing.assert_allclose(A_d.T @ P + P @ A_d, -2.0 * np.eye(2), atol=1e-10)
        printed = direction_matrix(LAWS["integral"], A_d)
        np.testing.assert_allclose(A_d.T @ printed, -np.eye(2), atol=1e-10)


def test_the_certificate_finds_no_gain_limit_of_the_lead_even_for_skewed_error_dynamics():
    tau = 1.01 * lead_time(lyapunov(SKEWED, 2.0 * np.eye(2)), forgetting=3.0)
    task = Operation(
        n_h=4,
        dt=0.001,
        integrator="rk4",
        bandwidth=0.5,
        disturbance=Disturbance(residual=2.0),
        needed_force=2.0,
        x_bar_max=1.0,
        input_feedback=None,
        W_M=0.0,
        w_bar=2.0,
    )
    gains = Gains(
        A_d=tuple(map(tuple, SKEWED)),
        forgetting=3.0,
        eta_W=1.0,
        eta_V=0.0,
        rho_W=0.1,
        rho_V=0.1,
        lead=tau,
    )
    certificate = certify(gains, LAWS["pi_lead"], task)
    assert certificate["gain_continuous"].margin == np.inf
    assert certificate["drift"].limit == np.inf
    short = certify(replace(gains, lead=0.2 * tau), LAWS["pi_lead"], task)
    assert short["drift"].limit < np.inf
