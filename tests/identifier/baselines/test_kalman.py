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


def textbook(recording, car, method, force, theta, P_theta, walk, lag=None, slip=None):
    """Predict, correct, one after the other; returns estimates carried into each next sample.

    force(θ, v_x, x, u); where slip lags, force(θ, α', u), slip(θ, v_x, x, u) and lag(θ) [m].
    """
    m, I_z, l_f, l_r = car.mass, car.yaw_inertia, car.l_f, car.l_r
    R = np.diag([method.v_y_noise, method.r_noise]) ** 2
    lags = 0 if lag is None else 2
    n, z, dt = 2 + lags + theta.size, 2 + lags, method.dt
    disturbances = [method.v_y_disturbance, method.r_disturbance, *[0.0] * lags]
    Q = np.diag([*disturbances, *walk]) ** 2 * dt
    x, P = recording.x[0], np.zeros((n, n))
    P[:2, :2], P[z:, z:] = R, P_theta
    begun = []
    if lag is not None:  # a start is a steady slide, known as far as x and θ are
        at = recording.v_x[0], recording.u[0]

        def steady(v):
            return np.concatenate([v[:2], slip(v[2:], at[0], v[:2], at[1]), v[2:]])

        begun = slip(theta, at[0], x, at[1])
        T = derivative(steady, np.concatenate([x, theta]))
        P = (
            T
            @ np.block([[R, np.zeros((2, theta.size))], [np.zeros((theta.size, 2)), P_theta]])
            @ T.T
        )
        P[2:4, 2:4] += np.eye(2) * (method.v_y_noise / at[0]) ** 2
    s = np.concatenate([x, begun, theta])
    rows, H = [s], np.eye(2, n)
    for k in range(1, len(recording)):
        u, v_x = recording.u[k - 1 : k + 1].mean(axis=0), recording.v_x[k - 1 : k + 1].mean()

        def rate(state, u=u, v_x=v_x):
            if lag is None:
                F, slip_rate = force(state[2:], v_x, state[:2], u), []
            else:
                F = force(state[4:], state[2:4], u)
                slip_rate = v_x / lag(state[4:]) * (slip(state[4:], v_x, state[:2], u) - state[2:4])
            v_dot = F.sum() / m - v_x * state[1]
            return np.array([v_dot, (l_f * F[0] - l_r * F[1]) / I_z, *slip_rate])

        def ahead(state, rate=rate):
            J = derivative(rate, state)[:, :z]
            moved = state[:z] + np.linalg.solve(np.eye(z) - dt / 2 * J, dt * rate(state))
            return np.concatenate([moved, state[z:]])

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
    method = replace(magic_formula_ekf(car, textbook=True), outlier=1e6, dt=dt)
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


@pytest.mark.parametrize("dt", [0.01, 0.03])
def test_the_lagged_filter_is_the_textbook_with_more_states(dt, car, drive, rng):
    """States α' and unknowns ln σ/σ₀, δ₀ and b, v_y and r as the sensors read them."""
    clean = drive(n=120, dt=dt)
    v_y = clean.v_y + 0.1 + 0.02 * rng.standard_normal(120)
    recording = replace(clean, v_y=v_y, r=clean.r + 0.002 * rng.standard_normal(120))
    method = replace(magic_formula_ekf(car), outlier=1e6, dt=dt)
    told, loads = np.array(car.bicycle)[4:], np.array(car.axle_loads)

    def force(theta, slip, u):
        D = method.friction * loads * np.exp(theta[4:6])
        C = 1 + 1 / (1 + np.exp(-theta[2:4]) * 0.6 / 0.4)
        return D * np.sin(C * np.arctan(told * np.exp(theta[:2]) / (C * D) * slip)) * np.cos(u)

    def slip(theta, v_x, x, u):
        zero, bias = theta[8] * method.steering_spread, theta[9] * method.v_y_spread
        return np.array([zero, 0.0]) + slips(car, v_x, x - [bias, 0.0], u)

    spread = [0.5, 0.5, 0.7, 0.7, 0.4, 0.4, *[method.relaxation_spread] * 2, 1.0, 1.0]
    rows, P = textbook(
        recording,
        car,
        method,
        force,
        np.zeros(10),
        np.diag(spread) ** 2,
        [method.walk] * 10,
        lag=lambda theta: method.relaxation_length * np.exp(theta[6:8]),
        slip=slip,
    )
    history = identify(recording, car, method)
    np.testing.assert_allclose(history.state["estimate"][1:], rows, rtol=1e-3, atol=1e-5)
    np.testing.assert_allclose(history.state["P"][-1], P, rtol=1e-2, atol=1e-7)
    assert np.abs(rows[-1, 10:]).max() > 0.01, "lag and offsets have moved"
    other = replace(method, relaxation_length=1.05 * method.relaxation_length)
    estimate = identify(recording, car, other).state["estimate"][1:]
    assert not np.allclose(estimate, rows, rtol=1e-3, atol=1e-5), "a wrong number shows"


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
