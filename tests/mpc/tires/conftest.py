"""A car, motions it may be in, and the forces of a prediction tire at such motions."""

import casadi as ca
import numpy as np
import pytest

from models.recordings import Recording
from models.vehicle import sedan
from mpc.tires.tire import Car, Point


def forces(model, v_x, v_y, r, delta, lagged=None):
    """Axle forces (n, 2) and kinematic slip (n, 2) of a prediction tire; lagged slip (n, 2)."""
    names = ("v_y", "r", "delta", "v_x")
    symbols = [ca.SX.sym(name) for name in names]
    behind, car = ca.SX.sym("behind", 2), Car(*model.car)
    w = ca.SX.sym("w", model.structure.n_weights)
    at = Point(*symbols, car, w)
    slip = model.structure.slip(at)
    used = slip if lagged is None else (behind[0], behind[1])
    force = model.structure.force(used, at)
    function = ca.Function("tire", [*symbols, behind, w], [ca.vertcat(*force), ca.vertcat(*slip)])
    rows = [np.broadcast_to(value, np.shape(v_y))[None] for value in (v_y, r, delta, v_x)]
    behind = np.zeros((np.size(v_y), 2)) if lagged is None else lagged
    result = function(*rows, behind.T, np.tile(model.weights[:, None], np.size(v_y)))
    return tuple(np.array(value).T for value in result)


@pytest.fixture
def motions():
    """A recording of unrelated samples: every sample is another speed, drift and steering."""
    rng, n = np.random.default_rng(3), 200
    return Recording(
        name="motions",
        t=0.01 * np.arange(n),
        v_x=rng.uniform(8.0, 40.0, n),
        v_y=rng.normal(0.0, 1.0, n),
        r=rng.normal(0.0, 0.3, n),
        delta_f=rng.normal(0.0, 0.1, n),
        delta_r=np.zeros(n),
    )


def at(recording):
    return recording.v_x, recording.v_y, recording.r, recording.delta_f


@pytest.fixture(name="car")
def the_car():
    return sedan()


@pytest.fixture(name="forces")
def forces_of():
    """The function `forces(model, v_x, v_y, r, delta, lagged=None)`."""
    return forces


@pytest.fixture(name="at")
def signals_of():
    """The function `at(recording)`, which gives v_x, v_y, r, delta."""
    return at
