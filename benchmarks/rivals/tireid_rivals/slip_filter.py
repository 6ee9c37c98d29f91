"""Kalman filters of v_y and yaw rate that read r and a_y: on known linear tires, and learning.

State [v_y, r, θ] [m/s, rad/s, -].   u = [δ_f, δ_r] [rad].   F: axle forces [N], frame of the body.
ẋ = K F - [v_x r, 0];   measured are r and, at the center of gravity, a_y = (F_f + F_r)/m.
A steady turn needs F_r = l_f m v_x r/L, so that on a linear tire its v_y is
l_r r + v_x (δ_r - F_r/C_r): what both begin with.
The linear filter has no θ: the tires are those of the vehicle file. The joint one learns a tire of
Dugoff for each axle alongside, θ = [ln C/C_0 front and rear, ln μ/μ_0 front and rear], as random
walks, and knows nothing of bank, bias, roll, lag or offsets: the naive filter that a textbook
suggests (Simon, Optimal State Estimation, 2006, sections 5.1 and 13.2; states and parameters
together in section 13.4).
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

import casadi as ca
import numpy as np

from codegen import Scan
from identifier.baselines.curves import sample_ports, wheel_slip
from identifier.baselines.lagged_ekf import (
    CARRY,
    WITH_A_Y,
    axle_loads,
    corrected,
    midpoint,
    motion_rate,
)
from identifier.baselines.lagged_ekf import PORTS as CARRIED
from identifier.method import Method, require_fresh
from identifier.setup import AXLE_FORCE, Port, Setup
from identifier.tire_model import TireModel
from models.bicycle import BicycleParameters, linear_axle_force
from models.rules import require_positive
from models.vehicle import Vehicle

PORTS = (
    AXLE_FORCE,
    Port("v_y", "m/s", "lateral velocity at the center of gravity, positive to the left"),
    Port("v_y_sd", "m/s", "standard deviation of v_y"),
    *CARRIED[1:-1],
    Port("running", "-", "1 after a sample in motion that was understood"),
)
LIMITS = (2.0, 2.0, 1.5, 1.5)  # of |θ|: stiffness within a factor of 7.4, friction of 4.5
MOST_SLIDING = 0.7  # |v_y|/v_x beyond which an estimate is none
FLATTEST = 1e-9  # [rad] keeps Dugoff's λ finite at zero slip, where it does not matter
# What a filter is given, in the order of its constant.
NUMBERS = (
    *("r_noise", "a_y_noise", "v_y_disturbance", "r_disturbance", "walk", "start_slip", "outlier"),
    *("friction", "learning_speed"),
)


def dugoff(C: Any, mu: Any, loads: Any, alpha: Any) -> Any:
    """Return Dugoff's force without longitudinal slip, (2,) [N].

    F = C tan α f(λ), λ = μ F_z/(2 C |tan α|), f = λ (2 - λ) for λ < 1, else 1.
    Source: Dugoff, Fancher and Segel, SAE 700377 (1970).
    C : stiffness (2,) [N/rad].   mu : friction (2,).   loads : F_z (2,) [N].   alpha : (2,) [rad].
    """
    slope = ca.tan(ca.fmin(ca.fmax(alpha, -1.5), 1.5))  # short of a right angle
    lam = ca.fmin(mu * loads / (2 * C * ca.fmax(ca.fabs(slope), FLATTEST)), 1)
    return C * slope * lam * (2 - lam)


def axle_force(p: BicycleParameters, friction: Any, estimate: Any, v_x: Any, u: Any) -> Any:
    """Return the axle forces of an estimate, (2,) [N].
    friction : μ_0.   estimate : [v_y, r], and θ of Dugoff's tires where they are learnt.
    v_x : longitudinal speed [m/s], not zero.   u : [δ_f, δ_r] (2,).
    """
    x, theta = estimate[:2], estimate[2:]
    if theta.numel() == 0:
        return linear_axle_force(p, v_x, x, u)
    stiffness = ca.vertcat(p.C_f, p.C_r) * ca.exp(theta[:2])
    alpha = wheel_slip(p, v_x, x, u)
    return dugoff(stiffness, friction * ca.exp(theta[2:]), axle_loads(p), alpha) * ca.cos(u)


def steady_v_y(p: BicycleParameters, v_x: Any, r: Any, u: Any) -> Any:
    """Return v_y of a steady turn on the linear rear tire [m/s].
    v_x : longitudinal speed [m/s].   r : yaw rate [rad/s].   u : [δ_f, δ_r] (2,).
    """
    F_r = p.m * v_x * r / (p.l_f + p.l_r) * p.l_f
    return p.l_r * r + v_x * (u[1] - F_r / p.C_r)


def build_step(name: str, unknowns: int) -> ca.Function:
    """Return the filter's step; all numbers stay inputs of it.

    Carried: estimate (n,) = [v_y, r, θ], its covariance P, before (3,), running. Below the learning
    speed, and after an estimate that slides by more than `MOST_SLIDING`, x begins anew in a steady
    turn; θ and its covariance are kept.
    unknowns : size of θ.
    """
    s, n = sample_ports(), 2 + unknowns
    z, P = ca.SX.sym("estimate", n), ca.SX.sym("P", n, n)
    before, running = ca.SX.sym("before", 3), ca.SX.sym("running")
    numbers = ca.SX.sym("numbers", len(NUMBERS))
    r_noise, a_y_noise, v_y_disturbance, r_disturbance, *others = ca.vertsplit(numbers)
    walk, start_slip, outlier, friction, learning_speed = others
    p, dt, r, a_y = s.parameters, s.sampling[0], s.x[1], ca.if_else(s.has_a_y, s.a_y, 0)
    fast = s.v_x >= learning_speed
    going = ca.logic_and(fast, running > 0.5)

    v_mean = ca.fmax((before[2] + s.v_x) / 2, learning_speed)
    force = axle_force(p, friction, z, v_mean, (before[:2] + s.u) / 2)
    ahead = ca.vertcat(midpoint(z, motion_rate(p, v_mean, z[:2], force), dt), z[2:])
    F = ca.jacobian(ahead, z)
    walks = ca.repmat(walk, unknowns, 1)
    Q = ca.diag(ca.vertcat(v_y_disturbance, r_disturbance, walks) ** 2 * dt)
    at = ca.SX.sym("at", n)
    felt = axle_force(p, friction, at, s.speed, s.u)
    shows = ca.vertcat(at[1], (felt[0] + felt[1]) / p.m)
    shows, H = ca.substitute([shows, ca.jacobian(shows, at)], [at], [ahead])
    H[1, :] *= s.has_a_y
    innovation = ca.vertcat(r - shows[0], s.has_a_y * (a_y - shows[1]))
    R, P_ahead = ca.diag(ca.vertcat(r_noise, a_y_noise) ** 2), F @ P @ F.T + Q
    most = outlier * ca.sqrt(ca.diag(H @ P_ahead @ H.T + R))
    found = corrected(P_ahead, H, R, ca.fmin(ca.fmax(innovation, -most), most))

    limit = ca.DM(LIMITS[:unknowns])
    theta = ca.fmin(ca.fmax((ahead + found.move)[2:], -limit), limit)
    afresh = ca.vertcat(steady_v_y(p, s.speed, r, s.u), r, z[2:])
    first = ca.diag(ca.vertcat(start_slip * s.speed, r_noise) ** 2)
    following = ca.if_else(going, ca.vertcat((ahead + found.move)[:2], theta), afresh)
    P_next = ca.if_else(going, found.P, ca.diagcat(first, P[2:, 2:]))
    sane = ca.fabs(following[0]) < MOST_SLIDING * s.speed
    output = axle_force(p, friction, ca.vertcat(following[:2], z[2:]), s.speed, s.u)
    return ca.Function(
        name,
        [z, P, before, running, s.x, s.u, s.v_x, s.a_y, s.vehicle, s.sampling, numbers],
        [
            following,
            ca.densify(P_next),
            ca.vertcat(s.u, s.v_x),
            ca.logic_and(fast, sane),
            ca.if_else(s.moving, output, 0),
            ca.if_else(s.moving, following[0], 0),
            ca.sqrt(P_next[0, 0]),
        ],
        [*CARRY, *WITH_A_Y, "vehicle", "sampling", "numbers"],
        [*(f"{port}_next" for port in CARRY), "axle_force", "v_y", "v_y_sd"],
        {"cse": True},
    )


@cache
def _scan(learns: bool) -> Scan:
    name, unknowns = ("joint_ekf", len(LIMITS)) if learns else ("linear_kf", 0)
    return Scan(build_step(name, unknowns), carry=CARRY, over=WITH_A_Y)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipFilter(Method):
    """Lateral velocity by a Kalman filter of r and a_y; a recording's v_y is not read.
    learns : whether tires of Dugoff are identified, or the linear ones of the vehicle file hold.
    r_noise : standard deviation of the measured yaw rate [rad/s].
    a_y_noise : standard deviation of the measured a_y [m/s²].
    v_y_disturbance : what the tires miss, as random change of v_y [m/s/√s].
    r_disturbance : what the tires miss, as random change of the yaw rate [rad/s/√s].
    start_slip : standard deviation of the rear slip at a start [rad].
    walk : of every unknown of the tires [1/√s]; the linear tire has none.
    friction : what friction is held for at first [-]; as all that follow, not of the linear tire.
    stiffness_spread : standard deviation of the logarithm of stiffness at first [-].
    friction_spread : standard deviation of the logarithm of friction at first [-].
    dt : sampling interval [s].   learning_speed : below this speed [m/s] the filter rests.
    min_speed : below this speed [m/s] forces and v_y read zero.
    """

    ports = PORTS
    estimates = "lateral velocity"
    needs = ("a_y",)  # it estimates v_y

    learns: bool
    r_noise: float
    a_y_noise: float
    v_y_disturbance: float
    r_disturbance: float
    start_slip: float = 0.007
    walk: float = 0.01
    friction: float = 0.86
    stiffness_spread: float = 0.4
    friction_spread: float = 0.7
    outlier: float = 5.0
    dt: float = 0.01
    learning_speed: float = 3.0
    min_speed: float = 1.0

    def __post_init__(self) -> None:
        names = (*NUMBERS, "stiffness_spread", "friction_spread", "dt", "min_speed")
        require_positive(ValueError, **{name: getattr(self, name) for name in names})

    @classmethod
    def for_vehicle(cls, vehicle: Vehicle, *, learns: bool, dt: float = 0.01) -> Self:
        """Return the filter for a car; its numbers were chosen on 48 random drives of our plant.

        So that the joint filter errs least, and 95 % of its errors lie within two standard
        deviations there; the linear one has the same, and does not know that stiffnesses are wrong.
        dt : sampling interval [s].
        """
        time, speed = vehicle.froude_time, vehicle.froude_speed
        return cls(
            learns=learns,
            r_noise=0.0023 / time,
            a_y_noise=1.5,
            v_y_disturbance=0.09 * speed / math.sqrt(time),
            r_disturbance=0.26 / time**1.5,
            walk=0.002 / math.sqrt(time),
            dt=dt,
            learning_speed=0.6 * speed,
            min_speed=vehicle.lowest_speed,
        )

    @property
    def remark(self) -> str:
        """Say which tires it stands on."""
        on = "identified tires of Dugoff" if self.learns else "the vehicle's linear tires"
        return f"on {on}"

    def setup(self, vehicle: Vehicle, start: TireModel | None = None) -> Setup:
        """Return what a run needs; it begins afresh, with no stored model."""
        require_fresh(start)
        theta = np.zeros(len(LIMITS) if self.learns else 0)
        spread = np.repeat([self.stiffness_spread, self.friction_spread], 2)[: theta.size]
        return Setup(
            scan=_scan(self.learns),
            carry={
                "estimate": np.append(np.zeros(2), theta),
                "P": np.diag(np.append(np.zeros(2), spread) ** 2),
                "before": np.zeros(3),
                "running": np.zeros(1),
            },
            constants={
                "numbers": np.array([getattr(self, name) for name in NUMBERS]),
                "vehicle": np.array(vehicle.bicycle),
                "sampling": np.array([self.dt, self.min_speed]),
            },
        )
