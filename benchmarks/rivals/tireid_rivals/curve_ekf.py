"""B, C, D of a Magic Formula per axle by an extended Kalman filter; they freeze to that curve.

ẋ = K F(θ, α', u) - [v_x r, 0] + w_x,   α̇' = v_x/σ (α(x, u, θ) - α'),   θ̇ = w_θ (random walk),
measured: x + noise. The textbook's has neither α' nor offsets: F reads α itself. The Jacobian of
the sampled map, with steering and speed at their means, is taken by automatic differentiation. An
outlier leads x all the way, unless slip lags: α' would remember it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Self

import casadi as ca
import numpy as np

from codegen import Scan
from codegen.arrays import Array
from identifier.baselines.curves import (
    LAG_PORTS,
    OVER,
    CurveModel,
    LaggedSlip,
    lag_symbols,
    lagged_slip,
    magic_formula,
    measured_slip,
    sample_ports,
    unlagged,
    wheel_slip,
)
from identifier.baselines.lagged_ekf import (
    CARRY,
    PORTS,
    SHAPE,
    axle_loads,
    corrected,
    midpoint,
    motion_rate,
)
from identifier.method import Method
from identifier.setup import Port, Setup
from identifier.tire_model import TireModel
from models.bicycle import BicycleParameters
from models.rules import require_positive
from models.vehicle import Vehicle

# Numbers without limits for parameters that have some: what a filter may add noise to.
#
# θ = 0 is the prior: declared stiffness, usual friction and shape. Logarithms keep stiffness and
# friction positive; a logistic keeps the Magic Formula's shape C between 1 and 2, where the force
# has a peak and keeps its sign.

_LOGIT = math.log((SHAPE - 1.0) / (2.0 - SHAPE))
OF_CURVE = 6  # of the unknowns θ; then ln σ/σ₀ (2,), δ₀ and b over their spreads
# Standard deviations of θ at first: log stiffness, logit shape, log friction, in front and behind.
SPREAD = np.array([0.5, 0.5, 0.7, 0.7, 0.4, 0.4, 0.5, 0.5, 1.0, 1.0])
# Of |θ|: stiffness within a factor of 7.4, friction 4.5, a relaxation length 7.4; the last two are
# 0.01 rad, and for a sedan 0.2 m/s.
LIMIT = np.array([2.0, 2.0, 3.0, 3.0, 1.5, 1.5, 2.0, 2.0, 5.0, 8.0])
FRICTION = 0.9  # at first
STEERING_SPREAD = 0.002  # [rad] standard deviation of the zero of the front steering at first
OUTLIER = 5.0  # standard deviations


def _decoded(p: BicycleParameters, friction: Any, loads: Any, theta: Any) -> Any:
    """Return B, C, D (2, 3) of θ: log stiffness, logit shape, log friction; front and rear each."""
    slope = ca.vertcat(p.C_f, p.C_r) * ca.exp(theta[0:2])  # B C D, which data tell sooner than B
    C = 1 + 1 / (1 + ca.exp(-theta[2:4] - _LOGIT))
    D = friction * loads * ca.exp(theta[4:6])
    return ca.horzcat(slope / (C * D), C, D)


def _correct(
    estimate: Any, P: Any, R: Any, x: Any, outlier: Any, *, follow: bool
) -> tuple[Any, Any]:
    """Return estimate and covariance after the measurement of the first two states.

    An innovation beyond `outlier` standard deviations counts as one at that distance.
    estimate : before, (n,).   P : its covariance (n, n).
    R : covariance of the measurement (2, 2).   x : the measurement (2,).
    follow : whether it counts for the first two all the same.
    """
    H, innovation = ca.SX.eye(estimate.numel())[:2, :], x - estimate[:2]
    most = outlier * ca.sqrt(ca.diag(P[:2, :2] + R))
    trusted = corrected(P, H, R, ca.fmin(ca.fmax(innovation, -most), most))
    leading = corrected(P, H, R, innovation) if follow else trusted
    return estimate + ca.vertcat(leading.move[:2], trusted.move[2:]), trusted.P


_CONSTANTS = ("noise", "walk", "limit", "prior", "learning_speed")


def _build_step(textbook: bool) -> ca.Function:
    """Return the filter's step; all numbers stay inputs of it.

    Carried: estimate (n,) = [v_y, r, α' where slip lags, θ], its covariance P, before (3,) = δ_f,
    δ_r and v_x of the last sample, running (1 after a sample in motion); where slip lags also the
    `LaggedSlip` of what is measured, which the output force reads as the frozen model does: that of
    the θ carried into the sample. Constant: noise (standard deviations of v_y [m/s] and r [rad/s];
    disturbances [m/s/√s], [rad/s/√s]; outlier), walk of θ [1/√s], limit of |θ|, learning_speed
    [m/s], prior: friction [-], σ₀ [m], spreads of δ₀ [rad] and b [m/s]. Below that speed θ and its
    covariance are kept, and x and α' begin anew from the measurement.
    textbook : whether it is without lag and offsets; then θ is that of the curve alone.
    """
    s, lags = sample_ports(), 0 if textbook else 2
    unknowns = OF_CURVE if textbook else LIMIT.size
    p, dt, n = s.parameters, s.sampling[0], 2 + lags + unknowns
    estimate, P, before = ca.SX.sym("estimate", n), ca.SX.sym("P", n, n), ca.SX.sym("before", 3)
    running, noise = ca.SX.sym("running"), ca.SX.sym("noise", 5)
    walk, limit = ca.SX.sym("walk", unknowns), ca.SX.sym("limit", unknowns)
    known, learning_speed = ca.SX.sym("prior", 4), ca.SX.sym("learning_speed")
    moved, theta = estimate[: 2 + lags], estimate[2 + lags :]
    x, loads = estimate[:2], axle_loads(p)
    learning = s.v_x >= learning_speed

    def slip_of(v_x: Any, x: Any, u: Any) -> Any:
        if textbook:
            return wheel_slip(p, v_x, x, u)
        return measured_slip(p, known[2:4] * theta[OF_CURVE + 2 :], v_x, x, u)

    def force_of(slip: Any, u: Any) -> Any:
        return magic_formula(_decoded(p, known[0], loads, theta[:OF_CURVE]), slip, u)

    u_mean = (before[:2] + s.u) / 2
    v_mean = ca.fmax((before[2] + s.v_x) / 2, learning_speed)
    alpha = slip_of(v_mean, x, u_mean)
    slip = alpha if textbook else moved[2:]
    rate = motion_rate(p, v_mean, x, force_of(slip, u_mean))
    sigma: Any = None if textbook else known[1] * ca.exp(theta[OF_CURVE : OF_CURVE + 2])
    if not textbook:
        rate = ca.vertcat(rate, v_mean / sigma * (alpha - slip))
    ahead = ca.vertcat(midpoint(estimate, rate, dt), theta)
    F = ca.jacobian(ahead, estimate)
    Q = ca.diag(ca.vertcat(noise[2:4], ca.SX(lags, 1), walk) ** 2 * dt)
    R = ca.diag(noise[:2] ** 2)
    found, P_found = _correct(ahead, F @ P @ F.T + Q, R, s.x, noise[4], follow=textbook)

    going = ca.logic_and(learning, running > 0.5)
    lagged = alpha_now = slip_of(s.speed, s.x, s.u)
    afresh = ca.vertcat(s.x, alpha_now[:lags], theta)
    at_once = ca.jacobian(afresh, ca.vertcat(s.x, theta))  # a start is taken for a steady slide
    unsteady = ca.vertcat(ca.SX(2, 1), ca.repmat(noise[0] / s.speed, lags, 1), ca.SX(unknowns, 1))
    P_afresh = at_once @ ca.diagcat(R, P[2 + lags :, 2 + lags :]) @ at_once.T
    P_afresh += ca.diag(unsteady**2)
    following = ca.if_else(going, found, afresh)
    theta_next = ca.fmin(ca.fmax(following[2 + lags :], -limit), limit)
    last, carry = lag_symbols(), _carry(textbook)
    lag_next: tuple[Any, ...] = ()
    if not textbook:
        lagged = lagged_slip(last, alpha_now, s.speed * dt, sigma)
        lag_next = (lagged, alpha_now, ca.if_else(s.moving, 1, 0))
    return ca.Function(
        "magic_formula_ekf",
        [
            *(estimate, P, before, running, *last[: len(lag_next)]),
            *(s.x, s.u, s.v_x),
            *(noise, walk, limit, known, learning_speed, s.vehicle, s.sampling),
        ],
        [
            ca.vertcat(following[: 2 + lags], theta_next),
            ca.densify(ca.if_else(going, P_found, P_afresh)),
            ca.vertcat(s.u, s.v_x),
            ca.if_else(learning, 1, 0),
            *lag_next,
            ca.if_else(s.moving, force_of(lagged, s.u), 0),
        ],
        [*carry, *OVER, *_CONSTANTS, "vehicle", "sampling"],
        [*(f"{port}_next" for port in carry), "axle_force"],
        {"cse": True},
    )


def _carry(textbook: bool) -> tuple[str, ...]:
    return CARRY if textbook else (*CARRY, *LaggedSlip._fields)


@cache
def _scan(textbook: bool) -> Scan:
    return Scan(_build_step(textbook), carry=_carry(textbook), over=OVER)


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveEkf(Method):
    """Tire parameters that walk at random, slowly, in the coordinates of `_decoded`.

    With them the lag of the tire and the zeros of both sensors, which the default learns too. The
    size of the car sets its numbers: for a sedan noise of 0.02 m/s and 0.002 rad/s. Disturbances
    stand for what the curve misses, for a natural time at once: 8 % of g without lag and offsets,
    half of it with them. The parameters may walk by one percent in a second. Both were chosen on 32
    random cars of our plant, from a compact to 1:10.
    time : sqrt(L/g) of the car [s].   speed : sqrt(g L) [m/s].   wheelbase : L [m].
    textbook : without lag and offsets, as papers have this filter.
    dt : sampling interval [s].   min_speed : below this speed [m/s] forces read zero.
    """

    time: float
    speed: float
    wheelbase: float
    textbook: bool = False
    dt: float = 0.01
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        names = ("time", "speed", "wheelbase", "dt", "min_speed")
        require_positive(ValueError, **{name: getattr(self, name) for name in names})

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, dt: float = 0.01, textbook: bool = False) -> Self:
        return cls(
            time=vehicle.froude_time,
            speed=vehicle.froude_speed,
            wheelbase=vehicle.wheelbase,
            textbook=textbook,
            dt=dt,
            min_speed=vehicle.lowest_speed,
        )

    @property
    def prior(self) -> Array:
        """Friction [-], σ₀ of both axles [m], spreads of δ₀ [rad] and of b [m/s]."""
        return np.array([FRICTION, 0.4 * self.wheelbase, STEERING_SPREAD, 0.005 * self.speed])

    @property
    def ports(self) -> tuple[Port, ...]:
        """Outputs and state of its step, axle_force first."""
        return PORTS if self.textbook else (*PORTS, *LAG_PORTS)

    @property
    def remark(self) -> str:
        """Return whether it extends the textbook filter."""
        if self.textbook:
            return "the textbook's, without lag and offsets"
        return "lag of the tires and offsets of the sensors are identified, as by the default"

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs; it begins afresh, from the prior."""
        if start is not None:
            raise ValueError("this filter begins afresh: it goes on from no stored model")
        lags, unknowns = (0, OF_CURVE) if self.textbook else (2, LIMIT.size)
        missed, learning_speed = 1.0 if self.textbook else 0.5, 0.6 * self.speed
        v_y_noise, r_noise = 0.004 * self.speed, 0.001 / self.time
        v_y_disturbance = 0.08 * missed * self.speed / math.sqrt(self.time)
        r_disturbance = 0.12 * missed / self.time**1.5
        begun = [v_y_noise, r_noise, *[v_y_noise / learning_speed] * lags]
        return Setup(
            scan=_scan(self.textbook),
            carry={
                "estimate": np.zeros(2 + lags + unknowns),
                "P": np.diag([*begun, *SPREAD[:unknowns]]) ** 2,
                "before": np.zeros(3),
                "running": np.zeros(1),
                **({} if self.textbook else unlagged()),
            },
            constants={
                "noise": np.array([v_y_noise, r_noise, v_y_disturbance, r_disturbance, OUTLIER]),
                "walk": np.full(unknowns, 0.0075 / math.sqrt(self.time)),
                "limit": LIMIT[:unknowns],
                "prior": self.prior,
                "learning_speed": np.array(learning_speed),
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )

    def frozen(self, vehicle: Vehicle, state: Mapping[str, Array]) -> CurveModel:
        """Return the curve with the carried parameters, lag and offsets."""
        n = OF_CURVE if self.textbook else LIMIT.size
        theta, loads = state["estimate"].ravel()[-n:], ca.DM(vehicle.axle_loads)
        values = _decoded(vehicle.bicycle, FRICTION, loads, ca.DM(theta[:OF_CURVE]))
        curve = CurveModel(
            vehicle=vehicle, parameters=np.array(ca.DM(values)), min_speed=self.min_speed
        )
        if self.textbook:
            return curve
        length, *spreads = self.prior[1:]
        lag, offset = theta[OF_CURVE : OF_CURVE + 2], theta[OF_CURVE + 2 :]
        return replace(
            curve, relaxation_length=length * np.exp(lag), offset=offset * np.array(spreads)
        )
