import warnings

import control
import numpy as np
import pytest
from scipy.linalg import eigvals

from identifier.paper.laws import DrivingError
from identifier.stability.loop import INSTANTANEOUS, INTEGRAL, Loop, growth_rate
from identifier.stability.margins import gain_margin, phase_margin


def scalar_loop(*, a, lam, g, law, leakage, dt):
    """Return the loop transfer function for A_d = -a I, in s, or in w = 1 + s dt (Euler).

    (g/a) (c_ξ (s + λ) + c_z) / ((s + λ)(s + a)(s + l)); the pole-zero pair at λ of a law without
    z is kept out.

    Parameters
    ----------
    a : decay rate [1/s].
    lam : forgetting factor λ [1/s].
    g : loop gain λ_max(G).
    law : coefficients of z and ξ̃ in the driving error.
    leakage : l [1/s].
    dt : step [s] of explicit Euler, None for continuous time.
    """
    c_z, c_xi = law
    poles = [-a, -leakage] + ([-lam] if c_z > 0.0 else [])
    zeros = [-lam - c_z / c_xi] if c_z > 0.0 and c_xi > 0.0 else []
    gain = g / a * (c_xi if c_xi > 0.0 else c_z)
    if dt is not None:
        gain *= dt ** (len(poles) - len(zeros))
        poles = [1.0 + dt * pole for pole in poles]
        zeros = [1.0 + dt * zero for zero in zeros]
    time = 0 if dt is None else dt
    return control.tf(gain * np.poly(zeros), np.poly(poles), time)


def random_hurwitz(rng, skew):
    while True:
        A_d = -rng.uniform(2.0, 8.0) * np.eye(2) + skew * rng.standard_normal((2, 2))
        if np.linalg.eigvals(A_d).real.max() < -0.5:
            return A_d


def limits_by_the_kronecker_sum(loop):
    """All factors with a pair of eigenvalues that sums to zero: M ⊕ M is singular there."""
    M = loop.matrix()
    free = M.copy()
    free[4:, :4] = 0.0
    eye = np.eye(6)
    constant = np.kron(free, eye) + np.kron(eye, free)
    slope = np.kron(M - free, eye) + np.kron(eye, M - free)
    factors = eigvals(constant, -slope)
    real = factors[np.isfinite(factors) & (np.abs(factors.imag) < 1e-7 * np.abs(factors))].real
    return np.sort(real[real > 1e-9])


def test_the_gain_margin_of_any_error_dynamics_is_a_root_of_the_kronecker_sum():
    rng = np.random.default_rng(8)
    for skew in (0.5, 2.0, 4.0):
        for _ in range(4):
            A_d = random_hurwitz(rng, skew)
            G = np.diag(rng.uniform(1.0, 300.0, 2))
            loop = Loop(A_d=A_d, forgetting=5.0, law=INTEGRAL, G=G, leakage=0.3)
            found = gain_margin(loop).factor
            roots = limits_by_the_kronecker_sum(loop)
            assert np.min(np.abs(roots / found - 1.0)) < 1e-6
            assert np.all(growth_rate([loop.scaled(0.999 * found).matrix()]) < 0.0)
            assert np.all(growth_rate([loop.scaled(1.001 * found).matrix()]) > 0.0)


def test_the_instantaneous_law_too_has_a_gain_limit_where_error_dynamics_are_not_symmetric():
    turning = np.array([[-4.0, -2.0], [2.0, -4.0]])  # normal, rotating
    loop = Loop(A_d=turning, forgetting=4.0, law=INSTANTANEOUS, G=np.eye(2))
    limit = gain_margin(loop)
    assert np.isfinite(limit.factor)
    a, w, g = 4.0, 2.0, limit.factor  # s² + (a - jw) s + g (a - jw)/(a² + w²), one of two copies
    roots = np.roots([1.0, a - 1j * w, g * (a - 1j * w) / (a**2 + w**2)])
    assert np.max(roots.real) == pytest.approx(0.0, abs=1e-9)
    symmetric = Loop(
        A_d=np.array([[-4.0, 2.0], [2.0, -4.0]]), forgetting=4.0, law=INSTANTANEOUS, G=np.eye(2)
    )
    assert gain_margin(symmetric).factor == np.inf


@pytest.mark.parametrize("law", [INTEGRAL, INSTANTANEOUS, DrivingError(1.0, 0.05)])
@pytest.mark.parametrize("dt", [None, 0.01])
def test_eigenvalues_and_python_control_find_the_same_margins(law, dt):
    a, lam, g, leakage = 6.0, 9.0, 500.0, 0.2
    loop = Loop(A_d=-a * np.eye(2), forgetting=lam, law=law, G=g * np.eye(2), leakage=leakage)
    transfer = scalar_loop(a=a, lam=lam, g=g, law=law, leakage=leakage, dt=dt)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # control warns where a margin is at infinity
        gain, phase, at_limit, _ = control.margin(transfer)
    found = gain_margin(loop, dt)
    assert found.factor == pytest.approx(gain, rel=1e-6)
    if np.isfinite(gain):
        assert found.frequency == pytest.approx(at_limit, rel=1e-6)
    assert phase_margin(loop, dt) == pytest.approx(phase, rel=1e-6)


def test_euler_loses_some_of_the_phase_margin():
    loop = Loop(A_d=-10 * np.eye(2), forgetting=10.0, law=INTEGRAL, G=0.287 * 1e4 * np.eye(2))
    assert phase_margin(loop) == pytest.approx(60.0, abs=0.03)
    assert 50.0 < phase_margin(loop, 0.01) < 60.0


def test_an_unstable_loop_has_no_margin():
    loop = Loop(A_d=-np.eye(2), forgetting=1.0, law=INTEGRAL, G=2.1 * np.eye(2), leakage=0.0)
    assert gain_margin(loop).factor == pytest.approx(2.0 / 2.1, rel=1e-9)
    assert phase_margin(loop) == 0.0
    read_back = Loop(
        A_d=-np.eye(2), forgetting=1.0, law=INTEGRAL, G=np.eye(2), input_feedback=2.0 * np.eye(2)
    )
    assert gain_margin(read_back).factor == 0.0
