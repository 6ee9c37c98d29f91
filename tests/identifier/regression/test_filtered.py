"""y = W s: to round-off where the trapezoidal rule holds, to second order where it does not."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest

from identifier.regression.laws import Lags, filtered_pair
from identifier.run import identify
from models.bicycle import bicycle

UNIT, DT, SPEED = 1000.0, 0.01, 20.0
W_TRUE = np.array([[1.5, -0.8, 0.3], [-0.6, 1.1, 0.9]])
V = np.array([[1.0, -0.4, 2.0, 0.0], [0.2, 1.3, -1.0, 0.5], [-0.9, 0.3, 0.6, 1.0]])


def run_filters(xi, b, sigma, filter_rate=4.0, dt=DT):
    """s and y of the filters over samples."""
    sizes = {"target_lag": 2, "regressor_lag": 3, "fresh": 1, "xi": 2, "b": 2, "sigma": 3}
    p = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
    signals = {name: p[name] for name in ("xi", "b", "sigma")}
    lags = Lags(p["target_lag"], p["regressor_lag"])
    pair, following = filtered_pair(lags, p["fresh"], **signals, filter_rate=filter_rate, dt=dt)
    lags = ca.vertcat(*lags)
    samples = [p[name] for name in ("fresh", "xi", "b", "sigma")]
    function = ca.Function("pair", [lags, *samples], [ca.vertcat(*following), pair.s, pair.y])
    fresh = np.arange(len(xi)) == 0
    rows = (np.array(column, dtype=float).T for column in (fresh[:, None], xi, b, sigma))
    _, s, y = function.mapaccum(len(xi))(np.zeros(5), *rows)
    return np.array(s).T, np.array(y).T


@cache
def drive_by_trapezoids(car, n=300, dt=DT, refine=1):
    """ξ, b, σ (n, .) of dξ/dt = b + W σ by the implicit trapezoidal rule, solved to round-off.

    With `refine` steps to a sample, which are then all that is told.
    """
    _, _, K, _, A_xi, B_xi = (np.array(ca.DM(m)) for m in bicycle(car.bicycle, SPEED))
    h = dt / refine
    t = h * np.arange(n * refine)
    u = np.column_stack([0.06 * np.sin(3 * t), 0.01 * np.sin(5 * t)])

    def terms(xi, u):
        x_bar = np.concatenate([UNIT * K @ xi, u]) / [1.0, 0.5, 0.1, 0.1]
        return A_xi @ xi + B_xi @ u / UNIT, np.tanh(V @ x_bar)

    xi, rows = np.array([0.1, -0.05]), []
    for k, steering in enumerate(u):
        b, sigma = terms(xi, steering)
        rows.append((xi, b, sigma))
        ahead = xi
        for _ in range(20):  # a contraction by about h |A_ξ| < 0.1
            b_next, sigma_next = terms(ahead, u[min(k + 1, len(u) - 1)])
            last, ahead = ahead, xi + h / 2 * (b + b_next + W_TRUE @ (sigma + sigma_next))
            if np.abs(ahead - last).max() < 1e-16:
                break
        xi = ahead
    return [np.array(column)[::refine] for column in zip(*rows, strict=True)]


@pytest.mark.parametrize("filter_rate", [0.5, 4.0, 40.0])
def test_constant_weights_satisfy_the_regression_to_round_off(filter_rate, car):
    s, y = run_filters(*drive_by_trapezoids(car), filter_rate)
    assert np.abs(y).max() > 0.1  # kN: there is something to explain
    np.testing.assert_allclose(y, s @ W_TRUE.T, rtol=0, atol=1e-12)


def test_a_known_rate_that_is_a_sample_late_is_caught(car):
    xi, b, sigma = drive_by_trapezoids(car)
    s, y = run_filters(xi, np.vstack([b[:1], b[:-1]]), sigma)
    assert np.abs(y - s @ W_TRUE.T).max() > 0.01 * np.abs(y).max()


def test_in_continuous_time_the_error_falls_with_the_square_of_the_step(car):
    errors = []
    for dt in (0.04, 0.02):
        refined = drive_by_trapezoids(car, n=int(3.0 / dt), dt=dt, refine=int(dt / 0.001))
        s, y = run_filters(*refined, dt=dt)
        errors.append(np.abs(y - s @ W_TRUE.T).max())
    assert 3.5 < errors[0] / errors[1] < 4.5


def test_the_filters_have_the_transfer_function_of_their_name():
    """κ/(s + κ) of a sine: by its amplitude and phase, once the start is forgotten."""
    kappa, omega, dt = 4.0, 3.0, 0.001
    t = dt * np.arange(8000)
    sine = np.sin(omega * t)[:, None]
    s, y = run_filters(np.hstack([sine, 0 * sine]), np.zeros((8000, 2)), sine * [1, 2, 0], dt=dt)
    expected = np.imag(kappa / (kappa + 1j * omega) * np.exp(1j * omega * t))
    np.testing.assert_allclose(s[4000:, 1], 2 * expected[4000:], atol=1e-4)
    rate = np.real(omega * kappa / (kappa + 1j * omega) * np.exp(1j * omega * t))
    np.testing.assert_allclose(y[4000:, 0], rate[4000:], atol=1e-3)


def test_after_a_rest_the_filters_begin_as_at_the_first_sample(car, drive, design):
    whole = drive(n=300)
    stops = np.where(np.arange(300) // 40 == 3, 0.0, whole.v_x)
    paused = identify(replace(whole, v_x=stops), car, design())
    signals = ("t", "v_x", "v_y", "r", "delta_f", "delta_r")
    rest = replace(whole, axle_force=None, **{name: getattr(whole, name)[160:] for name in signals})
    anew = identify(rest, car, design())
    for name in ("target_lag", "regressor_lag"):
        np.testing.assert_array_equal(paused.state[name][161:], anew.state[name][1:])
    unpaused = identify(whole, car, design()).state["target_lag"]
    assert np.abs(unpaused[161:200] - anew.state["target_lag"][1:40]).max() > 0.01
    np.testing.assert_allclose(paused.outputs["residual"][120:161], 0.0, atol=1e-12)
    np.testing.assert_array_equal(paused.state["P"][120], paused.state["P"][161])
