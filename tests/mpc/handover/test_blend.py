"""Weights move in steps that the plan does not notice, and arrive exactly."""

import numpy as np
import pytest

from mpc.handover.learner import blended
from mpc.handover.road import at_friction
from mpc.tires import prediction_tire


def along(now, target, gain):
    """A plan whose first rate moves in proportion to the way of the weights."""
    way = target.weights - now.weights

    def planned(tire):
        return 0.1 + gain * float(way @ (tire.weights - now.weights)) / float(way @ way)

    return planned


def test_a_plan_that_does_not_care_gets_the_share_that_was_asked_for(tire):
    target = at_friction(tire, 0.5)
    step = blended(tire, target, 0.25, planned=lambda _: 0.3, most=0.01)
    np.testing.assert_allclose(step.weights, 0.75 * tire.weights + 0.25 * target.weights)
    assert blended(tire, target, 1.0, planned=lambda _: 0.3, most=0.01) is target


@pytest.mark.parametrize("gain", [0.05, 0.3, 2.0])
def test_the_step_is_halved_until_the_plan_does_not_jump(tire, gain):
    target = at_friction(tire, 0.5)
    planned = along(tire, target, gain)
    jump = planned(blended(tire, target, 1.0, planned=planned, most=0.1)) - planned(tire)
    assert 0.0 < jump <= 0.1
    assert jump == pytest.approx(gain) or 2.0 * jump > 0.1  # no smaller than it must be


def test_there_is_no_way_to_another_structure_and_none_to_go_at_the_target(car, tire):
    with pytest.raises(ValueError, match="cannot move to"):
        blended(tire, prediction_tire(car), 1.0, planned=lambda _: 0.0, most=0.1)
    copy = tire._replace(weights=tire.weights.copy())
    assert blended(tire, copy, 0.1, planned=lambda _: 0.0, most=0.1) is copy
