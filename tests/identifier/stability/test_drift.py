"""Slow drift of the weights, and the PI-lead law z + τ ξ̃ that takes it away, τ long enough."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.paper.laws import LAWS, DrivingError
from identifier.stability.certificate import certify
from identifier.stability.loop import INSTANTANEOUS, INTEGRAL, Loop, direction_matrix
from identifier.stability.lyapunov import lyapunov
from identifier.stability.margins import drift_frequency, gain_margin
from tests.identifier.stability.test_certificate import CITY, gains

SKEWED = np.array([[-4.0, 6.0], [-0.5, -3.0]])
LEAD = 0.75  # s: along P positive real from 0.735 on


def weight_error_after(a, lam, eta, frequency, law=INTEGRAL):
    """|W_t| of one weight under a regressor s = sin(frequency t), from 1, no residual."""
    dt = 2e-3
    s = np.sin(frequency * dt * np.arange(200_000))
    error, z, weight = 0.0, 0.0, 1.0
    for regressor in s.tolist():
        drive = law.drive(z, error)
        error, z, weight = (
            error + dt * (-a * error + weight * regressor),
            z + dt * (error - lam * z),
            weight + dt * (-eta / a * drive * regressor),
        )
    return abs(weight)


def test_weights_drift_above_the_drift_frequency_at_a_gain_far_within_the_limit():
    a, lam, eta = 2.0, 2.0, 0.4  # the limit is 16
    assert drift_frequency(A_d=-a * np.eye(2), forgetting=lam, law=INTEGRAL) == pytest.approx(2.0)
    assert weight_error_after(a, lam, eta, 1.4) < 0.1
    assert weight_error_after(a, lam, eta, 3.2) > 2.0
    assert weight_error_after(a, lam, eta, 3.2, law=INSTANTANEOUS) < 0.1


def test_the_drift_frequency_of_every_law_with_equal_poles_is_the_closed_form():
    a, lam = 5.0, 3.0
    A_d = -a * np.eye(2)
    assert drift_frequency(A_d=A_d, forgetting=lam, law=INSTANTANEOUS) == np.inf
    for tau in (0.05, 0.1, 0.19):
        expected = np.sqrt(a * lam * (1 + tau * lam) / (1 - tau * a))
        found = drift_frequency(A_d=A_d, forgetting=lam, law=DrivingError(1.0, tau))
        assert found == pytest.approx(expected, rel=1e-9)
    for lead, limited in ((1.0 / a, False), (0.999 / a, True)):
        found = drift_frequency(A_d=A_d, forgetting=lam, law=DrivingError(1.0, lead))
        assert np.isfinite(found) is np.bool_(limited)


def test_for_skewed_error_dynamics_only_the_lyapunov_direction_is_positive_real():
    pair = lyapunov(SKEWED, 2.0 * np.eye(2))
    law = DrivingError(1.0, LEAD)
    assert drift_frequency(A_d=SKEWED, forgetting=3.0, law=law) < 1e4
    assert drift_frequency(A_d=SKEWED, forgetting=3.0, law=law, direction=pair.P) == np.inf
    printed = Loop(A_d=SKEWED, forgetting=3.0, law=law, G=np.eye(2))
    assert np.isfinite(gain_margin(printed).factor)
    assert gain_margin(printed._replace(direction=pair.P)).factor == np.inf


def test_the_law_that_runs_goes_along_p_of_the_lyapunov_equation():
    rng = np.random.default_rng(7)
    for _ in range(50):
        A_d = -rng.uniform(1.0, 8.0) * np.eye(2) + 2.0 * rng.standard_normal((2, 2))
        if np.linalg.eigvals(A_d).real.max() > -0.1:
            continue
        P = direction_matrix(LAWS["pi_lead"], A_d)
        np.testing.assert_allclose(A_d.T @ P + P @ A_d, -2.0 * np.eye(2), atol=1e-10)
        printed = direction_matrix(LAWS["integral"], A_d)
        np.testing.assert_allclose(A_d.T @ printed, -np.eye(2), atol=1e-10)


def test_the_certificate_finds_no_gain_limit_of_the_lead_even_for_skewed_error_dynamics():
    skewed = replace(gains(lam=3.0, eta_W=1.0, lead=LEAD), A_d=tuple(map(tuple, SKEWED)))
    certificate = certify(skewed, LAWS["pi_lead"], CITY)
    assert certificate["gain_continuous"].margin == np.inf
    assert certificate["drift"].limit == np.inf
    short = certify(replace(skewed, lead=0.2 * LEAD), LAWS["pi_lead"], CITY)
    assert short["drift"].limit < np.inf
