"""No number that is not finite stays in the tracker, whatever it is told."""

import numpy as np
import pytest

from mpc.prediction import build_stage, state_size
from mpc.realtime import Status, Tracker
from mpc.tires.tire import valid_slip
from tests.mpc.realtime.conftest import PERIOD

HUGE = [1e308, -1e308, 1e30, np.inf, np.nan]
CARRIED = ("x", "u", "feedback", "commands", "lagged")
OF_PLAN = ("x", "u", "feedback", "lagged", "age", "planned", "guessed", "started")


def numbers(tracker):
    return np.concatenate([tracker.instance.state[name].ravel() for name in CARRIED])


@pytest.mark.sweep(
    "linear-1e+308-*", "lagging-nan-*", "lagging-inf-True-*", "linear--1e+308-True-*"
)
@pytest.mark.parametrize("field", ["e_y", "e_psi", "v_y", "r", "kappa", "v_x"])
@pytest.mark.parametrize("planned", [False, True])
@pytest.mark.parametrize("value", HUGE)
def test_a_huge_number_in_any_input_leaves_the_state_finite(
    tracker, measure, field, planned, value
):
    if planned:
        tracker.step(measure(e_y=0.3, kappa=0.002))
    refused = tracker.step(measure(**{field: value}))
    assert refused.status >= Status.QP_FAILED
    assert np.abs(numbers(tracker)).max() < 1e12
    assert tracker.step(measure(e_y=0.3, kappa=0.002)).status == Status.OK


@pytest.mark.parametrize("place", [0, 1, 10, -1])
@pytest.mark.parametrize("field", ["kappa", "v_x"])
def test_a_huge_number_far_ahead_is_no_road(tracker, measure, field, place):
    told = measure(e_y=0.3)
    getattr(told, field)[place] = 1e308
    assert tracker.step(told).status == Status.OFF_MAP  # a number, and no road
    assert np.abs(numbers(tracker)).max() < 1e12


def test_what_is_refused_does_to_the_plan_what_any_other_refused_sample_does(
    tire, problem, measure
):
    states = []
    for wrong in ({"e_y": np.nan}, {"v_y": 1e308}, {"e_psi": -9.0}, {"v_x": 0.1}):
        tracker = Tracker(tire, problem, period=PERIOD, delay=2 * PERIOD)
        tracker.step(measure(e_y=0.3, kappa=0.002))
        tracker.step(measure(**wrong))
        states.append([tracker.instance.state[name].copy() for name in OF_PLAN])
    for other in states[1:]:
        for a, b in zip(states[0], other, strict=True):
            np.testing.assert_array_equal(a, b)


def test_the_stage_is_finite_beyond_the_center_and_as_before_on_this_side(tire, problem):
    stage = build_stage(tire.structure)
    n_x = state_size(tire.structure)
    valid = valid_slip(tire, problem.limits.slip)

    def s_dot_acts(e_y, kappa):
        x = np.zeros(n_x)
        x[0] = e_y
        rest = (0.0, kappa, 10.0, 1e-3, tire.car, tire.weights, *valid)
        found = [np.array(value) for value in stage(x, *rest, problem.cost.numbers())]
        assert all(np.isfinite(value).all() for value in found)
        return found[0][1, 0] / (-kappa * 1e-3)  # e_psi falls by kappa s_dot

    assert s_dot_acts(1.0, 0.5) == pytest.approx(10.0 / (1 - 0.5), rel=0.01)
    for kappa in (0.95, 1.0, 1.05, 2.0):
        assert s_dot_acts(1.0, kappa) <= 10.0 / 0.1 + 1e-9


def test_weights_that_overflow_give_no_plan_and_stay_out_of_the_state(tire, problem, measure):
    tracker = Tracker(tire, problem, period=PERIOD)
    good = tracker.step(measure(e_y=0.3))
    tracker.set_tire(tire._replace(weights=1e200 * tire.weights))
    failed = tracker.step(measure(e_y=0.3))
    assert failed.status == Status.QP_FAILED
    assert np.abs(numbers(tracker)).max() < 1e12
    assert failed.iterations <= 2  # it is seen at once
    tracker.set_tire(tire)
    assert tracker.step(measure(e_y=0.3)).status == good.status
