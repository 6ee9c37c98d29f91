"""The bounds of the identifier as it runs: what they cover, and what passes when it is left out."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import LAWS, DrivingError, Gains
from identifier.stability.certificate import certify
from identifier.stability.loop import INTEGRAL
from identifier.stability.sampled_bound import (
    Disturbance,
    by_leakage,
    error_gains,
    output_layer,
)
from models.vehicle import sedan

CAR = sedan()
SKEWED = np.array([[-6.0, 4.0], [-1.0, -9.0]])


def judged(design):
    return certify(design.gains, LAWS[design.law], design.operation(CAR))


@pytest.mark.parametrize("A_d", [-6.0 * np.eye(2), SKEWED])
@pytest.mark.parametrize("law", [INTEGRAL, DrivingError(0.0, 1.0), DrivingError(1.0, 0.2)])
def test_without_noise_euler_has_the_bounds_of_the_closed_form(A_d, law):
    gains = Gains(
        A_d=tuple(map(tuple, A_d)), forgetting=5.0, eta_W=40.0, eta_V=0.0, rho_W=2.0, rho_V=0.0
    )
    D, acting = -np.linalg.inv(A_d).T, Disturbance(residual=6.0)
    learning = output_layer(gains, law, D, n_h=4, dt=0.01)
    found = by_leakage(error_gains(A_d, 0.01), learning, A_d, acting, 4)
    powers = [np.linalg.matrix_power(np.eye(2) + 0.01 * A_d, k) for k in range(800)]
    gamma, g = 0.01 * np.linalg.norm(powers, 2, axis=(1, 2)).sum(), 40.0 * np.linalg.norm(D, 2) * 2
    balance, theta = g * (law.z / 5.0 + law.xi_tilde) / 2.0, law.z * gamma * 2 * g / 5.0**2
    X = gamma * (6.0 + 2 * balance) / (1.0 - theta)
    assert found.xi_tilde == pytest.approx(X, rel=1e-6)
    assert pytest.approx(balance + law.z * g * X / 5.0**2, rel=1e-6) == found.W


def test_a_V_layer_that_leaks_more_than_itself_in_a_sample_fails():
    design = PaperIdentifier.for_vehicle(CAR)
    planted = replace(design, gains=replace(design.gains, rho_V=3000.0))
    certificate = judged(planted)
    assert certificate["leakage_step_V"].status == "fail"
    assert judged(design).verdict == "pass"
    factor = float(certificate["leakage_step_V"].advice.split()[2].rstrip(","))
    mended = replace(design, gains=replace(design.gains, rho_V=0.99 * factor))
    assert judged(mended)["leakage_step_V"].status == "pass"


def test_nothing_that_is_unbounded_passes():
    gains = PaperIdentifier.for_vehicle(CAR).gains
    for changed in ({"rho_W": 0.0, "eta_V": 0.0}, {"rho_V": 0.0}, {"rho_W": 0.0, "rho_V": 0.0}):
        design = replace(PaperIdentifier.for_vehicle(CAR), gains=replace(gains, **changed))
        assert judged(design).verdict != "pass"


def test_the_tight_route_claims_no_less_than_an_identifier_without_a_network():
    for law in ("integral", "instantaneous"):
        certificate = judged(PaperIdentifier.for_vehicle(CAR, law=law))
        for name in ("printed_bound", "tight_bound", "ultimate_bound"):
            assert certificate[name].value >= certificate["trivial_bound"].value * (1 - 1e-9)
