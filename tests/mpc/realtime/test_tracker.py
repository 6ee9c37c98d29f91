import numpy as np
import pytest

from mpc.prediction import build_rk4
from mpc.realtime import Guards, Status, Tracker
from mpc.tires.tire import ALL
from tests.mpc.realtime.conftest import PERIOD


def drive(tracker, tire, measure, x, steps, delay_periods, kappa=0.004, v_x=20.0):
    """Drive the prediction itself; return states at the measurements, commands and plans.

    A command is held from `delay_periods` after its measurement on.
    """
    step, n_x = build_rk4(tire.structure), 7 if tire.structure.lagged else 5
    waiting = [0.0] * delay_periods
    x = np.concatenate([x, np.zeros(n_x - len(x))])
    states, commands = [], []
    for _ in range(steps):
        states.append(x.copy())
        commands.append(tracker.step(measure(*x[:4], kappa=kappa, v_x=v_x)))
        waiting.append(commands[-1].steering)
        x[4] = waiting.pop(0)
        for _ in range(4):
            told = step(x, 0.0, kappa, v_x, PERIOD / 4, tire.car, tire.weights, *ALL)
            x = np.asarray(told).ravel()
    return np.array(states), commands


def test_it_brings_the_prediction_to_the_path(tracker, tire, measure):
    states, commands = drive(tracker, tire, measure, [0.5, 0.0, 0.0, 0.0], 150, 2)
    assert all(command.status == Status.OK for command in commands)
    assert abs(states[-1, 0]) < 0.02
    assert commands[-1].steering == pytest.approx(states[-1, 4], abs=1e-3)  # steady


def test_the_delay_is_predicted_away(tracker, tire, measure):
    states, commands = drive(tracker, tire, measure, [0.3, 0.0, 0.1, 0.05], 40, 2)
    # The plan begins half a period before its command acts, where the held steering has the mean of
    # a ramp: between the states of the first and second measurement after.
    for k in range(10, 35):
        middle = 0.5 * (states[k + 1] + states[k + 2])
        np.testing.assert_allclose(commands[k].plan_x[0, :4], middle[:4], atol=4e-3)


def test_hard_limits_hold_for_every_command_and_plan(tracker, measure, problem):
    rng, last, limits = np.random.default_rng(1), 0.0, problem.limits
    for _ in range(60):
        state = [0.8, 0.1, 0.5, 0.2] * rng.standard_normal(4)
        command = tracker.step(measure(*state, kappa=0.02 * rng.standard_normal()))
        assert abs(command.steering) <= limits.steering
        assert abs(command.steering - last) <= limits.steering_rate * PERIOD + 1e-12
        assert np.abs(command.plan_u).max() <= limits.steering_rate
        assert np.abs(command.plan_x[:, 4]).max() <= limits.steering
        last = command.steering


def test_a_shifted_plan_is_the_plan_of_a_period_later(tracker, problem, rng):
    """States, inputs and feedback, each read off between its own nodes; the last ones stay."""
    state, share = tracker.instance.state, PERIOD / problem.dt
    before = {name: rng.normal(size=state[name].shape) for name in ("x", "u", "feedback")}
    for name, values in before.items():
        state[name] = values
    tracker.instance._library.mpc_shift(*tracker.instance._step[:2])
    for name, values in before.items():
        nodes = np.arange(len(values))
        columns = values.reshape(len(values), -1).T
        read = np.column_stack([np.interp(nodes + share, nodes, column) for column in columns])
        np.testing.assert_allclose(state[name].reshape(read.shape), read, atol=1e-14)


WRONG = {
    Status.NOT_FINITE: {"e_y": np.nan},
    Status.OFF_PATH: {"e_y": 6.0},
    Status.OFF_MAP: {"v_y": -11.0},
    Status.TOO_SLOW: {"v_x": 1.0},
}


@pytest.mark.parametrize("status", WRONG)
def test_what_cannot_be_planned_has_a_status_and_a_counter(tracker, measure, status):
    tracker.step(measure(e_y=0.3))
    command = tracker.step(measure(**WRONG[status]))
    assert command.status == status
    assert tracker.faults[status] == 1
    assert tracker.faults[Status.OK] == 1
    assert np.isfinite(command.steering)


@pytest.mark.parametrize("status", WRONG)
def test_then_the_old_plan_steers_and_later_damped_tracking(tracker, measure, problem, status):
    good = tracker.step(measure(e_y=0.3, kappa=0.002))
    rate, share, last = good.plan_u.copy(), PERIOD / problem.dt, good.steering
    for _ in range(round(Guards().hold_time / PERIOD)):
        rate[:-1] += share * np.diff(rate)
        command = tracker.step(measure(**WRONG[status]))
        assert command.steering == pytest.approx(last + PERIOD * rate[0], abs=1e-12)
        last = command.steering
    for _ in range(60):
        command = tracker.step(measure(**{"kappa": 0.002, **WRONG[status]}))
    wanted = steady_steering(tracker, command.steering, {"kappa": 0.002, **WRONG[status]})
    assert command.steering == pytest.approx(wanted, abs=1e-9)


