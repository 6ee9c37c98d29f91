"""Without a lateral velocity, of a car that pushes on the road with the square of its speed."""

import casadi as ca
import numpy as np

from identifier.inertial.motion import Sample, predicted, static_load, unknowns
from models.vehicle import load_ratio
from tests.identifier.inertial.test_motion import SCALES, STEPS, V_X, N, car, laws, places, state


def stepped(z, load):
    """What moves, and the slip, a step later at one speed."""
    symbol, tilt = ca.SX.sym("z", z.size), (ca.SX(2.0), ca.SX(-1.0))
    at = Sample(ca.SX(V_X), ca.DM([0.03, 0.0]))
    after = predicted(
        car(), laws(0.01), 0.01, unknowns(symbol, N), tilt, at, at, SCALES, STEPS, load
    )
    return np.array(ca.Function("f", [symbol], [ca.vertcat(after.moving, after.alpha)])(z))


def test_at_one_speed_a_load_is_a_scale_of_the_weights():
    more = np.array([1.7, 0.6])
    kappa, at, z = (more - 1.0) / V_X**2, places(), state()
    scaled = z.copy()
    scaled[at["W"] : at["W"] + N] *= more[0]
    scaled[at["W_rear"] : at["W_rear"] + N] *= more[1]
    pressed = stepped(z, lambda v_x: load_ratio(ca.DM(kappa), v_x))
    np.testing.assert_allclose(pressed, stepped(scaled, static_load), rtol=1e-12, atol=1e-15)
    assert np.abs(pressed - stepped(z, static_load)).max() > 1e-4
