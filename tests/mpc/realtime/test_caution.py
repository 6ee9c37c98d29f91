"""What is not known of the tires, and what a cautious tracker does about it."""

import numpy as np
import pytest

from mpc.handover.road import at_friction
from mpc.prediction import build_dynamics, build_rk4, state_size
from mpc.realtime import Measurement, Status, Tracker
from mpc.realtime.caution import GRIPS, SURPRISE, set_caution
from mpc.tires.tire import ALL, DOUBT_STEP, N_DOUBTS, curves_at
from tests.mpc.realtime.conftest import PROBLEM
from tests.mpc.test_prediction import TIRES

PERIOD, V_X = 0.02, 20.0
STEPS = 250


def slalom(tracker, road, *, zero=0.0, peak=0.012, bias=(0.0, 0.0), off=None):
    """Drive a prediction along a sine of curvature; return grips that were planned with.

    bias: of the sensors of v_y [m/s] and yaw rate [rad/s].   off: takes the deviations [m].
    """
    step, n_x = build_rk4(road.structure), state_size(road.structure)
    x, waiting, grips = np.zeros(n_x), [0.0, 0.0], []
    shown = np.array([0.0, 0.0, *bias])
    for k in range(STEPS):
        t = PERIOD * k + tracker.times
        kappa = peak * np.sin(2.0 * np.pi * 0.4 * t)
        told = Measurement(*map(float, x[:4] + shown), kappa, np.full(t.size, V_X))
        command = tracker.step(told)
        assert command.status <= Status.ITERATION_LIMIT
        grips.append(tracker.grip)
        if off is not None:
            off.append(x[0])
        waiting.append(command.steering)
        x[4] = waiting.pop(0) + zero
        for _ in range(4):
            x = np.asarray(
                step(x, 0.0, kappa[0], V_X, PERIOD / 4, road.car, road.weights, *ALL)
            ).ravel()
        x[4] -= zero
    return np.array(grips)


def make(tire, caution):
    return Tracker(tire, PROBLEM, period=PERIOD, delay=2 * PERIOD, caution=caution)


def test_without_caution_nothing_that_is_feared_is_read(lagging):
    plain, other = make(lagging, 0.0), make(lagging, 0.0)
    for name in ("doubt", "grips", "prior", "force_error"):
        other.instance.params[name] *= 0.3
    slalom(plain, lagging), slalom(other, lagging)
    assert plain.instance.state.tobytes() == other.instance.state.tobytes()
    assert plain.grip == 1.0


def test_a_road_of_half_the_friction_is_planned_for_and_the_dry_one_is_not_feared(lagging):
    dry = slalom(make(lagging, 1.0), lagging, peak=0.006)
    wet = slalom(make(lagging, 1.0), at_friction(lagging, 0.5), peak=0.01)
    assert dry.min() > 0.9
    assert 0.35 < wet[-1] < 0.75


def test_half_the_caution_fears_half_as_much(lagging):
    state = []
    for caution in (1.0, 0.5):
        tracker = make(lagging, caution)
        tracker.instance.params["prior"][1:4] = 0.0  # these may be, before anything is seen
        tracker.step(Measurement(0.0, 0.0, 0.0, 0.0, np.zeros(21), np.full(21, V_X)))
        state.append(1.0 - tracker.grip)
    assert state[0] == pytest.approx(1.0 - GRIPS[3], abs=1e-12)
    assert state[1] == pytest.approx(0.5 * state[0], abs=1e-12)


def test_wheels_that_are_off_what_is_commanded_are_found_and_not_taken_for_ice(lagging):
    tracker = make(lagging, 1.0)
    grips = slalom(tracker, lagging, zero=0.01, peak=0.004)
    assert float(tracker.instance.state["zero"]) == pytest.approx(0.01, abs=2e-3)
    assert grips[-1] > 0.85


@pytest.mark.parametrize(
    ("bias", "found"), [((0.3, 0.0), ("drift", -0.3)), ((0.0, 0.02), ("turning", -0.02))]
)
def test_what_v_y_and_yaw_rate_are_off_is_found_and_the_car_comes_back(lagging, bias, found):
    weights = lagging.weights.copy()
    weights[1] += bias[0]  # learnt by the same sensors
    deviations = []
    for caution in (0.0, 1.0):
        tracker, off = make(lagging._replace(weights=weights), caution), []
        slalom(tracker, lagging, peak=0.004, bias=bias, off=off)
        deviations.append(abs(np.mean(off[-125:])))
    name, value = found
    assert float(tracker.instance.state[name]) == pytest.approx(value, rel=0.1)
    assert deviations[1] < 0.3 * deviations[0] or deviations[0] < 0.01


