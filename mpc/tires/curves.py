"""The tire of the linear bicycle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from models.vehicle import Vehicle
from mpc.tires.tire import Pair, Point, PredictionTire, SmallSlip


@dataclass(frozen=True, slots=True)
class LinearAxles(SmallSlip):
    """F = C α; w = [C_f, C_r] [N/rad]."""

    n_weights = 2

    def force(self, slip: Pair, at: Point) -> Pair:
        """Return the axle forces [N], frame of the body."""
        w = at.w
        return w[0] * slip[0], w[1] * slip[1]


def linear_tire(vehicle: Vehicle, stiffness: ArrayLike | None = None) -> PredictionTire:
    """Return the tire of the linear bicycle.
    stiffness : C_f, C_r per axle [N/rad] (2,); None takes those that the vehicle states.
    """
    weights = vehicle.bicycle[4:] if stiffness is None else stiffness
    return PredictionTire(LinearAxles(), np.array(weights, dtype=np.float64), vehicle)
