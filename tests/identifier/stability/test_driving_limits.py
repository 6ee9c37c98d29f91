from dataclasses import replace

import numpy as np
import pytest

from identifier.driving import Driving
from identifier.paper.design import PaperIdentifier
from identifier.paper.laws import LAWS
from identifier.paper.network import Network
from identifier.stability.certificate import certify
from identifier.stability.operation import (
    SPEED_SPREAD,
    _largest_signals,
    _residual_bound,
    declared_signals,
    disturbance,
    expected_residual,
)

HARD = {"v_x": 20.0, "slip": 0.12, "friction": 0.9}
DRIVING = Driving(**HARD, bandwidth=0.5)


def test_a_random_state_within_slip_and_grip_stays_within_the_signals(car):
    limits = _largest_signals(car, **HARD)
    rng = np.random.default_rng(0)
    alpha = rng.uniform(-0.12, 0.12, (1000, 2))
    r = 1.5 * rng.uniform(-1, 1, 1000) * 0.9 * 9.81 / 20.0
    v_y = car.l_r * r - 20.0 * alpha[:, 1]  # the rear axle does not steer
    delta_f = alpha[:, 0] + (v_y + car.l_f * r) / 20.0
    for name, signal in (("v_y", v_y), ("r", r), ("delta_f", delta_f)):
        assert 0.8 * limits[name] < np.abs(signal).max() <= limits[name]


def test_no_tire_between_none_and_twice_the_stated_stiffness_misses_more_than_the_bound(car):
    """Magic curves of any friction and shape; those that slide late are the ones that counted."""
    rng, C = np.random.default_rng(1), (car.cornering_stiffness_front, car.cornering_stiffness_rear)
    bound, worst = _residual_bound(car, slip=0.12), 0.0
    for _ in range(300):
        alpha, friction = rng.uniform(-0.12, 0.12, 2), rng.uniform(0.05, 1.2, 2)
        shape, stiffer = rng.uniform(1.0, 1.9), rng.uniform(0.1, 2.0)
        peak = friction * car.axle_loads
        force = peak * np.sin(shape * np.arctan(stiffer * np.multiply(C, alpha) / (shape * peak)))
        worst = max(worst, np.linalg.norm(force - np.multiply(C, alpha)))
    assert 0.8 * bound < worst <= bound


def test_a_smooth_tire_misses_force_long_before_it_slides(car):
    """At half the slip of sliding nothing slides, and yet the linear tire is wrong."""
    sliding = min(car.axle_loads) / max(car.cornering_stiffness_front, car.cornering_stiffness_rear)
    missed = expected_residual(car, slip=0.5 * sliding, friction=1.0)
    assert 0.0 < 100.0 < missed < _residual_bound(car, slip=0.5 * sliding)
    late = expected_residual(car, slip=0.12, friction=0.9)
    slid = 0.12 * np.array([car.cornering_stiffness_front, car.cornering_stiffness_rear])
    assert late == pytest.approx(np.linalg.norm(slid - 0.9 * np.array(car.axle_loads)), rel=0.05)


def test_what_each_sensor_adds_is_the_force_of_the_slip_and_of_the_turn_that_it_feigns(car):
    """By hand, with all sensors wrong at once; told nothing of noise, there is none."""
    assert (DRIVING.noise_v_x, DRIVING.noise_v_y, DRIVING.noise_r, DRIVING.noise_delta) == (0,) * 4
    d_v_x, d_v_y, d_r, d_delta = 0.3, 0.1, 0.02, 0.003
    noisy = replace(DRIVING, noise_v_x=d_v_x, noise_v_y=d_v_y, noise_r=d_r, noise_delta=d_delta)
    clean, wrong = (disturbance(car, of, dt=0.01, unit=1000.0) for of in (DRIVING, noisy))
    signals, added = declared_signals(car, DRIVING), []
    slow, fast = (1 - SPEED_SPREAD) * DRIVING.v_x, (1 + SPEED_SPREAD) * DRIVING.v_x
    for lever, other, C in (
        (car.l_f, car.l_r, car.cornering_stiffness_front),
        (car.l_r, car.l_f, car.cornering_stiffness_rear),
    ):
        sway = signals["v_y"] + lever * signals["r"]
        slip = d_delta + (d_v_y + lever * d_r + sway * d_v_x / slow) / (slow - d_v_x)
        turn = fast * d_r + d_v_x * (signals["r"] + d_r)
        added.append((C * slip + car.mass * other / car.wheelbase * turn) / 1000.0)
    told = np.linalg.norm(added)
    assert wrong.residual - clean.residual == pytest.approx(told, rel=1e-9)


def test_the_operation_of_a_design_is_enough_for_its_certificate(car):
    for law in ("integral", "instantaneous_scaled"):
        design = PaperIdentifier.for_vehicle(car, law=law)
        task = design.operation(car, DRIVING)
        certificate = certify(design.gains, LAWS[design.law], task)
        assert certificate["gain_sampled"].margin > 1.0
        a = -design.gains.A_d[0][0]
        decay = -np.log(1.0 - 0.01 * a) / 0.01  # of Euler at 10 ms
        assert certificate["error_dynamics"].value == pytest.approx(decay)


def test_a_network_that_reads_the_estimate_brings_its_feedback_along(car):
    design = replace(PaperIdentifier.for_vehicle(car), input_source="estimated")
    task = design.operation(car, DRIVING)
    assert task.input_feedback is not None
    assert 5.0 < np.linalg.eigvals(task.input_feedback).real.max() < 12.0


def test_a_speed_that_errs_by_half_of_itself_is_refused():
    """A slip angle divides by what the sensor shows: an error near the speed leaves nothing."""
    half = 0.5 * DRIVING.v_x
    assert replace(DRIVING, noise_v_x=0.99 * half).noise_v_x == 0.99 * half
    for wrong in (half, 1.2 * half):
        with pytest.raises(ValueError, match="noise_v_x must be below half the speed"):
            replace(DRIVING, noise_v_x=wrong)


def test_an_error_of_the_estimate_adds_most_to_the_input_at_the_slowest_speed_that_is_shown(car):
    """Slip angles that the network reads, by hand, where the sensor shows its least."""
    names = ("alpha_f", "alpha_r")
    network = Network(hidden=4, inputs=names, scale=(0.1, 0.2))
    design = replace(PaperIdentifier.for_vehicle(car), network=network, input_source="estimated")
    noisy = replace(DRIVING, noise_v_x=4.0)
    K_inv = np.array(
        [[car.mass * car.l_r, car.yaw_inertia], [car.mass * car.l_f, -car.yaw_inertia]]
    )
    K = np.linalg.inv(K_inv / car.wheelbase)
    shown = 0.95 * 20.0 - 4.0
    angles = np.array([[1.0, car.l_f], [1.0, -car.l_r]]) / shown
    expected = np.linalg.norm(angles / [[0.1], [0.2]] @ K * design.force_unit, 2)
    assert design.operation(car, noisy).input_per_error == pytest.approx(expected, rel=1e-9)
