"""The compiled extended Kalman filters against the textbook in numpy."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from identifier.baselines import ForceEkf, dugoff_ekf, magic_formula_ekf
from identifier.baselines.kalman import correct
from identifier.run import identify
from models.vehicle import GRAVITY


def derivative(function, at):
    """Central differences of a function of a vector, (m, n)."""
    columns = []
    for i in range(at.size):
        step = np.zeros(at.size)
        step[i] = 1e-5 * max(1.0, abs(at[i]))
        columns.append((function(at + step) - function(at - step)) / (2 * step[i]))
    return np.array(columns).T


def textbook(recording, car, method, force, theta, P_theta, walk):
    """Predict, correct, one after the other; returns estimates carried into each next sample."""
    m, I_z, l_f, l_r = car.mass, car.yaw_inertia, car.l_f, car.l_r
    R = np.diag([method.v_y_noise, method.r_noise]) ** 2
    n, dt = 2 + theta.size, method.dt
    Q = np.diag([method.v_y_disturbance, method.r_disturbance, *walk]) ** 2 * dt
    s, P = np.concatenate([recording.x[0], theta]), np.zeros((n, n))
    P[:2, :2], P[2:, 2:] = R, P_theta
    rows, H = [s], np.eye(2, n)
    for k in range(1, len(recording)):
        u, v_x = recording.u[k - 1 : k + 1].mean(axis=0), recording.v_x[k - 1 : k + 1].mean()

        def rate(state, u=u, v_x=v_x):
            F = force(state[2:], v_x, state[:2], u)
            v_dot = F.sum() / m - v_x * state[1]
            return np.array([v_dot, (l_f * F[0] - l_r * F[1]) / I_z])

        def ahead(state, rate=rate):
            J = derivative(rate, state)[:, :2]
            x = state[:2] + np.linalg.solve(np.eye(2) - dt / 2 * J, dt * rate(state))
            return np.concatenate([x, state[2:]])

        F = derivative(ahead, s)
        s, P = ahead(s), F @ P @ F.T + Q
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        s, P = s + K @ (recording.x[k] - s[:2]), (np.eye(n) - K @ H) @ P
        rows.append(s)
    return np.array(rows), P


def slips(car, v_x, x, u):
    arm = np.array([car.l_f, -car.l_r])
    return u - np.arctan2(x[0] + arm * x[1], v_x)


def magic(car, method):
    told, loads = np.array(car.bicycle)[4:], np.array(car.axle_loads)

    def force(theta, v_x, x, u):
        D = method.friction * loads * np.exp(theta[4:])
        C = 1 + 1 / (1 + np.exp(-theta[2:4]) * 0.6 / 0.4)
        B = told * np.exp(theta[:2]) / (C * D)
        return D * np.sin(C * np.arctan(B * slips(car, v_x, x, u))) * np.cos(u)

    return force


@pytest.mark.parametrize("dt", [0.01, 0.03])
def test_magic_formula_filter_is_the_textbook(dt, car, drive, rng):
    clean = drive(n=120, dt=dt)
    v_y = clean.v_y + 0.02 * rng.standard_normal(120)
    recording = replace(clean, v_y=v_y, r=clean.r + 0.002 * rng.standard_normal(120))
    method = replace(magic_formula_ekf(car), outlier=1e6, dt=dt)
    history = identify(recording, car, method)
    spread = [0.5, 0.5, 0.7, 0.7, 0.4, 0.4]
    rows, P = textbook(
        recording,
        car,
        method,
        magic(car, method),
        np.zeros(6),
        np.diag(spread) ** 2,
        [method.walk] * 6,
    )
    np.testing.assert_allclose(history.state["estimate"][1:], rows, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(history.state["P"][-1], P, rtol=1e-3, atol=1e-8)
    other = replace(method, v_y_disturbance=1.1 * method.v_y_disturbance)
    estimate = identify(recording, car, other).state["estimate"][1:]
    assert not np.allclose(estimate, rows, rtol=1e-4, atol=1e-6), "a wrong number shows"


def test_force_filter_is_the_textbook_and_tells_the_corrected_force(car, drive):
    recording, method = drive(n=200), replace(ForceEkf.for_vehicle(car), outlier=1e6)
    loads = np.array([car.l_r, car.l_f]) * car.mass * GRAVITY / car.wheelbase
    rows, _ = textbook(
        recording,
        car,
        method,
        lambda theta, v_x, x, u: loads * theta,
        np.zeros(2),
        np.eye(2),
        [method.force_walk] * 2,
    )
    history = identify(recording, car, method)
    np.testing.assert_allclose(history.axle_force, rows[:, 2:] * loads, rtol=1e-5, atol=0.1)


@pytest.mark.parametrize("make", [magic_formula_ekf, dugoff_ekf, ForceEkf.for_vehicle])
def test_covariance_stays_symmetric_and_positive(make, car, drive):
    P = identify(drive(n=3000), car, make(car)).state["P"][1:]
    np.testing.assert_array_equal(P, P.swapaxes(1, 2))
    assert np.linalg.eigvalsh(P).min() > 0.0


@pytest.mark.parametrize("make", [magic_formula_ekf, dugoff_ekf])
@pytest.mark.parametrize("size", [1000.0, -1000.0])
def test_a_spike_teaches_little_and_all_forces_stay_finite(size, make, car, drive):
    clean, method = drive(n=800), make(car)
    v_y = clean.v_y.copy()
    v_y[500] += size
    spiked = replace(clean, v_y=v_y)

    def moved(method):
        history = identify(spiked, car, method)
        assert np.isfinite(history.axle_force).all()
        theta = history.state["estimate"][:, 2:]
        deviation = np.sqrt(np.diag(history.state["P"][500]))[2:]
        return np.max(np.abs(theta[502] - theta[500]) / deviation)

    assert moved(method) < 1.0
    assert moved(replace(method, outlier=1e6)) > 3.0, "without the guard the spike is believed"


@pytest.mark.parametrize("away", [(0.5, -2.0), (3.0, 80.0), (-80.0, 3.0), (-9.0, -7.0)])
def test_an_outlier_is_followed_but_teaches_as_one_at_the_limit(away, rng):
    """Measured `away` deviations: θ moves as for the same, cut to 5; x all the way; P as ever."""
    root = rng.standard_normal((5, 5))
    P, R, estimate = root @ root.T, np.diag([0.3, 0.7]), rng.standard_normal(5)
    S = P[:2, :2] + R
    deviation = np.sqrt(np.diag(S))
    gain = P[:, :2] @ np.linalg.inv(S)
    x = estimate[:2] + np.array(away) * deviation
    after, P_after = (np.array(ca.DM(v)) for v in correct(*map(ca.DM, (estimate, P, R, x)), 5.0))
    moved = after.ravel() - estimate
    np.testing.assert_allclose(moved[:2], gain[:2] @ (np.array(away) * deviation), rtol=1e-9)
    cut = np.clip(away, -5.0, 5.0) * deviation
    np.testing.assert_allclose(moved[2:], gain[2:] @ cut, rtol=1e-9)
    np.testing.assert_allclose(P_after, P - gain @ S @ gain.T, rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("make", [magic_formula_ekf, dugoff_ekf])
def test_at_rest_the_force_is_zero_and_learning_rests(make, car, halted_drive):
    recording, rest = halted_drive
    history = identify(recording, car, make(car))
    assert (history.axle_force[rest] == 0.0).all()
    theta = history.state["estimate"][:, 2:]
    assert (np.diff(theta, axis=0)[rest] == 0.0).all()
    assert np.abs(np.diff(theta, axis=0)[~rest]).max() > 0.0
