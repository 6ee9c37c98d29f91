"""How hard a car can corner, found by driving it: steered more and more at constant speed.

The driven axle also holds the speed against the drag of cornering, so that this limit lies a few
per cent below the sum of what the tires could give to the side alone.
"""

import numpy as np

from models.friction import Friction
from models.maneuvers import SlowlyIncreasingSteer
from models.plant import Plant
from models.tires import Tire
from models.vehicle import Vehicle

RAMP_TIME = 20.0  # s
LARGEST_ANGLE = 0.3  # rad at friction 1: beyond the peak of any tire for the road


def cornering_limit(
    vehicle: Vehicle, tire: Tire | None = None, mu: float = 1.0, *, speed: float = 20.0
) -> float:
    """Return the largest steady lateral acceleration [m/s^2].

    Parameters
    ----------
    vehicle : the car, with chassis.
    tire : of all four wheels; None reads the file named by the chassis.
    mu : friction of the road over that of the tire's measurement [-].
    speed : at which the car is driven [m/s].
    """
    rate = LARGEST_ANGLE * mu / RAMP_TIME
    ramp = SlowlyIncreasingSteer(
        amplitude=LARGEST_ANGLE * mu, rate=rate, rate_limit=rate, onset=0.1, duration=RAMP_TIME
    )
    run = Plant(vehicle, tire).simulate(ramp, speed=speed, friction=Friction(scale=mu))
    return float(np.abs(run.a_y).max())
