"""Vertical load of each wheel from roll, axle side force and longitudinal acceleration.

Order of wheels everywhere: front left, front right, rear left, rear right.
"""

from typing import Any

import casadi as ca

from models.vehicle import Vehicle


def wheel_loads(vehicle: Vehicle, roll: Any, roll_rate: Any, axle_force: Any, a_x: Any) -> Any:
    """Return the four wheel loads [N]; none is negative and their sum is m g exactly.

    An axle takes its share of the spring and damper moment and, through its roll center, the
    moment of its own side force. A wheel that would pull on the road is lifted: its load is zero
    and the other wheel of the axle carries all; the moment beyond that is lost.

    Parameters
    ----------
    vehicle : the car, with chassis.
    roll, roll_rate : angle [rad] and rate [rad/s] of the body, positive when the right side dips.
    axle_force : side force of the front and the rear axle, body frame, (2,) [N].
    a_x : longitudinal acceleration [m/s^2].
    """
    c = vehicle.require_chassis()
    total = vehicle.weight
    share = c.roll_stiffness_front_share
    body_moment = c.roll_stiffness * roll + c.roll_damping * roll_rate
    to_rear = vehicle.mass * a_x * c.cg_height / vehicle.wheelbase
    front = ca.fmin(ca.fmax(vehicle.axle_loads[0] - to_rear, 0.0), total)
    rear = total - front
    loads = []
    for axle, part, force, height, track in (
        (front, share, axle_force[0], c.roll_center_height_front, c.track_front),
        (rear, 1.0 - share, axle_force[1], c.roll_center_height_rear, c.track_rear),
    ):
        transfer = (part * body_moment + height * force) / track
        right = ca.fmin(ca.fmax(0.5 * axle + transfer, 0.0), axle)
        loads += [axle - right, right]
    return ca.vertcat(*loads)
