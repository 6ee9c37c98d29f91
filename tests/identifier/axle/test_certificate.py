"""What is certified of the axle identifier holds by another road, and its alarms ring."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import linprog

from identifier.axle import AxleIdentifier
from identifier.axle import learning as steps
from identifier.axle.certificate import (
    FrictionDrop,
    _widest_range,
    corners,
    curve_facts,
    jump_by_learning,
)
from identifier.axle.covariance import LEAST_VARIANCE
from identifier.axle.curve import LADDER
from identifier.run import identify

A = np.array(LADDER)


@pytest.fixture(name="design")
def a_design(car):
    return AxleIdentifier.for_vehicle(car)


def test_forces_of_the_corners_are_those_of_linear_programs(design):
    """Each most and each least force of the set, by HiGHS."""
    W = corners(design.bounds, design.ladder)
    rows = np.array([np.ones(4), -np.ones(4), 1 / A, -1 / A])
    limits = [3.0, -0.1, 80.0, -2.0]
    widest = 0.0
    for slip in (0.003, 0.02, 0.05, 0.13, 0.4):
        T = np.tanh(slip / A)
        least, most = (
            sign * linprog(sign * T, rows, limits, bounds=(-3.0, 3.0)).fun for sign in (1, -1)
        )
        assert (W @ T).min() == pytest.approx(least, abs=1e-7)
        assert (W @ T).max() == pytest.approx(most, abs=1e-7)
        widest = max(widest, most - least)
    assert widest <= _widest_range(W, LADDER, 1.5) < 1.2 * widest


def test_a_ladder_of_three_has_its_corners_too(design):
    for ladder in ((0.02, 0.08, 0.16), LADDER):
        W = corners(design.bounds, ladder)
        grip = W.sum(axis=1)
        assert W.shape[1] == len(ladder) and np.abs(W).max() <= 3.0 + 1e-9
        assert 0.1 - 1e-9 <= grip.min() < grip.max() <= 3.0 + 1e-9


def test_facts_of_curves_are_those_of_a_fine_grid_from_the_safe_side(rng):
    grid = np.linspace(1e-4, 0.3, 30_000)
    falls = 0
    for _ in range(60):
        w = rng.uniform(-1.0, 1.5, (1, 4))
        found = curve_facts(w, LADDER, 0.3)
        secant = (np.tanh(grid[:, None] / A) @ w[0]) / grid
        slope = (1.0 / (A * np.cosh(grid[:, None] / A) ** 2)) @ w[0]
        assert (
            secant.max() - 1e-12
            <= found.steepest
            < secant.max() + 0.02 * (np.abs(w) @ (1.0 / A)).item()
        )
        wrong = grid[slope <= 0.0]
        if wrong.size:
            falls += 1
            assert found.rises_until <= wrong[0]
    assert falls > 10


def test_a_limited_step_is_cut_to_the_rate_and_another_is_not_moved(design, rng):
    numbers = design.bounds.of_ladder(LADDER)
    W = corners(design.bounds, LADDER)
    slips = np.tanh(np.geomspace(1e-4, 2.0, 300)[:, None] / A)
    for _ in range(60):
        last, w = (rng.dirichlet(np.ones(len(W))) @ W for _ in range(2))
        found = steps.limited(numbers, 1.0 / 0.3, list(map(ca.DM, last)), list(map(ca.DM, w)))
        got = np.array([float(one) for one in found])
        jump = np.abs(slips @ (got - last)).max()
        assert jump <= jump_by_learning(design) < 0.3025
        largest = np.abs(np.cumsum(w - last)).max()
        assert np.array_equal(got, w) == (largest <= 0.3)
        assert 0.1 < got.sum() < 3.0 and 2.0 < (got / A).sum() < 80.0


def test_a_covariance_at_its_floor_is_learnt_with_but_does_not_shrink(design, car, drive):
    """The floor is raised to where the drive reaches it: D stops there; without it, it falls."""
    recording = drive(n=1500, amplitude=0.07)
    n = len(design.ladder)
    places = [0, 7, 13, 18, 22, 25, 27]
    free = identify(recording, car, design).state["UD"][:, :, places]
    assert LEAST_VARIANCE < free.min() < 1e-5
    setup = design.setup(car)
    low = setup.carry["UD"].copy()
    low[:, places] = LEAST_VARIANCE
    state, theta = dict(setup.carry), []
    state["UD"] = low
    for block in setup.run(recording, carry=state):
        assert block.state["UD"][:, :, places].min() >= LEAST_VARIANCE * (1.0 - 1e-12)
        theta.append(block.state["W"])
    assert np.ptp(np.concatenate(theta), axis=0).max() < 1e-6 and n == 4


def test_a_drop_is_followed_later_the_less_is_seen_and_never_unless_it_is_believed(design, car):
    def time(design=design, **conditions):
        return FrictionDrop(**conditions).time(design, 1.0, 20.0)

    assert time(seen=0.4) < time() < time(errors=1.5) < 5.0
    blind = replace(design, change=replace(design.change, evidence=1e9))
    assert time(blind) == np.inf
    assert blind.certify(car)["drop_time"].status == "warn"
    assert time(noise=0.3) == np.inf


def test_designs_that_the_proofs_do_not_cover_do_not_pass(design, car):
    forgetful = replace(design, regression=replace(design.regression, memory=0.004))
    assert forgetful.certify(car).verdict == "fail"
    assert forgetful.certify(car)["forgets"].status == "fail"
    hasty = replace(design, regression=replace(design.regression, rate=1e4))
    assert hasty.certify(car)["jump"].status == "warn"
    tight = replace(
        design, bounds=replace(design.bounds, least_grip=1.0, most_grip=1.002, weight=3.0)
    )
    assert tight.certify(car)["lean"].status == "fail"
