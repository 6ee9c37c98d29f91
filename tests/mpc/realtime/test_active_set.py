"""Sets of active limits before the interior point: what they find, and at what cost."""

import numpy as np
import pytest

from benchmarks.converged import iterated, solve
from mpc.prediction import build_rk4
from mpc.realtime import Status, Tracker, instance
from mpc.tires.tire import valid_slip
from tests.mpc.realtime.test_iteration import dense_solution


def near_a_plan(tracker, seed, size=1.0):
    """Plan to convergence with limits reached; a state near its beginning, on the same road."""
    rng = np.random.default_rng(seed)
    x0 = np.zeros(tracker.instance.start.size)
    x0[:5] = size * np.array([0.5, 0.08, 0.3, 0.1, 0.05]) * rng.uniform(-1.0, 1.0, 5)
    kappa, v_x = (np.full(tracker.problem.horizon, x) for x in (0.012 * x0[0], 18.0 + 4.0 * x0[1]))
    iterated(tracker, x0, kappa, v_x)
    x0[:4] += size * np.array([0.02, 0.004, 0.03, 0.05]) * rng.standard_normal(4)
    return x0, kappa, v_x


def by_highs(tracker, x0, kappa, v_x):
    """u of the program that a step solves: along the way from x0 under plan and feedback."""
    state, problem, tire = tracker.instance.state, tracker.problem, tracker.tire
    most, fastest, dt = problem.limits.steering, problem.limits.steering_rate, problem.dt
    rk4, valid = build_rk4(tire.structure), valid_slip(tire, problem.limits.slip)
    x, u = [np.array(x0)], []
    for k in range(problem.horizon):
        fed_back = state["feedback"][k] @ (x[k] - state["x"][k])
        rate = np.clip(state["u"][k] + fed_back, -fastest, fastest)
        u.append((np.clip(x[k][4] + dt * rate, -most, most) - x[k][4]) / dt)
        step = (x[k], u[k], kappa[k], v_x[k], dt, tire.car, tire.weights, *valid)
        x.append(np.asarray(rk4(*step)).ravel())
    return dense_solution(tire, problem, np.array(x), np.array(u), kappa, v_x)


def solved(tracker, at):
    """The command; the plan stays."""
    before = tracker.instance.state.copy()
    command = solve(tracker, *at)
    tracker.instance.state[...] = before
    return command


@pytest.mark.parametrize("seed", [0, 1, 3, 4, 5])  # HiGHS gives up at 2
def test_a_set_finds_what_a_dense_solver_finds(linear, problem, seed):
    tracker = Tracker(linear, problem, tolerance=1e-10)
    at = near_a_plan(tracker, seed)
    command = solved(tracker, at)
    assert command.status == Status.OK
    np.testing.assert_allclose(command.plan_u, by_highs(tracker, *at), atol=1e-5)


def test_angle_and_rate_are_reached_and_kept_at_once(tire, problem):
    tracker = Tracker(tire, problem)
    x0 = np.zeros(tracker.instance.start.size)
    at = (x0, np.full(problem.horizon, 0.06), np.full(problem.horizon, 8.0))
    iterated(tracker, *at)
    again = solved(tracker, at)
    assert (again.status, again.iterations) == (Status.OK, 1)
    assert np.sum(again.plan_x[1:, 4] >= problem.limits.steering * (1.0 - 1e-9)) > 5
    assert np.sum(again.plan_u >= problem.limits.steering_rate * (1.0 - 1e-9)) > 2


def test_sets_answer_a_car_that_is_thrown_about_as_the_interior_point_does(linear, problem):
    trackers = [Tracker(linear, problem, tolerance=1e-12, max_active_sets=most) for most in (16, 0)]
    rng, sets = np.random.default_rng(0), []
    for seed in range(12):
        x0, *road = near_a_plan(trackers[0], seed)
        x0[:4] += np.array([0.15, 0.025, 0.15, 0.15]) * rng.standard_normal(4)
        trackers[1].instance.state[...] = trackers[0].instance.state
        by_sets, by_interior = (solved(tracker, (x0, *road)) for tracker in trackers)
        np.testing.assert_allclose(by_sets.plan_u, by_interior.plan_u, atol=1e-5)
        sets.append(by_sets.iterations)
    assert np.median(sets) <= 6
    assert sum(count <= 16 for count in sets) >= 9


@pytest.mark.sweep("pull*")
@pytest.mark.parametrize(
    ("pattern", "mistake"),
    [
        ("next[i] = (outward < -tolerance) ? 0 :", "next[i] = (outward < -1e9) ? 0 :"),
        ("pull += work->L[k][j] * work->dx[k][j];", "pull += 0.0;"),
        ("m[j] += work->L[k][j] * d;", "m[j] += 0.0 * d;"),
        ("active ? (MPC_C(1.0) / work", "active ? (MPC_C(0.5) / work"),
    ],
)
def test_a_mistake_in_the_sets_does_not_pass(linear, problem, pattern, mistake, monkeypatch):
    source = instance.tracker_source(linear.structure, problem.horizon, single=False)
    assert source.count(pattern) == 1, pattern
    mistaken = source.replace(pattern, mistake)
    monkeypatch.setattr(instance, "tracker_source", lambda *_, **__: mistaken)
    wrong = Tracker(linear, problem)
    monkeypatch.undo()
    right = Tracker(linear, problem)
    largest = 0.0
    for seed in range(24):
        at = near_a_plan(right, seed, size=1.0 + 0.5 * (seed % 3))
        wrong.instance.state[...] = right.instance.state
        largest = max(largest, np.abs(solved(wrong, at).plan_u - solved(right, at).plan_u).max())
    assert largest > 1e-4
