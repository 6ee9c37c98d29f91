"""What a certificate must know besides the gains, and the worst loop that follows from it.

In functions:
gains : of (8) to (12).   direction : (2, 2) D [s], of `direction_matrix`.   m : mass [kg].
I_z : yaw inertia [kg m²].   l_f : center of gravity to front axle [m].
l_r : center of gravity to rear axle [m].   v_x : speed [m/s].   slip : largest slip angle [rad].
friction : μ [-].
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.driving import SPEED_SPREAD, YAW_OVERSHOOT, Driving
from identifier.paper.laws import DrivingError, Gains
from identifier.stability.loop import Loop, worst_gain
from identifier.stability.sampled_bound import (
    Disturbance,
    SampledBounds,
    by_leakage,
    error_gains,
    output_layer,
)
from models.bicycle import BicycleParameters, bicycle
from models.vehicle import GRAVITY, Vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class Operation:
    """Where and how the identifier runs: what the certificate must know besides the gains.
    n_h : hidden units.   dt : sampling interval T_s [s].
    bandwidth : highest frequency of steering that matters [Hz].
    needed_force : that the network should be able to hold against its leakage [U].
    x_bar_max : bound on |x_bar| [-], without what the error adds where the network reads x_hat.
    input_feedback : (2, 2) J_f K [1/s] where the network reads x_hat; None where it reads x.
    V_start : largest |V_hat| to begin with (Frobenius) [-].
    W_large : where the margins do not hold up to the proven |W_hat|, they are judged up to this one
        (Frobenius) [U]; the V layer's share of the loop gain grows with it.
    input_per_error : what an error adds to |x_bar| where the network reads x_hat [1/(U s)].
    """

    n_h: int
    dt: float
    bandwidth: float
    disturbance: Disturbance
    needed_force: float
    x_bar_max: float
    input_feedback: Array | None
    V_start: float = 0.0
    W_large: float = math.inf
    input_per_error: float = 0.0

    def resolves(self, A_d: Array) -> bool:
        """Whether the step keeps the error dynamics stable.   A_d : (2, 2) error dynamics [1/s]."""
        return bool(np.abs(1.0 + self.dt * np.linalg.eigvals(A_d)).max() < 1.0)


class Proven(NamedTuple):
    """What is proven of a design; None and inf where nothing is.
    leakage : bounds that the leakage gives.   V : bound on |V_hat| [-].
    leakage_step : largest share of W that one sample leaks, ρ_W dt |ξ̃|; an estimate where no bound
        is proven.   leakage_step_V : that of V.
    """

    leakage: SampledBounds | None = None
    V: float = math.inf
    leakage_step: float = 0.0
    leakage_step_V: float = 0.0

    @property
    def W(self) -> float:
        """Bound on |W_hat| [U]."""
        return math.inf if self.leakage is None else self.leakage.W


def proven_bounds(
    gains: Gains, law: DrivingError, operation: Operation, direction: Array
) -> Proven:
    """Return all bounds that are proven, for the start of `sampled_bound.py`."""
    A_d, dt, n_h, acting = gains.matrix, operation.dt, operation.n_h, operation.disturbance
    if not operation.resolves(A_d):
        return Proven()
    error = error_gains(A_d, dt)
    learning = output_layer(gains, law, direction, n_h=n_h, dt=dt)
    leakage = by_leakage(error, learning, A_d, acting, n_h)
    if leakage is None:  # |ξ̃| is estimated: leakage of small steps, in continuous time
        V = math.inf
        smooth = by_leakage(error, learning._replace(dt=0.0), A_d, acting, n_h)
        X = error.force * acting.residual if smooth is None else smooth.X
    else:
        X = leakage.X
        x_bar = operation.x_bar_max + operation.input_per_error * X
        drive = gains.eta_V * float(np.linalg.norm(direction, 2)) * leakage.W * x_bar
        kept = learning._replace(leakage=gains.rho_V, drive=drive).kept(X)
        idle = drive == 0.0 and gains.rho_V == 0.0
        V = operation.V_start if idle else max(operation.V_start, kept)
    return Proven(
        leakage=leakage,
        V=V,
        leakage_step=gains.rho_W * dt * X,
        leakage_step_V=gains.rho_V * dt * X,
    )


def worst_loop(
    gains: Gains, law: DrivingError, operation: Operation, direction: Array, W: float
) -> Loop:
    """Return the loop at the worst regressor, and |W_hat| up to W.

    Where W is infinite, the V layer cannot be counted and is left out.
    W : largest |W_hat| that is counted [U].
    """
    g = worst_gain(
        eta_W=gains.eta_W,
        eta_V=gains.eta_V if math.isfinite(W) else 0.0,
        n_h=operation.n_h,
        x_bar_max=operation.x_bar_max,
        W_max=W,
    )
    return Loop(
        A_d=gains.matrix,
        forgetting=gains.forgetting,
        law=law,
        G=g * np.eye(2),
        input_feedback=operation.input_feedback,
        direction=direction,
    )


# The loop that opens where the network reads the estimate x_hat instead of the measurement.
#
# With x_hat = x - K ξ̃, the network errs by J_f K ξ̃, J_f = ∂f/∂x, and the error dynamics become
# A_d + J_f K. For f = F(α) - C α and α = δ - (1/v_x) [1 l_f; 1 -l_r] x:
# J_f K = diag(C - F') N / v_x, N = [1 l_f; 1 -l_r] K, symmetric positive semidefinite but for the
# row scaling: even a perfect network needs a > λ_max(J_f K). Worst where the tire is saturated,
# F' = 0. (8)c prints x_hat; x is measured, so that reading x costs nothing and has no such limit.


def estimated_input_feedback(lost: BicycleParameters, v_x: float) -> Array:
    """J_f K = diag(C - F') N / v_x [1/s], (2, 2): what reading x_hat adds to A_d.
    lost : its stiffness is C - F' of front and rear axle [N/rad]; C itself at full saturation.
    """
    m, I_z, l_f, l_r, *stiffness = lost
    K = np.array([[1.0 / m, 1.0 / m], [l_f / I_z, -l_r / I_z]])  # (6) prints a transpose
    slip = np.array([[1.0, l_f], [1.0, -l_r]])
    return np.diag(stiffness) @ (slip @ K) / v_x


# From a car and how hard it is driven to what a certificate must know: signals and disturbances.
#
# At the speed v_x, with slip angles up to `slip` and friction μ: |r| <= 1.5 μ g/v_x (a car that is
# steered fast overshoots), |v_y| <= l_r |r| + v_x slip, |δ_f| <= slip + (|v_y| + l_f |r|)/v_x, the
# same behind, and |δ'| <= 2 π bandwidth |δ|_max. A drive that breaks one of these is not judged.
#
# f = F - C α is the force that the linear tire misses. Wherever 0 <= F/(C α) <= 2, |f| <= C |α|: so
# |f| <= hypot(C_f, C_r) slip, however smooth the tire. (C slip - μ F_z is no bound: it is what is
# missed where the axle slides, and a smooth tire misses force long before.) The samples show f with
# ẋ as the mean over T_s and the rest held: |Cα - K⁻¹ [v_x r, 0]| moves by no more than its largest
# rate times T_s/2 from that.


def _largest_signals(
    vehicle: Vehicle, *, v_x: float, slip: float, friction: float
) -> dict[str, float]:
    """Bound of every signal that a network may read, SI."""
    r = YAW_OVERSHOOT * friction * GRAVITY / v_x
    v_y = vehicle.l_r * r + v_x * slip
    return {
        "v_y": v_y, "r": r, "delta_f": slip + (v_y + vehicle.l_f * r) / v_x,
        "delta_r": slip + (v_y + vehicle.l_r * r) / v_x, "v_x": v_x, "alpha_f": slip,
        "alpha_r": slip,
    }  # fmt: skip


def declared_signals(vehicle: Vehicle, driving: Driving) -> dict[str, float]:
    """Bound of every signal over the whole range of speeds, SI."""
    at = {"slip": driving.slip, "friction": driving.friction}
    speeds = [(1.0 + share) * driving.v_x for share in (-SPEED_SPREAD, SPEED_SPREAD)]
    slow, fast = (_largest_signals(vehicle, v_x=v_x, **at) for v_x in speeds)
    return {name: max(slow[name], fast[name]) for name in slow}


def _residual_bound(vehicle: Vehicle, *, slip: float) -> float:
    """Force that the linear tire can miss at most at any instant, |f| <= hypot(C_f, C_r) slip [N].
    vehicle : the car; its stiffness is at least half that of the tires.
    """
    return slip * math.hypot(vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear)


def expected_residual(vehicle: Vehicle, *, slip: float, friction: float) -> float:
    """Force that the linear tire misses on a usual tire, F = μ F_z sin(1.5 atan(C α/(1.5 μ F_z))).

    No bound, but what the network must be able to hold where both axles are at the slip [N].
    """
    peak = friction * np.array(vehicle.axle_loads)
    linear = slip * _stiffness(vehicle)
    state = peak * np.sin(1.5 * np.arctan(linear / (1.5 * peak)))
    return float(np.linalg.norm(linear - state))


def disturbance(vehicle: Vehicle, driving: Driving, *, dt: float, unit: float) -> Disturbance:
    """Return bounds of all that acts on the error dynamics, proven for the declared driving.
    dt : sampling interval [s].   unit : force unit U [N].
    """
    C, lever = _stiffness(vehicle), np.array([vehicle.l_f, vehicle.l_r])
    K_inv = np.abs(np.array(ca.DM(bicycle(vehicle.bicycle, 1.0).K_inv)))
    signals, grip = declared_signals(vehicle, driving), driving.friction * GRAVITY
    r, sway = signals["r"], signals["v_y"] + lever * signals["r"]  # |v_y ± l r| at the axles
    slow, fast = (1.0 - SPEED_SPREAD) * driving.v_x, (1.0 + SPEED_SPREAD) * driving.v_x
    push = grip / GRAVITY * np.array(vehicle.axle_loads)  # |F|
    spin = float(lever @ push) / vehicle.yaw_inertia  # |r'|

    # |f| as the samples show it: C α and v_x r are held over T_s, with v_x' up to the grip
    slip_rate = (
        2.0 * math.pi * driving.bandwidth * np.array([signals["delta_f"], signals["delta_r"]])
    )
    slip_rate = slip_rate + (grip + fast * r + lever * spin) / slow + sway * grip / slow**2
    turn_rate = K_inv[:, 0] * (fast * spin + grip * r)
    between = dt / 2.0 * float(np.linalg.norm(C * slip_rate + turn_rate))

    # what the sensors add to A_ξ ξ + B_ξ u, and to ξ itself
    n_x = np.array([driving.noise_v_y, driving.noise_r])
    slowest = slow - driving.noise_v_x
    wrong_slip = driving.noise_delta + (n_x[0] + lever * n_x[1]) / slowest
    wrong_slip = wrong_slip + sway * driving.noise_v_x / (slow * slowest)
    wrong_turn = fast * n_x[1] + driving.noise_v_x * (r + n_x[1])
    misread = float(np.linalg.norm(C * wrong_slip + K_inv[:, 0] * wrong_turn))

    return Disturbance(
        residual=(_residual_bound(vehicle, slip=driving.slip) + between + misread) / unit,
        noise=float(np.linalg.norm(K_inv @ n_x)) / unit,
    )


def _stiffness(vehicle: Vehicle) -> Array:
    """C of both axles (2,) [N/rad]."""
    return np.array([vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear])
