import control
import numpy as np
import pytest

from identifier.stability.lyapunov import (
    LyapunovError,
    lyapunov,
    lyapunov_residual,
    peak_gain,
)
from identifier.stability.sampled_bound import error_gains

SKEWED = np.array([[-2.0, 5.0], [0.3, -4.0]])  # Hurwitz, far from symmetric
Q = np.array([[2.0, 0.4], [0.4, 1.0]])


def test_the_lyapunov_matrix_solves_its_equation_for_a_matrix_that_is_not_symmetric():
    pair = lyapunov(SKEWED, Q)
    assert lyapunov_residual(SKEWED, pair.P, Q) < 1e-14
    unknowns = np.kron(SKEWED.T, np.eye(2)) + np.kron(np.eye(2), SKEWED.T)
    by_hand = np.linalg.solve(unknowns, -Q.ravel()).reshape(2, 2)
    np.testing.assert_allclose(pair.P, by_hand, rtol=1e-12)


def test_substitution_catches_lyap_called_with_the_matrix_itself():
    wrong = control.lyap(SKEWED, Q)  # solves A X + X Aᵀ = -Q
    assert lyapunov_residual(SKEWED, wrong, Q) > 0.5
    symmetric = np.array([[-3.0, 1.0], [1.0, -2.0]])  # where the mistake cannot be seen
    assert lyapunov_residual(symmetric, control.lyap(symmetric, Q), Q) < 1e-14


def transitions(A_d, t):
    """exp(A_d t) by eigenvectors, (n, 2, 2)."""
    poles, vectors = np.linalg.eig(np.asarray(A_d, dtype=float))
    modes = np.exp(np.multiply.outer(t, poles))[:, None, :]
    return ((vectors * modes) @ np.linalg.inv(vectors)).real


@pytest.mark.parametrize("A_d", [np.diag([-1.0, 1e-9]), [[0.0, 1.0], [-1.0, 0.2]]])
def test_a_matrix_that_is_not_hurwitz_is_refused(A_d):
    with pytest.raises(LyapunovError, match="relative residual"):
        lyapunov(A_d, np.eye(2))


def test_the_peak_gain_of_a_symmetric_matrix_is_that_of_its_slowest_pole():
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    assert peak_gain(turn @ np.diag([-3.0, -11.0]) @ turn.T) == pytest.approx(1.0 / 3.0, rel=1e-12)


@pytest.mark.parametrize(
    "A_d",
    [
        SKEWED, [[-1.0, 50.0], [0.0, -1.5]], [[-1.0, 30.0], [-0.2, -1.0]],
        [[-3.0, 0.3], [0.0, -3.0001]], [[-3.0, 2.0], [-2.0, -3.5]],
    ],
)  # fmt: skip
def test_the_peak_gain_is_the_integral_of_the_spectral_norm_and_the_shortcut_is_not(A_d):
    slowest = -np.linalg.eigvals(A_d).real.max()
    t = np.concatenate(([0.0], np.geomspace(1e-4, 40.0 / slowest, 200_000)))
    norms = np.linalg.norm(transitions(A_d, t), 2, axis=(1, 2))
    assert peak_gain(A_d) == pytest.approx(np.trapezoid(norms, t), rel=1e-6)
    assert peak_gain(A_d) > 1.0 / slowest * (1.0 + 1e-4)  # 1/a_min is not a bound here


def test_a_force_error_that_turns_against_the_error_comes_near_the_peak_gain_but_not_beyond():
    A_d, dt = np.array([[-1.0, 8.0], [0.0, -1.5]]), 0.002
    gamma = error_gains(A_d, dt).force
    assert gamma == pytest.approx(peak_gain(A_d), rel=0.01)
    last = np.linalg.svd(transitions(A_d, np.array([0.7]))[0])[0][:, 0]  # direction to push at
    powers, highest = transitions(A_d, np.arange(6000)[::-1] * dt), 0.0
    for direction in (last, np.array([1.0, 0.0]), np.array([0.0, 1.0])):
        force = powers.transpose(0, 2, 1) @ direction  # the worst force for this direction
        force /= np.linalg.norm(force, axis=1)[:, None]
        xi_tilde = np.zeros(2)
        for f in force:
            xi_tilde = xi_tilde + dt * (A_d @ xi_tilde + f)
        highest = max(highest, float(np.linalg.norm(xi_tilde)))
    assert 0.9 * gamma < highest <= gamma


@pytest.mark.parametrize("share", [1e-4, 1e-2, 1e3])
@pytest.mark.parametrize("A_d", [SKEWED, [[-1.0, 50.0], [0.0, -1.5]], [[-1.0, 30.0], [-0.2, -1.0]]])
def test_the_peak_gain_of_slower_dynamics_is_longer_by_as_much(A_d, share):
    """Time in another unit: exp(c A_d t) at t is exp(A_d t) at c t."""
    assert peak_gain(share * np.array(A_d)) == pytest.approx(peak_gain(A_d) / share, rel=1e-8)
