"""Errors where a model learnt and elsewhere are told apart, and counted on the same samples."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.baselines import LinearBaseline
from identifier.cross_replay import Course, cross_replay, frozen_shares, where_learnt_and_elsewhere
from identifier.reproducibility import AxleRmse


@pytest.fixture
def course(car, drive):
    recordings = (replace(drive(n=400), name="a"), replace(drive(n=400, amplitude=0.1), name="b"))
    return Course(vehicle=car, recordings=recordings, min_speed=1.0)


def test_the_drive_that_was_learnt_is_told_from_the_others():
    errors = {name: AxleRmse(front=k, rear=k) for k, name in enumerate(("aa", "ab", "ba", "bb"))}
    frozen = {
        "a": {"a": errors["aa"], "b": errors["ab"]},
        "b": {"a": errors["ba"], "b": errors["bb"]},
    }
    own, other = where_learnt_and_elsewhere(frozen)
    assert own == [("a", errors["aa"]), ("b", errors["bb"])]
    assert other == [("b", errors["ab"]), ("a", errors["ba"])]


def test_shares_are_means_over_the_right_drives(course):
    """A model that is right where it learnt and off by all of the force elsewhere: 0 and 100 %."""
    sizes = {recording.name: course.size(recording) for recording in course.recordings}
    none = AxleRmse(front=0.0, rear=0.0)
    frozen = {"a": {"a": none, "b": sizes["b"]}, "b": {"a": sizes["a"], "b": none}}
    own, other = frozen_shares(frozen, course)
    assert own == pytest.approx(0.0)
    assert other == pytest.approx(100.0)


def test_a_method_without_learning_errs_by_the_same_on_a_drive_wherever_it_learnt(course, car):
    trial = cross_replay(LinearBaseline.for_vehicle(car), course)
    for name in ("a", "b"):
        assert trial.frozen["a"][name] == trial.frozen["b"][name]
    truth = course.recordings[1].axle_force
    alpha = course.recordings[1].alpha(car.l_f, car.l_r)
    linear = alpha * [car.cornering_stiffness_front, car.cornering_stiffness_rear]
    missed = np.sqrt(np.mean((linear - truth) ** 2, axis=0))
    assert trial.frozen["a"]["b"].front == pytest.approx(missed[0], rel=0.02)
