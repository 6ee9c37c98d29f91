"""A road that turns slippery, and sensors that fail, on tires of the dry road."""

import math

import numpy as np
import pytest

from benchmarks.mpc_cases import cornering_limit
from models.faults import SensorFault
from models.vehicle import sedan
from mpc.cars import DoubleTrackCar
from mpc.loop.drive import drive
from mpc.loop.sensing import FaultySensors, inertial_unit
from mpc.path import iso_3888_1, steady_speed
from mpc.realtime import Tracker
from mpc.tires.ladder import oracle_tire

FAULTS = (  # channel, kind, how long [s], size: that caution may not take for ice
    ("v_y", "noisy", math.inf, 0.5),
    ("r", "scaled", math.inf, 0.8),
    ("v_x", "scaled", math.inf, 0.8),
)


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_sensor_that_fails_is_not_taken_for_ice(fault):
    car, path = sedan(), iso_3888_1()
    channel, kind, duration, size = fault
    broken = SensorFault(channel=channel, kind=kind, start=1.0, duration=duration, size=size)
    run = drive(
        path,
        DoubleTrackCar(car),
        Tracker(oracle_tire(car), delay=0.05, caution=1.0),
        speed=steady_speed(path, a_y_max=0.85 * cornering_limit(car, None, 1.0)),
        sensors=FaultySensors(inertial_unit(), [broken]),
        delay=2,
        rng=np.random.default_rng(4),
        plan_every=0,
    )
    assert run.completed
    assert np.abs(run.e_y).max() < 0.5  # m: on its path
