"""The car along a path as the tracker predicts it: ẋ and its Jacobian.

x = [e_y, e_psi, v_y, r, δ] and, where the tire lags, [α_f', α_r']: deviation from the path [m],
left positive; heading against the path's [rad]; lateral velocity [m/s]; yaw rate [rad/s];
commanded angle of the front wheels [rad]; lagged slip [rad].   u: steering rate [rad/s].
κ [1/m], > 0 where the path turns left, and v_x [m/s] are constant over a stage of dt [s].
Force curves are those of the tire up to the slip that is of use, and rise slightly beyond.
"""

from typing import Any, NamedTuple

import casadi as ca

from mpc.tires.reach import believed_force
from mpc.tires.structure import Car, Point, PredictionTire

N_CAR = 4
# Least 1 - κ e_y that is believed: towards the center of a turn it vanishes, and ṡ has no bound.
NEAREST = 0.1


class Ports(NamedTuple):
    """Symbols of a stage, SX: state, input, parameters; the last two are those of `Reach`."""

    x: Any
    u: Any
    kappa: Any
    v_x: Any
    dt: Any
    car: Any
    w: Any
    max_slip: Any
    rise: Any


class Motion(NamedTuple):
    """Expressions at a state: ẋ (n_x,), ṡ [m/s] and kinematic slip (2,) [rad] with derivatives."""

    x_dot: Any
    x_dot_x: Any
    x_dot_u: Any
    s_dot: Any
    slip: Any
    slip_x: Any


def state_size(structure: PredictionTire) -> int:
    """Return n_x, 5 or with lagged slip 7.

    Parameters
    ----------
    structure : of the tire.
    """
    return 7 if structure.lagged else 5


def stage_ports(structure: PredictionTire) -> Ports:
    """Return fresh symbols.

    Parameters
    ----------
    structure : of the tire.
    """
    sizes = (state_size(structure), 1, 1, 1, 1, N_CAR, structure.n_weights, 2, 2)
    pairs = zip(Ports._fields, sizes, strict=True)
    return Ports(*(ca.SX.sym(name, size) for name, size in pairs))


def motion(structure: PredictionTire, p: Ports) -> Motion:
    """Return the equations of motion and their derivatives, chained through the axle forces.

    Parameters
    ----------
    structure : of the tire.
    p : symbols.
    """
    e_y, e_psi, v_y, r, delta, *lagged = ca.vertsplit(p.x)
    car = Car(*ca.vertsplit(p.car))
    at = Point(v_y, r, delta, p.v_x, car, p.w)
    kinematic = structure.slip(at)
    slip = (lagged[0], lagged[1]) if structure.lagged else kinematic
    force = believed_force(structure, slip, at, p.max_slip, p.rise)

    F = ca.SX.sym("F", 2)
    c, s = ca.cos(e_psi), ca.sin(e_psi)
    s_dot = (p.v_x * c - v_y * s) * (1 / ca.fmax(1 - p.kappa * e_y, NEAREST))
    rates = [
        p.v_x * s + v_y * c,
        r - p.kappa * s_dot,
        (F[0] + F[1]) * (1 / car.m) - p.v_x * r,
        (car.l_f * F[0] - car.l_r * F[1]) * (1 / car.I_z),
        p.u,
    ]
    if structure.lagged:
        lengths = structure.lag_length(slip, at)
        for now, behind, length in zip(kinematic, slip, lengths, strict=True):
            # A lag under half a stage cannot be seen by it, and would make the step unstable.
            rates.append((now - behind) / ca.fmax(length * (1 / p.v_x), 0.5 * p.dt))
    x_dot = ca.vertcat(*rates)
    x_dot_x = ca.jacobian(x_dot, p.x) + ca.jacobian(x_dot, F) @ ca.jacobian(force, p.x)
    x_dot, x_dot_x = ca.substitute([x_dot, x_dot_x], [F], [force])
    angles = ca.vertcat(*kinematic)
    return Motion(x_dot, x_dot_x, ca.jacobian(x_dot, p.u), s_dot, angles, ca.jacobian(angles, p.x))