def steady_steering(tracker, wheels, told):
    """What the table says for a car that is measured so again and again, by the formula."""
    p, v_x, kappa = tracker.params, told.get("v_x", 20.0), told["kappa"]
    k_e_y, k_e_psi, k_v_y, k_r, k_delta, turn, drift = (
        np.interp(v_x, p["speeds"], column) for column in p["gains"].T
    )
    turn, v_y = kappa * turn, kappa * drift
    e_y = np.nan_to_num(np.clip(told.get("e_y", 0.0), -p["max_e_y"], p["max_e_y"]))
    off = [e_y, v_y / max(v_x, p["min_speed"]), told.get("v_y", 0.0) - v_y, -kappa * v_x]
    off[2] = np.clip(told.get("v_y", 0.0), -p["max_v_y"], p["max_v_y"]) - v_y
    return turn - np.dot([k_e_y, k_e_psi, k_v_y, k_r], off) - k_delta * (wheels - turn)


@pytest.mark.sweep("lagging")
def test_damped_tracking_alone_brings_the_car_back(tire, problem, measure):
    tracker = Tracker(tire, problem, period=PERIOD, guards=Guards(hold_time=0.0))

    def lost(*state, **road):
        told = measure(*state, **road)
        told.kappa[-1] = np.nan  # it never plans
        return told

    for speed in (10.0, 20.0, 30.0):
        tracker.reset()
        states, _ = drive(tracker, tire, lost, [0.5, 0.02, 0.0, 0.0], 400, 1, 0.0, speed)
        assert np.abs(states[-50:, 0]).max() < 0.05, speed


def test_a_missing_v_y_or_e_y_is_done_without(tracker, measure):
    told = {"e_psi": 0.05, "r": 0.1, "kappa": 0.002}
    steered = {}
    for missing in ({}, {"v_y": np.nan}, {"e_y": np.nan}, {"e_psi": np.nan}, {"r": np.nan}):
        tracker.reset()
        for _ in range(200):
            command = tracker.step(measure(**{**told, "e_y": 9.0, **missing}))
        steered[next(iter(missing), "")] = command.steering
    turn = 0.002 * np.interp(20.0, tracker.params["speeds"], tracker.params["gains"][:, 5])
    assert steered["e_psi"] == steered["r"] == pytest.approx(turn)  # the turn alone
    assert steered[""] < steered["e_y"] < turn - 0.01  # heading and yaw rate are answered
    assert steered["v_y"] == pytest.approx(steered[""], abs=2e-3)


def test_weights_swap_without_a_build_and_act_at_once(tracker, tire, measure):
    library = tracker.instance._library
    other = tire._replace(weights=0.7 * tire.weights)
    tracker.set_tire(other)
    assert tracker.instance._library is library
    fresh = Tracker(other, tracker.problem, period=PERIOD, delay=tracker.delay)
    told = measure(e_y=0.4, kappa=0.004)
    assert tracker.step(told).steering == fresh.step(told).steering
    old = Tracker(tire, tracker.problem, period=PERIOD, delay=tracker.delay)
    assert old.step(told).steering != fresh.step(told).steering


def test_another_structure_and_broken_weights_are_refused(linear, lagging, problem):
    tracker = Tracker(linear, problem)
    with pytest.raises(ValueError, match="is built for LinearAxles"):
        tracker.set_tire(lagging)
    with pytest.raises(ValueError, match="must be finite"):
        tracker.set_tire(linear._replace(weights=np.array([1e5, np.nan])))
    with pytest.raises(ValueError, match="weights must be 2"):
        tracker.set_tire(linear._replace(weights=np.ones(3)))
    assert tracker.tire is linear


def test_a_reset_forgets_all_but_the_faults(tracker, measure):
    first = tracker.step(measure(e_y=0.3)).steering
    tracker.step(measure(e_y=np.nan))
    tracker.reset()
    assert tracker.step(measure(e_y=0.3)).steering == first
    assert tracker.faults[Status.NOT_FINITE] == 1
    with pytest.raises(ValueError, match="must be finite"):
        tracker.reset(np.nan)


def test_the_road_is_asked_for_where_the_plan_will_be(tracker, problem):
    ahead = tracker.delay - 0.5 * PERIOD
    assert tracker.times[0] == 0.0
    assert tracker.times[1] == pytest.approx(ahead + 0.5 * problem.dt)
    assert tracker.plan_times[[0, -1]] == pytest.approx([ahead, ahead + 20 * problem.dt])
    assert len(tracker.times) == len(tracker.plan_times) == problem.horizon + 1
