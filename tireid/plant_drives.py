"""Drives of a plant that methods are compared on: the first to learn on, the others to predict."""

from collections.abc import Mapping

import numpy as np

from models.maneuvers import DoubleLaneChange, Maneuver, Slalom, StepSteer
from models.plant import Plant
from models.recordings import Recording
from models.sensors import Sensor, Sensors
from models.vehicle import Vehicle

RATE_LIMIT = np.radians(30.0)  # rad/s at the road wheels
SENSORS = Sensors(v_y=Sensor(noise=0.02), r=Sensor(noise=0.002))  # m/s and rad/s, rms
SLALOM = Slalom(
    amplitude=np.radians(4.0), frequency=0.5, onset=2.0, rate_limit=RATE_LIMIT, duration=30.0
)
DRIVES: Mapping[str, tuple[Maneuver, float]] = {  # and the speed [m/s]
    "slalom_20": (SLALOM, 20.0),
    "step_steer": (
        StepSteer(amplitude=np.radians(4.0), onset=2.0, rate_limit=RATE_LIMIT, duration=8.0),
        20.0,
    ),
    "lane_change": (
        DoubleLaneChange(
            amplitude=np.radians(4.5),
            frequency=0.6,
            pause=1.0,
            onset=2.0,
            rate_limit=RATE_LIMIT,
            duration=10.0,
        ),
        20.0,
    ),
    "slalom_25": (
        Slalom(
            amplitude=np.radians(3.5),
            frequency=0.6,
            onset=2.0,
            rate_limit=RATE_LIMIT,
            duration=20.0,
        ),
        25.0,
    ),
}


def plant_recordings(
    vehicle: Vehicle, rng: np.random.Generator | None = None
) -> tuple[Recording, ...]:
    """Drive the plant of a vehicle through every maneuver.

    Parameters
    ----------
    vehicle : the car, with a chassis.
    rng : of the noise of `SENSORS`; None measures exactly.

    Raises
    ------
    VehicleError
        Where the vehicle has no chassis or no tire file.
    """
    plant = Plant(vehicle)
    sensors = None if rng is None else SENSORS
    return tuple(
        plant.simulate(maneuver, speed=speed, name=name).recording(sensors, rng)
        for name, (maneuver, speed) in DRIVES.items()
    )
