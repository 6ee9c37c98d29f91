"""From a car and how hard it is driven to what a certificate must know: signals and residual.

At the speed v_x, with slip angles up to `slip` and friction μ: |r| <= μ g/v_x,
|v_y| <= l_r |r| + v_x slip, |δ_f| <= slip + (|v_y| + l_f |r|)/v_x, the same behind. On an axle that
slides, with the load F_z, the linear tire misses C slip - μ F_z.
"""

import math

import numpy as np

from identifier.design import Design
from identifier.stability.estimated_input import estimated_input_feedback
from identifier.stability.gain_limit import require_positive
from identifier.stability.operation import Operation
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
    r = friction * GRAVITY / v_x
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


def residual_bound(vehicle: Vehicle, *, slip: float, friction: float) -> float:
    """Force that the linear tire misses where both axles slide at the slip angle, |f| [N].

    Parameters
    ----------
    vehicle : the car.
    slip : largest slip angle [rad].
    friction : μ [-].
    """
    require_positive(slip=slip, friction=friction)
    load = vehicle.mass * GRAVITY / vehicle.wheelbase
    front = vehicle.cornering_stiffness_front * slip - friction * load * vehicle.l_r
    rear = vehicle.cornering_stiffness_rear * slip - friction * load * vehicle.l_f
    return math.hypot(max(front, 0.0), max(rear, 0.0))


def operation(
    design: Design,
    vehicle: Vehicle,
    *,
    v_x: float,
    slip: float,
    friction: float,
    bandwidth: float,
) -> Operation:
    """Return what the certificate of a design needs.

    (14) is given its best chance: w_bar = 0 and the smallest weights that hold the residual,
    |f|/√n_h with every unit saturated. The V layer is judged up to twice that: units half open.

    Parameters
    ----------
    design : network, step and input source.
    vehicle : the car.
    v_x : speed [m/s]; the slowest, where the network reads the estimate.
    slip : largest slip angle [rad].
    friction : μ [-].
    bandwidth : highest frequency of steering that matters [Hz].
    """
    signals = largest_signals(vehicle, v_x=v_x, slip=slip, friction=friction)
    assert design.network.scale is not None
    scaled = [
        signals[name] / scale
        for name, scale in zip(design.network.inputs, design.network.scale, strict=True)
    ]
    missed = residual_bound(vehicle, slip=slip, friction=friction) / design.force_unit
    feedback = estimated_input_feedback(
        m=vehicle.mass,
        I_z=vehicle.yaw_inertia,
        l_f=vehicle.l_f,
        l_r=vehicle.l_r,
        stiffness_lost=(vehicle.cornering_stiffness_front, vehicle.cornering_stiffness_rear),
        v_x=v_x,
    )
    return Operation(
        n_h=design.network.hidden,
        dt=design.dt,
        integrator=design.integrator,
        bandwidth=bandwidth,
        residual_bound=missed,
        x_bar_max=float(np.linalg.norm(scaled)),
        input_feedback=feedback if design.input_source == "estimated" else None,
        W_M=missed / math.sqrt(design.network.hidden),
        w_bar=0.0,
        W_large=2.0 * missed / math.sqrt(design.network.hidden),
    )
