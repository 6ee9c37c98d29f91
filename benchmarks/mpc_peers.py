"""Other ways to solve the problem of `mpc_double_lane_change`, each as well kept as we know.

HPIPM: CasADi's sqpmethod with one iteration, Gauss-Newton, stage by stage, jit -O3. IPOPT: to
convergence, warm started, jit -O3.
"""

import time
from typing import Any, NamedTuple, Protocol

import casadi as ca
import numpy as np

from benchmarks.converged import build_errors, prepare_solution, solve
from benchmarks.mpc_double_lane_change import PROBLEM, SPEED
from codegen.arrays import Array
from mpc.prediction import build_rk4
from mpc.realtime import Status, Tracker
from mpc.tires.tire import ALL, PredictionTire

N, N_X, WIDTH = PROBLEM.horizon, 5, 7  # a stage: x, u and the slack of the deviation behind it
JIT = {"jit": True, "compiler": "shell", "jit_options": {"flags": ["-O3"], "verbose": False}}
QUIET = {"print_time": False, "error_on_fail": False}


class Answer(NamedTuple):
    """Plan u (N,), thread time of the solver [s], and whether it failed."""

    u: Array
    time: float
    failed: bool


class Peer(Protocol):
    """Solves one step after the other, each from the answer before, moved ahead by a stage."""

    def step(self, x0: Array, kappa: Array) -> Answer:
        """Return the plan from a state, on the curvature of the stages."""


class Stagewise(NamedTuple):
    """The nonlinear program stage by stage, residuals r of its cost ½ r'r, and bounds."""

    nlp: dict[str, Any]
    r: Any
    bounds: dict[str, Array]


def stagewise(tire: PredictionTire) -> Stagewise:
    """Return the problem in the order that structure-aware solvers read; p = x0, kappa, car, w."""
    limits, cost, k_last = PROBLEM.limits, PROBLEM.cost, N - 1
    rk4, errors = build_rk4(tire.structure), build_errors(tire.structure)
    x0, road = ca.MX.sym("x0", N_X), ca.MX.sym("road", N)
    car, w = ca.MX.sym("car", 4), ca.MX.sym("w", tire.weights.size)
    X = [ca.MX.sym(f"x{k}", N_X) for k in range(N + 1)]
    U = [ca.MX.sym(f"u{k}", 2) for k in range(N)]
    q, q_end = np.sqrt(cost.numbers()), np.sqrt(cost.terminal_numbers())
    r, g, low, high = [], [], [], []
    for k in range(N):
        x_next = rk4(X[k], U[k][0], road[k], SPEED, PROBLEM.dt, car, w, *ALL)
        g += [X[k + 1] - x_next, *([X[0] - x0] if k == 0 else [])]
        g += [x_next[0] - U[k][1], -x_next[0] - U[k][1]]  # |e_y| <= limit + slack
        zeros = [0.0] * (N_X if k else 2 * N_X)
        low += [*zeros, -np.inf, -np.inf]
        high += [*zeros, limits.e_y, limits.e_y]
        r += [q * errors(X[k], road[k], SPEED, car, w)[0]]
        r += [np.sqrt(cost.R) * U[k][0], np.sqrt(limits.soft_e_y) * U[k][1]]
    r.append(q_end * errors(X[N], road[k_last], SPEED, car, w)[0])
    v = ca.vertcat(*(ca.vertcat(*pair) for pair in zip(X[:-1], U, strict=True)), X[N])
    most = np.tile([np.inf] * 4 + [limits.steering, limits.steering_rate, np.inf], N + 1)
    least = -most
    least[N_X + 1 :: WIDTH] = 0.0
    most[:N_X], least[:N_X] = np.inf, -np.inf
    size = WIDTH * N + N_X
    residual = ca.vertcat(*r)
    p = ca.vertcat(x0, road, car, w)
    return Stagewise(
        {"x": v, "p": p, "f": 0.5 * ca.sumsqr(residual), "g": ca.vertcat(*g)},
        residual,
        {"lbx": least[:size], "ubx": most[:size], "lbg": np.array(low), "ubg": np.array(high)},
    )


