"""Factors of the covariance against dense matrices of numpy."""

import casadi as ca
import numpy as np
import pytest

from identifier.axle.covariance import entry, factors_of, packed, row_of, triangle
from identifier.inertial.gaussian import measured, propagated

Q, MOVES = 6, 3


@pytest.fixture
def P(rng):
    A = rng.normal(size=(Q, Q))
    return A @ A.T


@pytest.fixture
def rng():
    return np.random.default_rng(4)


def evaluate(row, P, extra=()):
    """Numbers of an expression of factors, at the factors of P."""
    make, symbols, values = row, ca.SX.sym("UD", len(triangle(Q))), packed(P[None])[0]
    return np.array(ca.Function("f", [symbols], [make(ca.vertsplit(symbols))])(values)).squeeze()


def dense(row):
    F = np.zeros((Q, Q))
    F[tuple(np.array(triangle(Q)).T)] = row
    D = np.diag(F).copy()
    np.fill_diagonal(F, 1.0)
    return (F * D) @ F.T


def test_a_step_gives_f_p_f_plus_q(P, rng):
    F = rng.normal(size=(MOVES, Q))
    F[1, 2] = F[2, 4] = 0.0
    whole = np.vstack([F, np.hstack([np.zeros((Q - MOVES, MOVES)), np.eye(Q - MOVES)])])
    noise = np.array([0.0, 0.4, 1.3])

    def after(symbols):
        sparse = ca.sparsify(ca.SX(ca.DM(F)))
        stepped = propagated(factors_of(symbols, Q), sparse, [None, *map(ca.SX, noise[1:])])
        return ca.vertcat(*row_of(stepped))

    expected = whole @ P @ whole.T + np.diag([*noise, 0, 0, 0])
    np.testing.assert_allclose(dense(evaluate(after, P)), expected, rtol=1e-10, atol=1e-10)


def test_numbers_on_the_way_are_gone_on_from(P, rng):
    """a = A z, m+ = B z + C a is one step by B + C A."""
    A, B, C = rng.normal(size=(2, Q)), rng.normal(size=(MOVES, Q)), rng.normal(size=(MOVES, 2))
    by_way = np.block([[A, np.zeros((2, 2))], [B, C]])
    noise = [None, ca.SX(0.3), None]

    def after(F):
        return lambda symbols: ca.vertcat(
            *row_of(propagated(factors_of(symbols, Q), ca.sparsify(ca.SX(ca.DM(F))), noise))
        )

    np.testing.assert_allclose(
        evaluate(after(by_way), P), evaluate(after(B + C @ A), P), rtol=1e-9, atol=1e-12
    )


def test_what_is_learnt_keeps_the_bits_of_its_factors_over_a_step(P, rng):
    F = ca.SX(ca.DM(rng.normal(size=(MOVES, Q))))

    def after(symbols):
        stepped = propagated(factors_of(symbols, Q), F, [None, ca.SX(1), None])
        return ca.vertcat(*row_of(stepped))

    learnt = [place for place, (i, _) in enumerate(triangle(Q)) if i >= MOVES]
    np.testing.assert_array_equal(evaluate(after, P)[learnt], packed(P[None])[0][learnt])


def corrected(P, h, *, innovation=0.7, R=0.3, clip=100.0, counts=1):
    """By what a measurement corrects z, and P after it."""

    def after(symbols):
        z, factors = measured(
            factors_of(symbols, Q),
            ca.sparsify(ca.SX(ca.DM(h[None]))),
            innovation=innovation,
            R=R,
            clip=clip,
            counts=counts,
        )
        return ca.vertcat(*z, *row_of(factors))

    found = evaluate(after, P)
    return found[:Q], dense(found[Q:])


def test_a_measurement_is_that_of_the_textbook(P, rng):
    h = rng.normal(size=Q)
    h[2] = 0.0
    z, after = corrected(P, h)
    S = h @ P @ h + 0.3
    np.testing.assert_allclose(z, P @ h / S * 0.7, rtol=1e-10)
    np.testing.assert_allclose(after, P - np.outer(P @ h, h @ P) / S, rtol=1e-8, atol=1e-10)


def test_a_surprise_moves_no_further_than_the_clip(P, rng):
    h = rng.normal(size=Q)
    S = h @ P @ h + 0.3
    far, _ = corrected(P, h, innovation=50 * np.sqrt(S), clip=4.0)
    np.testing.assert_allclose(far, 4 * P @ h / np.sqrt(S), rtol=1e-10)


def test_without_a_measurement_every_bit_stays(P, rng):
    z, after = corrected(P, rng.normal(size=Q), innovation=5.0, counts=0)
    assert not z.any()
    np.testing.assert_array_equal(after, dense(packed(P[None])[0]))


def test_entries_are_those_of_the_product(P):
    def some(symbols):
        factors = factors_of(symbols, Q)
        return ca.vertcat(entry(factors, 0, 0), entry(factors, 1, 4), entry(factors, 5, 5))

    np.testing.assert_allclose(evaluate(some, P), [P[0, 0], P[1, 4], P[5, 5]], rtol=1e-10)


def test_nothing_is_divided_by_zero_where_nothing_surprises():
    """The slope of z over the innovation is the gain, also at none and up to the clip."""
    innovation, h = ca.SX.sym("nu"), ca.sparsify(ca.SX(ca.DM([[1.0] + [0.0] * (Q - 1)])))
    factors = factors_of(ca.vertsplit(ca.SX(ca.DM(packed(np.eye(Q)[None])[0]))), Q)
    z, _ = measured(factors, h, innovation=innovation, R=1.0, clip=3.0, counts=1)
    slope = ca.Function("slope", [innovation], [ca.jacobian(z[0], innovation)])
    assert [float(slope(nu)) for nu in (0.0, 1.0, -4.2)] == pytest.approx([0.5] * 3)
    assert float(slope(4.3)) == pytest.approx(0.0, abs=1e-12)
