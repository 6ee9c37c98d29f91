"""The memory never holds more than its size, and what it holds is the best of one exchange."""

import casadi as ca
import numpy as np
import pytest

from identifier.regression.laws import WORTH, Memory, Pair, determinant_gains, remember
from identifier.run import identify

WEIGHT, RIDGE, N_H, PLACES = 0.25, 1e-3, 3, 4


def determinant(S):
    return np.linalg.det(WEIGHT * S @ S.T + RIDGE * np.eye(len(S)))


def exchanged(S, s, j):
    tried = S.copy()
    tried[:, j] = s
    return tried


@pytest.fixture(name="store", scope="module")
def the_function():
    """(S, Z, s, y, allowed) -> (S, Z), and the gains."""
    S, Z = ca.SX.sym("S", N_H, PLACES), ca.SX.sym("Z", 2, PLACES)
    s, y, allowed = ca.SX.sym("s", N_H), ca.SX.sym("y", 2), ca.SX.sym("allowed")
    memory = remember(Memory(S, Z), Pair(s, y), weight=WEIGHT, ridge=RIDGE, allowed=allowed)
    gains = determinant_gains(S, s, WEIGHT, RIDGE)
    function = ca.Function("store", [S, Z, s, y, allowed], [*memory, gains])
    return lambda *arguments: [np.array(value) for value in function(*arguments)]


def test_gains_are_ratios_of_determinants(store, rng):
    S, s = rng.standard_normal((N_H, PLACES)), rng.standard_normal(N_H)
    S[:, 2] = 0.0  # an empty place too
    gains = store(S, np.zeros((2, PLACES)), s, np.zeros(2), 1)[2].ravel()
    ratios = [determinant(exchanged(S, s, j)) / determinant(S) for j in range(PLACES)]
    np.testing.assert_allclose(gains, ratios, rtol=1e-9)
    assert np.argmax(gains) == 2


def test_each_pair_takes_the_place_that_gains_most_or_none(store, rng):
    S, Z = np.zeros((N_H, PLACES)), np.zeros((2, PLACES))
    stored = refused = 0
    for _ in range(300):
        s, y = rng.standard_normal(N_H) * rng.uniform(0, 1), rng.standard_normal(2)
        tried = [determinant(exchanged(S, s, j)) for j in range(PLACES)]
        S_next, Z_next, _ = store(S, Z, s, y, 1)
        if max(tried) > WORTH * determinant(S):
            np.testing.assert_allclose(S_next, exchanged(S, s, int(np.argmax(tried))))
            np.testing.assert_allclose(Z_next[:, int(np.argmax(tried))], y)
            stored += 1
        else:
            np.testing.assert_array_equal(S_next, S)
            refused += 1
        assert determinant(S_next) >= determinant(S)
        S, Z = S_next, Z_next
        assert np.count_nonzero(S.any(axis=0)) == min(stored, PLACES)
    assert stored > PLACES
    assert refused > 50


def test_nothing_is_stored_where_it_is_not_allowed(store, rng):
    empty = np.zeros((N_H, PLACES)), np.zeros((2, PLACES))
    assert not store(*empty, rng.standard_normal(N_H), np.ones(2), 0)[0].any()
    assert store(*empty, rng.standard_normal(N_H), np.ones(2), 1)[0].any()


def test_over_a_drive_every_kept_pair_was_seen_and_excitation_only_grows(car, drive, design, pairs):
    chosen, recording = design("concurrent", forgetting=0.0), drive(n=500)
    S, Z = (identify(recording, car, chosen).state[name] for name in "SZ")
    s, y = pairs(recording, chosen, car)
    assert S.shape == (501, 6, chosen.memory)
    for place in range(chosen.memory):
        seen = np.argmin(np.abs(s - S[-1, :, place]).sum(axis=1))
        np.testing.assert_allclose(S[-1, :, place], s[seen], atol=1e-10)
        np.testing.assert_allclose(Z[-1, :, place], y[seen], atol=1e-10)
    G = S @ S.swapaxes(1, 2) / chosen.filter_rate + chosen.ridge * np.eye(6)
    growth = np.diff(np.linalg.slogdet(G)[1])
    assert growth.min() > -1e-9
    assert growth.sum() > 5.0


def test_stored_pairs_fade_alike(car, drive, design):
    """Target over regressor stays what it was: a faded pair still says y = W s."""
    fading = identify(drive(n=300), car, design("concurrent", forgetting=2.0, memory=2))
    S, Z, fade = fading.state["S"], fading.state["Z"], np.exp(-2.0 * 0.01 / 2)
    full = [k for k in range(50, 300) if S[k, :, 0].any()]
    faded = [k for k in full if np.allclose(S[k + 1, :, 0], fade * S[k, :, 0], rtol=1e-12)]
    assert 20 < len(faded) < len(full)  # and now and then a new pair takes the place
    for k in faded:
        np.testing.assert_allclose(Z[k + 1, :, 0], fade * Z[k, :, 0], rtol=1e-12)