class Nlp:
    """A solver of CasADi, called without copies."""

    def __init__(
        self, tire: PredictionTire, problem: Stagewise, solver: Any, *, warm: bool
    ) -> None:
        self.numbers = np.concatenate([tire.car, tire.weights])
        self.solver, self.warm = solver, warm
        self.values: dict[str, Array] = {
            name: np.zeros(solver.numel_in(name)) for name in solver.name_in()
        }
        self.results: dict[str, Array] = {
            name: np.zeros(solver.numel_out(name)) for name in solver.name_out()
        }
        for name, value in problem.bounds.items():
            self.values[name][:] = value
        self.buffer, self.call = solver.buffer()
        for i, name in enumerate(solver.name_in()):
            self.buffer.set_arg(i, self.values[name].data)
        for i, name in enumerate(solver.name_out()):
            self.buffer.set_res(i, self.results[name].data)

    def step(self, x0: Array, kappa: Array) -> Answer:
        """Return the plan from a state, on the curvature of the stages."""
        guess, values = self.values["x0"], self.values
        guess[: WIDTH * (N - 1)] = self.results["x"][WIDTH : WIDTH * N]
        guess[WIDTH * (N - 1) :] = self.results["x"][WIDTH * (N - 1) :]
        guess[WIDTH * (N - 1) : WIDTH * (N - 1) + N_X] = self.results["x"][WIDTH * N :]
        guess[:N_X] = x0
        values["p"][:] = np.concatenate([x0, kappa, self.numbers])
        if self.warm:
            values["lam_x0"][:], values["lam_g0"][:] = self.results["lam_x"], self.results["lam_g"]
        start = time.thread_time()
        self.call()
        elapsed = time.thread_time() - start
        stages = self.results["x"][: WIDTH * N].reshape(N, WIDTH)
        failed = not np.isfinite(self.results["x"]).all()
        return Answer(stages[:, N_X].copy(), elapsed, failed)


def hpipm(tire: PredictionTire) -> Nlp:
    """Return CasADi's real-time iteration with HPIPM."""
    problem = stagewise(tire)
    nlp = problem.nlp
    J = ca.jacobian(problem.r, nlp["x"])
    scale, multipliers = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", nlp["g"].numel())
    ports = [nlp["x"], nlp["p"], scale, multipliers]
    names = ["x", "p", "lam_f", "lam_g"]
    gauss_newton = ca.Function("nlp_hess_l", ports, [scale * (J.T @ J)], names, ["hess_gamma_x_x"])
    silent = {f"print_{what}": False for what in ("header", "iteration", "status", "time")}
    once = {"max_iter": 1, "max_iter_ls": 0, "hess_lag": gauss_newton, "error_on_fail": False}
    options: dict[str, Any] = {"qpsol": "hpipm", "qpsol_options": QUIET, **once, **silent, **JIT}
    return Nlp(tire, problem, ca.nlpsol("rti", "sqpmethod", nlp, options), warm=False)


def ipopt(tire: PredictionTire) -> Nlp:
    """Return IPOPT, to convergence."""
    problem = stagewise(tire)
    warm = {"warm_start_init_point": "yes", "mu_init": 1e-3, "tol": 1e-6}
    options: dict[str, Any] = {"ipopt": {"print_level": 0, "sb": "yes", **warm}, **QUIET, **JIT}
    return Nlp(tire, problem, ca.nlpsol("ipopt", "ipopt", problem.nlp, options), warm=True)


class Ours:
    """The tracker, one iteration a step."""

    def __init__(
        self, tire: PredictionTire, *, prepared: bool = False, max_active_sets: int = 16
    ) -> None:
        self.tracker = Tracker(
            tire,
            PROBLEM,
            period=PROBLEM.dt,
            max_active_sets=max_active_sets,
            clock=time.thread_time,
        )
        self.prepared = prepared

    def step(self, x0: Array, kappa: Array) -> Answer:
        """Return the plan from a state, on the curvature of the stages."""
        instance = self.tracker.instance
        instance._library.mpc_shift(*instance._step[:2])
        if self.prepared:
            prepare_solution(self.tracker, kappa, SPEED)
        told = solve(self.tracker, x0, kappa, SPEED)
        return Answer(told.plan_u, told.solve_time_s, told.status != Status.OK)