def test_a_friction_is_the_tire_with_weights_of_that_friction():
    rng = np.random.default_rng(3)
    for tire in TIRES.values():
        if tire.structure.at_friction(tire.weights, 0.6) is None:
            continue
        rates, n_x = build_dynamics(tire.structure), state_size(tire.structure)
        for x in rng.normal(0.0, 0.05, (20, n_x)):
            told = (0.1, 0.01, V_X, 0.05, tire.car)
            shared = rates(x, *told, tire.weights, *ALL[:2], 0.6)
            weights = tire.structure.at_friction(tire.weights, 0.6)
            np.testing.assert_allclose(
                np.array(shared), np.array(rates(x, *told, weights, *ALL)), rtol=1e-9, atol=1e-9
            )


def test_a_wide_band_alone_lowers_no_grip(lagging):
    force = curves_at(lagging, DOUBT_STEP * np.arange(N_DOUBTS, dtype=np.float64))
    tracker = make(lagging._replace(doubt=0.5 * np.abs(force)), 1.0)
    assert (tracker.params["prior"] == np.where(GRIPS < 1.0, SURPRISE, 0.0)).all()
    assert slalom(tracker, lagging, peak=0.006).min() > 0.9


def test_doubt_tightens_slip_along_the_plan(lagging):
    """The same turn is planned with less slip, where more force may be missing."""
    slips = []
    for share in (0.0, 0.3, 0.6):
        tire = lagging._replace(
            doubt=share * curves_at(lagging, DOUBT_STEP * np.arange(N_DOUBTS, dtype=np.float64))
        )
        tracker = make(tire, 1.0)
        tracker.instance.params["prior"][1:] = SURPRISE  # of the grip nothing is feared
        turn = Measurement(0.0, 0.0, 0.0, 0.02 * V_X, np.full(21, 0.02), np.full(21, V_X))
        for _ in range(10):
            command = tracker.step(turn)
        x = command.plan_x[1:]
        slips.append(np.abs(x[:, 4] - (x[:, 2] + tire.car[2] * x[:, 3]) / V_X).mean())
    assert slips[1] < 0.95 * slips[0]
    assert slips[2] < 0.98 * slips[1]


def test_a_doubt_is_answered_where_the_plan_steers_as_fast_as_it_can(lagging):
    aside = Measurement(1.0, 0.0, 0.0, 0.0, np.zeros(21), np.full(21, V_X))
    for caution in (0.0, 1.0):
        tracker = make(lagging, caution)
        command = tracker.step(aside)
        held = np.abs(command.plan_u) >= PROBLEM.limits.steering_rate - 1e-9
        fed_back = np.abs(tracker.instance.state["feedback"][held, 0])
        assert held.any()
        assert (fed_back > 0.1).all() if caution else (fed_back < 0.1).all()


def test_a_sample_that_is_no_number_leaves_what_is_believed_as_it_was(lagging):
    tracker = make(lagging, 1.0)
    slalom(tracker, at_friction(lagging, 0.5), peak=0.01)
    before = tracker.grip
    broken = Measurement(0.0, 0.0, np.nan, 0.0, np.zeros(21), np.full(21, V_X))
    assert tracker.step(broken).status == Status.NOT_FINITE
    assert tracker.grip == before
    assert np.isfinite(tracker.instance.state["cost"]).all()


def test_caution_is_a_share(lagging):
    with pytest.raises(ValueError, match=r"caution must be from 0 to 1, it is 1\.5"):
        make(lagging, 1.5)
    with pytest.raises(ValueError, match="it is nan"):
        make(lagging, np.nan)


def test_a_tire_of_no_other_friction_is_driven_with_its_own(linear):
    tracker = make(linear, 1.0)
    slalom(tracker, linear, peak=0.004)
    assert tracker.grip == 1.0
    params = tracker.params
    set_caution(params, linear, 1.0)
    assert (params["grips"] == 1.0).all()
