"""Where an axle has been: the time above each edge of slip, and the largest slip, filtered."""

import casadi as ca
import numpy as np
import pytest

from identifier.axle.curve import EDGES, excited

DT = 0.02


def after(sizes, learns=(1, 1), samples=1.0):
    state = ca.DM.zeros(2, 1 + len(EDGES))
    for size in sizes:
        state = excited(state, ca.DM(size), dt=DT, samples=samples, learns=ca.DM(learns))
    return np.array(state)


def test_times_are_counted_above_every_edge_and_for_each_axle_alone(rng):
    sizes = np.abs(rng.normal(scale=0.03, size=(200, 2)))
    found = after(sizes)
    for axle in (0, 1):
        expected = [DT * np.count_nonzero(sizes[:, axle] >= edge) for edge in EDGES]
        np.testing.assert_allclose(found[axle, 1:], expected, atol=1e-9)
        assert found[axle, 0] == pytest.approx(sizes[:, axle].max())


def test_an_axle_that_rests_counts_nothing():
    found = after([[0.05, 0.05]] * 10, learns=(0, 1))
    assert not found[0].any()
    assert found[1, 0] == 0.05 and found[1, 1] == pytest.approx(10 * DT)


def test_one_sample_alone_does_not_make_a_range_known():
    assert after([[0.1, 0.1]], samples=4.0)[0, 0] == pytest.approx(0.025)
    assert after([[0.1, 0.1]] * 40, samples=4.0)[0, 0] == pytest.approx(0.1, rel=1e-3)
    assert after([[0.1, 0.1], [0.02, 0.02]], samples=0.5)[0, 0] == 0.1, "it never falls"
