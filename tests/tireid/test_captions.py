"""Captions of figures: their numbers are those of the data that is drawn."""

from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from models.recordings import read_recording
from tireid.reports.captions import force_caption, slip_caption


@pytest.fixture(scope="module")
def log(logs):
    return read_recording(logs / "slalom.csv")


@pytest.fixture(scope="module")
def run(log):
    return ti.identify(log, ti.sedan())


def test_an_error_that_was_planted_is_named_by_size_time_and_axle(log, run):
    force = 1.1 * log.axle_force
    assert "error 10.0 / 10.0 % of the true force" in force_caption(log, force, run.tire, None)
    force[500, 1] += 5000.0
    said = force_caption(log, force, run.tire, None)
    assert f"at {log.t[500]:.4g} s, rear" in said


def test_points_outside_the_band_are_counted_where_they_are(log, run):
    tire = run.tire
    slip = tire.lagged_slip(log)
    on_curve = np.stack([tire.force(slip[:, k])[:, k] for k in (0, 1)], axis=1)
    said = slip_caption(tire, replace(log, axle_force=on_curve))
    assert "0 / 0 % of the true forces" in said and "most" not in said
    far = np.abs(slip) > 0.8 * tire.known_slip
    said = slip_caption(tire, replace(log, axle_force=on_curve + 9e3 * far))
    front, rear = 100.0 * far.mean(axis=0)
    assert f"{front:.0f} / {rear:.0f} % of the true forces lie outside" in said
    assert "most near the end of the identified slip" in said
