"""How far slip is of use: up to where an axle's force hardly grows any more.

Beyond the peak of its curve an axle gives less, and more slip is the wrong way out: a tracker that
linearizes there would steer on, because that is what lowers the force. So slip is held below.
"""

from functools import cache

import casadi as ca
import numpy as np

from mpc.tires.structure import Array, Car, Point, PredictionTire, TireModel

FLAT = 0.05  # of the slope at zero: the peak is reached within a per cent or two of its force
SLIPS = np.linspace(0.0, 0.5, 251)  # rad
SPEED = 15.0  # m/s; curves of slip do not depend on it


def useful_slip(tire: TireModel) -> Array:
    """Return the slip [rad] where the slope of each axle's force falls below 5 % of its first.

    Infinite where it never does: a linear tire, and a network that reads other signals than slip.

    Parameters
    ----------
    tire : structure and weights.
    """
    slopes = curve_slopes(tire)
    flat = slopes < FLAT * slopes[:, :1]
    found = np.where(flat.any(axis=1), SLIPS[flat.argmax(axis=1)], np.inf)
    return np.where(slopes[:, 0] > 0.0, found, np.inf)


def curve_slopes(tire: TireModel) -> Array:
    """Return dF/dα of the axles at `SLIPS` (2, k) [N/rad], straight ahead.

    Parameters
    ----------
    tire : structure and weights.
    """
    return np.array(_slopes(tire.structure)(SLIPS[None], tire.car, tire.weights))


@cache
def _slopes(structure: PredictionTire) -> ca.Function:
    """Return dF/dα (2, k) of slips (1, k), straight ahead."""
    slip, w, numbers = ca.SX.sym("slip"), ca.SX.sym("w", structure.n_weights), ca.SX.sym("car", 4)
    at = Point(0.0, 0.0, 0.0, SPEED, Car(*ca.vertsplit(numbers)), w)
    force = ca.vertcat(*structure.force((slip, slip), at))
    slope = ca.Function("slope", [slip, numbers, w], [ca.densify(ca.jacobian(force, slip))])
    return slope.map(SLIPS.size, [False, True, True], [False])
