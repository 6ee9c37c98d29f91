"""The bounds of the identifier as it runs: what they cover, and what passes when it is left out."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.driving import natural_driving
from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import LAWS, DrivingError, Gains, diagonal, rk4
from identifier.paper.network import Network
from identifier.paper.step import GAINS, build_step
from identifier.stability import certify
from identifier.stability.loop import INTEGRAL, direction_matrix
from identifier.stability.operation import proven_bounds
from identifier.stability.sampled_bound import (
    Disturbance,
    by_leakage,
    by_projection,
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
    learning = output_layer(gains, law, D, n_h=4, integrator="euler", dt=0.01)
    found = by_leakage(error_gains(A_d, "euler", 0.01), learning, A_d, acting, 4)
    powers = [np.linalg.matrix_power(np.eye(2) + 0.01 * A_d, k) for k in range(800)]
    gamma, g = 0.01 * np.linalg.norm(powers, 2, axis=(1, 2)).sum(), 40.0 * np.linalg.norm(D, 2) * 2
    balance, theta = g * (law.z / 5.0 + law.xi_tilde) / 2.0, law.z * gamma * 2 * g / 5.0**2
    X = gamma * (6.0 + 2 * balance) / (1.0 - theta)
    assert found.xi_tilde == pytest.approx(X, rel=1e-6)
    assert pytest.approx(balance + law.z * g * X / 5.0**2, rel=1e-6) == found.W


def test_the_gains_of_rk4_are_those_of_its_own_step():
    """Each stage's force, alone and of one sign for ever, holds the error that its gain says."""
    A_d, dt = np.array([[-7.0, 0.0], [0.0, -7.0]]), 0.02
    gains = error_gains(A_d, "rk4", dt)
    for stage, gamma in enumerate(gains.weights):
        e = np.zeros(2)
        for _ in range(2000):
            calls = iter(range(4))

            def rate(state, calls=calls, stage=stage):
                return [A_d @ state[0] + (next(calls) == stage) * np.array([1.0, 0.0])]

            (e,) = rk4(rate, [e], dt)
        assert e[0] == pytest.approx(gamma, rel=1e-9)
    assert sum(gains.weights) == pytest.approx(gains.force, rel=1e-9)


def test_rk4_with_held_inputs_errs_by_what_the_car_moves_on():
    """No residual at all: A_ξ ξ + B_ξ u is ξ' exactly, and yet the estimate is late."""
    a, dt, slope = 20.0, 0.01, 3.0  # kN
    gains = Gains(A_d=diagonal(a), forgetting=5.0, eta_W=0.0, eta_V=0.0, rho_W=0.0, rho_V=0.0)
    design = PaperIdentifier(gains=gains, network=Network(hidden=2), integrator="rk4", dt=dt)
    step = build_step(design.structure)
    numbers = np.array([getattr(gains, name) for name in GAINS])
    K = np.array([[1 / CAR.mass] * 2, [CAR.l_f / CAR.yaw_inertia, -CAR.l_r / CAR.yaw_inertia]])
    C = np.array([CAR.cornering_stiffness_front, CAR.cornering_stiffness_rear])
    xi_hat, errors, v_x = np.zeros(2), [], 20.0
    lever = np.array([CAR.l_f, -CAR.l_r])
    for k in range(150):
        x = K @ np.array([slope, slope]) * 1e3 * k * dt  # ξ' = (3, 3) kN
        alpha_force = np.array([slope, slope]) * 1e3 + np.linalg.inv(K) @ [v_x * x[1], 0.0]
        u = alpha_force / C + (x[0] + lever * x[1]) / v_x
        out = step(
            xi_hat, [0, 0], np.zeros((2, 2)), np.zeros((2, 4)), x, u, v_x,
            np.array(CAR.bicycle), gains.matrix, numbers, [dt, 1e3, 1.0],
        )  # fmt: skip
        xi_hat = np.array(out[0]).ravel()
        errors.append(float(np.linalg.norm(np.array(out[6]))))
    reach = error_gains(gains.matrix, "rk4", dt).rate * np.hypot(slope, slope)
    assert errors[-1] == pytest.approx(reach, rel=1e-6)
    assert reach > 0.09 * np.hypot(slope, slope) * dt * 1.0  # a dt/2 = 0.1 of a sample


def test_inner_stages_of_rk4_are_projected():
    seen = []

    def rate(state):
        seen.append(abs(state[0]))
        return [100.0]

    def ball(state):
        return [min(state[0], 1.0)]

    rk4(rate, [0.5], 0.1, ball)
    assert max(seen) == 1.0
    rk4(rate, [0.5], 0.1)
    assert max(seen) > 5.0


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


def test_the_projection_of_rk4_needs_no_gain_to_be_small():
    acting = Disturbance(residual=5.0, rate=8.0, known=9.0)
    error = error_gains(SKEWED, "rk4", 0.01)
    found = by_projection(error, SKEWED, acting, n_h=4, W_max=2.0)
    assert found.xi_tilde == pytest.approx(
        error.force * 5.0 + error.rate * 8.0 + sum(error.weights) * 4
    )
    assert found.stage > found.xi_tilde


def test_the_tight_route_claims_no_less_than_an_identifier_without_a_network():
    for law in ("integral", "instantaneous"):
        certificate = judged(PaperIdentifier.for_vehicle(CAR, law=law))
        for name in ("printed_bound", "tight_bound", "ultimate_bound"):
            assert certificate[name].value >= certificate["trivial_bound"].value * (1 - 1e-9)


def test_a_projection_far_beyond_what_the_leakage_keeps_changes_no_bound_on_v():
    """Inner stages of RK4 go beyond the W of samples, with such a projection as without."""
    free = replace(PaperIdentifier.for_vehicle(CAR), integrator="rk4")
    bound = bounds_of(free)
    far = replace(free, gains=replace(free.gains, W_max=2.0 * bound.W))
    assert pytest.approx(bound.V, rel=1e-12) == bounds_of(far).V
