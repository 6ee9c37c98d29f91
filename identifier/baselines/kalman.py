"""One extended Kalman filter for every unknown that makes axle forces: [v_y, r, α', θ].

ẋ = K F(θ, α', u) - [v_x r, 0] + w_x,   α̇' = v_x/σ (α(x, u, θ) - α'),   θ̇ = w_θ (random walk),
measured: x + noise. α' is there for a tire that lags; else F reads α itself.
The sampled map is the linearly implicit midpoint rule, which no stiff tire at low speed makes
unstable: z⁺ = z + T_s (I - T_s J/2)⁻¹ f, z = [x, α'], with f and J = ∂f/∂z at the mean of steering
and speed. Its Jacobian is taken by automatic differentiation; the covariance is updated in Joseph's
form. An innovation beyond `outlier` standard deviations moves θ no further than one at that
distance. x follows it all the way, unless slip lags: α' would remember it. Source: Simon, Optimal
State Estimation, 2006, sections 5.1 and 13.2.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import casadi as ca

from identifier.baselines.ports import (
    LAG_PORTS,
    OVER,
    lag_symbols,
    lagged_slip,
    motion_rate,
    sample_ports,
)
from identifier.setup import AXLE_FORCE, COVARIANCE, Port
from models.bicycle import BicycleParameters

CARRY = ("estimate", "P", "before", "running")
CONSTANTS = ("noise", "walk", "limit", "prior", "learning_speed")
PORTS = (
    AXLE_FORCE,
    Port("estimate", "m/s; rad/s; -", "v_y, r and the unknowns of the force"),
    Port("P", "of estimate", "covariance of estimate", rule=COVARIANCE),
    Port("before", "rad; rad; m/s", "delta_f, delta_r and v_x of the last sample"),
    Port("running", "-", "1 after a sample in motion"),
)
NOISE = ("v_y_noise", "r_noise", "v_y_disturbance", "r_disturbance", "outlier")


class FilteredTire(NamedTuple):
    """What makes the forces by θ: all functions of symbols.

    slip(bicycle parameters, prior, θ, v_x, x, u) -> α (2,) [rad].
    force(bicycle parameters, prior, θ, slip (2,), u) -> axle forces (2,) [N].
    lag(prior, θ) -> σ (2,) [m]; None: the force reads α, nothing lags.
    unknowns, prior : sizes of θ and of whatever else it reads.
    The output force is that of the θ carried into the sample, to which a model freezes.
    """

    slip: Callable[[BicycleParameters, Any, Any, Any, Any, Any], Any]
    force: Callable[[BicycleParameters, Any, Any, Any, Any], Any]
    lag: Callable[[Any, Any], Any] | None
    unknowns: int
    prior: int

    @property
    def carry(self) -> tuple[str, ...]:
        return CARRY if self.lag is None else (*CARRY, *LAG_PORTS)


def build_step(name: str, tire: FilteredTire) -> ca.Function:
    """Return the filter's step; all numbers stay inputs of it.

    Carried: estimate (n,) = [v_y, r, α' where it lags, θ], its covariance P, before (3,) = δ_f, δ_r
    and v_x of the last sample, running (1 after a sample in motion); for a tire that lags also the
    `LaggedSlip` of what is measured, which the output force reads as the frozen model does. Held:
    noise in the order of `NOISE` (standard deviations [m/s], [rad/s]; disturbances per root of time
    [m/s/√s], [rad/s/√s]), walk of θ [1/√s], limit of |θ|, learning_speed [m/s], prior: whatever
    the tire needs. Below that speed θ and its covariance are kept, and x and α' begin anew from
    the measurement.
    """
    s = sample_ports()
    lags = 0 if tire.lag is None else 2
    p, dt, n = s.parameters, s.sampling[0], 2 + lags + tire.unknowns
    estimate, P, before = ca.SX.sym("estimate", n), ca.SX.sym("P", n, n), ca.SX.sym("before", 3)
    running, noise = ca.SX.sym("running"), ca.SX.sym("noise", len(NOISE))
    walk, limit = ca.SX.sym("walk", tire.unknowns), ca.SX.sym("limit", tire.unknowns)
    known, learning_speed = ca.SX.sym("prior", tire.prior), ca.SX.sym("learning_speed")
    moved, theta = estimate[: 2 + lags], estimate[2 + lags :]
    x = estimate[:2]
    learning = s.v_x >= learning_speed

    u_mean = (before[:2] + s.u) / 2
    v_mean = ca.fmax((before[2] + s.v_x) / 2, learning_speed)
    alpha = tire.slip(p, known, theta, v_mean, x, u_mean)
    slip = alpha if tire.lag is None else moved[2:]
    rate = motion_rate(p, v_mean, x, tire.force(p, known, theta, slip, u_mean))
    if tire.lag is not None:
        rate = ca.vertcat(rate, v_mean / tire.lag(known, theta) * (alpha - slip))
    ahead = ca.vertcat(midpoint(estimate, rate, dt), theta)
    F = ca.jacobian(ahead, estimate)
    Q = ca.diag(ca.vertcat(noise[2:4], ca.SX(lags, 1), walk) ** 2 * dt)
    R = ca.diag(noise[:2] ** 2)
    corrected, P_corrected = correct(ahead, F @ P @ F.T + Q, R, s.x, noise[4], follow=lags == 0)

    going = ca.logic_and(learning, running > 0.5)
    told_slip = alpha_now = tire.slip(p, known, theta, s.speed, s.x, s.u)
    afresh = ca.vertcat(s.x, alpha_now[:lags], theta)
    at_once = ca.jacobian(afresh, ca.vertcat(s.x, theta))  # a start is taken for a steady slide
    unsteady = ca.vertcat(
        ca.SX(2, 1), ca.repmat(noise[0] / s.speed, lags, 1), ca.SX(n - 2 - lags, 1)
    )
    P_afresh = at_once @ ca.diagcat(R, P[2 + lags :, 2 + lags :]) @ at_once.T
    P_afresh += ca.diag(unsteady**2)
    following = ca.if_else(going, corrected, afresh)
    theta_next = ca.fmin(ca.fmax(following[2 + lags :], -limit), limit)
    last = lag_symbols()
    lag_next: tuple[Any, ...] = ()
    if tire.lag is not None:
        told_slip = lagged_slip(last, alpha_now, s.speed * dt, tire.lag(known, theta))
        lag_next = (told_slip, alpha_now, ca.if_else(s.moving, 1, 0))
    axle_force = tire.force(p, known, theta, told_slip, s.u)
    return ca.Function(
        name,
        [
            *(estimate, P, before, running, *last[: len(lag_next)]),
            *(s.x, s.u, s.v_x),
            *(noise, walk, limit, known, learning_speed, s.vehicle, s.sampling),
        ],
        [
            ca.vertcat(following[: 2 + lags], theta_next),
            ca.densify(ca.if_else(going, P_corrected, P_afresh)),
            ca.vertcat(s.u, s.v_x),
            ca.if_else(learning, 1, 0),
            *lag_next,
            ca.if_else(s.moving, axle_force, 0),
        ],
        [*tire.carry, *OVER, *CONSTANTS, "vehicle", "sampling"],
        [*(f"{port}_next" for port in tire.carry), "axle_force"],
        {"cse": True},
    )


def midpoint(estimate: Any, rate: Any, dt: Any) -> Any:
    """Return what moves of an estimate a step later, by the linearly implicit midpoint rule.
    estimate : symbols; what moves comes first.   rate : of what moves (n,).
    dt : sampling interval [s].
    """
    n = rate.numel()
    implicit = ca.inv_minor(ca.SX.eye(n) - dt / 2 * ca.jacobian(rate, estimate)[:, :n])
    return estimate[:n] + dt * implicit @ rate


def correct(
    estimate: Any, P: Any, R: Any, x: Any, outlier: Any, *, follow: bool
) -> tuple[Any, Any]:
    """Return estimate and covariance after the measurement of the first two states.
    estimate : before, (n,).   P : its covariance (n, n).
    R : covariance of the measurement (2, 2).   x : the measurement (2,).
    follow : whether it counts for the first two all the same.
    """
    S = P[:2, :2] + R
    gain = P[:, :2] @ ca.inv_minor(S)
    innovation = x - estimate[:2]
    deviation = ca.sqrt(ca.vertcat(S[0, 0], S[1, 1]))
    trusted = ca.fmin(ca.fmax(innovation, -outlier * deviation), outlier * deviation)
    leading = innovation if follow else trusted
    move = ca.vertcat(gain[:2, :] @ leading, gain[2:, :] @ trusted)
    keep = ca.SX.eye(estimate.numel())
    keep[:, :2] -= gain
    after = keep @ P @ keep.T + gain @ R @ gain.T  # Joseph
    return estimate + move, (after + after.T) / 2


class _Corrected(NamedTuple):
    """What a measurement makes of an estimate.
    move : of the estimate (n,).   P : covariance after (n, n).   keep : I - K H (n, n).
    pull : Hᵀ S⁻¹ times the innovation (n,).
    """

    move: Any
    P: Any
    keep: Any
    pull: Any


def corrected(P: Any, H: Any, R: Any, innovation: Any, outlier: Any) -> _Corrected:
    """Return what a measurement of two numbers makes of an estimate, in Joseph's form.
    P : covariance before (n, n).
    H : what the numbers are of the estimate (2, n); a row of zeros measures nothing.
    R : covariance of the numbers (2, 2).   innovation : (2,).
    """
    S = H @ P @ H.T + R
    S_inverse = ca.inv_minor(S)
    most = outlier * ca.sqrt(ca.diag(S))
    trusted = ca.fmin(ca.fmax(innovation, -most), most)
    K = P @ H.T @ S_inverse
    keep = ca.SX.eye(P.size1()) - K @ H
    after = keep @ P @ keep.T + K @ R @ K.T
    return _Corrected(K @ trusted, (after + after.T) / 2, keep, H.T @ S_inverse @ trusted)
