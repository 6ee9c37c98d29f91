"""A tire on another friction is the one that is stretched, and the last moments tell which."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.methods import make_method
from identifier.paper.network import Network
from mpc.handover.judge import Judge, axle_forces
from mpc.handover.road import at_friction, fit_friction
from mpc.tires import prediction_tire
from tests.mpc.handover.conftest import DROP, samples_of


def steady_force(tire, alpha):
    """Forces [N] where both axles have one slip, straight ahead, sensors' offsets aside."""
    v_y = -20.0 * np.tan(alpha)
    rows = np.column_stack([np.full_like(alpha, 20.0), v_y, 0.0 * alpha, 0.0 * alpha])
    told = [axle_forces(tire, tire.weights[None], np.tile(row, (2, 1)), 0.01)[0, 0] for row in rows]
    return np.array(told)


def without_offsets(tire):
    weights = tire.weights.copy()
    weights[:4] = 0.0
    return tire._replace(weights=weights)


@pytest.mark.parametrize("ratio", [0.3, 0.5, 1.7])
def test_a_ladder_is_stretched_exactly(tire, ratio):
    tire, alpha = without_offsets(tire), np.linspace(-0.15, 0.15, 21)
    told = steady_force(at_friction(tire, ratio), alpha)
    np.testing.assert_allclose(
        told, ratio * steady_force(tire, alpha / ratio), rtol=1e-9, atol=1e-6
    )


def test_a_network_of_slip_is_stretched_exactly(car, rng):
    method = make_method("integral", car)
    method = replace(method, network=Network(inputs=("v_y", "r", "delta_f")))
    state = dict(W=rng.normal(size=(2, 10)), V=rng.normal(size=(10, 3)))
    tire, alpha = prediction_tire(method.frozen(car, state)), np.linspace(-0.02, 0.02, 9)
    told = steady_force(at_friction(tire, 0.5), 0.5 * alpha)
    v_y = [-20.0 * np.tan(0.5 * a) for a in alpha], [-20.0 * np.tan(a) for a in alpha]
    np.testing.assert_allclose(v_y[0], 0.5 * np.array(v_y[1]), rtol=1e-3)  # nearly similar states
    np.testing.assert_allclose(told, 0.5 * steady_force(tire, alpha), rtol=2e-3)


def test_what_reads_the_speed_or_knows_no_limit_cannot_be_told_for_a_friction(car):
    linear = prediction_tire(car)
    with pytest.raises(ValueError, match="LinearAxles cannot be scaled to another friction"):
        at_friction(linear, 0.5)
    with pytest.raises(ValueError, match="must be positive"):
        at_friction(linear, 0.0)


def test_a_drop_is_found_from_the_last_moments(tire, dropped):
    """0.4 s after the drop, in the bend that follows it."""
    samples, k = samples_of(dropped[1]), round(100 * (DROP + 0.9))
    judge = Judge(0.01)
    fit = fit_friction(judge, tire, samples[k - 42 : k])
    assert 0.42 < fit.ratio < 0.62
    assert fit.gain > 8.0
    assert fit.chi_square.total < 0.3 * judge.chi_square(tire, samples[k - 42 : k]).total


def test_without_a_drop_no_other_friction_is_worth_it(tire, dry):
    samples, judge = samples_of(dry[1]), Judge(0.01)
    gains = [
        fit_friction(judge, tire, samples[k - 42 : k]).gain for k in range(200, len(samples), 20)
    ]
    assert np.max(gains) < 8.0
    assert np.min(gains) >= 0.0  # what is known is among what is tried
