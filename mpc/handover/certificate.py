"""What must hold before learnt numbers may steer: the law was proven, and the tire is a tire."""

from collections.abc import Hashable
from functools import cache
from typing import Any, cast

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.axle.car import car_numbers, symbols
from identifier.method import Method
from models.vehicle import GRAVITY, Vehicle
from mpc.tires import PredictionTire
from mpc.tires.tire import Car, Point

LARGEST_SLIP = 0.25  # rad: an axle slides long before
_SHARES = (0.02, 0.04, 0.08, 0.16, 0.28, 0.44, 0.64, 1.0)  # of the largest slip that is judged
_SPEED = 20.0  # m/s, of a force that is compared
_MOST_GRIP = 1.8  # static axle loads: no road tire has more
_LEAST_GRIP = 0.03  # static axle loads at a slip of 0.1 rad and more: less is no road
_WRONG_WAY = 0.03  # static axle loads that a force may push the wrong way, for offsets of sensors


def law_complaint(method: Method, vehicle: Vehicle) -> str | None:
    """Return why a method must not teach while driving, or None.

    The paper's laws need the certificate of their gains, the default that of its numbers; what
    least squares with bounded parameters teach is judged by `tire_complaint` besides.
    """
    proven = method.certify(vehicle)
    failed = [entry.title for entry in proven.properties if entry.status == "fail"]
    return f"the certificate fails: {'; '.join(failed)}" if failed else None


def tire_complaint(tire: PredictionTire, v_x: float, largest: float = LARGEST_SLIP) -> str | None:
    """Return why a tire must not be steered with at a speed, or None.

    Its forces are finite, push against the slip of their axle, rise from zero slip, and lie between
    those of ice and a grip that no road tire has; straight ahead and in bends of g/3.

    v_x : speed [m/s].   largest : slip up to which it is judged [rad].
    """
    if not np.isfinite(tire.weights).all():
        return "a weight is not finite"
    slip, forces = _forces(tire, v_x, largest)
    pushes = forces * np.sign(slip)  # (turns, axles, signs, slips) [static axle loads]
    if not np.isfinite(forces).all():
        return "a force is not finite"
    for i, axle in enumerate(("front", "rear")):
        push = pushes[:, i]
        if push.max() > _MOST_GRIP:
            return f"the {axle} axle would carry {push.max():.2f} times its load"
        if push.min() < -_WRONG_WAY:
            return f"the {axle} axle would push the wrong way by {-push.min():.2f} of its load"
        if largest >= 0.1 and push[..., -1].min() < _LEAST_GRIP:
            return f"the {axle} axle would slide at {push[..., -1].min():.2f} of its load"
        if not (push[0].sum(axis=0)[0] > 0.0):
            return f"the force of the {axle} axle does not rise with slip"
    return None


def largest_push(tire: PredictionTire) -> Array:
    """Return the largest force of each axle, straight ahead, (2,) [static axle loads]."""
    slip, forces = _forces(tire, _SPEED, LARGEST_SLIP)
    return np.asarray((forces * np.sign(slip))[0].max(axis=-1).mean(axis=-1))


def _forces(tire: PredictionTire, v_x: float, largest: float) -> tuple[Array, Array]:
    """Return slips and forces (turns, axles, signs, slips) [rad, axle loads at that speed]."""
    arm, load = car_numbers(tire.vehicle)[:, [0, 3]].T
    load = load * tire.vehicle.load_ratio(v_x)
    signs = np.array([1.0, -1.0])[:, None]
    alpha = signs * largest * np.array(_SHARES)
    r = np.array([0.0, 1.0, -1.0])[:, None, None] * GRAVITY / (3.0 * v_x)
    alpha, r = np.broadcast_arrays(alpha[None], r)
    v_y = arm[1] * -r - v_x * np.tan(alpha)  # both axles at the same slip
    delta = alpha + np.arctan((v_y + arm[0] * r) / v_x)
    points = np.stack([part.ravel() for part in (v_y, r, delta)])
    structure = cast(Hashable, tire.structure)
    force = np.array(_statics(structure, points.shape[1])(points, v_x, tire.car, tire.weights))
    shaped = force.reshape(2, *alpha.shape).swapaxes(0, 1) / load[None, :, None, None]
    return np.broadcast_to(alpha[:, None], shaped.shape), shaped


@cache
def _statics(structure: Any, n: int) -> ca.Function:
    """Return steady axle forces (2, n) at states (3, n) = v_y, r, δ."""
    ports, s = symbols(one=3, v_x=1, car=Car, w=structure.n_weights)
    v_y, r, delta = ca.vertsplit(s.one)
    at = Point(v_y, r, delta, s.v_x, s.car, s.w)
    force = ca.vertcat(*structure.force(structure.slip(at), at))
    at_one = ca.Function("statics", list(ports.values()), [force])
    return at_one.map(n, [False, True, True, True], [False])
