"""One iteration of the C against the same quadratic program, dense, with slacks, by HiGHS."""

import casadi as ca
import numpy as np
import pytest

from benchmarks.converged import iterated, solve
from mpc.prediction import build_end, build_stage
from mpc.realtime import Status, Tracker
from mpc.tires.tire import valid_slip

SOFT = 3  # e_y, slip in front, slip at the rear


def dense_solution(tire, problem, plan_x, plan_u, kappa, v_x):
    """Return u of the linearized problem around a plan, all rows in one matrix."""
    N, n_x = problem.horizon, plan_x.shape[1]
    stage, end = build_stage(tire.structure), build_end(tire.structure)
    cost, limits = problem.cost, problem.limits
    valid = valid_slip(tire, limits.slip)
    plan_x = plan_x.copy()
    at = []
    for k in range(N):
        ports = (plan_x[k], plan_u[k], kappa[k], v_x[k], problem.dt, tire.car, tire.weights, *valid)
        at.append([np.array(value) for value in stage(*ports, cost.numbers())])
    plan_x[N] = at[-1][0].ravel()  # the end is where the last stage leads
    last = (plan_x[N], kappa[-1], v_x[-1], tire.car, tire.weights, *valid, cost.terminal_numbers())
    at.append([None, None, None, *(np.array(value) for value in end(*last))])

    # variables: dx_1 … dx_N, du_0 … du_{N-1}, s of every soft row
    n = n_x * N + N + SOFT * N
    P, p = np.zeros((n, n)), np.zeros(n)
    rows, low, high = [], [], []

    def x(k):
        return slice(n_x * (k - 1), n_x * k)

    def u(k):
        return n_x * N + k

    def s(k, i):
        return n_x * N + N + SOFT * (k - 1) + i

    Z = [limits.soft_e_y, limits.soft_slip, limits.soft_slip]
    most = [limits.e_y, *limits.slip]
    bounds = np.tile([[-np.inf], [np.inf]], n)
    for k in range(N):
        x_next, A, B, *_ = at[k]
        row = np.zeros((n_x, n))
        row[:, x(k + 1)] = np.eye(n_x)
        if k > 0:
            row[:, x(k)] = -A
        row[:, u(k)] = -B.ravel()
        gap = x_next.ravel() - plan_x[k + 1]
        rows.append(row), low.append(gap), high.append(gap)
        P[u(k), u(k)], p[u(k)] = cost.R, cost.R * plan_u[k]
        bounds[:, u(k)] = np.array([-1.0, 1.0]) * limits.steering_rate - plan_u[k]
    for k in range(1, N + 1):
        _, _, _, H, h, slip, slip_x = at[k]
        P[x(k), x(k)], p[x(k)] = H, h.ravel()
        delta = n_x * (k - 1) + 4
        bounds[:, delta] = np.array([-1.0, 1.0]) * limits.steering - plan_x[k, 4]
        values = [plan_x[k, 0], *slip.ravel()]
        slopes = [np.eye(n_x)[0], *slip_x]
        for i in range(SOFT):
            P[s(k, i), s(k, i)] = Z[i]
            bounds[0, s(k, i)] = 0.0
            for sign in (1.0, -1.0):
                row = np.zeros((1, n))
                row[0, x(k)], row[0, s(k, i)] = sign * slopes[i], -1.0
                rows.append(row), low.append([-np.inf]), high.append([most[i] - sign * values[i]])
    A = np.vstack(rows)
    solver = ca.conic("dense", "highs", {"h": ca.DM(P).sparsity(), "a": ca.DM(A).sparsity()})
    answer = solver(
        h=P,
        g=p,
        a=A,
        lba=np.concatenate(low),
        uba=np.concatenate(high),
        lbx=bounds[0],
        ubx=bounds[1],
    )
    assert solver.stats()["success"]
    return plan_u + np.array(answer["x"]).ravel()[n_x * N : n_x * N + N]


@pytest.mark.parametrize("seed", range(4))
def test_an_iteration_solves_the_linearized_problem(tire, problem, seed):
    rng = np.random.default_rng(seed)
    tracker = Tracker(tire, problem, tolerance=1e-12, max_iterations=60)
    state = tracker.instance.state
    N, n_x = problem.horizon, state["x"].shape[1]
    size = np.array([0.8, 0.1, 0.5, 0.2, 0.1, 0.05, 0.05])[:n_x]
    plan_x = size * rng.uniform(-1.0, 1.0, (N + 1, n_x))
    plan_u = rng.uniform(-0.5, 0.5, N)
    kappa, v_x = 0.01 * rng.standard_normal(N), 18.0 + rng.uniform(0.0, 4.0, N)
    wanted = dense_solution(tire, problem, plan_x, plan_u, kappa, v_x)
    state["x"], state["u"] = plan_x, plan_u
    command = solve(tracker, plan_x[0], kappa, v_x)
    assert command.status == Status.OK
    np.testing.assert_allclose(command.plan_u, wanted, atol=1e-5)


def test_too_few_iterations_are_said(tire, problem):
    tracker = Tracker(tire, problem, max_iterations=2)
    x0 = np.zeros(tracker.instance.state["x"].shape[1])
    x0[0] = 0.9
    plan = solve(tracker, x0, 0.0, 20.0)
    assert plan.status == Status.ITERATION_LIMIT
    assert plan.iterations == 2
    assert np.abs(plan.plan_u).max() <= problem.limits.steering_rate  # kept all the same


def test_what_is_not_finite_fails_and_leaves_the_plan(tire, problem):
    tracker = Tracker(tire, problem)
    x0 = np.zeros(tracker.instance.state["x"].shape[1])
    before = solve(tracker, x0, 0.001, 20.0)
    kappa = np.full(problem.horizon, 0.001)
    kappa[3] = np.nan
    failed = solve(tracker, x0, kappa, 20.0)
    assert failed.status == Status.QP_FAILED
    np.testing.assert_array_equal(failed.plan_u, before.plan_u)
    assert solve(tracker, x0, 0.001, 20.0).status == Status.OK  # nothing of it stays


@pytest.mark.sweep("linear")
def test_float_finds_nearly_the_same(tire, problem):
    x0 = np.zeros(7 if tire.structure.lagged else 5)
    x0[:2] = 0.4, 0.05
    double, single = (
        iterated(Tracker(tire, problem, single=is_single), x0, 0.004, 20.0, most=8)
        for is_single in (False, True)
    )
    np.testing.assert_allclose(single.plan_u, double.plan_u, atol=0.02)
    assert not np.array_equal(single.plan_u, double.plan_u)
