"""Steering without a plan: optimal feedback to the path, by speed, of the car that its file states.

x = [e_y, e_ψ, v_y, r, δ] off the steady turn of the path: deviation [m], heading [rad], lateral
velocity [m/s], yaw rate [rad/s], angle of the wheels [rad].   u: steering that is given [rad].
The linear bicycle with the vehicle's own cornering stiffness, so that nothing that was learnt, and
may be what the solver failed at, reaches it. The delay is a lag of its length.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from codegen.arrays import Array
from models.vehicle import Vehicle
from mpc.problem import size_of

_N_STATES = 5  # e_y, e_psi, v_y, r and the angle of the wheels
_STEERING = 0.2  # rad that cost as much as `e_y`, where the car hardly moves
_DIGITS = 9  # of what is exported: other digits depend on the machine
_DOUBLINGS = 40  # at most; ten are usual
_ENOUGH = 1e-13  # change of the cost, in parts

N_GAINS = _N_STATES + 2  # of x, and what the steady turn asks for
SPEEDS = np.round(np.geomspace(2.0, 100.0, 8), 3)  # m/s of a full-size car; between them by line
N_SPEEDS = SPEEDS.size


class _FallBack(NamedTuple):
    """Rows by speed [m/s] (k,): gains of x, then steering [rad m] and v_y [m²/s] a curvature.

    Read only: every tracker of the same car and times has the same.
    """

    speeds: Array
    gains: Array


@lru_cache(maxsize=32)
def fall_back(
    vehicle: Vehicle, *, period: float, delay: float, e_y: float, acceleration: float
) -> _FallBack:
    """Return the table that the tracker steers by where it has no plan.

    Minimizes Σ (e_y/`e_y`)² + (a/`acceleration`)² + (u/0.2 rad)², where a [m/s²] is the lateral
    acceleration of the steady turn that u steers: at speed, steering is worth less of it.
    period : between two steps [s].   delay : from a measurement until its command acts [s].
    e_y : deviation [m] that is worth as much as `acceleration`.   acceleration : lateral [m/s²].
    """
    rows, speeds = [], SPEEDS * size_of(vehicle) ** 0.5
    for v_x in speeds:
        A, B = motion(vehicle, float(v_x), delay + 0.5 * period)
        A_d, B_d = _sampled(A, B, period)
        turn, drift = steady_turn(vehicle, float(v_x))
        # Near the critical speed of an oversteering car a turn needs no steering at all.
        per_steering = v_x**2 / max(abs(turn), 0.2 * vehicle.wheelbase)
        Q = np.diag([1.0 / e_y**2, 0.0, 0.0, 0.0, 0.0])
        R = np.array([[1.0 / _STEERING**2 + (per_steering / acceleration) ** 2]])
        rows.append([*feedback(A_d, B_d, Q, R).ravel(), turn, drift])
    table = _FallBack(speeds, np.array([[float(f"{x:.{_DIGITS}g}") for x in row] for row in rows]))
    for numbers in table:
        numbers.flags.writeable = False
    return table


def motion(vehicle: Vehicle, v_x: float, lag: float) -> tuple[Array, Array]:
    """Return A (5, 5) and B (5, 1) of ẋ = A x + B u at a speed.
    v_x : longitudinal speed [m/s].   lag : of the wheels behind what is given [s].
    """
    m, I_z, l_f, l_r, C_f, C_r = vehicle.bicycle
    moment = C_f * l_f - C_r * l_r
    A = np.zeros((_N_STATES, _N_STATES))
    A[0, 1], A[0, 2], A[1, 3] = v_x, 1.0, 1.0
    A[2, 2:] = -(C_f + C_r) / (m * v_x), -moment / (m * v_x) - v_x, C_f / m
    A[3, 2:4] = -moment / (I_z * v_x), -(C_f * l_f**2 + C_r * l_r**2) / (I_z * v_x)
    A[3, 4], A[4, 4] = C_f * l_f / I_z, -1.0 / lag
    return A, np.array([[0.0], [0.0], [0.0], [0.0], [1.0 / lag]])


def steady_turn(vehicle: Vehicle, v_x: float) -> tuple[float, float]:
    """Return δ [rad m] and v_y [m²/s] of a steady turn, each a curvature.
    v_x : longitudinal speed [m/s].
    """
    m, _, l_f, l_r, C_f, C_r = vehicle.bicycle
    length = l_f + l_r
    slip_f, slip_r = (m * v_x**2 * a / (length * C) for a, C in ((l_r, C_f), (l_f, C_r)))
    return length + slip_f - slip_r, v_x * (l_r - slip_r)


def feedback(A: Array, B: Array, Q: Array, R: Array) -> Array:
    """Return K (1, n) of u = -K x that minimizes Σ x'Q x + u'R u, x⁺ = A x + B u.

    By structure-preserving doubling (Chu, Fan, Lin and Wang 2004), which converges quadratically
    and also for cars of which SciPy's Schur form is too ill-conditioned to be ordered.
    A : (n, n).   B : (n, m).   Q : (n, n), symmetric, not negative.
    R : (m, m), symmetric, positive.
    """
    P = _riccati(A, B @ _solved(R, B.T), Q)
    return _solved(R + B.T @ P @ B, B.T @ P @ A)


def _solved(M: Array, right: Array) -> Array:
    return np.asarray(np.linalg.solve(M, right), dtype=np.float64)


def _riccati(A: Array, G: Array, Q: Array) -> Array:
    """Return P of the cost behind 1, 2, 4, … samples, until it stays; G = B R⁻¹ B'."""
    P, eye = Q, np.eye(len(A))
    for _ in range(_DOUBLINGS):
        W = _solved(eye + G @ P, np.hstack([A, G]))
        A_1, G_1 = W[:, : len(A)], W[:, len(A) :]
        step = A.T @ P @ A_1
        A, G, P = A @ A_1, G + A @ G_1 @ A.T, P + 0.5 * (step + step.T)
        if np.abs(step).max() <= _ENOUGH * np.abs(P).max():
            break
    return P


def _sampled(A: Array, B: Array, period: float) -> tuple[Array, Array]:
    from scipy.linalg import expm  # takes longer to import than the rest of the tracker

    n, m = B.shape
    M = expm(period * np.vstack([np.hstack([A, B]), np.zeros((m, n + m))]))
    return M[:n, :n], M[:n, n:]
