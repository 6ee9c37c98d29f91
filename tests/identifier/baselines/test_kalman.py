"""The compiled extended Kalman filters against the textbook in numpy."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from identifier.baselines import magic_formula_ekf
from identifier.baselines.kalman import correct
from identifier.run import identify


def derivative(function, at):
    """Central differences of a function of a vector, (m, n)."""
    columns = []
    for i in range(at.size):
        step = np.zeros(at.size)
        step[i] = 1e-5 * max(1.0, abs(at[i]))
        columns.append((function(at + step) - function(at - step)) / (2 * step[i]))
    return np.array(columns).T


def textbook(recording, car, method, force, P_theta, walk):
    """Predict and correct with force(θ, v_x, x, u), from θ = 0; what each sample begins with."""
    R = np.diag([method.v_y_noise, method.r_noise]) ** 2
    n, dt = 2 + len(walk), method.dt
    Q = np.diag([method.v_y_disturbance, method.r_disturbance, *walk]) ** 2 * dt
    s, P, H = np.concatenate([recording.x[0], np.zeros(n - 2)]), np.zeros((n, n)), np.eye(2, n)
    P[:2, :2], P[2:, 2:] = R, P_theta
    rows = [s]
    for k in range(1, len(recording)):
        u, v_x = recording.u[k - 1 : k + 1].mean(axis=0), recording.v_x[k - 1 : k + 1].mean()

        def rate(state, u=u, v_x=v_x):
            F = force(state[2:], v_x, state[:2], u)
            turn = (car.l_f * F[0] - car.l_r * F[1]) / car.yaw_inertia
            return np.array([F.sum() / car.mass - v_x * state[1], turn])

        def ahead(state, rate=rate):
            J = derivative(rate, state)[:, :2]
            moved = state[:2] + np.linalg.solve(np.eye(2) - dt / 2 * J, dt * rate(state))
            return np.concatenate([moved, state[2:]])

        F = derivative(ahead, s)
        s, P = ahead(s), F @ P @ F.T + Q
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        s, P = s + K @ (recording.x[k] - s[:2]), (np.eye(n) - K @ H) @ P
        rows.append(s)
    return np.array(rows), P


def magic(car, method):
    told, loads = np.array(car.bicycle)[4:], np.array(car.axle_loads)

    def force(theta, v_x, x, u):
        D = method.friction * loads * np.exp(theta[4:])
        C = 1 + 1 / (1 + np.exp(-theta[2:4]) * 0.6 / 0.4)
        B = told * np.exp(theta[:2]) / (C * D)
        slip = u - np.arctan2(x[0] + np.array([car.l_f, -car.l_r]) * x[1], v_x)
        return D * np.sin(C * np.arctan(B * slip)) * np.cos(u)

    return force


@pytest.mark.sweep("0.01")
@pytest.mark.parametrize("dt", [0.01, 0.03])
def test_magic_formula_filter_is_the_textbook(dt, car, drive, rng):
    clean = drive(n=120, dt=dt)
    v_y = clean.v_y + 0.02 * rng.standard_normal(120)
    recording = replace(clean, v_y=v_y, r=clean.r + 0.002 * rng.standard_normal(120))
    method = replace(magic_formula_ekf(car, textbook=True), outlier=1e6, dt=dt)
    history = identify(recording, car, method)
    spread = [0.5, 0.5, 0.7, 0.7, 0.4, 0.4]
    P_theta, walk = np.diag(spread) ** 2, [method.walk] * 6
    rows, P = textbook(recording, car, method, magic(car, method), P_theta, walk)
    np.testing.assert_allclose(history.state["estimate"][1:], rows, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(history.state["P"][-1], P, rtol=1e-3, atol=1e-8)
    other = replace(method, v_y_disturbance=1.1 * method.v_y_disturbance)
    estimate = identify(recording, car, other).state["estimate"][1:]
    assert not np.allclose(estimate, rows, rtol=1e-4, atol=1e-6), "a wrong number shows"


def test_covariance_stays_symmetric_and_positive(car, drive):
    P = identify(drive(n=3000), car, magic_formula_ekf(car)).state["P"][1:]
    np.testing.assert_array_equal(P, P.swapaxes(1, 2))
    assert np.linalg.eigvalsh(P).min() > 0.0


@pytest.mark.parametrize("size", [1000.0, -1000.0])
def test_a_spike_teaches_little_and_all_forces_stay_finite(size, car, drive):
    clean, method = drive(n=800), magic_formula_ekf(car)
    v_y = clean.v_y.copy()
    v_y[500] += size
    spiked = replace(clean, v_y=v_y)

    def moved(method):
        history = identify(spiked, car, method)
        assert np.isfinite(history.axle_force).all()
        n = method.limit.size
        theta = history.state["estimate"][:, -n:]
        deviation = np.sqrt(np.diag(history.state["P"][500]))[-n:]
        return np.max(np.abs(theta[502] - theta[500]) / deviation)

    assert moved(method) < 1.0
    assert moved(replace(method, outlier=1e6)) > 3.0, "without the guard the spike is believed"


@pytest.mark.parametrize("away", [(0.5, -2.0), (3.0, 80.0), (-80.0, 3.0), (-9.0, -7.0)])
@pytest.mark.parametrize("follow", [True, False])
def test_an_outlier_is_followed_but_teaches_as_one_at_the_limit(follow, away, rng):
    """Measured `away` deviations: θ moves as for the same, cut to 5; x all the way where it is
    followed; P as ever."""
    root = rng.standard_normal((5, 5))
    P, R, estimate = root @ root.T, np.diag([0.3, 0.7]), rng.standard_normal(5)
    S = P[:2, :2] + R
    deviation = np.sqrt(np.diag(S))
    gain = P[:, :2] @ np.linalg.inv(S)
    x = estimate[:2] + np.array(away) * deviation
    found = correct(*map(ca.DM, (estimate, P, R, x)), 5.0, follow=follow)
    after, P_after = (np.array(ca.DM(v)) for v in found)
    moved = after.ravel() - estimate
    cut = np.clip(away, -5.0, 5.0) * deviation
    leading = np.array(away) * deviation if follow else cut
    np.testing.assert_allclose(moved[:2], gain[:2] @ leading, rtol=1e-9)
    np.testing.assert_allclose(moved[2:], gain[2:] @ cut, rtol=1e-9)
    np.testing.assert_allclose(P_after, P - gain @ S @ gain.T, rtol=1e-8, atol=1e-10)


def test_at_rest_the_force_is_zero_and_learning_rests(car, halted_drive):
    (recording, rest), method = halted_drive, magic_formula_ekf(car)
    history = identify(recording, car, method)
    assert (history.axle_force[rest] == 0.0).all()
    theta = history.state["estimate"][:, -method.limit.size :]
    assert (np.diff(theta, axis=0)[rest] == 0.0).all()
    assert np.abs(np.diff(theta, axis=0)[~rest]).max() > 0.0
