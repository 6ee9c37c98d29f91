"""The numbers of the forward model: tires, body and sensors, each with its unit.

Axles are `_f` and `_r`. Forces are in static axle loads, so that one prior serves every car.
"""

from functools import cache

SLIPS = (0.01, 0.02, 0.05, 0.12)  # a_j [rad], of what the Magic Formula misses


def _of_axles(name: str, unit: str) -> dict[str, str]:
    return {f"{name}_{axle}": unit for axle in "fr"}


UNITS = {
    **_of_axles("ln_stiffness", "ln(loads/rad)"),  # C, slope of the curve at zero
    **_of_axles("ln_grip", "ln(loads)"),  # μ, largest force of the Magic Formula
    **_of_axles("shape", "-"),  # c of the Magic Formula
    **_of_axles("curvature", "-"),  # E of the Magic Formula
    **{  # q of tanh(x/a_j)
        f"residual{j}_{axle}": "loads" for axle in "fr" for j in range(len(SLIPS))
    },
    **_of_axles("compliance", "m/load"),  # s, sideways deflection of the carcass
    **_of_axles("sway_share", "-"),  # k, share of the body's sway at the contact patch
    **_of_axles("braking", "1/g"),  # c of the friction ellipse where the car brakes
    **_of_axles("driving", "1/g"),  # c of the friction ellipse where it is driven
    "load_transfer": "-",  # h, effective height of the load transfer over the wheelbase
    "ln_sway": "-",  # ln of the sway's frequency over the usual one
    "steering_zero": "rad",  # δ0, added to the front steering angle
    "steering_gain": "-",  # g, relative error of the front steering angle
    "v_y_bias": "m/s",  # b, in the measured v_y
    "v_y_angle": "rad",  # β, mounting angle of the sensor of v_y
    "v_y_lever": "m",  # x_s, place of that sensor ahead of the center of gravity
    "v_y_delay": "s",  # τ, by which v_y is late
    "v_y_lag": "s",  # low pass of first order that v_y is behind
    "steering_delay": "s",  # by which the steering angle is late
    "steering_lag": "s",  # low pass of first order that the steering angle is behind
    "steering_play": "rad",  # p to each side, slip that turns loose front wheels and pushes nothing
    "r_bias": "rad/s",  # in the measured yaw rate
    "r_delay": "s",  # by which the yaw rate is late
    "r_lag": "s",  # low pass of first order that the yaw rate is behind
    "r_gain": "-",  # relative error of the yaw rate
    "v_x_factor": "-",  # relative error of v_x
    "cg_shift": "m",  # center of gravity ahead of the given one
    "ln_inertia": "-",  # ln of the yaw inertia over the given one
    **_of_axles("downforce", "s²/m²"),  # of the load per v_x², beside the given one
    "bank": "g",  # side force of a road that is banked throughout
    "ln_road": "-",  # ln of the road's friction over that of the curves
}
NAMES = tuple(UNITS)
INDEX = {name: i for i, name in enumerate(NAMES)}


def curve_names(axle: str) -> list[str]:
    """Return the numbers of a curve of an axle but for the road, (8,)."""
    names = ["ln_stiffness", "ln_grip", "shape", "curvature"]
    return [f"{name}_{axle}" for name in (*names, *(f"residual{j}" for j in range(len(SLIPS))))]


@cache
def curve_index(axle: str) -> list[int]:
    """Return where the numbers of a curve of an axle stand among the parameters, (9,).

    They are ln C, ln μ, c, E, q (4) and ln m of the road.
    """
    return [INDEX[name] for name in (*curve_names(axle), "ln_road")]
