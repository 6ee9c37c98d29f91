"""The tracker's problem solved to convergence by IPOPT: slow, and right.

Multiple shooting with the exact cost and `build_rk4`; soft limits by slack variables. Beside it the
tracker's own solver on a state of the prediction, once and iterated.
"""

import time
from functools import cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from codegen.arrays import Array
from mpc.prediction import build_rk4, motion, stage_ports, state_size
from mpc.problem import N_ERRORS, Problem, tracking_errors
from mpc.realtime import Command, Status, Tracker
from mpc.tires.tire import Car, PredictionTire, TireStructure, valid_slip

STAYS = 1e-9  # change of the steering rate [rad/s] below which a plan has converged
N_SOFT = 3  # e_y, slip in front, slip at the rear


class NotConvergedError(RuntimeError):
    """IPOPT did not find a solution; the message holds what it said."""


class Solution(NamedTuple):
    """x (N + 1, n_x), u (N,) [rad/s], the cost with that of the soft limits, and iterations."""

    x: Array
    u: Array
    cost: float
    iterations: int


@cache
def build_errors(structure: TireStructure) -> ca.Function:
    """Return what costs and what is bounded, of x, kappa, v_x, car, w: y (7,) and slip (2,)
    [rad].
    """
    p = stage_ports(structure)
    at = motion(structure, p)
    y = tracking_errors(p.x, p.kappa, p.v_x, at.s_dot)
    ports = [p.x, p.kappa, p.v_x, p.car, p.w]
    names = ["x", "kappa", "v_x", "car", "w"]
    return ca.Function("errors", ports, [y, at.slip], names, ["y", "slip"])


@cache
def build_nlp(structure: TireStructure, horizon: int) -> dict[str, Any]:
    """Return the nonlinear program with variables [X, U, S] by columns; every number is in `p`.

    Parameters
    ----------
    horizon : number of stages N.
    """
    n_x, N = state_size(structure), horizon
    X, U, S = ca.MX.sym("X", n_x, N + 1), ca.MX.sym("U", 1, N), ca.MX.sym("S", N_SOFT, N)
    road = ca.MX.sym("road", 2, N)  # kappa, v_x
    dt, R = ca.MX.sym("dt"), ca.MX.sym("R")
    car, w = ca.MX.sym("car", len(Car._fields)), ca.MX.sym("w", structure.n_weights)
    q, q_end = ca.MX.sym("q", N_ERRORS), ca.MX.sym("q_end", N_ERRORS)
    bounds, Z = ca.MX.sym("bounds", N_SOFT), ca.MX.sym("Z", N_SOFT)
    beyond = bounds[1:], ca.MX.sym("rise", 2), ca.MX(1.0)

    x_next = build_rk4(structure).map(N)(X[:, :-1], U, road[0, :], road[1, :], dt, car, w, *beyond)
    errors = build_errors(structure).map(N)
    y, _ = errors(X[:, :-1], road[0, :], road[1, :], car, w)
    ahead = ca.horzcat(road[:, 1:], road[:, -1])  # of x_1 … x_N; the end has the last stage's road
    y_ahead, slip = errors(X[:, 1:], ahead[0, :], ahead[1, :], car, w)
    soft = ca.vertcat(X[0, 1:], slip)
    most = ca.repmat(bounds, 1, N) + S
    cost = (
        0.5 * ca.sum1(q * ca.sum2(y**2))
        + 0.5 * ca.sum1(q_end * y_ahead[:, -1] ** 2)
        + 0.5 * R * ca.sumsqr(U)
        + 0.5 * ca.sum1(Z * ca.sum2(S**2))
    )
    gaps = X[:, 1:] - x_next
    return {
        "x": ca.vertcat(ca.vec(X), ca.vec(U), ca.vec(S)),
        "p": ca.vertcat(ca.vec(road), dt, R, car, w, q, q_end, bounds, beyond[1], Z),
        "f": cost,
        "g": ca.vertcat(ca.vec(gaps), ca.vec(soft - most), ca.vec(-soft - most)),
    }


def numbers(problem: Problem, tire: PredictionTire, kappa: ArrayLike, v_x: ArrayLike) -> Array:
    """Return `p` of `build_nlp`.

    Parameters
    ----------
    kappa : curvature of each stage [1/m], (N,).
    v_x : speed of each stage [m/s], (N,).
    """
    cost, limits, N = problem.cost, problem.limits, problem.horizon
    valid = valid_slip(tire, limits.slip)
    road = np.column_stack([np.broadcast_to(kappa, N), np.broadcast_to(v_x, N)]).ravel()
    bounds = [limits.e_y, *valid.slip]
    Z = [limits.soft_e_y, limits.soft_slip, limits.soft_slip]
    parts = [road, [problem.dt, cost.R], tire.car, tire.weights]
    return np.concatenate([*parts, cost.numbers(), cost.terminal_numbers(), bounds, valid.rise, Z])


