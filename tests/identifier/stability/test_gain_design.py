import numpy as np
import pytest

from identifier.paper.laws import DrivingError
from identifier.stability.bounds import steady_capacity
from identifier.stability.gain_design import DesignError, _gain_for_phase_margin, design_gains
from identifier.stability.loop import INSTANTANEOUS, INTEGRAL, Loop, euler, exact
from identifier.stability.margins import phase_margin
from identifier.stability.operation import Operation, proven_bounds, worst_loop
from identifier.stability.sampled_bound import Disturbance

TASK = {
    "bandwidth": 0.7, "dt": 0.01, "n_h": 10, "x_bar_max": 2.5,
    "disturbance": Disturbance(residual=4.0), "needed_force": 4.0, "V_max": 12.0,
}  # fmt: skip


def operation(**changes):
    settings = {
        "n_h": 10, "dt": 0.01, "integrator": "euler", "bandwidth": 0.7,
        "disturbance": Disturbance(residual=4.0), "needed_force": 4.0, "x_bar_max": 2.5,
        "input_feedback": None,
    }  # fmt: skip
    return Operation(**{**settings, **changes})


@pytest.mark.parametrize("margin", [30.0, 45.0, 60.0, 75.0])
def test_equal_poles_give_the_closed_form_of_the_gain(margin):
    x = np.tan(np.radians(90.0 - margin) / 2.0)
    g = _gain_for_phase_margin(a=7.0, lam=7.0, law=INTEGRAL, phase_margin=margin)
    assert g == pytest.approx(7.0**4 * x * (1 + x**2), rel=1e-9)


@pytest.mark.parametrize("law", [INTEGRAL, INSTANTANEOUS, DrivingError(1.0, 0.05)])
@pytest.mark.parametrize("dt", [None, 0.01])
def test_the_gain_has_the_phase_margin_that_was_asked_for(law, dt):
    g = _gain_for_phase_margin(a=6.0, lam=9.0, law=law, phase_margin=50.0, dt=dt)
    loop = Loop(A_d=-6.0 * np.eye(2), forgetting=9.0, law=law, G=g * np.eye(2))
    found = phase_margin(loop, exact if dt is None else euler, 0.01)
    assert found == pytest.approx(50.0, abs=1e-6)


def test_a_phase_margin_below_that_of_every_gain_is_refused():
    with pytest.raises(DesignError, match="every gain"):
        _gain_for_phase_margin(a=6.0, lam=9.0, law=INSTANTANEOUS, phase_margin=1e-6)


@pytest.mark.parametrize("law", [INTEGRAL, INSTANTANEOUS])
def test_a_design_keeps_its_phase_margin_at_the_worst_regressor_with_both_layers_learning(law):
    gains = design_gains(law=law, **TASK, phase_margin=55.0)
    assert gains.eta_V > 0.0
    direction = -np.linalg.inv(gains.matrix)
    kept = proven_bounds(gains, law, operation(), direction).W
    loop = worst_loop(gains, law, operation(), direction, kept)
    assert phase_margin(loop, euler, 0.01) == pytest.approx(55.0, abs=1e-6)
    assert loop.G[0, 0] == pytest.approx(10.0 * gains.eta_W)


@pytest.mark.parametrize("law", [INTEGRAL, INSTANTANEOUS, DrivingError(1.0, 0.05)])
def test_a_design_keeps_its_rules(law):
    gains = design_gains(law=law, **TASK, capacity=3.0)
    bounds = proven_bounds(gains, law, operation(), -np.linalg.inv(gains.matrix)).leakage
    a = -gains.A_d[0][0]
    lag = 2.0 * np.arctan(2 * np.pi * 0.7 / a)
    assert np.degrees(lag) == pytest.approx(45.0)
    capacity = steady_capacity(
        gains.matrix, law=law, forgetting=gains.forgetting, eta_W=gains.eta_W, rho_W=gains.rho_W,
        n_h=10,
    )  # fmt: skip
    assert capacity == pytest.approx(3.0 * 4.0)
    drive, lam = gains.eta_V / a * bounds.W * 2.5, gains.forgetting  # of V, at the bounds
    V = (
        drive * (law.z / lam + law.xi_tilde) / gains.rho_V
        + law.z * drive * bounds.xi_tilde / lam**2
    )
    assert pytest.approx(12.0) == V


def test_a_bandwidth_that_the_sampling_cannot_follow_is_refused_with_both_ways_out():
    with pytest.raises(
        DesignError, match=r"sample every .* ms, or ask for a bandwidth of 1\.32 Hz"
    ):
        design_gains(law=INTEGRAL, **{**TASK, "bandwidth": 1.4})
    with pytest.raises(DesignError, match="larger phase margin"):
        design_gains(law=INTEGRAL, **TASK, phase_margin=15.0)
    with pytest.raises(ValueError, match="V_max must be positive"):
        design_gains(law=INTEGRAL, **{**TASK, "V_max": 0.0})
    with pytest.raises(DesignError, match="phase margin must be"):
        design_gains(law=INTEGRAL, **TASK, phase_margin=95.0)


def test_a_network_that_reads_the_estimate_makes_the_error_dynamics_faster():
    slow = design_gains(law=INTEGRAL, **TASK)
    fast = design_gains(law=INTEGRAL, **TASK, minimal_decay=10.0)
    assert -fast.A_d[0][0] == pytest.approx(15.0)
    assert -slow.A_d[0][0] < 11.0
