"""A steering ratio that somebody typed is right to a few percent, or plainly wrong."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.estimate.fit import fit
from identifier.estimate.priors import OF_CAR, Priors
from identifier.motion.parameters import INDEX

GAIN = INDEX["steering_gain"]


@pytest.mark.parametrize("ratio", [0.75, 1.4])
def test_a_wrong_steering_ratio_does_not_reach_the_stiffness(ratio, car, drive):
    log = drive()
    right = fit([log], car).model
    found = fit([replace(log, delta_f=ratio * log.delta_f)], car).model
    np.testing.assert_allclose(found.stiffness, right.stiffness, rtol=0.08)
    assert found["steering_gain"] == pytest.approx(1.0 / ratio - 1.0, abs=0.06)
    assert abs(right["steering_gain"]) < 0.04


def test_the_belief_in_it_is_a_student_one_of_the_same_width(car):
    priors, sd = Priors.of(car), OF_CAR["steering_gain"].sd
    p = priors.mean.copy()
    p[GAIN] = 0.1 * sd
    assert priors.cost(p) == pytest.approx(0.5 * 0.1**2, rel=0.01)
    p[GAIN] = 10.0 * sd
    assert priors.cost(p) < 5.0, "a Gaussian has 50"
    step = np.zeros_like(p)
    step[GAIN] = 1e-4 * sd
    slope = (priors.cost(p + step) - priors.cost(p - step)) / (2.0 * step[GAIN])
    assert slope == pytest.approx(priors.around(p)[0][GAIN], rel=1e-5)
