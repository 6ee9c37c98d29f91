"""The named problem that real-time solvers are compared on: a double lane change at 20 m/s.

x = [e_y, e_psi, v_y, r, δ], input steering rate; axle force = linear + 10 tanh of 6 signals, whose
82 weights are run-time parameters; N = 40 stages of 50 ms, one RK4 step each; |δ| and |δ rate|
hard, |e_y| soft. 300 closed-loop steps of 50 ms. The plant is the prediction with 8 % less
stiffness and force, in ten substeps, so that solvers have errors to correct. The reference is a
straight road whose center line is the lane change: curvature over time, in both lanes.
"""

from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from models.vehicle import sedan
from mpc.prediction import build_rk4
from mpc.problem import Cost, Limits, Problem
from mpc.tires.network import NetworkAxles
from mpc.tires.tire import ALL, PredictionTire

SPEED = 20.0  # m/s
STEPS, SUBSTEPS = 300, 10  # of the loop; of the plant in each
HIDDEN = 10
INPUTS = ("v_y", "r", "delta_f", "v_x", "alpha_f", "alpha_r")
GRIP = 0.9  # of the tire that the network was fitted to
WEAKER = 0.92  # stiffness and force of the plant against the prediction
LANE = 3.5  # m
PULSES = ((2.0, 1.0), (4.6, -1.0), (8.5, 1.0), (11.1, -1.0))  # beginning [s], direction
PULSE = 1.8  # duration of a lane change [s]


def network_fitted_to_curve() -> PredictionTire:
    """Return the linear tire of the sedan plus a network fitted to what a tanh curve has less."""
    car, rng = sedan(), np.random.default_rng(1)
    _, _, l_f, l_r, C_f, C_r = car.bicycle
    structure = NetworkAxles(hidden=HIDDEN, inputs=INPUTS)
    C, load = np.array([C_f, C_r]), np.array(car.axle_loads)
    n = 4000
    v_y, r, delta = rng.normal(size=(3, n)) * [[1.0], [0.4], [0.06]]
    v_x = np.full(n, SPEED)
    alpha = np.array([delta - (v_y + l_f * r) / v_x, -(v_y - l_r * r) / v_x])
    signals = dict(v_y=v_y, r=r, delta_f=delta, v_x=v_x, alpha_f=alpha[0], alpha_r=alpha[1])
    V = np.column_stack(
        [rng.normal(size=HIDDEN) * size for size in (0.2, 0.5, 2.0, 0.01, 12.0, 12.0)]
    )
    hidden = np.tanh(V @ np.array([signals[name] for name in INPUTS]))
    limit = GRIP * load[:, None]
    missing = limit * np.tanh(C[:, None] * alpha / limit) - C[:, None] * alpha
    W = np.linalg.solve(hidden @ hidden.T + 1e-3 * np.eye(HIDDEN), hidden @ missing.T).T
    weights = np.concatenate([C, W.ravel(order="F"), V.ravel(order="F")])
    return PredictionTire(structure, weights, car)


def weaker(tire: PredictionTire) -> PredictionTire:
    """Return the tire of the plant."""
    weights = tire.weights.copy()
    weights[: 2 + 2 * HIDDEN] *= WEAKER
    return tire._replace(weights=weights)


PROBLEM = Problem(
    horizon=40,
    dt=0.05,
    cost=Cost(e_y=1.0, course=0.1, steering_rate=0.05, terminal=5.0),
    limits=Limits(steering=0.35, steering_rate=0.4, e_y=0.3, slip=(10.0, 10.0)),
)


def curvature(t: Array) -> Array:
    """Return the curvature of the reference [1/m] at some times, a sine for each lane change."""
    kappa = np.zeros_like(t)
    size = 2.0 * np.pi * LANE / (PULSE * SPEED) ** 2
    for begin, direction in PULSES:
        share = (t - begin) / PULSE
        inside = (share >= 0.0) & (share < 1.0)
        kappa += direction * size * np.where(inside, np.sin(2.0 * np.pi * share), 0.0)
    return kappa


class Road(NamedTuple):
    """kappa [1/m] of the stages of every step (STEPS, N), and now (STEPS,)."""

    ahead: Array
    now: Array


def road() -> Road:
    """Return the curvature that each step is told."""
    t = np.arange(float(STEPS)) * PROBLEM.dt
    stages = (np.arange(float(PROBLEM.horizon)) + 0.5) * PROBLEM.dt
    return Road(curvature(t[:, None] + stages), curvature(t + 0.5 * PROBLEM.dt))


class Plant:
    """The car that is driven: x (5,) over a step with the steering rate u."""

    def __init__(self, tire: PredictionTire) -> None:
        self.rk4 = build_rk4(tire.structure)
        self.weights, self.car = weaker(tire).weights, tire.car

    def step(self, x: Array, u: float, kappa: float) -> Array:
        """Return the state a step later."""
        dt = PROBLEM.dt / SUBSTEPS
        for _ in range(SUBSTEPS):
            x = np.asarray(self.rk4(x, u, kappa, SPEED, dt, self.car, self.weights, *ALL)).ravel()
        return x
