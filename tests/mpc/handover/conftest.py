"""Drives of the sedan, as noisy sensors see them, and the tires that are judged on them."""

import numpy as np
import pytest

from identifier.axle import AxleIdentifier
from identifier.run import identify
from models.friction import Friction, FrictionChange
from models.maneuvers import RandomSteer, Slalom
from models.plant import Plant
from models.sensors import Sensor, Sensors
from models.vehicle import sedan
from mpc.tires import prediction_tire

DROP = 6.0  # s
SPEED = 20.0  # m/s
NOISY = Sensors(
    v_x=Sensor(noise=0.03), v_y=Sensor(noise=0.03), r=Sensor(noise=0.003), delta=Sensor(noise=5e-4)
)


def drive(maneuver, *, friction=None):
    run = Plant(sedan()).simulate(maneuver, speed=SPEED, friction=friction)
    return run, run.recording(NOISY, np.random.default_rng(0))


def samples_of(recording):
    """Rows of `window.COLUMNS`."""
    return np.column_stack([recording.v_x, recording.v_y, recording.r, recording.delta_f])


class Told:
    """A judge whose chi-squares are told."""

    def lookback(self, seconds):
        return seconds

    def chi_square(self, tire, samples):
        return self.chi_squares(tire, tire.weights[None], samples)[0]


@pytest.fixture(scope="session")
def car():
    return sedan()


@pytest.fixture(scope="session")
def dry():
    """A random drive of 12 s on a dry road: the truth and what sensors saw."""
    steer = RandomSteer(
        amplitude=0.06, frequency=0.5, seed=2, onset=0.5, rate_limit=1.0, duration=12.0
    )
    return drive(steer)


@pytest.fixture(scope="session")
def dropped():
    """A slalom of 9 s on a road whose friction halves after 6 s."""
    steer = Slalom(amplitude=0.05, frequency=0.4, onset=0.5, rate_limit=1.0, duration=9.0)
    return drive(steer, friction=Friction(changes=(FrictionChange(scale=0.5, at_time=DROP),)))


@pytest.fixture(scope="session")
def learnt(car, dry):
    """The model that the axle identifier learnt on the dry road."""
    return identify(dry[1], car, AxleIdentifier.for_vehicle(car)).freeze(11.9)


@pytest.fixture(scope="session")
def tire(learnt):
    return prediction_tire(learnt)
