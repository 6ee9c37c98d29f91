"""The bounds of the identifier as it runs: what they cover, and what passes when it is left out."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.monte_carlo import (
    Beginning,
    largest_norms,
    measured,
    monte_carlo,
    random_drives,
    within,
)
from identifier.driving import natural_driving
from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import LAWS, DrivingError, Gains
from identifier.stability import certify
from identifier.stability.loop import INTEGRAL, direction_matrix
from identifier.stability.operation import proven_bounds
from identifier.stability.sampled_bound import (
    Disturbance,
    by_leakage,
    error_gains,
    output_layer,
)
from models.vehicle import sedan

CAR = sedan()
DRIVING = natural_driving(CAR)
SKEWED = np.array([[-6.0, 4.0], [-1.0, -9.0]])


def judged(design):
    return certify(design.gains, LAWS[design.law], design.operation(CAR))


def bounds_of(design, driving=None):
    law = LAWS[design.law]
    D = direction_matrix(law, design.gains.matrix)
    task = design.operation(CAR, driving)
    return proven_bounds(design.gains, law.error(design.gains.lead), task, D)


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


@pytest.mark.heavy
@pytest.mark.parametrize("law", ["integral", "instantaneous", "pi_lead"])
def test_no_drive_passes_a_bound_with_noise_resumed_weights_and_a_high_gain(law):
    design = PaperIdentifier.for_vehicle(CAR, law=law)
    gains = replace(design.gains, eta_W=1.5 * design.gains.eta_W, rho_W=1.5 * design.gains.rho_W)
    coupled = replace(gains, A_d=((gains.A_d[0][0], 3.0), (-1.0, gains.A_d[1][1])))
    for numbers in (gains, coupled):
        wild = replace(design, gains=numbers)
        found = bounds_of(wild)
        assert np.isfinite([found.leakage.xi_tilde, found.W, found.V]).all()
        seen = monte_carlo(
            wild, CAR, DRIVING, 64, beginning=Beginning(W=found.W, V=9.0),
            rng=np.random.default_rng(5),
        )  # fmt: skip
        for values, bound in (
            (seen.xi_tilde, found.leakage.xi_tilde),
            (seen.W, found.W),
            (seen.V, found.V),
        ):
            assert 0.02 * bound < values.max() <= bound * (1.0 + 1e-9)


def test_a_V_layer_that_leaks_more_than_itself_in_a_sample_fails_and_diverges():
    design = PaperIdentifier.for_vehicle(CAR)
    planted = replace(design, gains=replace(design.gains, rho_V=3000.0))
    certificate = judged(planted)
    assert certificate["leakage_step_V"].status == "fail"
    assert judged(design).verdict == "pass"
    seen = monte_carlo(
        planted, CAR, DRIVING, 40, beginning=Beginning(0.0, 12.0), rng=np.random.default_rng(1)
    )
    assert not (seen.V < 1e6).all()
    factor = float(certificate["leakage_step_V"].advice.split()[2].rstrip(","))
    mended = replace(design, gains=replace(design.gains, rho_V=0.99 * factor))
    assert judged(mended)["leakage_step_V"].status == "pass"


def test_a_smooth_tire_short_of_sliding_keeps_the_bound_and_passes_that_of_a_sliding_one():
    """At 0.06 rad the sedan hardly slides: what slides is no bound on what the tire misses."""
    gentle = replace(DRIVING, v_x=20.0, slip=0.07, bandwidth=0.5)
    design = PaperIdentifier.for_vehicle(CAR)
    C = np.array([CAR.cornering_stiffness_front, CAR.cornering_stiffness_rear])
    sliding = np.linalg.norm(np.maximum(C * 0.07 - CAR.axle_loads, 0.0)) / 1000.0
    D, gains = np.eye(2) / -design.gains.A_d[0][0], design.gains
    learning = output_layer(gains, INTEGRAL, D, n_h=10, dt=0.01)
    error = error_gains(gains.matrix, 0.01)
    found = bounds_of(design, gentle)
    small = Disturbance(residual=max(sliding, 1e-3))
    claimed = error.force * small.residual
    seen = monte_carlo(
        design, CAR, gentle, 64, beginning=Beginning(0.0, 12.0), rng=np.random.default_rng(2)
    )
    assert by_leakage(error, learning, gains.matrix, small, 10).W < found.W
    assert seen.residual.max() > 3.0 * sliding
    assert claimed < seen.xi_tilde.max() <= found.leakage.xi_tilde


def test_nothing_that_is_unbounded_passes():
    gains = PaperIdentifier.for_vehicle(CAR).gains
    for changed in ({"rho_W": 0.0, "eta_V": 0.0}, {"rho_V": 0.0}, {"rho_W": 0.0, "rho_V": 0.0}):
        design = replace(PaperIdentifier.for_vehicle(CAR), gains=replace(gains, **changed))
        assert judged(design).verdict != "pass"


def test_sensors_that_err_more_than_declared_pass_the_bound_and_those_as_declared_do_not():
    exact = replace(DRIVING, slip=0.01, noise_v_x=0.0, noise_v_y=0.0, noise_r=0.0, noise_delta=0.0)
    poor = replace(exact, noise_v_y=1.0, noise_r=0.1)
    design = PaperIdentifier.for_vehicle(CAR)
    gains = replace(design.gains, eta_W=0.0, eta_V=0.0, rho_W=0.0, rho_V=0.0)
    quiet = replace(design, gains=gains)
    rng = np.random.default_rng(3)
    drives = random_drives(CAR, rng, 64, driving=exact, duration=5.0, dt=0.01)
    drives = type(drives)(*(values[within(CAR, drives, exact, 0.01)] for values in drives))
    weights = quiet.network.initial_weights(rng)
    count = len(drives.v_x)
    begun = weights._replace(W=np.zeros((count, 2, 10)), V=np.repeat(weights.V[None], count, 0))
    error = largest_norms(quiet, CAR, measured(drives, poor, rng), begun)[0].max()
    declared, wrong = (bounds_of(quiet, one).leakage.xi_tilde for one in (exact, poor))
    assert declared < error <= wrong


def test_the_tight_route_claims_no_less_than_an_identifier_without_a_network():
    for law in ("integral", "instantaneous"):
        certificate = judged(PaperIdentifier.for_vehicle(CAR, law=law))
        for name in ("printed_bound", "tight_bound", "ultimate_bound"):
            assert certificate[name].value >= certificate["trivial_bound"].value * (1 - 1e-9)
