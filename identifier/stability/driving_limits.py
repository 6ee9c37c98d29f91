"""From a car and how hard it is driven to what a certificate must know: signals and disturbances.

At the speed v_x, with slip angles up to `slip` and friction μ: |r| <= 1.5 μ g/v_x (a car that is
steered fast overshoots), |v_y| <= l_r |r| + v_x slip, |δ_f| <= slip + (|v_y| + l_f |r|)/v_x, the
same behind, and |δ'| <= 2 π bandwidth |δ|_max. A drive that breaks one of these is not judged.

f = F - C α is the force that the linear tire misses. Wherever 0 <= F/(C α) <= 2, |f| <= C |α|: so
|f| <= hypot(C_f, C_r) slip, however smooth the tire. (C slip - μ F_z is no bound: it is what is
missed where the axle slides, and a smooth tire misses force long before.) The samples show f with
ẋ as the mean over T_s and the rest held: |Cα - K⁻¹ [v_x r, 0]| moves by no more than its largest
rate times T_s/2 from that.
"""

import math

import casadi as ca
import numpy as np

from identifier.design import Design
from identifier.driving import SPEED_SPREAD, YAW_OVERSHOOT, Driving
from identifier.network import network_signals
from identifier.stability.disturbance import Disturbance
from identifier.stability.estimated_input import estimated_input_feedback
from identifier.stability.gain_limit import require_positive
from identifier.stability.lyapunov import Matrix
from identifier.stability.operation import Operation
from models.bicycle import bicycle
from models.vehicle import GRAVITY, Vehicle


def largest_signals(
    vehicle: Vehicle, *, v_x: float, slip: float, friction: float
) -> dict[str, float]:
    """Bound of every signal that a network may read, SI.

    Parameters
    ----------
    vehicle : the car.
    v_x : speed [m/s].
    slip : largest slip angle [rad].
    friction : μ [-].
    """
    require_positive(v_x=v_x, slip=slip, friction=friction)
    r = YAW_OVERSHOOT * friction * GRAVITY / v_x
    v_y = vehicle.l_r * r + v_x * slip
    return {
        "v_y": v_y,
        "r": r,
        "delta_f": slip + (v_y + vehicle.l_f * r) / v_x,
        "delta_r": slip + (v_y + vehicle.l_r * r) / v_x,
        "v_x": v_x,
        "alpha_f": slip,
        "alpha_r": slip,
    }


def declared_signals(vehicle: Vehicle, driving: Driving) -> dict[str, float]:
    """Bound of every signal over the whole range of speeds, SI.

    Parameters
    ----------
    vehicle : the car.
    driving : how hard it is driven.
    """
    at = {"slip": driving.slip, "friction": driving.friction}
    speeds = [(1.0 + share) * driving.v_x for share in (-SPEED_SPREAD, SPEED_SPREAD)]
    slow, fast = (largest_signals(vehicle, v_x=v_x, **at) for v_x in speeds)
    return {name: max(slow[name], fast[name]) for name in slow}


def largest_steering_rate(vehicle: Vehicle, driving: Driving) -> tuple[float, float]:
    """Bound of |δ_f'| and |δ_r'|: 2 π bandwidth times the largest angle [rad/s].

    Parameters
    ----------
    vehicle : the car.
    driving : how hard it is driven.
    """
    signals, omega = declared_signals(vehicle, driving), 2.0 * math.pi * driving.bandwidth
    return omega * signals["delta_f"], omega * signals["delta_r"]


def residual_bound(vehicle: Vehicle, *, slip: float) -> float:
    """Force that the linear tire can miss at most at any instant, |f| <= hypot(C_f, C_r) slip [N].

    Parameters
    ----------
    vehicle : the car; its stiffness is at least half that of the tires.
    slip : largest slip angle [rad].
    """
    require_positive(slip=slip)
    return slip * math.hypot(vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear)


def expected_residual(vehicle: Vehicle, *, slip: float, friction: float) -> float:
    """Force that the linear tire misses on a usual tire, F = μ F_z sin(1.5 atan(C α/(1.5 μ F_z))).

    No bound, but what the network must be able to hold where both axles are at the slip [N].

    Parameters
    ----------
    vehicle : the car.
    slip : largest slip angle [rad].
    friction : μ [-].
    """
    require_positive(slip=slip, friction=friction)
    peak = friction * np.array(vehicle.axle_loads)
    linear = slip * _stiffness(vehicle)
    carried = peak * np.sin(1.5 * np.arctan(linear / (1.5 * peak)))
    return float(np.linalg.norm(linear - carried))


