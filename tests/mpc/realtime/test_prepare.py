"""What is done ahead of a measurement changes nothing but the time of its answer."""

import numpy as np
import pytest

from mpc.realtime import Measurement, Status, Tracker

PERIOD = 0.05


def driven(tire, problem, *, prepared, steps=12, kick=0.0, hidden=0.0):
    """Commands of a drive along the tracker's own plans, with a kick to each measurement."""
    rng = np.random.default_rng(0)
    tracker = Tracker(tire, problem, period=PERIOD)
    one = np.ones(problem.horizon + 1)
    kappa, v_x = 0.01 * one, 20.0 * one
    car, commands = np.array([0.3, 0.02, 0.1, 0.1]), []
    for _ in range(steps):
        if prepared:
            assert tracker.prepare(kappa + hidden, v_x) >= 0.0
        commands.append(tracker.step(Measurement(*car, kappa, v_x)))
        car = commands[-1].plan_x[1, :4] + kick * rng.standard_normal(4)
    return commands


def test_where_the_plan_comes_true_a_prepared_step_steers_the_same(tire, problem):
    plain, prepared = (driven(tire, problem, prepared=ahead) for ahead in (False, True))
    assert [command.status for command in prepared] == [Status.OK] * len(prepared)
    for one, other in zip(plain, prepared, strict=True):
        assert one.steering == pytest.approx(other.steering, abs=1e-4)
        np.testing.assert_allclose(one.plan_u, other.plan_u, atol=0.02)


def test_a_prepared_step_answers_what_was_not_expected_nearly_as_a_whole_one(tire, problem):
    plain, prepared = (driven(tire, problem, prepared=p, steps=2, kick=0.01) for p in (False, True))
    still = driven(tire, problem, prepared=False, steps=2)
    asked = np.abs(plain[1].plan_u - still[1].plan_u).max()
    miss = np.abs(prepared[1].plan_u - plain[1].plan_u).max()
    assert 0.0 < miss < 0.2 * asked


def test_another_road_than_was_expected_is_planned_for_from_the_beginning(tire, problem):
    plain = driven(tire, problem, prepared=False, kick=0.01)
    surprised = driven(tire, problem, prepared=True, kick=0.01, hidden=0.005)
    assert [a.steering for a in plain] == [b.steering for b in surprised]
