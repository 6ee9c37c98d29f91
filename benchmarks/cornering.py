"""How hard a simulated car can corner, found by driving it: no speed of a drive may see it.

It is steered more and more at constant speed. The driven axle also holds the speed against the drag
of cornering, so that this limit lies a few per cent below the sum of what the tires could give to
the side alone.
"""

from collections.abc import Hashable
from functools import cache
from typing import cast

import numpy as np

from models.friction import Friction
from models.maneuvers import StepSteer
from models.plant import Plant
from models.tires import Tire
from models.vehicle import Vehicle

_RAMP_TIME = 20.0  # s
_RAMP_SPEED = 20.0  # m/s
_LARGEST_ANGLE = 0.3  # rad at friction 1: beyond the peak of any tire for the road


def cornering_limit(
    vehicle: Vehicle, tire: Tire | None = None, mu: float = 1.0, rear_tire: Tire | None = None
) -> float:
    """Return the largest steady lateral acceleration [m/s^2].

    Parameters
    ----------
    vehicle : with a chassis.
    tire : of the wheels; None reads the file named by the chassis.
    mu : friction of the road over that of the tire's measurement [-].
    rear_tire : of the two rear wheels, where they have another.
    """
    return _steady_limit(vehicle, cast(Hashable, tire), mu, cast(Hashable, rear_tire))


@cache
def _steady_limit(vehicle: Vehicle, tire: Hashable, mu: float, rear_tire: Hashable) -> float:
    """Drive the ramp once for each car and road: setting up a drive asks a dozen times."""
    rate = _LARGEST_ANGLE * mu / _RAMP_TIME
    ramp = StepSteer(amplitude=_LARGEST_ANGLE * mu, rate_limit=rate, onset=0.1, duration=_RAMP_TIME)
    plant = Plant(vehicle, cast(Tire | None, tire), rear_tire=cast(Tire | None, rear_tire))
    run = plant.simulate(ramp, speed=_RAMP_SPEED, friction=Friction(scale=mu))
    return float(np.abs(run.a_y).max())
