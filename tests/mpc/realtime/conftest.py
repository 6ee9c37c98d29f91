"""Trackers, built once: a short horizon, for speed of the tests."""

import numpy as np
import pytest

from models.vehicle import sedan
from mpc.problem import Limits, Problem
from mpc.realtime import Measurement, Tracker
from mpc.tires import prediction_tire
from mpc.tires.ladder import oracle_tire

PERIOD = 0.02  # s
PROBLEM = Problem(horizon=20, limits=Limits(steering=0.2, steering_rate=0.5, slip=(0.1, 0.1)))


@pytest.fixture(scope="session")
def linear():
    return prediction_tire(sedan())


@pytest.fixture(scope="session")
def lagging():
    return oracle_tire(sedan())


@pytest.fixture(params=["linear", "lagging"])
def tire(request):
    return request.getfixturevalue(request.param)


@pytest.fixture
def problem():
    return PROBLEM


@pytest.fixture
def tracker(tire, problem):
    return Tracker(tire, problem, period=PERIOD, delay=2 * PERIOD)


@pytest.fixture
def measure():
    """A function that returns a measurement on a road of one curvature and speed."""
    one = np.ones(PROBLEM.horizon + 1)

    def measured(e_y=0.0, e_psi=0.0, v_y=0.0, r=0.0, kappa=0.0, v_x=20.0):
        return Measurement(e_y, e_psi, v_y, r, kappa * one, v_x * one)

    return measured
