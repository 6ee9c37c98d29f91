import math

import numpy as np
import pytest

from identifier.stability.loop import INSTANTANEOUS, INTEGRAL
from identifier.stability.lyapunov import lyapunov
from identifier.stability.margins import drift_frequency, passivity_shortage, sufficient_leakage
from tests.identifier.stability.storage import lead_time, pi_lead

SKEWED = np.array([[-4.0, 6.0], [-0.5, -3.0]])


def shortage_formula(a: float, lam: float) -> float:
    """1/(a (a + λ) (√a + √λ)²): shortage of passivity of the integral law with A_d = -a I.

    Parameters
    ----------
    a : decay rate of A_d = -a I [1/s].
    lam : forgetting factor λ [1/s].
    """
    return 1.0 / (a * (a + lam) * (math.sqrt(a) + math.sqrt(lam)) ** 2)


def weight_error_after(a, lam, eta, frequency, leakage=0.0, law=INTEGRAL, duration=400.0, dt=2e-3):
    """|W_t| of one weight under a regressor s = sin(frequency t), from 1, no residual."""
    s = np.sin(frequency * np.arange(round(duration / dt)) * dt)
    error, z, weight = 0.0, 0.0, 1.0
    for regressor in s.tolist():
        drive = law.drive(z, error)
        error, z, weight = (
            error + dt * (-a * error + weight * regressor),
            z + dt * (error - lam * z),
            weight + dt * (-eta / a * drive * regressor - leakage * weight),
        )
    return abs(weight)


def test_weights_drift_above_the_drift_frequency_at_a_gain_far_within_the_limit():
    a, lam, eta = 2.0, 2.0, 0.4  # the limit is 16
    assert drift_frequency(A_d=-a * np.eye(2), forgetting=lam, law=INTEGRAL) == pytest.approx(2.0)
    assert weight_error_after(a, lam, eta, 1.4) < 0.1
    assert weight_error_after(a, lam, eta, 3.2) > 2.0
    assert weight_error_after(a, lam, eta, 3.2, law=INSTANTANEOUS) < 0.1


def test_the_sufficient_leakage_stops_the_drift():
    a, lam, eta = 2.0, 2.0, 0.4
    A_d = -a * np.eye(2)
    s0 = sufficient_leakage(A_d=A_d, forgetting=lam, law=INTEGRAL, eta_W=eta, n_h=1)
    assert s0 == pytest.approx(eta * shortage_formula(a, lam), rel=1e-8)
    assert weight_error_after(a, lam, eta, 3.2, leakage=s0) < 1.0


def test_the_drift_frequency_of_every_law_with_equal_poles_is_the_closed_form():
    a, lam = 5.0, 3.0
    A_d = -a * np.eye(2)
    assert drift_frequency(A_d=A_d, forgetting=lam, law=INSTANTANEOUS) == np.inf
    for tau in (0.05, 0.1, 0.19):
        expected = np.sqrt(a * lam * (1 + tau * lam) / (1 - tau * a))
        found = drift_frequency(A_d=A_d, forgetting=lam, law=pi_lead(tau))
        assert found == pytest.approx(expected, rel=1e-9)
    assert drift_frequency(A_d=A_d, forgetting=lam, law=pi_lead(1.0 / a)) == np.inf


def test_the_shortage_of_passivity_is_the_closed_form_and_zero_for_the_instantaneous_law():
    for a, lam in ((5.0, 3.0), (1.0, 20.0), (8.0, 8.0)):
        A_d = -a * np.eye(2)
        found = passivity_shortage(A_d=A_d, forgetting=lam, law=INTEGRAL)
        assert found == pytest.approx(shortage_formula(a, lam), rel=1e-8)
        assert passivity_shortage(A_d=A_d, forgetting=lam, law=INSTANTANEOUS) == 0.0


def test_for_skewed_error_dynamics_only_the_lyapunov_direction_is_positive_real():
    pair = lyapunov(SKEWED, 2.0 * np.eye(2))
    law = pi_lead(1.01 * lead_time(pair, forgetting=3.0))
    assert drift_frequency(A_d=SKEWED, forgetting=3.0, law=law) < 1e4
    assert drift_frequency(A_d=SKEWED, forgetting=3.0, law=law, direction=pair.P) == np.inf
