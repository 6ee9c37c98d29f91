from dataclasses import replace

import numpy as np
import pytest

from identifier.defaults import default_design
from identifier.laws import DRIVING_ERRORS
from identifier.stability import certify
from identifier.stability.driving_limits import largest_signals, operation, residual_bound
from identifier.stability.estimated_input import minimal_decay

HARD = {"v_x": 20.0, "slip": 0.12, "friction": 0.9}


def test_a_random_state_within_slip_and_grip_stays_within_the_signals(car):
    limits = largest_signals(car, **HARD)
    rng = np.random.default_rng(0)
    alpha = rng.uniform(-0.12, 0.12, (1000, 2))
    r = rng.uniform(-1, 1, 1000) * 0.9 * 9.81 / 20.0
    v_y = car.l_r * r - 20.0 * alpha[:, 1]  # the rear axle does not steer
    delta_f = alpha[:, 0] + (v_y + car.l_f * r) / 20.0
    for name, signal in (("v_y", v_y), ("r", r), ("delta_f", delta_f)):
        assert 0.8 * limits[name] < np.abs(signal).max() <= limits[name]


def test_the_residual_is_what_is_left_of_the_linear_force_when_both_axles_slide(car):
    sliding = 0.9 * car.mass * 9.81 / car.wheelbase * np.array([car.l_r, car.l_f])
    linear = 0.12 * np.array([car.cornering_stiffness_front, car.cornering_stiffness_rear])
    assert residual_bound(car, slip=0.12, friction=0.9) == pytest.approx(
        np.linalg.norm(linear - sliding)
    )
    assert residual_bound(car, slip=0.01, friction=0.9) == 0.0


def test_the_operation_of_a_design_is_enough_for_its_certificate(car):
    for law in ("integral", "instantaneous_scaled"):
        design = default_design(car, law=law)
        task = operation(design, car, **HARD, bandwidth=0.5)
        certificate = certify(design.gains, DRIVING_ERRORS[design.law], task)
        assert certificate["gain_sampled"].margin > 1.0
        assert certificate["error_dynamics"].value == pytest.approx(-design.gains.A_d[0][0])


def test_a_network_that_reads_the_estimate_brings_its_feedback_along(car):
    design = replace(default_design(car), input_source="estimated")
    task = operation(design, car, **HARD, bandwidth=0.5)
    assert task.input_feedback is not None
    assert 5.0 < minimal_decay(task.input_feedback) < 12.0