def disturbance(vehicle: Vehicle, driving: Driving, *, dt: float, unit: float) -> Disturbance:
    """Return bounds of all that acts on the error dynamics, proven for the declared driving.

    Parameters
    ----------
    vehicle : the car.
    driving : how hard it is driven.
    dt : sampling interval [s].
    unit : force unit U [N].
    """
    C, lever = _stiffness(vehicle), np.array([vehicle.l_f, vehicle.l_r])
    K_inv = np.abs(np.array(ca.DM(bicycle(vehicle.bicycle, 1.0).K_inv)))
    signals, grip = declared_signals(vehicle, driving), driving.friction * GRAVITY
    r, sway = signals["r"], signals["v_y"] + lever * signals["r"]  # |v_y ± l r| at the axles
    slow, fast = (1.0 - SPEED_SPREAD) * driving.v_x, (1.0 + SPEED_SPREAD) * driving.v_x
    push = grip / GRAVITY * np.array(vehicle.axle_loads)  # |F|
    spin = float(lever @ push) / vehicle.yaw_inertia  # |r'|

    # |f| as the samples show it: C α and v_x r are held over T_s, with v_x' up to the grip
    slip_rate = np.array(largest_steering_rate(vehicle, driving))
    slip_rate = slip_rate + (grip + fast * r + lever * spin) / slow + sway * grip / slow**2
    turn_rate = K_inv[:, 0] * (fast * spin + grip * r)
    held = dt / 2.0 * float(np.linalg.norm(C * slip_rate + turn_rate))

    # what the sensors add to A_ξ ξ + B_ξ u, and to ξ itself
    n_x = np.array([driving.noise_v_y, driving.noise_r])
    slowest = slow - driving.noise_v_x
    wrong_slip = driving.noise_delta + (n_x[0] + lever * n_x[1]) / slowest
    wrong_slip = wrong_slip + sway * driving.noise_v_x / (slow * slowest)
    wrong_turn = fast * n_x[1] + driving.noise_v_x * (r + n_x[1])
    misread = float(np.linalg.norm(C * wrong_slip + K_inv[:, 0] * wrong_turn))

    turning = K_inv[:, 0] * fast * r
    return Disturbance(
        residual=(residual_bound(vehicle, slip=driving.slip) + held + misread) / unit,
        noise=float(np.linalg.norm(K_inv @ n_x)) / unit,
        rate=float(np.linalg.norm(push + turning)) / unit,
        known=(float(np.linalg.norm(C * driving.slip + turning)) + misread) / unit,
    )


def largest_input(design: Design, vehicle: Vehicle, driving: Driving) -> float:
    """Bound on |x_bar| [-], noise of the sensors in it.

    Parameters
    ----------
    design : its network.
    vehicle : the car.
    driving : how hard it is driven.
    """
    signals, slow = declared_signals(vehicle, driving), (1.0 - SPEED_SPREAD) * driving.v_x
    sideways = driving.noise_v_y + vehicle.wheelbase * driving.noise_r
    speed = driving.noise_v_x * (signals["v_y"] + vehicle.wheelbase * signals["r"]) / slow
    slip = driving.noise_delta + (sideways + speed) / (slow - driving.noise_v_x)
    noise = {
        "v_y": driving.noise_v_y,
        "r": driving.noise_r,
        "delta_f": driving.noise_delta,
        "delta_r": driving.noise_delta,
        "v_x": driving.noise_v_x,
        "alpha_f": slip,
        "alpha_r": slip,
    }
    assert design.network.scale is not None
    named = zip(design.network.inputs, design.network.scale, strict=True)
    return float(np.linalg.norm([(signals[name] + noise[name]) / scale for name, scale in named]))


def input_per_error(design: Design, vehicle: Vehicle, driving: Driving) -> float:
    """What |ξ̃| adds to |x_bar| where the network reads x_hat = x - K ξ̃ [1/(U s)].

    Parameters
    ----------
    design : its network.
    vehicle : the car.
    driving : how hard it is driven; the slowest speed counts.
    """
    slowest = (1.0 - SPEED_SPREAD) * driving.v_x - driving.noise_v_x
    x = ca.SX.sym("x", 2)
    signals = network_signals(vehicle.bicycle, slowest, x, ca.SX.zeros(2))
    x_bar = design.network.normalized_input(signals)
    K = bicycle(vehicle.bicycle, slowest).K
    per_error = ca.jacobian(x_bar, x) @ ca.DM(K) * design.force_unit
    return float(np.linalg.norm(np.array(ca.evalf(ca.densify(per_error))), 2))


def operation(design: Design, vehicle: Vehicle, driving: Driving) -> Operation:
    """Return what the certificate of a design needs.

    (14) is given what holds for sure: the ideal weights W = 0, that leave all of f as w_bar. The V
    layer is judged up to twice the smallest weights that hold the expected residual with every
    unit saturated: units half open.

    Parameters
    ----------
    design : network, step and input source.
    vehicle : the car.
    driving : how hard it is driven.
    """
    found = disturbance(vehicle, driving, dt=design.dt, unit=design.force_unit)
    expected = expected_residual(vehicle, slip=driving.slip, friction=driving.friction)
    feedback = estimated_input_feedback(
        m=vehicle.mass,
        I_z=vehicle.yaw_inertia,
        l_f=vehicle.l_f,
        l_r=vehicle.l_r,
        stiffness_lost=(vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear),
        v_x=(1.0 - SPEED_SPREAD) * driving.v_x,
    )
    estimated = design.input_source == "estimated"
    return Operation(
        n_h=design.network.hidden,
        dt=design.dt,
        integrator=design.integrator,
        bandwidth=driving.bandwidth,
        disturbance=found,
        needed_force=expected / design.force_unit,
        x_bar_max=largest_input(design, vehicle, driving),
        V_start=2.0 * math.sqrt(design.network.hidden * len(design.network.inputs)),
        input_feedback=feedback if estimated else None,
        input_per_error=input_per_error(design, vehicle, driving) if estimated else 0.0,
        W_M=0.0,
        w_bar=found.residual,
        W_large=2.0 * expected / design.force_unit / math.sqrt(design.network.hidden),
    )


def _stiffness(vehicle: Vehicle) -> Matrix:
    """C of both axles (2,) [N/rad]."""
    return np.array([vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear])
