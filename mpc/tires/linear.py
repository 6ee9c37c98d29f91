"""The linear tire of the textbook: F = C α of the paper's (3), without a limit."""

from dataclasses import dataclass

import numpy as np

from models.vehicle import Vehicle
from mpc.tires.structure import Array, Pair, Point, TireModel, no_lag, small_slip


@dataclass(frozen=True, slots=True)
class LinearAxles:
    """F = C α; w = [C_f, C_r] [N/rad]."""

    n_weights = 2
    lagged = False

    slip = small_slip
    lag_length = no_lag

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body.

        Parameters
        ----------
        slip : what makes the force [rad].
        at : motion, car and weights.
        """
        w = at.w
        return w[0] * slip[0], w[1] * slip[1]


def linear_tire(vehicle: Vehicle, stiffness: Array | None = None) -> TireModel:
    """Return the tire of the linear bicycle.

    Parameters
    ----------
    vehicle : the car.
    stiffness : C_f, C_r per axle [N/rad] (2,); None takes those that the vehicle states.
    """
    weights = vehicle.bicycle[4:] if stiffness is None else stiffness
    return TireModel(LinearAxles(), np.array(weights, dtype=np.float64), vehicle)
