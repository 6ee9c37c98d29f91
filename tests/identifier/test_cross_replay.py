"""Errors where a model learnt and elsewhere are told apart, and counted on the same samples."""

from dataclasses import replace

import numpy as np
import pytest

from identifier.baselines import LinearBaseline
from identifier.compare.course import (
    INFINITE,
    Course,
    Trial,
    cross_replay,
    same_and_other,
    shares,
)
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
    own, other = same_and_other(frozen)
    assert own == [("a", errors["aa"]), ("b", errors["bb"])]
    assert other == [("b", errors["ab"]), ("a", errors["ba"])]


def test_shares_are_means_over_the_right_drives(course):
    """A model that is right where it learnt and off by all of the force elsewhere: 0 and 100 %."""
    sizes = {recording.name: course.size(recording) for recording in course.recordings}
    none = AxleRmse(front=0.0, rear=0.0)
    frozen = {"a": {"a": none, "b": sizes["b"]}, "b": {"a": sizes["a"], "b": none}}
    found = shares(Trial(online={"a": none, "b": none}, frozen=frozen, diverged_at={}), course)
    assert found == pytest.approx((0.0, 0.0, 100.0))


def test_a_method_without_learning_errs_by_the_same_on_a_drive_wherever_it_learnt(course, car):
    trial = cross_replay(LinearBaseline.for_vehicle(car), course)
    for name in ("a", "b"):
        assert trial.frozen["a"][name] == trial.frozen["b"][name]
    truth = course.recordings[1].axle_force
    alpha = course.recordings[1].alpha(car.l_f, car.l_r)
    linear = alpha * [car.cornering_stiffness_front, car.cornering_stiffness_rear]
    missed = np.sqrt(np.mean((linear - truth) ** 2, axis=0))
    assert trial.frozen["a"]["b"].front == pytest.approx(missed[0], rel=0.02)


def test_the_forces_of_a_toy_car_count_and_silent_ones_are_refused(course, car):
    toy = replace(course.recordings[0], axle_force=1e-5 * course.recordings[0].axle_force)
    small = Course(vehicle=car, recordings=(toy,), min_speed=1.0)
    assert small.size(toy).front == pytest.approx(1e-5 * course.size(course.recordings[0]).front)
    for silent in ([0.0, 1.0], [1.0, 0.0]):
        dead = replace(toy, axle_force=toy.axle_force * silent)
        with pytest.raises(ValueError, match="an axle is always zero"):
            Course(vehicle=car, recordings=(dead,), min_speed=1.0)


def test_without_true_forces_the_motion_judges(course, car):
    """A force that is off by a constant is off by it in every mean; half of one is off by half."""
    judged = Course(
        vehicle=car,
        recordings=tuple(replace(one, axle_force=None) for one in course.recordings),
        min_speed=1.0,
    )
    assert judged.by_motion and not course.by_motion
    for known, blind in zip(course.recordings, judged.recordings, strict=True):
        size = judged.size(blind)
        right = judged.error(blind, known.axle_force)
        assert right.front < 0.1 * size.front and right.rear < 0.1 * size.rear
        off = judged.error(blind, known.axle_force + np.array([3e3, 0.0]))
        assert off.front == pytest.approx(3e3, rel=0.05) and off.rear == right.rear
        half = judged.error(blind, 0.5 * known.axle_force)
        assert judged.share(blind.name, half) == pytest.approx(50.0, abs=6.0)
        lost = np.full_like(known.axle_force, np.inf)
        assert judged.error(blind, lost) == INFINITE


def test_a_comparison_needs_recordings_of_different_names_with_forces(course, car):
    one = course.recordings[0]
    for recordings, complaint in (
        ((), "at least one recording"),
        ((one, one), "a is given twice"),
        ((replace(one.between(0.0, 1.0), axle_force=None),), "fewer than 8 windows"),
    ):
        with pytest.raises(ValueError, match=complaint):
            Course(vehicle=car, recordings=recordings, min_speed=1.0)
