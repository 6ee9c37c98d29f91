"""What drives tell adds up: over forces it is what the estimate of all of them at once makes."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.estimate.fit import fit
from identifier.estimate.information import GRID, PLACE, SIZE, Information, coordinates
from identifier.estimate.priors import Priors
from identifier.estimate.solve import settled
from identifier.motion.parameters import INDEX
from models.vehicle import sedan
from tests.identifier.estimate.conftest import driven

PRIORS = Priors.of(sedan())
SLIPS = np.linspace(0.005, 0.06, 12)


@pytest.fixture(scope="module")
def drives():
    return [driven(seed, amplitude=a) for seed, a in ((3, 0.07), (5, 0.05), (11, 0.02))]


@pytest.fixture(scope="module")
def told(drives):
    return [fit([one], sedan()).parts[0][1] for one in drives]


def test_slopes_of_forces_and_loss_are_those_of_differences(learnt):
    rng, told = np.random.default_rng(1), learnt.parts[0][1]
    p = learnt.posterior.p + 0.1 * PRIORS.sd * rng.normal(size=len(PRIORS.sd))
    _, slopes = coordinates(p)
    _, slope, _ = told.around(p)
    for k in np.flatnonzero(PRIORS.moves):
        step = np.zeros(len(p))
        step[k] = 1e-5 * PRIORS.sd[k]
        u = (coordinates(p + step)[0] - coordinates(p - step)[0]) / (2.0 * step[k])
        assert slopes[:, k] == pytest.approx(u, rel=1e-5, abs=1e-7)
        loss = (told.around(p + step)[0] - told.around(p - step)[0]) / (2.0 * step[k])
        assert slope[k] == pytest.approx(loss, rel=1e-3, abs=1e-2 / PRIORS.sd[k])


def test_about_the_optimum_it_is_slope_and_curvature_of_the_drives(learnt):
    found, told = learnt.posterior, learnt.parts[0][1]
    _, slope, curvature = told.around(found.p)
    sd = np.sqrt(np.diag(found.covariance))
    assert slope * sd == pytest.approx(found.slope * sd, abs=0.02)
    moves = np.ix_(PRIORS.moves, PRIORS.moves)  # the road does not, but forces tell of it
    size = np.sqrt(np.diag(found.curvature)[PRIORS.moves]) + 1e-9
    both = np.outer(size, size)
    assert curvature[moves] / both == pytest.approx(found.curvature[moves] / both, abs=0.01)
    assert told.seconds == found.seconds > 15.0


def test_logs_added_up_teach_what_they_do_at_once(drives, told):
    at_once = fit(drives, sedan())
    p, covariance = settled(PRIORS.after(sum(told, Information.nothing())), PRIORS.mean)
    added = replace(at_once.model, p=p, covariance=covariance)
    np.testing.assert_allclose(added.force(SLIPS), at_once.model.force(SLIPS), rtol=0.02)
    sd, whole = np.sqrt(np.diag(covariance)), np.sqrt(np.diag(at_once.posterior.covariance))
    on = whole > 0.0
    assert sd[on] == pytest.approx(whole[on], rel=0.3)
    for name in ("v_y_bias", "steering_zero"):
        assert abs(p[INDEX[name]] - at_once.posterior[name]) < at_once.posterior.sd(name)


def test_errors_of_a_drives_own_are_marginal(told):
    """As a Gaussian of u and the errors, whose inverse of the covariance of u it is."""
    along = np.zeros((SIZE, 2))
    along[PLACE["v_y_bias"], 0] = along[GRID.index(0.04), 1] = 1.0
    sd, one = np.array([0.05, 0.1]), told[0]
    whole = np.block(
        [[one.matrix, one.matrix @ along],
         [along.T @ one.matrix, along.T @ one.matrix @ along + np.diag(sd**-2.0)]]
    )  # fmt: skip
    held = 1e-3 * np.diag(np.append(np.ones(SIZE), [0.0, 0.0]))  # what is told alone is singular
    vector = np.append(one.vector, along.T @ one.vector)
    found = one.loosened(along, sd)
    marginal = np.linalg.inv(np.linalg.inv(whole + held)[:SIZE, :SIZE]) - held[:SIZE, :SIZE]
    scale = np.sqrt(np.outer(np.diag(one.matrix) + 1e-3, np.diag(one.matrix) + 1e-3))
    assert found.matrix / scale == pytest.approx(marginal / scale, abs=1e-4)
    there = np.linalg.solve(whole + held, vector)[:SIZE]
    again = np.linalg.solve(found.matrix + held[:SIZE, :SIZE], found.vector)
    assert again == pytest.approx(there, rel=1e-3, abs=1e-4)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"matrix": np.zeros((3, 3))}, "matrix must have shape"),
        ({"vector": np.zeros(3)}, "vector must have shape"),
        ({"vector": np.full(SIZE, np.nan)}, "vector holds a number that is not finite"),
        ({"seconds": -1.0}, "seconds must not be negative, it is -1"),
        ({"seconds": np.inf}, "must not be negative"),
    ],
)
def test_what_is_no_information_is_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        replace(Information.nothing(), **wrong)
