"""Captions of figures: their numbers are those of the data that is drawn."""

from dataclasses import replace

import numpy as np
import pytest

import tireid as ti
from models.logs.signals import Signal
from models.recordings import LogMap, read_recording
from tests.tireid.test_drive_figures import CURVES, ON_LANE, SLIP
from tireid.figures.drive import AT_THE_END
from tireid.reports.captions import (
    comparison_caption,
    curves_caption,
    force_caption,
    slip_caption,
)
from tireid.reports.identify import went_in


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


def test_forces_are_compared_with_the_curves_of_their_friction_where_these_are_drawn():
    drive, curve = ON_LANE["frozen"], CURVES[0]
    force = SLIP * [1e5, 8e4]
    part = np.where(np.abs(curve.alpha) > 0.5 * SLIP.max(), np.nan, 1.0)[:, None]
    known = curve._replace(label="learning", force=curve.force * part)
    later = curve._replace(label=f"frozen{AT_THE_END}", force=0.8 * curve.force)
    drops = [(60.0, 0.6)]
    force[drive.s >= 60.0] *= 0.6
    said = curves_caption(replace(drive, axle_force=force), [curve, known, later], drops)
    assert "frozen 100 / 100 %, learning 100 / 100 % up to 60 m; frozen at the" in said
    assert f"{AT_THE_END} 75 / 75 % from 60 m on." in said
    force += 1e4 * (np.abs(SLIP) > 0.5 * SLIP.max())
    said = curves_caption(replace(drive, axle_force=force), [known], drops)
    assert "learning 100 / 100 % up to 60 m" in said


def test_a_law_that_errs_less_is_counted_here_and_in_the_paper():
    low, high = (1.0, 0.9, 1.1), (2.0, 1.9, 2.1)
    ours = {"instantaneous": {"a": high, "b": low}, "integral": {"a": low, "b": high}}
    paper = {"instantaneous": {"a": 1.5, "b": 1.5}, "integral": {"a": 0.5, "b": 0.6}}
    said = comparison_caption({**ours, "instantaneous_scaled": {}}, paper)
    assert "of instantaneous: integral in 1 of 2 columns, 2 of the paper's 2. H" in said


def test_a_report_lists_the_car_and_its_channels(run):
    car = replace(run.tire.vehicle, estimated=("cornering_stiffness_rear",))
    steering = Signal(channel=("Wheel",), unit="deg", ratio=15.0)
    given = LogMap(signals={"delta_f": steering})
    numbers, channels = went_in(replace(run.tire, vehicle=car), given, run.recording, {})
    said = {name: row for name, *row in numbers.rows}
    assert said["l_f"] == [f"{car.l_f:.6g} m", "declared"]
    assert said["cornering_stiffness_rear"][-1] == "estimated, not used by this method"
    assert channels.rows == [["delta_f", "Wheel", "deg, ratio 15"]]