def bounds(problem: Problem, x0: ArrayLike) -> dict[str, Array]:
    """Return `lbx`, `ubx`, `lbg`, `ubg` of `build_nlp`.

    Parameters
    ----------
    x0 : state at the beginning (n_x,).
    """
    N, limits = problem.horizon, problem.limits
    start = np.asarray(x0, dtype=np.float64)
    X = np.full((N + 1, start.size), np.inf)
    X[:, 4] = limits.steering
    high = [X.ravel(), np.full(N, limits.steering_rate), np.full(N_SOFT * N, np.inf)]
    low = [-high[0], -high[1], np.zeros(N_SOFT * N)]
    low[0][: start.size] = high[0][: start.size] = start
    gaps, soft = np.zeros(start.size * N), np.zeros(2 * N_SOFT * N)
    return {
        "lbx": np.concatenate(low),
        "ubx": np.concatenate(high),
        "lbg": np.concatenate([gaps, np.full_like(soft, -np.inf)]),
        "ubg": np.concatenate([gaps, soft]),
    }


@cache
def _solver(structure: TireStructure, horizon: int) -> ca.Function:
    quiet: dict[str, Any] = {"print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 500}
    options: dict[str, Any] = {"print_time": False, "error_on_fail": False, "ipopt": quiet}
    return ca.nlpsol("converged", "ipopt", build_nlp(structure, horizon), options)


def solve_converged(
    tire: PredictionTire,
    problem: Problem,
    x0: ArrayLike,
    kappa: ArrayLike,
    v_x: ArrayLike,
) -> Solution:
    """Solve the problem from a state, beginning at x0 held.

    Parameters
    ----------
    x0 : state at the beginning (n_x,).
    kappa : curvature of each stage [1/m], (N,) or a number.
    v_x : speed of each stage [m/s], (N,) or a number.

    Raises
    ------
    NotConvergedError
        Where IPOPT gives up.
    """
    N, n_x = problem.horizon, state_size(tire.structure)
    solver = _solver(tire.structure, N)
    start = np.concatenate([np.tile(np.asarray(x0), N + 1), np.zeros((1 + N_SOFT) * N)])
    answer = solver(x0=start, p=numbers(problem, tire, kappa, v_x), **bounds(problem, x0))
    said = solver.stats()
    if not said["success"]:
        raise NotConvergedError(f"IPOPT ended with {said['return_status']}")
    found = np.asarray(answer["x"]).ravel()
    end = n_x * (N + 1)
    return Solution(
        found[:end].reshape(N + 1, n_x),
        found[end : end + N],
        float(answer["f"]),
        int(said["iter_count"]),
    )


# The tracker's solver, from a state: x0 (n_x,), curvature [1/m] and speed [m/s] of the stages (N,).


def _on_road(tracker: Tracker, kappa: ArrayLike, v_x: ArrayLike) -> Any:
    """Return its instance, told the road."""
    instance = tracker.instance
    instance.input["kappa"][1:], instance.input["v_x"][1:] = kappa, v_x
    return instance


def solve(tracker: Tracker, x0: ArrayLike, kappa: ArrayLike, v_x: ArrayLike) -> Command:
    """Take one iteration from the plan as it is; the steering is that behind the first stage."""
    instance = _on_road(tracker, kappa, v_x)
    instance.start[:] = x0
    start = time.perf_counter()
    status = instance.solve()
    return instance.command(float(instance.state["x"][1, 4]), status, time.perf_counter() - start)


def prepare_solution(tracker: Tracker, kappa: ArrayLike, v_x: ArrayLike) -> None:
    """Do ahead of `solve` what does not ask for its state, along the plan as it is."""
    instance = _on_road(tracker, kappa, v_x)
    instance.start[:] = instance.state["x"][0]
    instance._library.mpc_prepare_from(*instance.solve_arguments)


def iterated(
    tracker: Tracker, x0: ArrayLike, kappa: ArrayLike, v_x: ArrayLike, *, most: int = 100
) -> Command:
    """Iterate from a guess until the plan stays; its status is that of the last iteration."""
    instance = _on_road(tracker, kappa, v_x)
    instance.start[:] = x0
    instance._library.mpc_guess(*instance._step[:2], *instance.solve_arguments[3:])
    for _ in range(most):
        before = instance.state["u"].copy()
        command = solve(tracker, x0, kappa, v_x)
        if np.abs(instance.state["u"] - before).max() <= STAYS:
            return command
    return command._replace(status=int(Status.ITERATION_LIMIT))
