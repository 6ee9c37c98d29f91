"""Slip and force of the four wheels in the paper's sign: α = δ - atan2(v_y, v_x), F_y = +C α.

The tires of the two sides mirror each other: what a tire does at zero slip (conicity, ply steer)
pulls both inwards or both outwards and cancels straight ahead.
"""

from typing import Any, NamedTuple

import casadi as ca

from models.tires import MagicFormula, Tire
from models.vehicle import Vehicle

LEAST_SPEED = 1.0  # below this wheel speed slip decays as if at it [m/s]
LEAST_LOAD = 1.0  # a tire is asked at this load or more, and its force scaled down below it [N]
LARGEST_KAPPA = 0.1  # about where a passenger tire has its largest longitudinal force [-]


class Wheel(NamedTuple):
    """Position [m] in the body frame, y > 0 left, and the axle it belongs to (0 front, 1 rear)."""

    x: float
    y: float
    axle: int

    def velocity(self, v_x: Any, v_y: Any, r: Any) -> tuple[Any, Any]:
        """Velocity of the wheel center [m/s] in the body frame.

        Parameters
        ----------
        v_x, v_y : velocity of the center of gravity, body frame [m/s].
        r : yaw rate [rad/s].
        """
        return v_x - self.y * r, v_y + self.x * r


def wheels(vehicle: Vehicle) -> tuple[Wheel, Wheel, Wheel, Wheel]:
    """Return the wheels: front left, front right, rear left, rear right.

    Parameters
    ----------
    vehicle : the car, with chassis.
    """
    c = vehicle.require_chassis()
    front, rear = 0.5 * c.track_front, 0.5 * c.track_rear
    return (
        Wheel(vehicle.l_f, front, 0),
        Wheel(vehicle.l_f, -front, 0),
        Wheel(-vehicle.l_r, rear, 1),
        Wheel(-vehicle.l_r, -rear, 1),
    )


def mounted(tire: Tire, wheel: Wheel) -> Tire:
    """Return the tire for the side of the wheel; only measured tires have sides.

    Parameters
    ----------
    tire : any of `models.tires`.
    wheel : where it goes.
    """
    if isinstance(tire, MagicFormula):
        return tire.mounted("left" if wheel.y > 0.0 else "right")
    return tire


def relax(slip: Any, delta: Any, velocity: tuple[Any, Any], length: float) -> Any:
    """Return the derivative [1/s] of the lagged lateral slip tan(α').

    σ d(tan α')/dt + |V_cx| tan α' = -V_cy with the velocity V_c of the contact point in the frame
    of the wheel (Pacejka, Tire and Vehicle Dynamics, 3rd ed., section 7.2; no division by speed,
    so it is well posed down to standstill).

    Parameters
    ----------
    slip : lagged slip tan(α') [-].
    delta : steering angle of the wheel [rad].
    velocity : of the wheel, body frame [m/s].
    length : relaxation length σ [m].
    """
    v_x, v_y = velocity
    along = v_x * ca.cos(delta) + v_y * ca.sin(delta)
    aside = v_y * ca.cos(delta) - v_x * ca.sin(delta)
    return (-aside - ca.fmax(ca.fabs(along), LEAST_SPEED) * slip) / length


def tire_force(tire: Tire, slip: Any, camber: Any, drive: Any, load: Any, mu: Any) -> Any:
    """Return [F_x, F_y] [N] of one tire in the frame of the wheel.

    Parameters
    ----------
    tire : as mounted on this side.
    slip : lagged slip tan(α') [-].
    camber : γ > 0 when the top leans right [rad].
    drive : wanted longitudinal force [N]; the tire gives less at large side slip.
    load : vertical load [N].
    mu : friction over the tire's own [-].
    """
    carried = ca.fmax(load, LEAST_LOAD)
    # A tire may push at zero slip (its shifts); a free wheel then slips to where it does not.
    at_rest = tire.forces(0.0, 0.0, 0.0, carried, mu)[0]
    kappa = (drive - at_rest) / tire.slip_stiffness(carried)
    kappa = ca.fmin(ca.fmax(kappa, -LARGEST_KAPPA), LARGEST_KAPPA)
    F_x, F_y = tire.forces(ca.atan(slip), kappa, camber, carried, mu)
    return ca.vertcat(F_x, F_y) * (load / carried)
