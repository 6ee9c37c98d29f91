"""The statistics give the exact gradient of the cost, and Newton's fixed point minimizes it."""

import casadi as ca
import numpy as np

from identifier.run import identify


def weighted_cost(W, s, y, forgetting, dt):
    """(9) for weights of now: Σ exp(-λ T (k - j)) |y_j - W s_j|² T/2, k the last pair."""
    age = dt * np.arange(len(s))[::-1]
    errors = ca.DM(y.T) - W @ ca.DM(s.T)
    return ca.sum2(ca.sum1(errors**2) @ ca.diag(ca.DM(np.exp(-forgetting * age)))) * dt / 2


def cost_gradient(W_at, *arguments):
    W = ca.SX.sym("W", *W_at.shape)
    J = ca.Function("J", [W], [ca.gradient(weighted_cost(W, *arguments), W)])
    return np.array(J(W_at))


def test_statistics_are_the_gradient_of_the_weighted_cost(car, drive, design, pairs, rng):
    chosen, recording = design("kreisselmeier"), drive(n=250)
    history = identify(recording, car, chosen)
    s, y = pairs(recording, chosen, car)
    Omega, Y = history.state["Omega"][-1], history.state["Y"][-1]
    for W in (history.state["W"][-1], rng.standard_normal((2, 6))):
        exact = cost_gradient(W, s, y, chosen.forgetting, chosen.dt)
        np.testing.assert_allclose(W @ Omega - Y, exact, rtol=1e-9, atol=1e-10)
    wrong = cost_gradient(W, s, y, 1.1 * chosen.forgetting, chosen.dt)  # another λ is seen
    assert np.abs(W @ Omega - Y - wrong).max() > 1e-3 * np.abs(wrong).max()


def test_the_step_goes_against_the_gradient_by_finite_differences(car, drive, design, pairs):
    """The move of W at the last sample, against differences of cost and ridge at the W of then."""
    chosen, recording = design("kreisselmeier"), drive(n=200)
    W = identify(recording, car, chosen).state["W"]
    s, y = pairs(recording, chosen, car)

    def cost(W):
        data = float(weighted_cost(ca.DM(W), s, y, chosen.forgetting, chosen.dt))
        return data + chosen.ridge * np.sum(W**2) / 2

    slope, step = np.zeros((2, 6)), 1e-4
    for index in np.ndindex(2, 6):
        nudge = np.zeros((2, 6))
        nudge[index] = step
        slope[index] = (cost(W[-2] + nudge) - cost(W[-2] - nudge)) / (2 * step)
    age = chosen.dt * np.arange(200)[::-1]
    size = np.sum(np.exp(-chosen.forgetting * age)[:, None] * s**2) * chosen.dt + 6 * chosen.ridge
    share = 1 - np.exp(-chosen.learning_rate * chosen.dt)
    np.testing.assert_allclose(W[-1] - W[-2], -share / size * slope, rtol=1e-6, atol=1e-9)


def test_newton_rests_at_the_weighted_least_squares_solution(car, drive, design, pairs):
    """At an infinitely fast rate W is that solution at every sample; numpy's lstsq knows it."""
    chosen, recording = design("kreisselmeier_newton", learning_rate=1e9), drive(n=300)
    W = identify(recording, car, chosen).state["W"][-1]
    s, y = pairs(recording, chosen, car)
    root = np.sqrt(chosen.dt * np.exp(-chosen.forgetting * chosen.dt * np.arange(300)[::-1]))
    ridge = np.sqrt(chosen.ridge) * np.eye(6)
    stacked = (
        np.vstack([root[:, None] * s, ridge]),
        np.vstack([root[:, None] * y, np.zeros((6, 2))]),
    )
    np.testing.assert_allclose(W, np.linalg.lstsq(*stacked, rcond=None)[0].T, rtol=1e-7)
    unweighted = np.linalg.lstsq(s, y, rcond=None)[0].T
    assert np.abs(W - unweighted).max() > 1e-3


def test_no_rate_is_too_high_for_either_way_down(car, drive, design):
    for law in ("kreisselmeier", "kreisselmeier_newton", "concurrent", "concurrent_newton"):
        for rate in (1e-3, 1e9):
            history = identify(drive(n=600), car, design(law, learning_rate=rate))
            assert history.diverged_at is None
            assert np.abs(history.state["W"]).max() < 100.0
