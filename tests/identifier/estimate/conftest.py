"""Drives of the sedan's plant with sensor noise, and what one of them taught."""

from functools import cache

import numpy as np
import pytest

from identifier.estimate.fit import fit
from models.friction import Friction, FrictionChange
from models.sensors import Sensor, Sensors
from models.vehicle import sedan
from tests.identifier.conftest import steered

NOISE = Sensors(v_y=Sensor(noise=0.02), r=Sensor(noise=0.002))
DROP = 10.0  # s


@cache
def driven(seed, duration=20.0, scale=1.0, amplitude=0.07, swing=5.0):
    """Random steering at 17 m/s ± `swing`; from `DROP` on the friction is `scale` times as much."""
    wet = None if scale == 1.0 else Friction(changes=(FrictionChange(scale=scale, at_time=DROP),))
    run = steered(
        seed, duration, amplitude=amplitude, frequency=0.6, friction=wet,
        speed=lambda t: 17.0 + swing * np.sin(0.4 * t),
    )  # fmt: skip
    return NOISE.apply(run.recording(), np.random.default_rng(seed))


@pytest.fixture(scope="package")
def learnt():
    """The fit of one drive."""
    return fit([driven(3)], sedan())
