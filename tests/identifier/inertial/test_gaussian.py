"""Factors of the covariance against dense matrices of numpy."""

import casadi as ca
import numpy as np
import pytest

from identifier.axle.covariance import factors_of, packed, row_of, triangle
from identifier.inertial.gaussian import measured, propagated

Q, MOVES = 6, 3


@pytest.fixture
def P(rng):
    A = rng.normal(size=(Q, Q))
    return A @ A.T


@pytest.fixture
def rng():
    return np.random.default_rng(4)


def evaluate(row, P):
    """Numbers of an expression of factors, at the factors of P."""
    symbols, values = ca.SX.sym("UD", len(triangle(Q))), packed(P[None])[0]
    return np.array(ca.Function("f", [symbols], [row(ca.vertsplit(symbols))])(values)).squeeze()


def dense(row):
    F = np.zeros((Q, Q))
    F[tuple(np.array(triangle(Q)).T)] = row
    D = np.diag(F).copy()
    np.fill_diagonal(F, 1.0)
    return (F * D) @ F.T


def test_a_step_gives_f_p_f_plus_q(P, rng):
    """And the bits of what is learnt, which does not move, stay."""
    F = rng.normal(size=(MOVES, Q))
    F[1, 2] = F[2, 4] = 0.0
    whole = np.vstack([F, np.hstack([np.zeros((Q - MOVES, MOVES)), np.eye(Q - MOVES)])])
    noise = np.array([0.0, 0.4, 1.3])

    def after(symbols):
        sparse = ca.sparsify(ca.SX(ca.DM(F)))
        stepped = propagated(factors_of(symbols, Q), sparse, [None, *map(ca.SX, noise[1:])])
        return ca.vertcat(*row_of(stepped))

    found = evaluate(after, P)
    expected = whole @ P @ whole.T + np.diag([*noise, 0, 0, 0])
    np.testing.assert_allclose(dense(found), expected, rtol=1e-10, atol=1e-10)
    learnt = [place for place, (i, _) in enumerate(triangle(Q)) if i >= MOVES]
    np.testing.assert_array_equal(found[learnt], packed(P[None])[0][learnt])


@pytest.mark.parametrize(("deviations", "counts"), [(0.7, 1), (50.0, 1), (5.0, 0)])
def test_a_measurement_is_that_of_the_textbook_and_moves_no_further_than_the_clip(
    deviations, counts, P, rng
):
    h = rng.normal(size=Q)
    h[2] = 0.0
    S = h @ P @ h + 0.3

    def after(symbols):
        z, factors = measured(
            factors_of(symbols, Q),
            ca.sparsify(ca.SX(ca.DM(h[None]))),
            innovation=deviations * np.sqrt(S),
            R=0.3,
            clip=4.0,
            counts=counts,
        )
        return ca.vertcat(*z, *row_of(factors))

    found = evaluate(after, P)
    moved = counts * min(deviations, 4.0) * P @ h / np.sqrt(S)
    np.testing.assert_allclose(found[:Q], moved, rtol=1e-10)
    expected = P - counts * np.outer(P @ h, h @ P) / S
    np.testing.assert_allclose(dense(found[Q:]), expected, rtol=1e-8, atol=1e-10)
    if not counts:
        np.testing.assert_array_equal(found[Q:], packed(P[None])[0])


def test_nothing_is_divided_by_zero_where_nothing_surprises():
    """The slope of z over the innovation is the gain, also at none and up to the clip."""
    innovation, h = ca.SX.sym("nu"), ca.sparsify(ca.SX(ca.DM([[1.0] + [0.0] * (Q - 1)])))
    factors = factors_of(ca.vertsplit(ca.SX(ca.DM(packed(np.eye(Q)[None])[0]))), Q)
    z, _ = measured(factors, h, innovation=innovation, R=1.0, clip=3.0, counts=1)
    slope = ca.Function("slope", [innovation], [ca.jacobian(z[0], innovation)])
    assert [float(slope(nu)) for nu in (0.0, 1.0, -4.2)] == pytest.approx([0.5] * 3)
    assert float(slope(4.3)) == pytest.approx(0.0, abs=1e-12)
