"""Errors of many runs at once are those of arithmetic done by hand."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from codegen import Scan
from identifier.compare.course import rmse, run_scored


def proportional() -> Scan:
    """Forces are a gain times the steering; it carries the last force."""
    x, u, v_x = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("v_x")
    gain, last = ca.SX.sym("gain"), ca.SX.sym("last", 2)
    force = gain * ca.vertcat(u[0], x[1])
    step = ca.Function(
        "proportional",
        [last, x, u, v_x, gain],
        [force, force],
        ["last", "x", "u", "v_x", "gain"],
        ["last_next", "axle_force"],
    )
    return Scan(step, carry=("last",), over=("x", "u", "v_x"))


def scores_of(recording, gains, impossible=1e9, counts=None):
    counts = np.ones(len(recording), dtype=bool) if counts is None else counts
    values = [{"last": np.zeros(2), "gain": np.array(gain)} for gain in gains]
    return run_scored(
        proportional(), values, recording, impossible=[impossible] * len(gains), counts=counts
    )


def forces_by_hand(recording, gain):
    return gain * np.column_stack([recording.delta_f, recording.r])


def test_squares_are_means_over_the_samples_that_count(drive):
    recording = drive(n=300)
    counts = np.arange(300) % 3 == 0
    found = scores_of(recording, (1e4, 5e4), counts=counts)
    for i, gain in enumerate((1e4, 5e4)):
        missed = (forces_by_hand(recording, gain) - recording.axle_force)[counts]
        np.testing.assert_allclose(found.squares[i], np.mean(missed**2, axis=0), rtol=1e-12)
        error = rmse(found.squares[i])
        assert (error.front, error.rear) == pytest.approx(np.sqrt(np.mean(missed**2, axis=0)))


def test_without_true_forces_the_error_is_that_of_no_force(drive):
    recording = replace(drive(n=200), axle_force=None)
    found = scores_of(recording, (3e4,))
    expected = np.mean(forces_by_hand(recording, 3e4) ** 2, axis=0)
    np.testing.assert_allclose(found.squares[0], expected, rtol=1e-12)


def test_a_run_is_sane_until_its_first_force_that_no_tire_makes(drive):
    recording = drive(n=400)
    size = np.abs(forces_by_hand(recording, 5e4)).max(axis=1)
    limit = 0.6 * size.max()
    first = int(np.argmax(size > limit))
    assert 0 < first < 400
    assert list(scores_of(recording, (5e4, 0.0), impossible=limit).sane_samples) == [first, 400]
