"""Plans: the car moves as a bicycle, the covariance is that of a fit, and the rank holds."""

from dataclasses import replace

import control
import numpy as np
import pytest

import tireid as ti
from benchmarks.answers import force_error
from benchmarks.random_cars import random_car, random_drive
from identifier.estimate.drive import Drive
from identifier.estimate.fit import fit
from identifier.estimate.priors import Priors
from identifier.estimate.solve import Problem
from identifier.motion.parameters import INDEX
from identifier.plan import ERROR, LASTS, PlanError, _extent, _Likely, _steerings, plan
from models.bicycle import BicycleParameters, bicycle
from models.maneuvers import Slalom

CAR, SPEED = ti.sedan(), 15.0


@pytest.fixture(scope="module")
def likely():
    priors = Priors.of(CAR)
    return _Likely(CAR, priors, priors.mean, 0.9)


@pytest.fixture(scope="module")
def found():
    return plan(CAR, speeds=[SPEED], time=6.0)


def test_small_angles_move_the_likely_car_as_the_linear_bicycle(likely):
    stiff = [np.exp(likely.p[INDEX[f"ln_stiffness_{k}"]]) for k in "fr"] * np.array(CAR.axle_loads)
    linear = bicycle(
        BicycleParameters(CAR.mass, CAR.yaw_inertia, CAR.l_f, CAR.l_r, *map(float, stiff)), SPEED
    )
    slow = Slalom(amplitude=2e-3, frequency=0.1, onset=0.5, rate_limit=0.1, duration=12.0)
    t = np.arange(0.0, 12.0, 0.01)
    system = control.ss(np.array(linear.A), np.array(linear.B)[:, :1], np.eye(2), np.zeros((2, 1)))
    expected = control.forced_response(system, t, slow.steering(t)[:, 0]).outputs.T
    driven = likely.driven(slow, SPEED, 0.01)[:, :2]
    # What is left is the lag of the tires, some 20 ms.
    missed, (_, r) = (np.abs(np.asarray(one)).max(axis=0) for one in (driven - expected, expected))
    assert np.all(missed < 0.02 * r * np.array([CAR.l_r, 1.0]))


def test_the_covariance_is_that_of_the_balance_differenced_and_of_the_prior(likely, found):
    one = next(one for one in found if one.name == "slalom")
    problem = Problem([Drive.of(one.log, CAR)], CAR, likely.priors)
    p, sd = one.tire.p, likely.priors.sd
    J = []
    for k in problem.index:
        step = 1e-4 * sd[k] * np.eye(len(p))[k]
        J.append((problem.residuals(p + step).e - problem.residuals(p - step).e).ravel())
        J[-1] /= 2e-4 * sd[k]
    variance = 4.0 / 5.0 * ERROR**2 * LASTS / problem.weight[0]  # Student's, where nothing is off
    where = np.ix_(problem.index, problem.index)
    expected = np.linalg.inv(
        np.array(J) @ np.array(J).T / variance + likely.priors.information[where]
    )
    given = np.sqrt(np.diag(one.tire.covariance))[problem.index]
    np.testing.assert_allclose(given, np.sqrt(np.diag(expected)), rtol=0.03)


def test_a_maneuver_is_as_hard_as_the_share_of_the_grip_allows(likely):
    half = likely._replace(share=0.5)
    of = _steerings(CAR, 4.0, 0)["slalom"]
    hard, gentle = (
        np.abs(one.driven(one.hardest(of, SPEED), SPEED, 0.01)[:, 2:]).max()
        for one in (likely, half)
    )
    assert 2.0 * gentle < hard


@pytest.mark.parametrize(
    ("kind", "seed", "friction"), [("sedan", 0, 0.9), ("race", 0, 1.5), ("tenth", 2, 0.7)]
)
def test_a_car_of_other_tires_learns_more_from_the_first_than_from_the_last(kind, seed, friction):
    rng = np.random.default_rng([seed, 31])
    car = random_car(kind, rng)
    asked = random_drive(car, rng).exact
    ranked = plan(car.declared, friction=friction, speeds=[4.0 * car.declared.froude_speed])
    errors = []
    for one in (ranked[0], ranked[-1]):
        run = car.plant.simulate(one.maneuver, speed=one.speed)
        log = car.sensors.apply(run.recording(), np.random.default_rng(1))
        tire = fit([replace(log, axle_force=None)], car.declared).model
        errors.append(np.mean(force_error(tire, asked)) / 100.0)
    assert errors[1] > 1.5 * errors[0]
    assert errors[0] < 2.0 * ranked[0].error


def test_the_room_is_that_of_the_least_rectangle():
    along = np.linspace(0.0, 100.0, 200)
    length, width = _extent(0.8 * along, 0.6 * along + 1e-3)
    assert length == pytest.approx(100.0, rel=1e-3) and width < 0.5


def test_a_plan_goes_on_from_a_fit_and_from_nothing_else(found):
    again = plan(CAR, speeds=[SPEED], time=6.0, start=found[0].tire)
    assert again[0].error < 0.9 * found[0].error
    axle = ti.identify(ti.sample_recording(), CAR, "axle").tire
    with pytest.raises(PlanError, match="goes on from a fit"):
        plan(CAR, start=axle)


@pytest.mark.parametrize(
    "others", [{"speeds": [1.0]}, {"time": np.nan}, {"share": 1.0}, {"friction": 9.0}]
)
def test_numbers_that_make_no_plan_are_refused(others):
    with pytest.raises(PlanError):
        plan(CAR, **others)
