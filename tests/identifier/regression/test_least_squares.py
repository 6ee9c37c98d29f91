"""Recursive least squares against the batch, and what forgetting does to P."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from identifier.regression.laws import bounded_trace, directional, exponential
from identifier.run import identify


def test_without_forgetting_it_is_batch_ridge_regression(car, drive, design, pairs):
    recording = drive(n=400)
    s, y = pairs(recording, design(), car)
    for law in ("rls", "rls_bounded_trace", "rls_exponential"):
        chosen = design(law, forgetting=0.0)
        W = identify(recording, car, chosen).state["W"][-1]
        information = chosen.dt * s.T @ s + chosen.ridge * np.eye(6)
        batch = np.linalg.solve(information, chosen.dt * s.T @ y).T
        np.testing.assert_allclose(W, batch, rtol=1e-6, atol=1e-8)
        forgetful = identify(recording, car, design(law, forgetting=0.5)).state["W"][-1]
        assert np.abs(forgetful - batch).max() > 1e-3


def test_exponential_forgetting_is_newton_with_a_fading_ridge(car, drive, design, pairs):
    chosen, recording = design("rls_exponential"), drive(n=300)
    history = identify(recording, car, chosen)
    s, y = pairs(recording, chosen, car)
    weight = np.exp(-chosen.forgetting * chosen.dt * np.arange(300)[::-1])
    # The first pair has s = 0, which counts as no excitation: its sample does not forget.
    ridge = chosen.ridge * np.exp(-chosen.forgetting * chosen.dt * 298)
    information = chosen.dt * (s.T * weight) @ s + ridge * np.eye(6)
    batch = np.linalg.solve(information, chosen.dt * (s.T * weight) @ y).T
    np.testing.assert_allclose(history.state["W"][-1], batch, rtol=1e-6, atol=1e-8)


def straight_after_slalom(drive, straight=6000):
    """Five seconds of slalom, then a minute that excites one direction of s only, barely."""
    slalom = drive(n=500)
    dt, n = slalom.dt, 500 + straight
    hold = {
        name: np.concatenate([getattr(slalom, name), np.full(straight, value)])
        for name, value in (("v_y", 0.02), ("r", 0.01), ("delta_f", 0.001), ("delta_r", 0.0))
    }
    return replace(slalom, t=dt * np.arange(n), v_x=np.full(n, 20.0), axle_force=None, **hold)


def test_only_exponential_forgetting_blows_up_without_excitation(car, drive, design):
    recording = straight_after_slalom(drive)
    traces = {
        law: np.trace(identify(recording, car, design(law)).state["P"], axis1=1, axis2=2)
        for law in ("rls", "rls_bounded_trace", "rls_exponential")
    }
    bound = 6 / design().ridge
    assert traces["rls_exponential"][-1] > 1e6 * traces["rls_exponential"][500]  # the alarm rings
    assert traces["rls"].max() <= bound * (1 + 1e-9)
    assert traces["rls_bounded_trace"].max() <= bound * (1 + 1e-9)
    assert traces["rls"][-1] < 3.0 * traces["rls"][500]


def evaluated(forget, P, s, keep, bound):
    return np.array(forget(ca.DM(P), ca.DM(s), keep, bound))


@pytest.fixture(name="P")
def a_covariance(rng):
    root = rng.standard_normal((4, 4))
    return root @ root.T + 0.1 * np.eye(4)


def test_directional_forgetting_is_that_of_kulhavy(P, rng):
    s, keep, T = rng.standard_normal(4), 0.97, 0.01
    zeta = T * s @ P @ s
    beta = keep - (1 - keep) / zeta
    expected = np.linalg.inv(np.linalg.inv(P) + beta * T * np.outer(s, s))
    updated = np.linalg.inv(np.linalg.inv(P) + T * np.outer(s, s))
    np.testing.assert_allclose(evaluated(directional, updated, s, keep, np.inf), expected)


def test_directional_forgetting_leaves_what_it_does_not_see(P, rng):
    s = rng.standard_normal(4)
    unseen = np.linalg.svd((P @ s)[None])[2][1:]  # orthogonal to P s
    after = evaluated(directional, P, s, 0.5, np.inf)
    np.testing.assert_allclose(unseen @ after, unseen @ P, atol=1e-12)
    np.testing.assert_allclose(s @ after @ s, s @ P @ s / 0.5)
    np.testing.assert_array_equal(evaluated(directional, P, 0 * s, 0.5, np.inf), P)
    assert np.abs(unseen @ evaluated(exponential, P, s, 0.5, np.inf) - unseen @ P).max() > 0.1


def test_bounds_stop_growth_and_never_shrink(P, rng):
    s, trace = rng.standard_normal(4), np.trace(P)
    for forget in (bounded_trace, directional):
        stopped = evaluated(forget, P, s, 0.5, 1.1 * trace)
        assert np.trace(stopped) == pytest.approx(1.1 * trace)
        np.testing.assert_allclose(evaluated(forget, P, s, 0.5, 0.5 * trace), P)
